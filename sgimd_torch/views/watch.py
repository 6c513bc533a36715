"""Open TensorBoard on the boards of runs, also while they are still running. Only this machine can see it.

Examples:
  sgimd run --algorithm sgim-d --board true &
  sgimd watch                                         all boards below runs; new ones appear by themselves
  sgimd watch runs/sgim-d --port 7007                 one learner, on another port
"""

from __future__ import annotations

import argparse
import io
import threading
from collections.abc import Sequence
from contextlib import redirect_stderr
from pathlib import Path

from sgimd_torch.runs.process import Failed

POINTS = 100_000  # that TensorBoard keeps of each curve, enough for all; 0 should mean all, but shows none
WHERE = """
Begin here:  {url}#custom_scalars&_smoothingWeight=0
      Where is it competent, and since when? Does it learn? What did it do, and its teacher?
      First switch off "Ignore outliers in chart scaling": it hides the first values of a learner.

TensorBoard shows the boards of {runs}   (Ctrl-C ends it)
  {url}#images
      The same as a map (competent/since); how far each goal is missed; the regions that curves are named after.
  {url}#scalars&_smoothingWeight=0
      Every curve by itself; steps are movements. A click on (i) explains a curve; so does the tab Text.
  {url}#hparams
      Runs next to each other: their options and results.
"""


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd watch``."""
    parser = argparse.ArgumentParser(
        prog="sgimd watch",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("runs", nargs="?", type=Path, default=Path("runs"), help="where to look for boards (runs)")
    parser.add_argument("--port", type=int, help="of this machine (the first free one from 6006 on)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C or SIGTERM.

    Raises:
        ValueError: there is no board.
        Failed: TensorBoard cannot start.
    """
    options = parser().parse_args(argv)
    if not any(options.runs.rglob("events.out.tfevents.*")):
        raise ValueError(f"{options.runs} holds no board; start a run with --board true, or resume one with it")
    print(WHERE.format(runs=options.runs, url=serve(options.runs, options.port)), flush=True)
    threading.Event().wait()  # until a signal
    return 0


def serve(runs: Path, port: int | None) -> str:
    """Start TensorBoard in a thread of its own; returns its address once it answers.

    Args:
        runs: the folder whose boards it shows.
        port: of this machine; 0 for any that is free, None for the first free one from 6006 on.

    Raises:
        Failed: TensorBoard cannot start, such as on a port that is taken.
    """
    from tensorboard import program  # the extra "board"; TensorBoard takes long to import

    kept = ",".join(f"{plugin}={POINTS}" for plugin in ("scalars", "images", "text"))
    words = ["", "--logdir", str(runs), "--host", "127.0.0.1", "--reload_interval", "5", "--samples_per_plugin", kept]
    board = program.TensorBoard()
    try:
        with redirect_stderr(io.StringIO()):  # notes about its own development
            board.configure(words, port=port)
            return str(board.launch())
    except program.TensorBoardServerException as error:
        raise Failed(f"{error}; give another --port") from error
