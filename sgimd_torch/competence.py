"""Performance and competence: how well was a goal met, and how well can it be met by now?

Section 4.3 and eqs. (2) and (7) of Nguyen & Oudeyer (2014).
    competence = Competence(problem); competence(context, goal)   # -1 never came near ... 0 reached
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.parts import Judge, Problem
from sgimd_torch.spaces import Array


def performance(goal: Array, outcome: Array, rest: Array, d_min: float) -> Array:
    """How nearly an outcome meets a goal: 0 when met, -1 when no better than not moving.

    Eq. (7): the distance left, relative to how far the goal lies from where the float rests.

    Args:
        goal: ``(..., outcome_dim)`` metres on the water plane.
        outcome: ``(..., outcome_dim)``; leading axes broadcast with ``goal``.
        rest: ``(outcome_dim,)`` where the float lands without moving, the paper's tau_org.
        d_min: metres, > 0, for example the standard deviation of the noise. Deviation: eq. (7) is 0/0 for a goal at
            ``rest``, and near it noise alone gives -1, so goals nearer than ``d_min`` are judged as if at ``d_min``.

    Returns:
        ``(...)`` in [-1, 0].

    Raises:
        ValueError: ``d_min`` is not positive.
    """
    if not 0 < d_min < np.inf:
        raise ValueError(f"d_min must be positive and finite, got {d_min}; without it a goal at rest divides by zero")
    return -np.minimum(1.0, _distance(goal, outcome) / np.maximum(_distance(goal, rest), d_min))


class Competence(Judge):
    """Competence by the best outcome ever remembered, as in the paper.

    gamma of eq. (2), the `memory` reading. In one context it never falls.

    Deviation: the paper prints the minimum over memory, but J is negative, so the best is the maximum. J falls with
    distance, so the nearest outcome has the best. Deviation: eq. (2) asks for exactly the same context, which never
    comes again where contexts vary; the nearest exemplar in (context, outcome) is used instead.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._asked: tuple[bytes, bytes] | None = None
        self._row: int | None = None

    def __call__(self, context: Array, goal: Array, outcomes: Array | None = None) -> float:
        """In [-1, 0], -1 for an empty memory. ``outcomes`` of the attempt are not needed: they are in memory.

        Asked again for the same goal, as after each movement of an attempt, it looks at the newest exemplars only.
        """
        asked = np.asarray(context).tobytes(), np.asarray(goal).tobytes()
        if asked != self._asked:
            self._nearest = self.problem.memory.nearest(context, goal)
            self._asked, self._row, self._best = asked, None, -1.0
        if (row := self._nearest.row) != self._row:
            assert row is not None
            self._row, self._best = row, _best(self.problem, goal, self.problem.memory.outcomes[row : row + 1])
        return self._best


class AttemptCompetence(Judge):
    """Competence by the best outcome of the attempt alone.

    The `attempt` reading, SAGG-RIAC's own. It can fall when a movement stops working, and then interest sees a change.
    """

    def __call__(self, context: Array, goal: Array, outcomes: Array) -> float:
        """In [-1, 0] from the ``outcomes`` ``(n, outcome_dim)`` of this attempt, -1 if nothing was executed."""
        return _best(self.problem, goal, outcomes)


def _best(problem: Problem, goal: Array, outcomes: Array) -> float:
    return float(np.max(performance(goal, outcomes, problem.rest, problem.tolerance), initial=-1.0))


def _distance(a: Array, b: Array) -> Array:
    difference = np.subtract(a, b, dtype=np.float64)
    return np.sqrt((difference * difference).sum(axis=-1))
