"""MAP-Elites from the middle of Pi, a rival of the experiments.

sgimd run --algorithm experiments.parts:map_elites_middle         # in the root folder of the repository
"""

from __future__ import annotations

import numpy as np
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.learner import Learner
from sgimd_torch.rivals import quality_diversity


def map_elites_middle(environment: Environment, seed: int) -> Learner:
    """MAP-Elites that begins around the middle of Pi, with wider variations, and with cells of twice the side."""

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[GaussianEmitter]:
        dim = environment.policies.dim
        bounds = {"lower_bounds": np.zeros(dim), "upper_bounds": np.ones(dim)}
        first = rng.normal(0.5, 0.1, (100, dim)).clip(0, 1)
        drawn = int(rng.integers(2**32))
        return [GaussianEmitter(archive, sigma=0.1, initial_solutions=first, batch_size=10, seed=drawn, **bounds)]

    return quality_diversity.quality_diversity(environment, seed, "map-elites", emitters, {}, cells=10)
