"""The line of progress of a comparison: what is done, how long the rest will take, what is running.

overview = Overview(tasks, done=3); overview.started(task, child); overview.show(0); overview.ended(child, failed=False)
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence

from sgimd_torch.runs.children import Child, report, time_left
from sgimd_torch.runs.process import say
from tasks import Task

REPLAY = 0.2  # what replaying a movement takes, of executing it: the learner's part, without physics


class Overview:
    """Counts runs, and measures how far they are by the movements that the robot still has to make.

    Args:
        tasks: still to be done; some may have begun, or even ended, on disk.
        done: how many more are done already.
    """

    def __init__(self, tasks: Sequence[Task], done: int) -> None:
        self._total, self._done, self._failed = len(tasks) + done, done, 0
        self._waiting = {task: _ahead(task, _movements_on_disk(task), lives=False) for task in tasks}
        self._running: dict[Child, Task] = {}
        self._all = self._left()
        self._began = time.monotonic()
        self._next_line = 0.0
        self._live = sys.stderr.isatty()

    def started(self, task: Task, child: Child) -> None:
        """A run has its process."""
        self._running[child] = task
        del self._waiting[task]

    def ended(self, child: Child, *, failed: bool) -> None:
        """Its process ended."""
        task = self._running.pop(child)
        if failed:
            self._failed += 1
            self._all -= _ahead(task, child.done(), lives=True)  # it is not going to be made
        else:
            self._done += 1

    def cannot_start(self, task: Task) -> None:
        """A run failed before it had a process."""
        self._failed += 1
        self._all -= self._waiting.pop(task)

    def again(self, child: Child) -> None:
        """It ended since another process has that run in hand; it waits for that one's end."""
        task = self._running.pop(child)
        self._waiting[task] = _ahead(task, child.done(), lives=False)

    def seconds_left(self) -> float:
        """At the pace so far; inf before the first new movement."""
        left = self._left()
        made = self._all - left
        return left * (time.monotonic() - self._began) / made if made > 0 else math.inf

    def line(self, elsewhere: int) -> str:
        """For people; ``elsewhere`` runs are in the hands of processes that an earlier start left behind."""
        failed = f", {self._failed} failed" if self._failed else ""
        parts = [f"{self._done} of {self._total} runs{failed}", time_left(self.seconds_left())]
        parts += [f"waiting for {elsewhere} of an earlier start"] if elsewhere else []
        parts += [child.status() for child in self._running]
        return "   ".join(filter(None, parts))

    def show(self, elsewhere: int, *, every: float = 30.0) -> None:
        """The line: on a terminal in place; elsewhere a new one now and then."""
        now = time.monotonic()
        if now >= self._next_line:
            self._next_line = now + (0.5 if self._live else every)
            report(self.line(elsewhere), self._live)

    def tell(self, *messages: str) -> None:
        """Below the line of progress."""
        say(*([""] if self._live else []), *messages)

    def _left(self) -> float:
        """Movements, those that are replayed counted by what they take."""
        running = (_ahead(task, child.done(), lives=child.fresh() > 0) for child, task in self._running.items())
        return sum(self._waiting.values()) + sum(running)


def _ahead(task: Task, done: int, *, lives: bool) -> float:
    """Of a run with so many movements in its log; one that does not live yet has to replay them first."""
    share = done / task.config.movements
    return task.work * (1 - share) + (0.0 if lives else REPLAY * task.work * share)


def _movements_on_disk(task: Task) -> int:
    try:
        log = (task.config.directory / "episodes.csv").read_bytes()
    except OSError:
        return 0
    return min(task.config.movements, max(0, log.count(b"\n") - 1))
