"""The loop over the runs of a sweep, the same on every engine: start them, show how far they are, name the failures.

with Local(processes=4) as engine: failures = sweep([Config(seed=seed) for seed in range(20)], engine)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final, TypeVar

from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines.local import LOOK_EVERY, Engine, Job
from sgimd_torch.runs.process import Failed, Progress, say

Item = TypeVar("Item")
NAMED: Final = 8  # runs in the live line


def sweep(
    configs: Sequence[Config],
    engine: Engine,
    *,
    flags: Sequence[str] = (),
    on_end: Callable[[Config], None] | None = None,
    keep_going: bool = True,
) -> list[str]:
    """Run them, in this order, and show how far they are; those that are finished already are not started.

    If another process writes a run, such as one left by a killed sweep, it is waited for and then taken over.

    Args:
        configs: the runs, each with a directory of its own.
        engine: where they run; leaving its block stops those that have not ended.
        flags: of ``sgimd run``, for all of them, besides --resume.
        on_end: called with each run that ended well, in this thread; its ValueError or OSError counts as a failure.
        keep_going: False: the first failure is raised.

    Returns:
        The failures: which run, the last words of its log, and where the log is.

    Raises:
        ValueError: two runs have one directory; without ``keep_going`` also: a run refused its request.
        Failed: the engine failed; without ``keep_going`` also: a run failed under way.
        KeyboardInterrupt: a signal came.
    """
    twice = [path for path, n in Counter(config.directory for config in configs).items() if n > 1]
    if twice:
        raise ValueError(f"two runs would be written to {twice[0]}; their variants need different names")
    jobs, failures, ended = [Job(config, flags) for config in configs], list[str](), SimpleQueue[Future[None]]()
    total = sum(config.movements for config in configs)
    try:
        with Progress("sweep", total, _done(jobs), every=30.0) as progress:
            pending = {engine.submit(job): job for job in jobs}
            for future in pending:
                future.add_done_callback(ended.put)
            while pending:
                for future in _arrived(ended):
                    job = pending.pop(future)
                    job.look()
                    try:
                        future.result()
                        if on_end is not None:
                            on_end(job.config)
                        job.state = "done"
                    except (Failed, ValueError, OSError) as error:
                        job.state = "failed"
                        progress.total -= job.config.movements - job.done  # the rest will not be run
                        failures.append(f"{job.config.title} failed: {error}")
                        if not keep_going:
                            raise (Failed if isinstance(error, Failed) else ValueError)(failures[0]) from error
                engine.refresh()
                progress.show(_done(jobs), _note(jobs))
    except KeyboardInterrupt:
        say("stopping all runs; the same command goes on from here")
        raise
    return failures


def _arrived(queue: SimpleQueue[Item]) -> list[Item]:
    """What is in the queue; waits a moment for the first."""
    found = []
    with suppress(Empty):
        found.append(queue.get(timeout=LOOK_EVERY))
        while True:
            found.append(queue.get_nowait())
    return found


def _done(jobs: Sequence[Job]) -> int:
    """Movements on disk of all of them."""
    for job in jobs:
        if job.state in ("held", "running"):
            job.look()
    return sum(job.done for job in jobs)


def _note(jobs: Sequence[Job]) -> str:
    """How many runs are in each state, and how far the first of the running ones are."""
    states = Counter(job.state for job in jobs)
    parts = [f"{states['done']} of {len(jobs)} runs"]
    parts += [f"{states['failed']} failed"] if states["failed"] else []
    parts += [f"waiting for {states['held']} held by another process"] if states["held"] else []
    running = [f"{job.config.title} at {job.done}" for job in jobs if job.state == "running"]
    more = [f"{len(running) - NAMED} more are running"] if len(running) > NAMED else []
    return ", ".join([*parts, *running[:NAMED], *more])
