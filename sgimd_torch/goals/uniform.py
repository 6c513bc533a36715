"""Goals that are uniform in T, a baseline for the interest map; and the checks of arguments of all goal models.

goals = UniformGoals(problem); point = check_attempt(problem, context, goal, competence, gain)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array, Box, check_vector


class UniformGoals(Goals):
    """Uniform goals, anywhere in T."""

    def sample(self, context: ArrayLike) -> Array:
        """A goal ``(outcome_dim,)``, uniform in T."""
        check_in(self.problem.contexts, "context", context)
        return self.problem.outcomes.sample(self.rng)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Check the arguments, and remember nothing."""
        check_attempt(self.problem, context, goal, competence, gain)


def check_in(box: Box, name: str, value: ArrayLike, hint: str = "was a goal passed instead?") -> Array:
    """``value`` as one point ``(dim,)`` of ``box``.

    Raises:
        ValueError: the value has another shape, is not finite, or lies outside the box.
    """
    point = check_vector(name, value, box.dim, hint)
    if point.ndim != 1 or not box.contains(point):
        raise ValueError(f"{name} must be one point of [{box.low}, {box.high}], got {point}; {hint}")
    return point


def check_attempt(problem: Problem, context: ArrayLike, goal: ArrayLike, competence: float, gain: float) -> Array:
    """The point (context, goal) of C x T, ``(context_dim + outcome_dim,)``.

    Raises:
        ValueError: ``context`` is not one point of C, ``goal`` is not one point of T, ``competence`` is not in [-1, 0],
            or ``gain`` is not in [-1, 1]. Check a demonstrated outcome by ``outcomes.contains`` first.
    """
    point = check_in(problem.contexts, "context", context)
    goal = check_in(problem.outcomes, "goal", goal, "is it a demonstrated outcome? Check it by outcomes.contains first")
    if not -1 <= competence <= 0:  # NaN is refused, too
        raise ValueError(f"competence must lie in [-1, 0], got {competence}; was a distance passed instead?")
    if not -1 <= gain <= 1:
        raise ValueError(f"gain must lie in [-1, 1], got {gain}; it is a difference of two competences")
    return np.concatenate((point, goal))
