"""Local inverse model, corrected to first order by a weighted regression of theta on outcome near the goal.

Deviation: the paper stops at the weighted mean of eq. (9); this model corrects it.
    inverse = LocallyLinear(problem); estimate = inverse(context, goal); estimate.theta
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.inverses.nearest import near_goal
from sgimd_torch.memory import Memory, Rows
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate

NEAR: Final = 10  # number of nearest outcomes that are compared, eq. (8)
ALIKE: Final = 20  # largest number of exemplars in a neighbourhood; a slope needs more than the mean of `LocalInverse`


class LocallyLinear(Inverse):
    """Mean of the most reliable neighbourhood, eq. (9), corrected to first order.

    The mean theta is expected to land on the weighted mean of the outcomes; a weighted ridge regression of theta on
    outcome corrects the theta from this mean to the goal.

    The answer is clipped to the box around all executed thetas, because the regression extrapolates to far goals.

    Args:
        problem: problem to learn.
    """

    says_how_sure = False  # estimates have no expected outcome and no error

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._memory, self._radius = problem.memory, 0.6 * np.sqrt(problem.policies.dim / 25)  # as `LocalInverse`

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The corrected theta_g, with K_best as :class:`LocalInverse` gives it.

        Raises:
            RuntimeError: the memory is empty.
        """
        memory, goal = self._memory, np.ascontiguousarray(goal, dtype=np.float64)
        near = near_goal(memory, context, goal, NEAR)
        outcomes = memory.outcomes_around(goal)
        theta, rows = corrected(memory, outcomes, memory.neighbourhoods(near, ALIKE, self._radius), goal)
        return Estimate(theta, memory.thetas[rows], outcomes[rows], context)


def corrected(memory: Memory, outcomes: Array, alike: Rows, goal: Array) -> tuple[Array, Rows]:
    """The corrected theta_g and the rows of K_best, from neighbourhoods ``(h, k)``, -1 where they are fewer, and all
    ``outcomes``, unwrapped around the goal."""
    kernels, theta = compiled("sgimd_torch.inverses.linear_kernel"), np.empty(memory.theta_dim)
    best = kernels.locally_linear(alike, memory.thetas, outcomes, goal, memory.theta_range, theta)
    return theta, alike[best][alike[best] >= 0]
