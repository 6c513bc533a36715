"""Robots that move at once, of an environment without ``execute_many``: one in each of several processes.

make = partial(PlanarArm, 7)
with in_processes(make, seed, 8) as execute: list(run(learner, make(), seed, movements=900, execute=execute, at_once=8))
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

from sgimd_torch.environments.protocol import SimulationError, reason_of
from sgimd_torch.session import Execute, live
from sgimd_torch.spaces import Array, Failure
from sgimd_torch.tasks import Task

ONE: Final = "is one robot all there is?"
_robot: Execute  # executes movements in this process, if it is one of several


@contextmanager
def in_processes(make: Callable[[], Any], seed: int, processes: int) -> Iterator[Execute]:
    """The function that executes movements in this number of ``processes``, which end with the block.

    Each process makes an environment, or a `Task`, by ``make``. SimulationError when it executes: a process could not
    make it, or has ended.
    """
    import multiprocessing  # modules that most runs do not need
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    # A forked process would share the locks of this one's threads.
    spawning = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, spawning, _begin, (make, seed))
    workers = pool._processes  # filled as movements come

    def execute(indices: Sequence[int], contexts: Sequence[Array], thetas: Sequence[Array]) -> list[Array | Failure]:
        try:
            return list(pool.map(_execute, indices, contexts, thetas))
        except BrokenProcessPool as error:
            pool.shutdown()  # it ends the other processes by SIGTERM
            codes = [process.exitcode for process in workers.values()]
            code = next((code for code in codes if code != -signal.SIGTERM), -signal.SIGTERM)
            raise SimulationError(f"a process that executes movements ended with exit code {code}; {ONE}") from error

    try:
        yield execute
    except BaseException:  # after a second Ctrl-C, too, nothing waits for a robot that hangs
        for process in list(workers.values()):
            process.kill()
        raise
    finally:
        pool.shutdown()


def _begin(make: Callable[[], Any], seed: int) -> None:
    """Begin a process: Ctrl-C is left to its parent, and it ends with its parent."""
    global _robot
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from multiprocessing import parent_process

    parent: Any = parent_process()
    threading.Thread(target=lambda: parent.join() or os._exit(1), daemon=True).start()
    try:
        made = make()
        _robot = live(made.environment if isinstance(made, Task) else made, seed)
    except (Exception, SystemExit) as error:
        _robot = partial(_fail, f"a process that executes movements cannot make its robot: {reason_of(error)}; {ONE}")


def _fail(reason: str, *_: object) -> list[Array | Failure]:
    raise SimulationError(reason)


def _execute(index: int, context: Array, theta: Array) -> Array | Failure:
    (outcome,) = _robot([index], [context], [theta])
    return Failure(outcome.reason) if isinstance(outcome, Failure) else outcome  # its cause may not be picklable
