"""Recall: a new learner gets the exemplars of a run. Nothing is lived again, so this takes seconds.

An inverse model depends on the memory alone, so it answers as that of the recorded learner; a forward model comes from
its checkpoint. Goals and searches do not go on: for this, see `sgimd_torch.record.replay`.
    recalled = Recalled(learner, record); recalled.until(500); learner.inverse(context, goal)
"""

from __future__ import annotations

import math
from itertools import accumulate, pairwise

import numpy as np

from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.record import Record, Row
from sgimd_torch.record.layout import movements_after
from sgimd_torch.runs.hooks import Listening
from sgimd_torch.texts import numbers_in


class Recalled:
    """A learner that gets the exemplars of a run.

    Args:
        learner: learner freshly built from the settings of the run.
        record: record of the run.

    Attributes:
        failed: number of failed movements so far.

    Raises:
        RunError: the record is damaged.
    """

    def __init__(self, learner: Learner, record: Record) -> None:
        self._learner, self._directory, self.failed = learner, record.path.parent, 0
        self._events, self._kept, self._refreshes = ([*record.rows(table)] for table in ("events", "kept", "refreshes"))
        self._demonstrations = record.demonstrations()
        self._parts = [slice(*ends) for ends in pairwise(accumulate((*record.dims, record.dims[2]), initial=3))]
        self._read = 0  # number of events so far

    def until(self, movements: float = math.inf) -> None:
        """Give the learner all exemplars up to this number of ``movements``; inf: to the end of the record.

        Robots that moved at once made the last movements together, so there may be more.
        """
        learner, cells, restart = self._learner, list[Row](), None
        robot = math.inf  # of the last movement, if the next one may be of the same group
        for number, row in enumerate(self._events[self._read :], self._read + 1):
            kind, counts = Kind(row[1]), movements_after(0, row[1])
            together = (counts and row[-2] > robot) or kind in (Kind.RESTARTED, Kind.CHANGED)
            if learner.movements >= movements and not together:
                break
            self._read, learner.movements = number, learner.movements + counts
            robot = row[-2] if counts else math.inf
            self.failed += kind == Kind.FAILED
            if counts:
                lived = len(learner.memory) + len(cells)
                learner.rows[learner.movements - 1] = lived if kind == Kind.MOVED else kind
            if kind in (Kind.MOVED, Kind.ADDED):
                context, theta, _, outcome = (row[part] for part in self._parts)
                cells.append(context + theta + outcome)
            elif kind == Kind.SHOWN and learner.social is not None and learner.social.remembers:
                shown = self._demonstrations[row[-6]]
                cells.append((*shown.context, *learner.translate(shown), *shown.outcome))
            elif kind == Kind.RESTARTED:
                restart = number, row[-1], len(learner.memory) + len(cells)
            elif kind == Kind.FORGOTTEN:
                self._give(cells)
                learner.take_back(numbers_in(row[-3]), watched=False)
                cells, restart = [], None
        self._give(cells)
        ends = np.cumsum(learner.problem.dims)
        if restart is not None and learner.watcher is not None:
            event, since, n = restart
            kept = np.array([row[1:] for row in self._kept if row[0] == event]).reshape(-1, ends[-1])
            own = Exemplars.of(learner.memory, slice(since, n))
            begun = Exemplars(*np.split(kept, ends[:2], axis=1)).and_then(own)
            learner.go_on_as(learner.watcher.begin_again(begun, n))
            learner.problem.memory.extend(*Exemplars.of(learner.memory, slice(n, None)))
        for part in learner.problem.trained:
            if isinstance(part, Listening):
                refreshes = [row for row in self._refreshes if row[0] <= learner.movements]
                part.recall(self._directory, refreshes, learner.memory)

    def _give(self, cells: list[Row]) -> None:
        """Give the learner these exemplars, context, theta and outcome in a row."""
        learner = self._learner
        ends = np.cumsum(learner.problem.dims)
        lived = Exemplars(*np.split(np.array(cells, dtype=np.float64).reshape(-1, ends[-1]), ends[:2], axis=1))
        for memory in dict.fromkeys((learner.memory, learner.problem.memory)):
            memory.extend(*lived)
