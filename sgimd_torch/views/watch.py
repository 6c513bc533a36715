"""Open TensorBoard on the boards of runs, also while they are still running. Only this machine can see it.

Examples:
  sgimd run --algorithm sgim-d --board true &
  sgimd watch                                         all boards below runs
  sgimd watch runs/sgim-d --port 7007                 one learner, on another port
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from sgimd_torch.runs.process import Failed, say

PORTS = 50  # how many are tried
POINTS = 100_000  # that TensorBoard keeps of each curve, enough for all; 0 should mean all, but shows none
PATIENCE = 60.0  # s, for TensorBoard to answer
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
        Failed: TensorBoard ended by itself.
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
    if find_spec("tensorboard") is None:
        raise ValueError("watching needs tensorboard, which is not installed; pip install 'sgimd-torch[board]'")
    boards = boards_below(options.runs)
    port = free_port(options.port)
    if port != options.port:
        say(f"port {options.port} is taken, {port} is free")
    shown = "1 board" if boards == 1 else f"{boards} boards"
    serve(options.runs, port, WHERE.format(boards=shown, runs=options.runs, url=f"http://127.0.0.1:{port}"))
    return 0


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


def serve(runs: Path, port: int, where: str) -> None:
    """Run TensorBoard, and say ``where`` to look once it answers.

    Raises:
        Failed: it ended by itself.
    """
    command = [sys.executable, "-m", "tensorboard.main", "--logdir", str(runs), "--host", "127.0.0.1"]
    command += ["--port", str(port), "--reload_interval", "5"]
    command += ["--samples_per_plugin", ",".join(f"{plugin}={POINTS}" for plugin in ("scalars", "images", "text"))]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)
        try:
            wait_for(f"http://127.0.0.1:{port}/data/environment", process)
            print(where, flush=True)
            process.wait()
        finally:
            process.terminate()
            process.wait()
        log.seek(0)
        lines = log.read().decode(errors="replace").strip().splitlines()
        raise Failed("\n".join(["TensorBoard ended by itself; it said:", *lines[-12:]]))


def wait_for(address: str, process: subprocess.Popen[bytes]) -> None:
    """Wait until something answers there, the process ends or ``PATIENCE`` is over."""
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up:
        try:
            direct.open(address, timeout=5).close()
        except OSError:  # not yet
            time.sleep(0.1)
        else:
            return
