"""Nearest neighbour, the simplest inverse model: the remembered movement whose outcome is nearest to the goal.

inverse = NearestNeighbour(problem); inverse(context, goal).theta
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.memory import Memory, Rows
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate, check_count


class NearestNeighbour(Inverse):
    """Remembered movement whose outcome is nearest to the goal.

    Args:
        problem: problem to learn.
        k: number of exemplars in the estimate, at which a search may begin, at least 1.

    Raises:
        ValueError: ``k`` is not a whole number, or below 1.
    """

    says_how_sure = False  # estimates have no expected outcome and no error

    def __init__(self, problem: Problem, *, k: int = 10) -> None:
        super().__init__(problem)
        self.k = check_count("k", k, 1)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """theta of the nearest outcome, and the ``k`` exemplars of the nearest outcomes, nearest first."""
        memory = self.problem.memory
        rows = near_goal(memory, context, goal, self.k)
        thetas = memory.thetas[rows]
        return Estimate(theta=thetas[0], thetas=thetas, outcomes=memory.outcomes_around(goal, rows), context=context)


def near_goal(memory: Memory, context: Array, goal: Array, k: int) -> Rows:
    """Rows of the ``k`` exemplars whose outcomes lie nearest to a goal.

    Raises:
        RuntimeError: the memory is empty.
    """
    rows = memory.near_outcomes(context, goal, k)
    if not len(rows):
        raise RuntimeError("the inverse model needs a memory of at least one exemplar, but it is empty; explore first")
    return rows


def distances_to(outcomes: Array, goal: Array) -> Array:
    """``(n,)`` distances of ``outcomes`` ``(n, outcome_dim)`` to a goal."""
    difference = outcomes - goal
    return np.sqrt((difference * difference).sum(axis=-1))
