"""The engine of one machine: a process for each run, so many at a time.

with local(processes=4) as submit: failures = sweep(configs, submit)
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from threading import Lock
from typing import Final

from sgimd_torch.files import make_folder
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines.loop import Submit, check_end, log_of, run_words

PATIENCE: Final = 20.0  # s, for stopped runs to write what they have; then they are killed and lose a second at most


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
