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
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from pathlib import Path
from types import ModuleType
from typing import Any

from sgimd_torch.runs.process import Failed, say

PORTS = 50  # how many are tried
POINTS = 100_000  # that TensorBoard keeps of each curve, enough for all; 0 should mean all, but shows none
WHERE = """
Begin here:  {url}{begin}
      Where is it competent, and since when? Does it learn? What did it do, and its teacher?

TensorBoard shows {boards} of {runs}   (Ctrl-C ends it)
  {url}/#images
      The same as a map (competent/since); the regions that curves are named after; where movements landed.
  {url}/#scalars&_smoothingWeight=0
      Every curve by itself; steps are movements. A click on (i) explains a curve; so does the tab Text.
  {url}/#hparams
      Runs next to each other: their options and results.
"""
BEGIN = "/begin"
# TensorBoard leaves a tenth of the values out of a chart's range, such as the first and lowest ones of a learner. Only
# the browser's memory can change that, so a page of our own writes there, and goes on to the charts.
BEGINNING = b"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>sgimd watch</title></head><body><script>
localStorage.setItem("_ignoreYOutliers", "false");
location.replace("/#custom_scalars&_smoothingWeight=0");
</script></body></html>
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
    parser.add_argument("--port", type=int, default=6006, help="the first port to try (6006)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C or SIGTERM.

    Raises:
        ValueError: the request is wrong, or tensorboard is not installed.
        Failed: TensorBoard cannot start.
    """
    options = parser().parse_args(argv)
    tensorboard_program()  # what is missing is named first, as without it no run has a board
    boards = boards_below(options.runs)
    port = free_port(options.port)
    if port != options.port:
        say(f"port {options.port} is taken, {port} is free")
    shown = "1 board" if boards == 1 else f"{boards} boards"
    serve(options.runs, port)
    print(WHERE.format(boards=shown, runs=options.runs, url=f"http://127.0.0.1:{port}", begin=BEGIN), flush=True)
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


def beginning(tensorboard: Callable[..., Any]) -> Callable[..., Any]:
    """TensorBoard's web application, with the page to begin with at ``BEGIN``."""

    def application(environ: dict[str, Any], start_response: Callable[..., Any]) -> Any:
        if environ["PATH_INFO"] != BEGIN:
            return tensorboard(environ, start_response)
        about = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(BEGINNING))}
        start_response("200 OK", list(about.items()))
        return [BEGINNING]

    return application


def serve(runs: Path, port: int) -> None:
    """Start TensorBoard in a thread; returns once it answers.

    Raises:
        ValueError: as `tensorboard_program`.
        Failed: it cannot start.
    """
    program = tensorboard_program()
    words = ["", "--logdir", str(runs), "--host", "127.0.0.1", "--port", str(port), "--reload_interval", "5"]
    kept = ",".join(f"{plugin}={POINTS}" for plugin in ("scalars", "images", "text"))
    server = program.create_port_scanning_werkzeug_server
    board = program.TensorBoard(server_class=lambda app, flags: server(beginning(app), flags))
    said = io.StringIO()
    try:
        with redirect_stderr(said):  # notes about its own development
            board.configure([*words, "--samples_per_plugin", kept])
            board.launch()
    except (program.TensorBoardServerException, SystemExit) as error:
        raise Failed(f"TensorBoard cannot start: {error} {said.getvalue()}") from error
