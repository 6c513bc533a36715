"""How quality diversity explores: a scheduler's movements, batch after batch, and what is demonstrated beside them.

explorer = QualityDiversity(policies, Scheduler(archive, emitters), "map-elites"); Learner(memory, explorer)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Attempt, Box, Demonstration, Move
from sgimd_torch.strategies import Imitate

if TYPE_CHECKING:
    from ribs.schedulers import Scheduler


class QualityDiversity:
    """The movements of a scheduler, batch after batch; it is told of a batch when all of it was executed.

    The objective, which decides between elites of one cell, is little effort: minus the mean square of a movement's
    distance from the middle of Pi, in sides. Outcomes outside T count for the nearest cell of its border. In a T far
    larger than what can be reached nearly all outcomes share a few cells, and few elites are left to vary.

    Each attempt is one movement; if it is interrupted before its outcome is told, it is proposed again.

    Args:
        policies: Pi.
        scheduler: with its archive over T, of movements in sides of Pi. Deviation: what lies outside Pi is executed
            clipped, but told as it was proposed, and its effort counts. CMA-ES itself would draw again, and never end
            once its mean lies in a corner of many dimensions.
        origin: of the movements, for the log.
        again: share of the movements that repeat elites.
        start: its exemplars are in the archive from the start; None for an empty one.
    """

    def __init__(
        self, policies: Box, scheduler: Scheduler, origin: str, again: float = 0.0, start: Memory | None = None
    ) -> None:
        if not 0 <= again < 1:
            raise ValueError(f"again must lie in [0, 1), got {again}; it is a share of the movements")
        self.policies = policies
        self.archive = scheduler.archive
        self._scheduler = scheduler
        self._origin = origin
        self._again = again
        self._landed: dict[bytes, list[Array]] = {}  # outcomes of each movement, where elites are repeated
        if start is not None and len(start):
            self.add(start.thetas, start.outcomes)
        self._ask()

    def attempt(self, context: Array) -> Attempt:
        """The next movement of the batch."""
        theta = self.policies.low + self.policies.sides * self._batch[len(self._outcomes)]
        outcome = yield Move(self.policies.clip(theta), None, self._origin)
        self._outcomes.append(outcome)
        if len(self._outcomes) == len(self._batch):
            self._tell()
            self._ask()

    def add(self, thetas: Array, outcomes: Array) -> None:
        """Movements ``(n, theta_dim)`` in Pi that were not its own, with their outcomes, for the archive."""
        batch = (thetas - self.policies.low) / self.policies.sides
        self._remember(batch, outcomes)
        self.archive.add(batch, objectives_of(batch), outcomes)

    def _ask(self) -> None:
        new = self._scheduler.ask()
        n = 0 if self.archive.empty else round(len(new) * self._again / (1 - self._again))
        repeated = [self.archive.sample_elites(n)["solution"]] if n else []
        self._batch: Array = np.concatenate([new, *repeated])  # (n, theta_dim)
        self._new = len(new)
        self._outcomes: list[Array] = []

    def _tell(self) -> None:
        outcomes, new = np.stack(self._outcomes), slice(self._new)
        self._remember(self._batch, outcomes)
        self._scheduler.tell(objectives_of(self._batch[new]), outcomes[new])
        if len(self._batch) > self._new:
            elites = self.archive.data("solution")
            means = np.stack([np.mean(self._landed[elite.tobytes()], axis=0) for elite in elites])
            self.archive.clear()
            self.archive.add(elites, objectives_of(elites), means)

    def _remember(self, batch: Array, outcomes: Array) -> None:
        if self._again:
            for theta, outcome in zip(batch, outcomes, strict=True):
                self._landed.setdefault(theta.tobytes(), []).append(outcome)


class Shown:
    """Imitate what is demonstrated, as SGIM-D does; what was executed enters the archive, where it is varied."""

    def __init__(self, explorer: QualityDiversity, imitate: Imitate) -> None:
        self.explorer, self.imitate = explorer, imitate

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """The movements of the imitation."""
        thetas: list[Array] = []
        outcomes: list[Array] = []
        moves = self.imitate.attempt(context, theta_d, demonstration)
        move = next(moves, None)
        try:
            while move is not None:
                outcome = yield move
                thetas.append(move.theta)
                outcomes.append(outcome)
                try:
                    move = moves.send(outcome)
                except StopIteration:
                    return
        finally:  # also when the next demonstration interrupts
            if outcomes:
                self.explorer.add(np.stack(thetas), np.stack(outcomes))


def objectives_of(batch: Array) -> Array:
    """Little effort: minus the mean square distance of each movement from the middle of Pi, in sides."""
    objectives: Array = -np.square(batch - 0.5).mean(axis=1)
    return objectives
