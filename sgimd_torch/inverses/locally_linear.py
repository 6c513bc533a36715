"""Local inverse model corrected to first order: a weighted regression of theta on outcome near the goal.

Deviation: the paper stops at the weighted mean of eq. (9); this goes on from it.
    inverse = LocallyLinear(memory); estimate = inverse(context, goal); estimate.theta
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.inverses.local import LocalInverse, gaussian_weights
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Estimate

_COINCIDENT = 1e-12  # metres: outcomes spread less than this are one outcome, and have no slope


class LocallyLinear:
    """:class:`LocalInverse`, corrected to first order: eq. (9) averages, so it answers with a theta that should land on
    the weighted mean of the outcomes; a weighted ridge regression of theta on outcome supplies the rest of the way.

    The answer stays in the box around all that was ever executed, since a far goal extrapolates far.

    Args:
        ridge: relative to the variance of the outcomes, > 0; the larger, the closer to :class:`LocalInverse`. It is
            also what settles outcomes that lie on a line, or are fewer than there are slopes.
        h_max, k_max, dist_n, alpha, width: as for :class:`LocalInverse`, which averages fewer and more closely.
    """

    def __init__(
        self,
        memory: Memory,
        *,
        ridge: float = 1e-3,
        h_max: int = 10,
        k_max: int = 20,
        dist_n: float | None = None,
        alpha: float = 0.5,
        width: float = 1.0,
    ) -> None:
        if not ridge > 0:
            raise ValueError(f"ridge must be positive, got {ridge}; outcomes on a line have no slope across it")
        self.memory = memory
        self.ridge = ridge
        self.width = width
        self._local = LocalInverse(memory, h_max=h_max, k_max=k_max, dist_n=dist_n, alpha=alpha, width=width)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The corrected theta_g, with K_best as :class:`LocalInverse` gives it.

        Raises:
            RuntimeError: the memory is empty.
        """
        estimate = self._local(context, goal)
        mean_theta, thetas, outcomes, _ = estimate
        weights = gaussian_weights(goal, outcomes, self.width)
        mean_outcome = weights @ outcomes
        deviations = outcomes - mean_outcome
        covariance = (weights * deviations.T) @ deviations
        variance = covariance.trace()
        if variance < _COINCIDENT**2:
            return estimate
        cross = (weights * deviations.T) @ (thetas - mean_theta)
        slope = np.linalg.solve(covariance + self.ridge * variance * np.eye(len(goal)), cross)
        theta = mean_theta + (goal - mean_outcome) @ slope
        return estimate._replace(theta=np.clip(theta, self.memory.thetas.min(axis=0), self.memory.thetas.max(axis=0)))
