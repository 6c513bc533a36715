"""A goal model chooses the next goal and is told what came of it: two methods, `sample` and `add`.

Section 3.2 of Nguyen & Oudeyer (2014). A goal model of your own is made from (contexts, outcomes, rng), and begins its
two methods with the checks below.
    goal = goals.sample(context); goals.add(context, goal, competence)
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box, check_vector


class Goals(Protocol):
    """Which goal to aim at next, given what came of the earlier ones."""

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` a goal in T for this ``context`` ``(context_dim,)``.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        ...

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """An attempt at a goal has ended.

        Args:
            context: ``(context_dim,)`` in C.
            goal: ``(outcome_dim,)`` in T.
            competence: at this goal now, in [-1, 0].
            strategy: who had chosen the goal.
            gain: how much the best competence remembered at this goal rose during the attempt; if it did not rise, how
                much less the attempt came to, by the judge of the learner; in [-1, 1].

        Raises:
            ValueError: see `check_attempt`.
        """
        ...


def check_in(box: Box, name: str, value: ArrayLike, hint: str = "was a goal passed instead?") -> Array:
    """``value`` as one point ``(dim,)`` of ``box``.

    Raises:
        ValueError: another shape, not finite, or outside.
    """
    point = check_vector(name, value, box.dim, hint)
    if point.ndim != 1 or not box.contains(point):
        raise ValueError(f"{name} must be one point of [{box.low}, {box.high}], got {point}; {hint}")
    return point


def check_attempt(
    contexts: Box, outcomes: Box, context: ArrayLike, goal: ArrayLike, competence: float, gain: float
) -> Array:
    """The point (context, goal) of C x T, ``(context_dim + outcome_dim,)``.

    Raises:
        ValueError: ``context`` is not one point of C, ``competence`` not in [-1, 0], ``gain`` not in [-1, 1], or
            ``goal`` not one point of T. A demonstrated outcome may lie outside, so ask ``outcomes.contains`` first.
    """
    point = check_in(contexts, "context", context)
    goal = check_in(outcomes, "goal", goal, "ask outcomes.contains before a demonstrated outcome becomes a goal")
    if not -1 <= competence <= 0:  # NaN too
        raise ValueError(f"competence must lie in [-1, 0], got {competence}; was a distance passed instead?")
    if not -1 <= gain <= 1:
        raise ValueError(f"gain must lie in [-1, 1], got {gain}; it is a difference of two competences")
    return np.concatenate((point, goal))
