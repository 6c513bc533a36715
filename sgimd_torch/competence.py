"""Performance J rates an outcome for a goal; competence gamma is the best performance so far.

Section 4.3 and eqs. (2) and (7) of Nguyen & Oudeyer (2014).
    competence = Competence(problem); competence(context, goal)   # values from -1 (never near) to 0 (reached)
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.parts import Judge, Problem
from sgimd_torch.spaces import Array


def performance(goal: Array, outcome: Array, rest: Array, d_min: float) -> Array:
    """Eq. (7): minus the distance between goal and outcome, relative to the distance between goal and ``rest``.

    Performance is 0 if the outcome meets the goal, and -1 if the outcome is no better than not moving.

    Args:
        goal: ``(..., outcome_dim)`` m.
        outcome: ``(..., outcome_dim)`` m; leading axes broadcast with ``goal``.
        rest: ``(outcome_dim,)`` m, the outcome of not moving, the paper's tau_org.
        d_min: least distance (m) of a goal from ``rest``, > 0, for example the standard deviation of the noise.
            Deviation: eq. (7) is 0/0 for a goal at ``rest``, and near ``rest`` noise alone gives -1. So a goal nearer
            than ``d_min`` is judged as if its distance from ``rest`` were ``d_min``.

    Returns:
        Performance ``(...)`` in [-1, 0].

    Raises:
        ValueError: ``d_min`` is not positive.
    """
    if not 0 < d_min < np.inf:
        raise ValueError(f"d_min must be positive and finite, got {d_min}; without it a goal at rest divides by zero")
    return -np.minimum(1.0, _distance(goal, outcome) / np.maximum(_distance(goal, rest), d_min))


class Competence(Judge):
    """Competence by the best outcome ever remembered, as in the paper.

    This is gamma of eq. (2), over the whole memory. In one context it never falls while the robot stays the same.

    Deviation: when the robot has changed, memory keeps only what still holds (`Watcher`), so competence
    falls again where nothing reaches the goal any more.

    Deviation: the paper prints the minimum over memory, but J is negative, so the best J is the maximum, the J of the
    nearest outcome. Deviation: eq. (2) demands an equal context, but contexts drawn from a continuum never recur; the
    nearest exemplar in (context, outcome) is used instead.
    """

    def __call__(self, context: Array, goal: Array, outcomes: Array | None = None) -> float:
        """Competence in [-1, 0], -1 for an empty memory; ``outcomes`` is not used, as they are in memory already."""
        problem, memory = self.problem, self.problem.memory
        if not len(memory):
            return -1.0
        nearest = memory.outcomes[memory.near_outcomes(context, goal, 1)]
        return _best(problem, goal, nearest)


class AttemptCompetence(Judge):
    """Competence by the best outcome of the attempt alone.

    This is the competence of SAGG-RIAC. It falls if a movement no longer reaches the goal, and interest shows this.
    """

    def __call__(self, context: Array, goal: Array, outcomes: Array) -> float:
        """Competence in [-1, 0] by the ``outcomes`` ``(n, outcome_dim)`` of this attempt; -1 if there are none."""
        return _best(self.problem, goal, outcomes)


def _best(problem: Problem, goal: Array, outcomes: Array) -> float:
    outcomes, rest = (problem.outcomes.unwrapped(points, goal) for points in (outcomes, problem.rest))
    return float(np.max(performance(goal, outcomes, rest, problem.tolerance), initial=-1.0))


def _distance(a: Array, b: Array) -> Array:
    difference = np.subtract(a, b, dtype=np.float64)
    return np.sqrt((difference * difference).sum(axis=-1))
