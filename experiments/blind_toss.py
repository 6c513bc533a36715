"""The toss for a learner that does not feel the wind: what a context is worth to one that does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.toys import toss
from sgimd_torch.runs.tasks import Task
from sgimd_torch.runs.tasks.robots import toy_benchmark
from sgimd_torch.spaces import Array, Box


class BlindToss:
    """The same robot without a context: each movement meets a wind of its own, drawn from the same range."""

    def __init__(self) -> None:
        self._toss = toss()
        self.contexts = Box.cube(0, 1, 0)
        self.policies, self.outcomes, self.rest = self._toss.policies, self._toss.outcomes, self._toss.rest
        self.outcome_noise = self._toss.outcome_noise

    def observe(self, rng: np.random.Generator) -> Array:
        """``(0,)``: nothing."""
        return np.zeros(0)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """See `Toy.execute`."""
        return self._toss.execute(self._toss.observe(rng), theta, rng)


def blind_toss() -> Task:
    """With the goals of the toss."""
    goals = toy_benchmark(toss(), 0.4)
    return Task(BlindToss(), lambda: replace(goals, environment=BlindToss.__name__))
