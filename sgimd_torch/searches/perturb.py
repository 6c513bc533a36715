"""The simplest searches: the best movement so far, plus noise; or again and again what was inferred, plus less noise.

search = Perturb(problem)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from sgimd_torch.explore.widening import Width
from sgimd_torch.parts import Problem, Search
from sgimd_torch.spaces import Array, Estimate


class Perturb(Search):
    """Best movement so far plus Gaussian noise.

    The noise is around the best theta so far, remembered or executed here, and clipped to Pi; it never ends.

    It executes theta_g first, unless that is a copy of a remembered theta, whose outcome is known.

    Args:
        problem: Pi is read; nothing outside is proposed.
        sd: standard deviation of the noise, in sides of Pi.

    Raises:
        ValueError: ``sd`` is not positive.
    """

    def __init__(self, problem: Problem, *, sd: float = 0.05) -> None:
        super().__init__(problem)
        self.sd = _positive(sd)

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around ``start``."""
        distances = np.linalg.norm(start.outcomes - goal, axis=1)
        best, shortest = start.thetas[distances.argmin()], float(distances.min())
        policies = self.problem.policies
        theta = self._vary(best) if _remembered(start) else policies.check("theta of the estimate", start.theta)
        while True:
            distance = math.dist(goal, (yield theta))
            if distance < shortest:
                best, shortest = theta, distance
            theta = self._vary(best)

    def _vary(self, theta: Array) -> Array:
        policies = self.problem.policies
        return policies.clip(self.rng.normal(theta, self.sd * policies.sides))


class Vary(Search):
    """Answer of the inverse model plus a little Gaussian noise.

    The noise is around theta_g, whatever came of it, and clipped to Pi; it never ends.

    So the inverse model is corrected where it errs, and sees in which directions the outcome changes. It is meant for
    an inverse model that is nearly right, and for one movement or two at each goal. Where theta_g is the copy of a
    remembered theta, the inverse model knows nothing better, and more noise looks farther around it: half of the
    `Width` of exploration.

    Args:
        problem: Pi is read; nothing outside is proposed.
        sd: standard deviation of the noise, in sides of Pi.

    Raises:
        ValueError: ``sd`` is not positive.
    """

    def __init__(self, problem: Problem, *, sd: float = 0.02) -> None:
        super().__init__(problem)
        self.sd, self.width = _positive(sd), problem.shared(Width, Width)

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around theta_g of ``start``."""
        policies = self.problem.policies
        theta = policies.check("theta of the estimate", start.theta)
        while True:
            sd = self.width.sd / 2 if _remembered(start) else self.sd
            yield policies.clip(self.rng.normal(theta, sd * policies.sides))


def _remembered(start: Estimate) -> bool:
    """Whether theta_g is a copy of a theta that the estimate was made from."""
    return bool((start.thetas == start.theta).all(axis=1).any())


def _positive(sd: float) -> float:
    if not sd > 0:
        raise ValueError(f"sd must be positive, got {sd}; without noise nothing new is tried")
    return sd
