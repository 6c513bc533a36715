"""Carry out a list of runs on any engine: start them, show how far they are, name the failures.

with local(processes=4) as submit: failures = sweep([Config(seed=seed) for seed in range(20)], submit)

An engine is a context manager that gives ``submit(config, flags)``. It starts runs in the order in which they come, as
many at a time as it has room for, and stops those that have not ended when its block is left. ``local`` is the engine
of one machine: a process for each run.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Final

from sgimd_torch.files import make_folder
from sgimd_torch.runs.config import Config, words
from sgimd_torch.runs.process import Failed, Progress, say
from sgimd_torch.runs.read import movements_on_disk

REFRESH: Final = 1.0  # s, from one look at the movements on disk to the next; the end of a run is shown at once
PATIENCE: Final = 20.0  # s, for stopped runs to write what they have; then they are killed and lose a second at most

Submit = Callable[[Config, Sequence[str]], Future[None]]
"""Starts a run with these flags of ``sgimd run``, or goes on with it; the future ends with the run. It raises what
``check_end`` raises, and OSError where files cannot be written or no process starts."""


def sweep(
    configs: Sequence[Config],
    submit: Submit,
    *,
    flags: Sequence[str] = (),
    on_end: Callable[[Config], None] | None = None,
) -> list[str]:
    """Run them, in this order, and show how far they are. If a run fails, the others go on.

    Args:
        configs: the runs, each with a directory of its own.
        submit: of the engine where they run.
        flags: of ``sgimd run``, for all of them, besides --resume.
        on_end: called with each run that ended well, in this thread; its ValueError or OSError counts as a failure.

    Returns:
        The failures: which run, the last words of its log, and where the log is.

    Raises:
        ValueError: two runs have one directory.
        KeyboardInterrupt: a signal came.
    """
    twice = [path for path, n in Counter(config.directory for config in configs).items() if n > 1]
    if twice:
        raise ValueError(f"two runs would be written to {twice[0]}; their variants need different names")
    done = {config: _on_disk(config) for config in configs}
    failures: dict[Config, str] = {}
    try:
        with Progress("sweep", sum(config.movements for config in configs), sum(done.values()), every=30.0) as progress:
            pending = {submit(config, flags): config for config in configs}
            while pending:
                for future in wait(pending, REFRESH, FIRST_COMPLETED).done:
                    config = pending.pop(future)
                    done[config] = _on_disk(config)
                    try:
                        future.result()
                        if on_end is not None:
                            on_end(config)
                    except (Failed, ValueError, OSError) as error:
                        failures[config] = f"{config.title} failed: {error}"
                        progress.total -= config.movements - done[config]  # the rest will not be run
                done |= {config: _on_disk(config) for future, config in pending.items() if future.running()}
                ended = f"{len(configs) - len(pending) - len(failures)} of {len(configs)} runs"
                progress.show(sum(done.values()), ended + (f", {len(failures)} failed" if failures else ""))
    except KeyboardInterrupt:
        say("stopping all runs; the same command goes on from here")
        raise
    return [failures[config] for config in configs if config in failures]


@contextmanager
def local(processes: int) -> Iterator[Submit]:
    """An engine: so many processes of this machine at a time."""
    running, stopped = set[subprocess.Popen[bytes]](), False
    starting = Lock()  # no run starts after all have been stopped

    def carry_out(config: Config, flags: Sequence[str]) -> None:
        make_folder(config.directory.parent)
        command = [sys.executable, "-m", "sgimd_torch", *run_words(config, flags)]
        with log_of(config).open("ab") as log:
            before = log.tell()
            with starting:
                if stopped:
                    return
                # In a group of its own: only we get Ctrl-C, and pass it on.
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, process_group=0)
                running.add(process)
            code = process.wait()
        running.discard(process)
        check_end(config, code, log_of(config).read_bytes()[before:])

    # Threads that each wait for a process of their own: a pool of processes would break, for all runs, when the system
    # kills one of its processes.
    pool = ThreadPoolExecutor(processes)
    try:
        yield lambda config, flags: pool.submit(carry_out, config, flags)
    finally:
        with starting:
            stopped = True
        left = [*running]
        for process in left:
            process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in left:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            process.kill()
        pool.shutdown(cancel_futures=True)


def run_words(config: Config, flags: Sequence[str]) -> list[str]:
    """The command line of a run after ``sgimd``."""
    return ["run", "--resume", *flags, *words(config)]


def log_of(config: Config) -> Path:
    """The file of a run's output, next to its directory."""
    return config.directory.with_suffix(".log")


def check_end(config: Config, code: int, said: bytes) -> None:
    """Raise what is wrong, if anything, with the last words of a run.

    Args:
        config: of the run.
        code: exit code of its process; negative: the signal that killed it.
        said: its output.

    Raises:
        ValueError: the run refused its request.
        Failed: it failed under way.
    """
    if code == 0:
        return
    _, mark, last = ("\n" + said.decode(errors="replace").rstrip()).rpartition("\nerror: ")
    if code < 0:
        last = f"stopped by {signal.Signals(-code).name}; the same command goes on with it"
    elif not mark:
        last = last.rpartition("\n")[2] or "it said nothing"
    raise (ValueError if code == 2 else Failed)(f"{last}\nIts whole log: {log_of(config)}")


def _on_disk(config: Config) -> int:
    return min(movements_on_disk(config.directory), config.movements)
