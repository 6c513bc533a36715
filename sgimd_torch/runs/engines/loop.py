"""Carry out a list of runs on any engine: start them, show progress, name failures.

with local(processes=4) as submit: failures = sweep([Config(seed=seed) for seed in range(20)], submit)

An engine is a context manager that gives ``submit(config, flags)``. It starts runs in order, as many at a time as it
has room for. Leaving its block stops the runs that have not ended. ``local`` is the engine of one machine, with a
process for each run.
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

REFRESH: Final = 1.0  # s between two looks at the movements on disk; the end of a run is shown at once
PATIENCE: Final = 20.0  # s for stopped runs to save their movements; a run killed then loses a second at most

Submit = Callable[[Config, Sequence[str]], Future[None]]
"""(config, flags of ``sgimd run``) -> a future that ends with the run, which is started or resumed. The future raises
the errors of ``check_end``, and OSError if a file cannot be written or a process cannot start."""


def sweep(
    configs: Sequence[Config],
    submit: Submit,
    *,
    flags: Sequence[str] = (),
    on_end: Callable[[Config], None] | None = None,
) -> list[str]:
    """Carry out runs in this order and show progress; a failed run does not stop the others.

    Args:
        configs: the runs, each with its own directory.
        submit: submission function of an engine.
        flags: flags of ``sgimd run`` for all runs, besides --resume.
        on_end: function to call in this thread with each run that ended well; its ValueError or OSError means failure.

    Returns:
        A sentence for each failure: name of the run, last line of its log, path of the log.

    Raises:
        ValueError: two runs have the same directory.
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
                        progress.total -= config.movements - done[config]  # other movements are not made
                done |= {config: _on_disk(config) for future, config in pending.items() if future.running()}
                ended = f"{len(configs) - len(pending) - len(failures)} of {len(configs)} runs"
                progress.show(sum(done.values()), ended + (f", {len(failures)} failed" if failures else ""))
    except KeyboardInterrupt:
        say("stopping all runs; the same command continues them")
        raise
    return [failures[config] for config in configs if config in failures]


@contextmanager
def local(processes: int) -> Iterator[Submit]:
    """An engine: at most ``processes`` processes of this machine at a time."""
    running, stopped = set[subprocess.Popen[bytes]](), False
    starting = Lock()  # a lock: no run starts after all were stopped

    def carry_out(config: Config, flags: Sequence[str]) -> None:
        make_folder(config.directory.parent)
        command = [sys.executable, "-m", "sgimd_torch", *run_words(config, flags)]
        with log_of(config).open("ab") as log:
            before = log.tell()
            with starting:
                if stopped:
                    return
                # The run has its own process group: Ctrl-C reaches only this process, which passes it on.
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, process_group=0)
                running.add(process)
            code = process.wait()
        running.discard(process)
        check_end(config, code, log_of(config).read_bytes()[before:])

    # Each thread waits for one process. A pool of processes would fail for all runs if one process were killed.
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
    """The command line of a run, without ``sgimd``."""
    return ["run", "--resume", *flags, *words(config)]


def log_of(config: Config) -> Path:
    """The log of a run's output, next to its directory."""
    return config.directory.with_suffix(".log")


def check_end(config: Config, code: int, said: bytes) -> None:
    """Raise an error with the last line of the output if a run did not end well.

    Args:
        config: configuration of the run.
        code: exit code of its process; if negative, the signal that killed it.
        said: output of its process.

    Raises:
        ValueError: the run refused its request.
        Failed: the run failed after it started.
    """
    if code == 0:
        return
    _, mark, last = ("\n" + said.decode(errors="replace").rstrip()).rpartition("\nerror: ")
    if code < 0:
        last = f"stopped by {signal.Signals(-code).name}; the same command continues the run"
    elif not mark:
        last = last.rpartition("\n")[2] or "it printed nothing"
    raise (ValueError if code == 2 else Failed)(f"{last}\nFull log: {log_of(config)}")


def _on_disk(config: Config) -> int:
    return min(movements_on_disk(config.directory), config.movements)
