"""CMA-ES, the usual evolution strategy, as a search instead of Nelder-Mead.

Hansen & Ostermeier (2001), by Hansen's own package ``cma``; a rival of the search in section 4.4.2 of Nguyen & Oudeyer
(2014).
    learner = sgim_d(environment, seed, correspondence=..., search=CmaEs)
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from sgimd_torch.parts import Problem, Search
from sgimd_torch.spaces import Array, Estimate

try:
    from cma import CMAEvolutionStrategy
except ImportError as error:
    raise ImportError(f"CMA-ES needs the package cma: pip install 'sgimd-torch[rivals]' ({error})") from error


class CmaEs(Search):
    """Evolution strategy CMA-ES on the distance to the goal.

    Each goal starts a new evolution strategy around theta_g, which is executed first. The exemplars of the estimate are
    not used, because CMA-ES begins with a Gaussian, not with given movements. All draws come from ``rng``.

    Args:
        problem: problem to learn.
        sd: standard deviation of the first generation, as a fraction of each parameter's range in Pi.
        population: number of movements in a generation, at least 3; None: default of the package, 4 + 3 ln(theta_dim).
            Deviation: the package's default is 13 for the rod, so the first generation would use nearly all of a goal's
            15 movements. With 4 there are three generations.

    Raises:
        ValueError: a number is out of its range, or Pi has one dimension.
    """

    def __init__(self, problem: Problem, *, sd: float = 0.05, population: int | None = 4) -> None:
        super().__init__(problem)
        if not 0 < sd < np.inf:
            raise ValueError(f"sd must be positive and finite, got {sd}; without noise nothing new is tried")
        if population is not None and population < 3:
            raise ValueError(f"population must be at least 3 movements, got {population}")
        if problem.policies.dim < 2:
            raise ValueError(f"CMA-ES adapts covariances, so Pi needs 2 dimensions or more, got {problem.policies.dim}")
        self.sd = sd
        self._options = {
            "bounds": [0, 1],
            "randn": lambda *shape: self.rng.standard_normal(shape),
            "seed": math.nan,  # any number would seed numpy's global stream
            "verb_log": 0,  # no written files
            "verbose": -10,  # no printed text, and no file of signals
            **({} if population is None else {"popsize": population}),
        }

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around theta_g of ``start``."""
        policies = self.problem.policies
        theta = policies.check("theta of the estimate", start.theta)
        yield theta
        # CMA-ES gets movements relative to the sides of Pi, so that the units of Pi do not matter.
        centre = np.clip((theta - policies.low) / policies.sides, 0, 1)
        strategy = CMAEvolutionStrategy(centre, self.sd, self._options)
        while not strategy.stop():
            generation = strategy.ask()
            distances = []
            for point in generation:
                theta = policies.clip(policies.low + policies.sides * point)
                distances.append(math.dist(goal, (yield theta)))
            strategy.tell(generation, distances)
