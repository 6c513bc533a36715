"""Carry out a list of jobs, such as runs, each in a process of its own: start them, show progress, name failures.

failures = sweep([Config(seed=seed) for seed in range(20)], Machine(processes=4))
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from sgimd_torch.files import make_folder
from sgimd_torch.runs.messages import ProgressBar
from sgimd_torch.runs.program import ONE_THREAD, Failed
from sgimd_torch.runs.read import movements_on_disk
from sgimd_torch.runs.signals import Stopped, Stopping

POLL: Final = 0.05  # s between two looks at the processes
REFRESH: Final = 20  # looks at the processes between two looks at the movements on disk
PATIENCE: Final = 20.0  # s for stopped runs to save their movements; a run killed then loses a second at most

Process = subprocess.Popen[bytes]


class Job(Protocol):
    """Work of one process, which may be stopped and started again. A `Config` is one: its work is the run."""

    @property
    def title(self) -> str:
        """Name of the job in messages."""

    @property
    def directory(self) -> Path:
        """Folder of what the job makes; its log lies beside it."""

    @property
    def movements(self) -> int:
        """Number of movements in all."""

    @property
    def program(self) -> tuple[str, ...]:
        """Program for ``python -c``, and its arguments."""


J = TypeVar("J", bound=Job)


class Engine(Protocol):
    """What carries out jobs: this machine, or a cluster. A job has ``poll`` and ``returncode``, as ``Process``."""

    at_once: float  # most jobs under way at a time

    def start(self, job: Job) -> Any:
        """Start or resume a job; its output is appended to its log."""

    def stop(self, runs: Sequence[Any]) -> None:
        """Stop jobs, which get some time to save their movements; none is started later."""


class Machine:
    """This machine; at most ``processes`` jobs at a time."""

    def __init__(self, processes: float) -> None:
        self.at_once = processes

    def start(self, job: Job) -> Process:
        return start_process(job.program, log_of(job), stdin=subprocess.DEVNULL)

    @staticmethod
    def stop(processes: Sequence[Process]) -> None:
        """Stop runs; they get some time to save their movements."""
        for process in processes:
            process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            process.kill()


def sweep(jobs: Sequence[J], engine: Engine, *, on_end: Callable[[J], None] | None = None) -> list[str]:
    """Carry out jobs in this order and show progress; a failed job does not stop the others.

    Args:
        jobs: runs and others, each with its own directory; they are started or resumed.
        engine: machine or cluster that carries them out.
        on_end: function to call with each job that ended well; its ValueError or OSError means failure.

    Returns:
        A sentence for each failure: name of the job, last line of its log, path of the log.

    Raises:
        ValueError: two jobs have the same directory.
        OSError: a log cannot be written; all jobs are stopped.
        Failed: the cluster is gone, or cannot start jobs; all jobs are stopped.
        Stopped: a signal came; all jobs are stopped.
    """
    twice = [path for path, n in Counter(job.directory for job in jobs).items() if n > 1]
    if twice:
        raise ValueError(f"two runs would be written to {twice[0]}; their variants need different names")
    done = {job: _on_disk(job) for job in jobs}
    failures: dict[J, str] = {}
    waiting, running = [*reversed(jobs)], dict[J, tuple[Any, int]]()
    bar = ProgressBar("sweep", sum(job.movements for job in jobs), sum(done.values()))
    looks = count(1)
    with Stopping("stopping all runs; the same command continues them") as stopping, bar as progress:
        try:
            while (waiting or running) and not stopping.heard:
                while waiting and len(running) < engine.at_once:
                    job = waiting.pop()
                    make_folder(job.directory.parent)
                    before = log_of(job).stat().st_size if log_of(job).exists() else 0
                    running[job] = engine.start(job), before
                time.sleep(POLL)
                ended = [job for job, (run, _) in running.items() if run.poll() is not None]
                if not ended and next(looks) % REFRESH:
                    continue
                done |= {job: _on_disk(job) for job in running}
                for job in ended:
                    run, before = running.pop(job)
                    try:
                        check_end(job, run.returncode, log_of(job).read_bytes()[before:])
                        if on_end is not None:
                            on_end(job)
                        done[job] = job.movements
                    except (Failed, ValueError, OSError) as error:
                        failures[job] = f"{job.title} failed: {error}"
                        progress.total -= job.movements - done[job]  # other movements are not made
                well = len(jobs) - len(waiting) - len(running) - len(failures)
                failed = f", {len(failures)} failed" if failures else ""
                progress.show(sum(done.values()), f"{well} of {len(jobs)} runs{failed}")
        finally:
            engine.stop([run for run, _ in running.values()])
    if stopping.heard:
        raise Stopped(stopping.heard)
    return [failures[job] for job in jobs if job in failures]


def start_process(program: Sequence[str], log: Path, *, stdin: int, folder: str = ".") -> Process:
    """Start ``Job.program`` in a process."""
    command = [sys.executable, "-c", *program]
    environment = {**os.environ, **ONE_THREAD}  # the processes share the cores
    with log.open("ab") as output:
        # The run has its own process group: Ctrl-C reaches only this process, which passes it on.
        return subprocess.Popen(
            command, stdin=stdin, stdout=output, stderr=output, process_group=0, env=environment, cwd=folder
        )


def log_of(job: Job) -> Path:
    """The log of a run's output, next to its directory."""
    return job.directory.with_suffix(".log")


def check_end(job: Job, code: int, said: bytes) -> None:
    """Raise an error with the last line that the process of a job ``said`` if the job did not end well.

    A negative exit ``code`` is the signal that killed the process.

    Raises:
        Failed: the run failed.
    """
    if code == 0:
        return
    _, mark, last = ("\n" + said.decode(errors="replace").rstrip()).rpartition("\nerror: ")
    if code < 0:
        last = f"stopped by {signal.Signals(-code).name}; the same command continues the run"
    elif not mark:
        last = last.rpartition("\n")[2] or "it printed nothing"
    raise Failed(f"{last}\nFull log: {log_of(job)}")


def _on_disk(job: Job) -> int:
    return min(movements_on_disk(job.directory), job.movements)
