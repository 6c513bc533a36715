"""A simple search: the best movement so far plus noise.

search = Perturb(problem)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from sgimd_torch.parts import Problem
from sgimd_torch.searches.vary import Vary
from sgimd_torch.spaces import Array, Estimate


class Perturb(Vary):
    """Best movement so far plus Gaussian noise.

    The best movement is one of the exemplars of the estimate, or a movement of this search. theta_g is executed first,
    unless it is a copy of a remembered theta, whose outcome is known. Movements are clipped to Pi; the search never
    ends.

    Args:
        problem: problem to learn.
        sd: standard deviation of the noise, as a fraction of each parameter's range in Pi.

    Raises:
        ValueError: ``sd`` is not positive.
    """

    def __init__(self, problem: Problem, *, sd: float = 0.05) -> None:
        super().__init__(problem, sd=sd)

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around ``start``."""
        distances = np.linalg.norm(start.outcomes - goal, axis=1)
        best, shortest = start.thetas[distances.argmin()], float(distances.min())
        policies = self.problem.policies
        theta = self.varied(best) if _remembered(start) else policies.check("theta of the estimate", start.theta)
        while True:
            distance = math.dist(goal, (yield theta))
            if distance < shortest:
                best, shortest = theta, distance
            theta = self.varied(best)


def _remembered(start: Estimate) -> bool:
    """Whether theta_g is a copy of one of the thetas of the estimate."""
    return bool((start.thetas == start.theta).all(axis=1).any())
