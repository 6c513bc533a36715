"""Several runs of experiments/run.py side by side: a process for each, one line of progress for all, one end.

Ctrl-C, and the failure of one, stop them all; each then goes on from its files when it is started again.
"""

from __future__ import annotations

import fcntl
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.figures.learning import NAMES
from sgimd_torch.runs.process import say
from sgimd_torch.runs.tables import EVALUATION


class ChildFailed(RuntimeError):
    """A run ended with an error; ``code`` is its exit status."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def learn(
    algorithms: Sequence[str], seed: int, movements: int, out: Path, run_options: Sequence[str]
) -> dict[str, Path]:
    """Let them live, showing their progress in one line.

    Args:
        algorithms: one run for each.
        seed, movements, out: of each run, as in run.py.
        run_options: further options of run.py, for all.

    Returns:
        The run directory of each algorithm.

    Raises:
        ChildFailed: one of them did; the others are stopped.
        KeyboardInterrupt: Ctrl-C; all are stopped.
    """
    children: list[Child] = []
    live = sys.stderr.isatty()
    next_report = time.monotonic()
    try:
        for algorithm in algorithms:
            whole = ["--algorithm", algorithm, "--seed", str(seed), "--movements", str(movements), "--out", str(out)]
            directory = out / algorithm / f"seed-{seed:03d}"
            log = out / f"{algorithm}.log"
            children.append(Child(NAMES[algorithm], directory, movements, log, [*whole, *run_options]))
        while True:
            running = any(child.process.poll() is None for child in children)
            for child in children:
                child.check()
            if live or not running or time.monotonic() >= next_report:
                report("   ".join([*(child.status() for child in children), _time_left(children)]), live)
                next_report += 15
            if not running:
                return dict(zip(algorithms, (child.directory for child in children), strict=True))
            time.sleep(0.3)
    finally:
        if live:
            say("")
        for child in children:
            child.interrupt()
        for child in children:
            child.end()


class Child:
    """One run in a process of its own. Its messages go to a log, its progress is read off the files that it writes.

    Args:
        title: what it is called on the line of progress.
        directory, movements: of the run, as ``run_options`` make them.
        log: file for its messages.
        run_options: of run.py; it resumes what is there.
    """

    def __init__(self, title: str, directory: Path, movements: int, log: Path, run_options: Sequence[str]) -> None:
        self.title = title
        self.movements = movements
        self.directory = directory
        self.log = log
        self._episodes = self.directory / "episodes.csv"
        self._read = self._lines = 0
        self._began, self._already = time.monotonic(), self.done()
        command = [sys.executable, "-m", "sgimd_torch.runs.run", "--resume", *run_options]
        threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
        with self.log.open("wb") as said:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
                env={**os.environ, **threads},
                process_group=0,  # Ctrl-C comes to us, and we pass it on
            )

    def done(self) -> int:
        """Movements on disk; reads only what was added since the last look."""
        try:
            with self._episodes.open("rb") as file:
                file.seek(self._read)
                added = file.read()
        except FileNotFoundError:
            return 0
        self._read += len(added)
        self._lines += added.count(b"\n")
        return min(self.movements, max(0, self._lines - 1))  # the first line names the columns

    def fresh(self) -> int:
        """Movements made since it was started, those that it found on disk left out."""
        return self.done() - self._already

    def seconds_left(self) -> float:
        """At the pace so far, pauses for evaluations included; inf before the first new movement."""
        left, fresh = self.movements - self.done(), self.fresh()
        if left == 0:
            return 0.0
        return left * (time.monotonic() - self._began) / fresh if fresh > 0 else math.inf

    def status(self) -> str:
        """For the progress line."""
        done, error = self.done(), _last_error(self.directory / "evaluation.csv")
        shown = f", error {error:.3f} m" if error is not None else ""
        state = "done" if self.process.poll() == 0 else f"{done}/{self.movements}"
        return f"{self.title} {state}{shown}"

    def check(self) -> None:
        """Notice a failure.

        Raises:
            ChildFailed: with the last words of its log.
        """
        code = self.process.poll()
        if not code:
            return
        said = self.log.read_text(errors="replace").strip()
        words = said[said.rfind("error: ") :] if "error: " in said else said.rpartition("\n")[2] or "it said nothing"
        if code < 0:
            words = f"stopped by {signal.Signals(-code).name}; start this again and it goes on"
        outlook = f"Its whole log: {self.log}."
        begun = self.directory.exists()
        if begun and "movements already" not in words:  # what was asked for is wrong then, not what is there
            outlook += f" To begin afresh, delete {self.directory} or choose another --out."
        raise ChildFailed(f"{self.title} failed: {words}\n{outlook}", code if code > 0 else 1)

    def interrupt(self) -> None:
        """As Ctrl-C does: it writes what it has, and ends."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Wait for it; killed, it would lose a second of its life at most."""
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()


def in_use(directory: Path) -> bool:
    """Whether a run is being written there, one that outlived who started it, say."""
    try:
        lock = os.open(directory / "lock", os.O_RDONLY)
    except (FileNotFoundError, NotADirectoryError):
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False


def _last_error(path: Path) -> float | None:
    """Of an evaluation.csv, which is replaced whole at every evaluation."""
    try:
        last = path.read_text().splitlines()[-1].split(",")
        return float(last[EVALUATION.index("mean_error_m")])
    except (FileNotFoundError, IndexError, ValueError):  # not there, or the names of the columns only
        return None


def _time_left(children: Sequence[Child]) -> str:
    running = [child for child in children if child.process.poll() is None]
    if not running:
        return "finished"
    return time_left(max(child.seconds_left() for child in running))


def time_left(seconds: float) -> str:
    """For people."""
    if seconds == math.inf:
        return ""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    clock = f"{hours}:{minutes:02}" if hours else f"{minutes}"
    return f"{clock}:{seconds:02} left" if hours or minutes or seconds else "finishing"


def report(line: str, live: bool) -> None:
    """One line of progress; on a terminal it takes the place of the last."""
    width = (os.get_terminal_size(sys.stderr.fileno()).columns or 80) if live else 0
    start, end = ("\r\x1b[K", "") if live else ("", "\n")
    print(start + (line[: width - 1] if live else line), end=end, file=sys.stderr, flush=True)
