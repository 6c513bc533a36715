"""Local inverse model, corrected to first order by a weighted regression of theta on outcome near the goal.

Deviation: the paper stops at the weighted mean of eq. (9); this model corrects it.
    inverse = LocallyLinear(problem); estimate = inverse(context, goal); estimate.theta
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.inverses.local import LocalInverse, gaussian_weights
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate

# A slope needs more exemplars in a neighbourhood, and a wider Gaussian, than the mean of `LocalInverse`.
_K_MAX, _WIDTH = 20, 1.0
# Ridge, relative to the variance of the outcomes; with a larger ridge the answer is nearer to `LocalInverse`. The ridge
# also makes the regression unique when outcomes lie on a line, or are fewer than the slopes.
_RIDGE = 1e-3
_COINCIDENT = 1e-12  # least spread of outcomes relative to their size; below it, they count as one, without a slope


class LocallyLinear(Inverse):
    """Mean of the most reliable neighbourhood, eq. (9), corrected to first order.

    The mean theta is expected to land on the weighted mean of the outcomes; a weighted ridge regression of theta on
    outcome corrects the theta from this mean to the goal.

    The answer is clipped to the box around all executed thetas, because the regression extrapolates to far goals.

    Args:
        problem: problem to learn.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._local = LocalInverse(problem, k_max=_K_MAX, width=_WIDTH)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The corrected theta_g, with K_best as :class:`LocalInverse` gives it.

        Raises:
            RuntimeError: the memory is empty.
        """
        estimate = self._local(context, goal)
        mean_theta, thetas, outcomes, _ = estimate
        weights = gaussian_weights(goal, outcomes, _WIDTH)
        mean_outcome = weights @ outcomes
        deviations = outcomes - mean_outcome
        covariance = (weights * deviations.T) @ deviations
        variance = covariance.trace()
        if variance <= (_COINCIDENT * np.abs(outcomes).max()) ** 2:
            return estimate
        cross = (weights * deviations.T) @ (thetas - mean_theta)
        slope = np.linalg.solve(covariance + _RIDGE * variance * np.eye(len(goal)), cross)
        theta = mean_theta + (goal - mean_outcome) @ slope
        return estimate._replace(theta=np.clip(theta, *self.problem.memory.theta_range))
