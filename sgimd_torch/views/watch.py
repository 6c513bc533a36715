"""Open TensorBoard on the boards of runs, also while they are still running. Only this machine can see it.

Examples:
  sgimd run --algorithm sgim-d --board true &
  sgimd watch                                         all boards below runs
  sgimd watch runs/sgim-d --port 7007                 one learner, on another port
"""

from __future__ import annotations

import argparse
import io
import socket
import time
from collections.abc import Sequence
from contextlib import redirect_stderr
from pathlib import Path
from types import ModuleType

from sgimd_torch.runs.process import Failed, say

PORTS = 50  # how many are tried
POINTS = 100_000  # that TensorBoard keeps of each curve, enough for all; 0 should mean all, but shows none
WHERE = """
TensorBoard shows {boards} of {runs} at  {url}   (Ctrl-C ends it)

  {url}/#custom_scalars&_smoothingWeight=0
      Begin here: does it learn, where is it competent, where does it make progress, what did its teacher do?
  {url}/#images
      The regions that curves are named after; where the float landed; the error at each goal.
  {url}/#scalars&_smoothingWeight=0
      Every curve by itself; steps are movements. A click on (i) explains a curve; so does the tab Text.
  {url}/#hparams
      Runs next to each other: their options and results.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C or SIGTERM.

    Raises:
        ValueError: the request is wrong, or tensorboard is not installed.
        Failed: TensorBoard cannot start.
    """
    parser = argparse.ArgumentParser(
        prog="sgimd watch",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("runs", nargs="?", type=Path, default=Path("runs"), help="where to look for boards (runs)")
    parser.add_argument("--port", type=int, default=6006, help="the first port to try (6006)")
    options = parser.parse_args(argv)
    tensorboard_program()  # what is missing is named first, as without it no run has a board
    boards = boards_below(options.runs)
    port = free_port(options.port)
    if port != options.port:
        say(f"port {options.port} is taken, {port} is free")
    shown = "1 board" if boards == 1 else f"{boards} boards"
    serve(options.runs, port)
    print(WHERE.format(boards=shown, runs=options.runs, url=f"http://127.0.0.1:{port}"), flush=True)
    while True:
        time.sleep(3600)


def boards_below(runs: Path) -> int:
    """How many boards there are.

    Raises:
        ValueError: none.
    """
    if not runs.is_dir():
        raise ValueError(f"there is no directory {runs}; runs lie where --out says, and get a board by --board true")
    found = {path.parent for path in runs.rglob("events.out.tfevents.*")}
    if not found:
        raise ValueError(f"{runs} holds no board; start a run with --board true, or resume one with it")
    return len(found)


def free_port(first: int) -> int:
    """The first free port of this machine from ``first`` on.

    Raises:
        ValueError: no such number, or all are taken.
    """
    if not 1 <= first <= 65535:
        raise ValueError(f"--port must be from 1 to 65535, got {first}")
    for port in range(first, min(first + PORTS, 65536)):
        with socket.socket() as attempt:
            attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a server that just ended does not count
            try:
                attempt.bind(("127.0.0.1", port))
            except OSError:  # taken, or not allowed for this user
                continue
            return port
    raise ValueError(f"no port from {first} on is free; give another --port")


def tensorboard_program() -> ModuleType:
    """What starts TensorBoard.

    Raises:
        ValueError: tensorboard is not installed.
    """
    try:
        from tensorboard import program
    except ImportError as error:
        raise ValueError(
            f"watching needs {error.name}, which is not installed; pip install 'sgimd-torch[board]'"
        ) from error
    return program


def serve(runs: Path, port: int) -> None:
    """Start TensorBoard in a thread; returns once it answers.

    Raises:
        ValueError: as `tensorboard_program`.
        Failed: it cannot start.
    """
    program = tensorboard_program()
    words = ["", "--logdir", str(runs), "--host", "127.0.0.1", "--port", str(port), "--reload_interval", "5"]
    kept = ",".join(f"{plugin}={POINTS}" for plugin in ("scalars", "images", "text"))
    board, said = program.TensorBoard(), io.StringIO()
    try:
        with redirect_stderr(said):  # notes about its own development
            board.configure([*words, "--samples_per_plugin", kept])
            board.launch()
    except (program.TensorBoardServerException, SystemExit) as error:
        raise Failed(f"TensorBoard cannot start: {error} {said.getvalue()}") from error
