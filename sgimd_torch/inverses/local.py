"""Local inverse model L^-1: mean of similar movements whose outcomes are near the goal.

Section 4.4.2 and eqs. (8) and (9) of Nguyen & Oudeyer (2014). Different movements can reach the same place, but their
mean may land elsewhere. So the mean is over one neighbourhood in Pi, the space of thetas, whose outcomes are near the
goal and vary little.
    inverse = LocalInverse(problem); estimate = inverse(context, goal); estimate.theta
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.inverses.nearest import distances_to, near_goal
from sgimd_torch.memory import Rows
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate


class LocalInverse(Inverse):
    """Mean of the most reliable neighbourhood, weighted towards the goal, eq. (9).

    Args:
        problem: problem to learn.
        h_max: number of exemplars, those nearest to the goal, whose neighbourhoods are compared, eq. (8).
        k_max: largest number of exemplars in a neighbourhood. The paper gives no number; 25 of them and theta_g are its
            simplex of 26 points.
        dist_n: radius of a neighbourhood in Pi, the paper's distN; None: 0.6 sqrt(theta_dim / 25), because distances
            grow with sqrt(theta_dim). The paper gives no number.
        alpha: weight of the standard deviation of outcomes in a neighbourhood; their distance to the goal has weight 1.
        variance: true: the variance takes the place of the standard deviation, as the paper prints it.
        width: width of the Gaussian of eq. (9), relative to the mean distance of the neighbourhood's outcomes from the
            goal. A wide Gaussian averages the neighbourhood; a narrow one follows the exemplar nearest to the goal.

    Raises:
        ValueError: ``width`` is not positive.
    """

    says_how_sure = False  # estimates have no expected outcome and no error

    def __init__(
        self,
        problem: Problem,
        *,
        h_max: int = 10,
        k_max: int = 25,
        dist_n: float | None = None,
        alpha: float = 0.5,
        variance: bool = False,
        width: float = 0.25,
    ) -> None:
        if not width > 0:
            raise ValueError(f"width must be positive, got {width}; it is relative to the mean distance to the goal")
        super().__init__(problem)
        self.memory = problem.memory
        self.h_max, self.k_max, self.alpha, self.variance, self.width = h_max, k_max, alpha, variance, width
        self.dist_n = 0.6 * np.sqrt(problem.policies.dim / 25) if dist_n is None else dist_n

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """theta_g, and the exemplars of the best neighbourhood K_best, those nearest to its centre theta_h first.

        Raises:
            RuntimeError: the memory is empty.
        """
        known = self.memory.outcomes_around(goal)
        rows = self._most_reliable(context, goal, known)
        thetas, outcomes = self.memory.thetas[rows], known[rows]
        theta = gaussian_weights(goal, outcomes, self.width) @ thetas  # eq. (9)
        # A mean lies between the values that it averages; clipping keeps rounding from moving it out of Pi.
        return Estimate(np.clip(theta, thetas.min(axis=0), thetas.max(axis=0)), thetas, outcomes, context)

    def _most_reliable(self, context: Array, goal: Array, outcomes: Array) -> Rows:
        near = near_goal(self.memory, context, goal, self.h_max)  # H of eq. (8), by distances of context and outcome
        padded = self.memory.neighbourhoods(near, self.k_max, self.dist_n)  # -1 fills lists with fewer than k_max rows
        neighbourhoods = [rows[rows >= 0] for rows in padded]  # K_h of eq. (8)
        spreads = _spreads(outcomes, neighbourhoods) ** (2 if self.variance else 1)
        unreliability = distances_to(outcomes[near], goal) + self.alpha * spreads
        return neighbourhoods[int(unreliability.argmin())]


def gaussian_weights(goal: Array, outcomes: Array, width: float) -> Array:
    """Weights beta of eq. (9): ``(k,)`` with sum 1, a Gaussian of the distances between ``outcomes`` and ``goal``.

    The paper does not give the standard deviation of the Gaussian. Here it is ``width`` times the mean distance.
    """
    distances = distances_to(outcomes, goal)
    scaled = distances / max(np.finfo(float).tiny, width * distances.mean())
    weights = np.exp(0.5 * (scaled.min() ** 2 - scaled**2))  # weight 1 for the nearest outcome, so the sum cannot be 0
    return weights / weights.sum()


def _spreads(outcomes: Array, neighbourhoods: list[Rows]) -> Array:
    """Standard deviations ``(h,)`` of the outcomes within each neighbourhood.

    Deviation: the paper takes the variance, which is too small to matter when it is added to a distance. A
    neighbourhood of one exemplar has no standard deviation and gets the median of the others. If all neighbourhoods
    have one exemplar, all get 0, and the exemplar nearest to the goal is chosen.
    """
    spreads = np.array([_standard_deviation(outcomes[rows]) for rows in neighbourhoods])
    known = ~np.isnan(spreads)
    return np.where(known, spreads, np.median(spreads[known]) if known.any() else 0.0)


def _standard_deviation(outcomes: Array) -> float:
    n = len(outcomes)
    if n < 2:
        return np.nan
    deviations = outcomes - outcomes.sum(axis=0) / n
    return float(np.sqrt((deviations * deviations).sum() / (n - 1)))  # division by n would favour small neighbourhoods
