"""Goals within reach: uniform in T where most of it is near what was reached, else in a box around that.

Our addition. Where T is far wider than what can be reached, nearly all of its points are hopeless, and a learner that
aims at them learns its most extreme movements. The box stands around what was reached, with a margin on all sides. The
margin grows with each goal there that is approached clearly more closely than ever before, and shrinks with the others.
As long as the box grows, a wide margin is tried anew from time to time: only far goals lead to global exploration.
    goals = WithinReach(contexts, outcomes, rng, reached=memory)
"""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.protocol import check_attempt, check_in
from sgimd_torch.spaces import Array, Box

_FIRST: Final = 21  # outcomes, so that a tail is at least one of them; before, goals are uniform in T
_LOOKED_AT: Final = 1000  # outcomes, at about equal distances in time
_TAIL: Final = 0.05  # of the outcomes on each side of a dimension: rare ones do not make the box larger
_LEAST: Final = 1 / 18  # of the box, the margin on each side: what is uniform has .9 of itself between its tails
_FACTOR: Final = 1.05  # from one margin to the next
_NEARER: Final = 0.2  # of what is left: an attempt leads on if it came nearer by more. In 6 dimensions most come nearer
_AGAIN: Final = 0.5  # of the box, the margin that is tried anew,
_GROWTH, _GROWN = 1.5, 1.1  # when there are so many times more outcomes, and the box is so many times larger
_MOST: Final = 0.7  # of a side of T, in the geometric mean: the box is then as good as T


class Reached(Protocol):
    """What a `Memory` knows of outcomes."""

    @property
    def outcomes(self) -> Array:
        """``(n, outcome_dim)``, all that were reached, in their order."""
        ...


class WithinReach:
    """Uniform goals in a box around what was reached, which is T where that is nearly as large; see `Goals`.

    The margin is the same on all sides, in the unit of T, and at first as wide as the box: goals beyond lead outwards
    in all directions at once. Each draw is one of `UniformGoals`, moved from T to the box.

    Args:
        contexts: C; the box is the same in all of them.
        outcomes: T; no goal lies outside.
        rng: the only source of draws; ``add`` draws nothing.
        reached: the learner's memory; only read.
    """

    def __init__(self, contexts: Box, outcomes: Box, rng: np.random.Generator, *, reached: Reached) -> None:
        self.contexts, self.outcomes, self.reached, self._rng = contexts, outcomes, reached, rng
        self._margin: float | None = None  # in the unit of T
        self._due = self._size = 0.0  # outcomes when the size of the box is next looked at; its size at the last look
        self._low, self._high = outcomes.low, outcomes.high  # of what was reached, without the margin

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` uniform in the box, or in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        check_in(self.contexts, "context", context)
        goal, space = self.outcomes.sample(self._rng), self.outcomes
        low, high = self._box()
        if np.prod((high - low) / space.sides) ** (1 / space.dim) >= _MOST:
            return goal
        moved: Array = low + (goal - space.low) / space.sides * (high - low)
        return moved

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """After an attempt at a goal in the margin: did it come clearly nearer than anything before?

        Raises:
            ValueError: see `Goals.add`.
        """
        goal = check_attempt(self.contexts, self.outcomes, context, goal, competence, gain)[self.contexts.dim :]
        if self._margin is not None and not ((self._low <= goal) & (goal <= self._high)).all():
            self._margin *= _FACTOR if gain > -_NEARER * competence else 1 / _FACTOR

    def _box(self) -> tuple[Array, Array]:
        """Lower and upper corner ``(outcome_dim,)`` of where goals lie: T until anything had an effect."""
        n = len(self.reached.outcomes)
        if n < _FIRST:
            return self.outcomes.low, self.outcomes.high
        known = self.reached.outcomes[:: 1 + n // _LOOKED_AT]
        self._low, self._high = np.quantile(known, (_TAIL, 1 - _TAIL), axis=0)
        sides = self._high - self._low
        if not sides.any():
            return self.outcomes.low, self.outcomes.high
        size = float(sides.max())
        if self._margin is None:
            self._margin = size
        if n >= self._due:
            if size > _GROWN * self._size:
                self._margin = max(self._margin, _AGAIN * size)
            self._due, self._size = _GROWTH * n, size
        margins = np.maximum(self._margin, _LEAST * sides)
        self._margin = float(margins.min())
        return self.outcomes.clip(self._low - margins), self.outcomes.clip(self._high + margins)
