"""Strategies of quality diversity: movements that a scheduler proposes in batches, and imitation of demonstrations.

explorer = QualityDiversity(problem, Scheduler(archive, emitters), "map-elites"); Learner(problem, explorer)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgimd_torch.parts import Problem, Social, Strategy
from sgimd_torch.spaces import Array, Attempt, Demonstration, Move
from sgimd_torch.strategies import Mimic, recording_outcomes

if TYPE_CHECKING:
    from ribs.schedulers import Scheduler


class QualityDiversity(Strategy):
    """Movements that a scheduler proposes in batches; after each batch, the scheduler is told the outcomes.

    A cell keeps the movement with the largest objective, its elite. The objective is minus the mean square distance of
    a movement from the middle of Pi, relative to the sides of Pi. An outcome outside T counts in the nearest border
    cell of T. If T is far larger than the reachable part, most outcomes fall into a few cells, so there are few elites.

    Each attempt is one movement. If an attempt is interrupted before its outcome, the next attempt repeats it. Several
    robots at once may repeat the first movement of a batch near its end, because the next batch is not known yet.

    Args:
        problem: problem to learn; exemplars of its memory are in the archive from the start.
        scheduler: scheduler of ribs, with an archive over T; its movements are relative to the sides of Pi. Deviation:
            a movement outside Pi is clipped for execution, but the scheduler is told the objective of the proposed
            movement. CMA-ES would draw such a movement again, and in many dimensions these draws may never end.
        origin: origin of the movements, for the record.
    """

    def __init__(self, problem: Problem, scheduler: Scheduler, origin: str) -> None:
        super().__init__(problem)
        self.policies = problem.policies
        self.archive = scheduler.archive
        self._scheduler = scheduler
        self._origin = origin
        self._under_way: list[int] = []  # rows of the batch that are being executed
        if len(problem.memory):
            self.add(problem.memory.thetas, problem.memory.outcomes)
        self._ask()

    def attempt(self, context: Array) -> Attempt:
        """The next movement of the batch."""
        batch, outcomes = self._batch, self._outcomes
        open_ = [row for row in range(len(batch)) if row not in self._under_way and row not in outcomes]
        row = open_[0] if open_ else 0
        self._under_way.append(row)
        try:
            theta = self.policies.low + self.policies.sides * batch[row]
            outcomes[row] = yield Move(self.policies.clip(theta), None, self._origin)
        finally:  # interruption included
            self._under_way.remove(row)
        if batch is self._batch and len(outcomes) == len(batch):
            self._tell()
            self._ask()

    def add(self, thetas: Array, outcomes: Array) -> None:
        """Add other movements, ``thetas`` ``(n, theta_dim)`` in Pi with their outcomes, to the archive."""
        batch = (thetas - self.policies.low) / self.policies.sides
        self.archive.add(batch, objectives_of(batch), outcomes)

    def _ask(self) -> None:
        self._batch: Array = self._scheduler.ask()  # (n, theta_dim)
        self._outcomes: dict[int, Array] = {}  # by row of the batch

    def _tell(self) -> None:
        outcomes = np.stack([self._outcomes[row] for row in range(len(self._batch))])
        self._scheduler.tell(objectives_of(self._batch), outcomes)


class Shown(Social):
    """Imitate a demonstration as in SGIM-D; the executed movements enter the archive, so that they are varied later."""

    def __init__(self, problem: Problem, explorer: QualityDiversity, mimic: Mimic) -> None:
        super().__init__(problem)
        self.explorer, self.mimic = explorer, mimic

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """The movements of the imitation."""
        executed: list[tuple[Array, Array]] = []
        try:
            yield from recording_outcomes(self.mimic.attempt(context, theta_d, demonstration), executed)
        finally:  # interruption by the next demonstration included
            if executed:
                thetas, outcomes = zip(*executed, strict=True)
                self.explorer.add(np.stack(thetas), np.stack(outcomes))


def objectives_of(batch: Array) -> Array:
    """Objectives: minus the mean square distance of each movement from the middle of Pi, relative to its sides."""
    objectives: Array = -np.square(batch - 0.5).mean(axis=1)
    return objectives
