"""Open TensorBoard on the boards that runs have made, also while they are still under way. For this machine alone.

Examples:
  python experiments/run.py --algorithm sgim-d --board true &
  scripts/watch                                         all boards below runs
  scripts/watch runs/sgim-d --port 7007                 those of one learner, elsewhere
"""

from __future__ import annotations

import argparse
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import IO

PORTS = 50  # how many are tried
POINTS = 100_000  # that TensorBoard keeps of each curve, which is all; 0, documented as all, shows none
PATIENCE = 60.0  # s, for TensorBoard to answer
WHERE = """
TensorBoard shows {boards} of {runs} at  {url}   (Ctrl-C ends it)

  {url}/#custom_scalars&_smoothingWeight=0
      Begin here, on one page: does it learn, where is it competent, where does it make progress, what did its teacher?
  {url}/#images
      Where the regions lie that the curves are named after; where the float landed; the error by goal.
  {url}/#scalars&_smoothingWeight=0
      Every curve by itself; the steps are movements. A click on (i) says what a curve shows, as does the tab Text.
  {url}/#hparams
      Runs beside each other: their options, and what they came to.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C or SIGTERM.

    Returns:
        The exit code: 2 the request is wrong, 1 TensorBoard failed, 130 or 143 a signal ended it.
    """
    parser = argparse.ArgumentParser(
        prog="watch", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("runs", nargs="?", type=Path, default=Path("runs"), help="where to look for boards (runs)")
    parser.add_argument("--port", type=int, default=6006, help="the first port to try (6006)")
    try:
        options = parser.parse_args(argv)
        boards = boards_below(options.runs)
        port = free_port(options.port)
    except SystemExit as end:  # --help, or an option that cannot be
        return int(end.code or 0)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if port != options.port:
        print(f"port {options.port} is taken, {port} is free", file=sys.stderr)
    shown = "1 board" if boards == 1 else f"{boards} boards"
    return serve(options.runs, port, WHERE.format(boards=shown, runs=options.runs, url=f"http://127.0.0.1:{port}"))


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
    """The first port of this machine from ``first`` on that nobody uses.

    Raises:
        ValueError: no such number, or all are taken.
    """
    if not 1 <= first <= 65535:
        raise ValueError(f"--port must be from 1 to 65535, got {first}")
    for port in range(first, min(first + PORTS, 65536)):
        with socket.socket() as attempt:
            attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # else a server that just ended counts
            try:
                attempt.bind(("127.0.0.1", port))
            except OSError:  # taken, or not for everybody
                continue
            return port
    raise ValueError(f"no port from {first} on is free; give another --port")


def serve(runs: Path, port: int, where: str) -> int:
    """Run TensorBoard, and say ``where`` to look once it answers."""
    command = [sys.executable, "-m", "tensorboard.main", "--logdir", str(runs), "--host", "127.0.0.1"]
    command += ["--port", str(port), "--reload_interval", "5"]
    command += ["--samples_per_plugin", ",".join(f"{plugin}={POINTS}" for plugin in ("scalars", "images", "text"))]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, _terminated)
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)
        try:
            wait_for(f"http://127.0.0.1:{port}/data/environment", process)
            print(where, flush=True)
            process.wait()
        except KeyboardInterrupt:
            return 130
        except _Terminated:
            return 143
        finally:
            process.terminate()
            process.wait()
        return _failed(log)


def wait_for(address: str, process: subprocess.Popen[bytes]) -> None:
    """Until something answers there, the process has ended, or patience has."""
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up:
        try:
            direct.open(address, timeout=5).close()
        except OSError:  # not yet
            time.sleep(0.1)
        else:
            return


class _Terminated(Exception):
    """SIGTERM."""


def _terminated(*_: object) -> None:
    raise _Terminated


def _failed(log: IO[bytes]) -> int:
    log.seek(0)
    lines = log.read().decode(errors="replace").strip().splitlines()
    print("error: TensorBoard ended by itself; it said:", *lines[-12:], sep="\n", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
