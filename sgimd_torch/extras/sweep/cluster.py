"""Carry out runs on a Dask cluster, for ``sgimd sweep --on ADDRESS``.

The scheduler hands each run to a worker, which starts it as a process of its own, as one machine does. If the worker
dies, so does the process, and another worker resumes the run from its last commit. All machines of the cluster share
the folder in which the sweep was started.
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

from sgimd_torch.extras.sweep.parallel import PATIENCE, POLL, Job, Machine, log_of, start_process
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import Failed
from sgimd_torch.runs.read import movements_on_disk

try:
    from distributed import CancelledError, Client, KilledWorker, Reschedule, Status, get_worker
    from distributed.comm import get_address_host_port
except ImportError as error:
    raise ImportError(f"--on needs distributed: pip install 'sgimd-torch[cluster]' ({error})") from error

CONNECT: Final = "5s"  # time for the scheduler to answer
# Beginning of the program of a job that ends at once when the worker that holds its stdin does.
HELD: Final = """
import os, threading
threading.Thread(target=lambda: os.read(0, 1) or os._exit(1), daemon=True).start()
"""
LEAVING: Final = (Status.closing, Status.closed)  # a worker that does so can wait for a run only for a moment
TERMINATED: Final = (-signal.SIGTERM, 128 + signal.SIGTERM)  # exit codes of a run that was told to stop
UNDER_WAY: Final = set[str]()  # keys of the tasks whose runs have a process on this worker


class Cluster:
    """A Dask cluster, which is given all runs at once.

    Args:
        address: address of the scheduler, or path of the file that ``dask scheduler --scheduler-file`` writes.

    Raises:
        ValueError: no scheduler answers.
    """

    at_once = float("inf")

    def __init__(self, address: str) -> None:
        for name in ("distributed", "distributed.client"):  # each has its own handler
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            if not (is_file := Path(address).is_file()):
                get_address_host_port(address)  # a client of an address without a port would wait for ever
            found = {"scheduler_file" if is_file else "address": address}
            self.client = Client(**found, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ValueError(
                f"no Dask scheduler answers at {address}; `dask scheduler` starts one ({error})"
            ) from error
        say(f"{address} has {len(self.client.nthreads())} workers; more may join")

    def start(self, job: Job) -> ClusterJob:
        return ClusterJob(self.client, job)

    def stop(self, runs: Sequence[ClusterJob]) -> None:
        keys, deadline = {run.future.key for run in runs}, time.monotonic() + PATIENCE
        if self.client.status == "running":
            self.client.cancel([run.future for run in runs])
            while keys and time.monotonic() < deadline:
                time.sleep(POLL)
                keys &= {*chain(*self.client.run(under_way, on_error="ignore").values())}
        self.client.close()


class ClusterJob:
    """A run that the cluster was given."""

    def __init__(self, client: Client, job: Job) -> None:
        self.job, self.returncode, log = job, 0, os.path.abspath(log_of(job))
        self._submit = partial(client.submit, carry_out, job.program, log, os.getcwd(), pure=False)
        self._movements, self.future = movements_on_disk(job.directory), self._submit()

    def poll(self) -> int | None:
        """The exit code of the run, or None.

        Raises:
            Failed: the scheduler is gone, or a worker cannot start runs.
        """
        if not self.future.done():
            return None
        try:
            self.returncode = self.future.result()
        except CancelledError as error:
            raise Failed("the scheduler is gone; all runs are kept, and the same command continues them") from error
        except KilledWorker:  # several workers have died during this run
            before, self._movements = self._movements, movements_on_disk(self.job.directory)
            if self._movements > before:
                self.future = self._submit()
                return None
            self.returncode = -signal.SIGKILL
        except Exception as error:
            raise Failed(f"a worker cannot start runs; has it this package and this folder? ({error})") from error
        return self.returncode


def carry_out(program: Sequence[str], log: str, folder: str) -> int:
    """Do the work of a job on a worker, by its ``program`` in this folder, and return its exit code.

    Raises:
        Reschedule: the run was stopped, but not by the sweep: another worker continues it.
    """
    worker = get_worker()
    task = worker.state.tasks[worker.get_current_task()]
    process = start_process([HELD + program[0], *program[1:]], Path(log), stdin=subprocess.PIPE, folder=folder)
    UNDER_WAY.add(task.key)
    while process.poll() is None and task.state != "cancelled" and worker.status not in LEAVING:
        time.sleep(POLL)
    Machine.stop([process])
    UNDER_WAY.remove(task.key)
    if process.returncode in TERMINATED and task.state != "cancelled":
        raise Reschedule
    return process.returncode


def under_way() -> list[str]:
    """On a worker: keys of the tasks whose runs have a process."""
    return [*UNDER_WAY]
