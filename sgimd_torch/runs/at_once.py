"""Robots that move at once, of an environment without ``execute_many``: a copy of it in each of several processes.

with in_processes(arm, seed, 8) as execute: list(run(learner, arm, seed, movements=2000, execute=execute, at_once=8))
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from sgimd_torch.environments.protocol import BatchEnvironment, Environment, Limited
from sgimd_torch.session import Execute, live, reason_of
from sgimd_torch.spaces import Array, Failure

_here: Execute  # of a process that executes movements


def check_at_once(environment: Environment, at_once: int) -> None:
    """Refuse more movements at once than the robot can make.

    Raises:
        ValueError: the environment has a lower limit, or cannot be copied to other processes.
    """
    name = type(environment).__name__
    if isinstance(environment, Limited) and at_once > environment.at_once:
        raise ValueError(f"at_once must be at most {environment.at_once}, the at_once of {name}, got {at_once}")
    if at_once > 1 and not isinstance(environment, BatchEnvironment):
        try:
            pickle.dumps(environment)
        except Exception as error:  # code of a user may raise anything
            way_out = "use --at-once 1, or give it execute_many()"
            raise ValueError(f"{name} cannot be copied to other processes ({reason_of(error)}); {way_out}") from error


def executing(environment: Environment, seed: int, at_once: int) -> AbstractContextManager[Execute]:
    """The function that executes movements: in processes where that is faster, else in this one."""
    if at_once == 1 or isinstance(environment, BatchEnvironment):
        return nullcontext(live(environment, seed))
    return in_processes(environment, seed, at_once)


@contextmanager
def in_processes(environment: Environment, seed: int, processes: int) -> Iterator[Execute]:
    """The function that executes movements in this number of ``processes``, which end with the block.

    It raises RuntimeError if one of the processes has ended.
    """
    import multiprocessing  # modules that most runs do not need
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    # A forked process would share the locks of this one's threads.
    spawning = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, spawning, _begin, (pickle.dumps(environment), seed))

    def execute(indices: Sequence[int], contexts: Sequence[Array], thetas: Sequence[Array]) -> list[Array | Failure]:
        try:
            return list(pool.map(_execute, indices, contexts, thetas))
        except BrokenProcessPool as error:
            raise RuntimeError("a process that executes movements has ended; is memory short?") from error

    try:
        yield execute
    except BaseException:  # after a second Ctrl-C, too, nothing waits for a robot that hangs
        for each in list(pool._processes.values()):
            each.kill()
        raise
    finally:
        pool.shutdown()


def _begin(pickled: bytes, seed: int) -> None:
    """Begin a process: Ctrl-C is left to its parent, and it ends with its parent."""
    global _here
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from multiprocessing import parent_process

    parent = parent_process()
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    _here = live(pickle.loads(pickled), seed)


def _execute(index: int, context: Array, theta: Array) -> Array | Failure:
    (outcome,) = _here([index], [context], [theta])
    return Failure(outcome.reason) if isinstance(outcome, Failure) else outcome  # its cause may not be picklable


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
