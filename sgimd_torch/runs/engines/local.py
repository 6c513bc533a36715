"""The engine of one machine: a process for each run, so many at a time. And what all engines share: a run as a job.

with Local(processes=4) as engine: failures = sweep(configs, engine)
"""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Protocol, Self

from sgimd_torch.files import locked, make_folder
from sgimd_torch.runs.config import Config, words
from sgimd_torch.runs.process import Failed, say
from sgimd_torch.runs.read import finished, movements_on_disk

LOOK_EVERY: Final = 0.3  # s, from one look at a process to the next
PATIENCE: Final = 20.0  # s, for a stopped run to write what it has; then it is killed and loses a second at most


class Engine(Protocol):
    """Carries out jobs, in the order in which they come, as many at a time as it has room for.

    A context manager; leaving its block stops the jobs that have not ended.
    """

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def submit(self, job: Job) -> Future[None]:
        """The future ends when the job has ended, with its ValueError, Failed or OSError."""
        ...

    def refresh(self) -> None:
        """Bring the states of all jobs up to date.

        Raises:
            Failed: the engine itself has failed.
        """
        ...


class Local:
    """An ``Engine``: processes of this machine.

    Args:
        processes: how many run at a time.
    """

    def __init__(self, processes: int) -> None:
        self._stop = threading.Event()
        # Threads that each wait for a process of their own: a pool of processes would break, for all runs, when the
        # system kills one of its processes.
        self._pool = ThreadPoolExecutor(processes)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._pool.shutdown(cancel_futures=True)

    def submit(self, job: Job) -> Future[None]:
        """A thread that waits for the process of this job."""
        return self._pool.submit(job.carry_out, self._stop.is_set)

    def refresh(self) -> None:
        """Nothing to do: the threads set the states."""


@dataclass(eq=False)
class Job:
    """A run to be carried out. ``state``: waiting, held by another process, running, done or failed.

    Args:
        config: of the run.
        flags: of ``sgimd run``, besides --resume.
        program: what Python is to run as the command ``sgimd``.
    """

    config: Config
    flags: Sequence[str] = ()
    program: Sequence[str] = ("-m", "sgimd_torch")
    state: str = "waiting"

    def __post_init__(self) -> None:
        self.log = self.config.directory.with_suffix(".log")  # its output, next to its directory
        self.look()

    def look(self) -> None:
        """Update ``done``, its number of movements on disk."""
        self.done = min(movements_on_disk(self.config.directory), self.config.movements)

    def hold(self) -> None:
        """Say, once, that another process writes this run."""
        if self.state != "held":
            say(f"{self.config.title}: waiting for another process, which writes this run")
        self.state = "held"

    def carry_out(self, stopped: Callable[[], bool]) -> None:
        """Run it, or resume it, to its end.

        Args:
            stopped: asked every ``LOOK_EVERY`` seconds; once it is True, the run is stopped and this returns early.

        Raises:
            ValueError: it refused its request (exit code 2), or there is no place for its directory.
            Failed: it failed under way.
            OSError: its log cannot be written, or no process started.
        """
        directory = self.config.directory
        make_folder(directory.parent)
        while not stopped():
            if locked(directory / "lock"):
                self.hold()
                time.sleep(LOOK_EVERY)
                continue
            if finished(self.config):
                return
            self.state = "running"
            code, was_stopped = self._process(stopped)
            if code == 0 or was_stopped:
                return
            if not locked(directory / "lock"):  # else another process took it over first
                raise (ValueError if code == 2 else Failed)(self._last_words(code))

    def _process(self, stopped: Callable[[], bool]) -> tuple[int, bool]:
        """Start its process, wait for it, stop it where asked to; its exit code, and whether it was stopped."""
        command = [sys.executable, *self.program, "run", "--resume", *self.flags, *words(self.config)]
        with self.log.open("wb") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                process_group=0,  # only we get Ctrl-C, and pass it on
            )
        try:
            while not stopped():
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(LOOK_EVERY), False
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)  # not SIGINT, which is blocked in all that Ray starts
                with suppress(subprocess.TimeoutExpired):
                    process.wait(PATIENCE)
                process.kill()
        return process.wait(), True

    def _last_words(self, code: int) -> str:
        _, mark, said = ("\n" + self.log.read_text(errors="replace").rstrip()).rpartition("\nerror: ")
        if not mark:
            said = said.rpartition("\n")[2] or "it said nothing"
        if code < 0:
            said = f"stopped by {signal.Signals(-code).name}; the same command goes on with it"
        return f"{said}\nIts whole log: {self.log}"
