"""The simplest searches: the best movement so far, plus noise; or again and again what was inferred, plus less noise.

search = perturb(policies, rng)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator

import numpy as np

from sgimd_torch.searches.widening import Width
from sgimd_torch.spaces import Array, Box, Estimate, Search


def perturb(policies: Box, rng: np.random.Generator, *, sd: float = 0.05) -> Search:
    """Gaussian noise around the best theta so far, remembered or executed here, clipped to ``policies``; never ends.

    It executes theta_g first, unless it is a copy of a remembered theta, whose outcome is known.

    Args:
        policies: Pi; nothing outside is proposed.
        rng: draws the noise.
        sd: standard deviation of the noise, in sides of ``policies``.

    Raises:
        ValueError: ``sd`` is not positive.
    """
    vary = _variation(policies, rng, sd)

    def search(start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        distances = np.linalg.norm(start.outcomes - goal, axis=1)
        best, shortest = start.thetas[distances.argmin()], float(distances.min())
        theta = vary(best) if _remembered(start) else policies.check("theta of the estimate", start.theta)
        while True:
            distance = math.dist(goal, (yield theta))
            if distance < shortest:
                best, shortest = theta, distance
            theta = vary(best)

    return search


def practise(policies: Box, rng: np.random.Generator, *, sd: float = 0.02, width: Width | None = None) -> Search:
    """Gaussian noise around theta_g, whatever came of it, clipped to ``policies``; never ends.

    So the inverse model is corrected where it errs, and sees in which directions the outcome changes. It is meant for
    an inverse model that is nearly right, and for one movement or two at each goal. Where theta_g is the copy of a
    remembered theta, the inverse model knows nothing better, and more noise looks farther around it.

    Args:
        policies, rng: as in `perturb`.
        sd: standard deviation of the noise, in sides of ``policies``.
        width: of a search for what is far from the goal; around a copy the noise is half as wide. None: one that stays
            as it begins.

    Raises:
        ValueError: ``sd`` is not positive.
    """
    vary = _variation(policies, rng, sd)
    width = width if width is not None else Width()

    def search(start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        theta = policies.check("theta of the estimate", start.theta)
        while True:
            yield (_variation(policies, rng, width.sd / 2) if _remembered(start) else vary)(theta)

    return search


def _remembered(start: Estimate) -> bool:
    """Whether theta_g is a copy of a theta that the estimate was made from."""
    return bool((start.thetas == start.theta).all(axis=1).any())


def _variation(policies: Box, rng: np.random.Generator, sd: float) -> Callable[[Array], Array]:
    if not sd > 0:
        raise ValueError(f"sd must be positive, got {sd}; without noise nothing new is tried")
    return lambda theta: policies.clip(rng.normal(theta, sd * policies.sides))
