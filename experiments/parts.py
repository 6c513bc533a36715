"""Parts that only the experiments need: MAP-Elites from the middle of Pi, and a toss without a context.

sgimd run --algorithm experiments.parts:map_elites_middle         # in the root folder of the repository
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.environments.toys import toss
from sgimd_torch.learner import Learner
from sgimd_torch.rivals import quality_diversity
from sgimd_torch.runs.tasks import Task
from sgimd_torch.runs.tasks.toys import toy_benchmark
from sgimd_torch.spaces import Array, Box


def map_elites_middle(environment: Environment, seed: int) -> Learner:
    """MAP-Elites that begins around the middle of Pi, with wider variations, and with cells of twice the side."""

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[GaussianEmitter]:
        dim = environment.policies.dim
        bounds = {"lower_bounds": np.zeros(dim), "upper_bounds": np.ones(dim)}
        first = rng.normal(0.5, 0.1, (100, dim)).clip(0, 1)
        drawn = int(rng.integers(2**32))
        return [GaussianEmitter(archive, sigma=0.1, initial_solutions=first, batch_size=10, seed=drawn, **bounds)]

    return quality_diversity.quality_diversity(environment, seed, "map-elites", emitters, {}, cells=10)


class BlindToss:
    """The toss with a hidden wind: there is no context, and each movement draws a wind from the range of the toss."""

    def __init__(self) -> None:
        self._toss = toss()
        self.contexts = Box.cube(0, 1, 0)
        self.policies, self.outcomes, self.rest = self._toss.policies, self._toss.outcomes, self._toss.rest
        self.outcome_noise = self._toss.outcome_noise

    def observe(self, rng: np.random.Generator) -> Array:
        """The empty context, ``(0,)``."""
        return np.zeros(0)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """See `Toy.execute`."""
        return self._toss.execute(self._toss.observe(rng), theta, rng)


def blind_toss() -> Task:
    """The task of the toss with a hidden wind and the goals of the toss; it shows what knowing the context is worth."""
    goals = toy_benchmark(toss(), 0.4)
    return Task(BlindToss(), lambda: replace(goals, environment=BlindToss.__name__))
