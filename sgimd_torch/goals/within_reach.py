"""Goals within reach: uniform in T where most of it is near what was reached, else in a box around that.

Our addition. Where T is far wider than what can be reached, nearly all of its points are hopeless, and a learner that
aims at them learns its most extreme movements. The box holds what can be reached again: for each movement, the mean
outcome of those most like it counts, so a lucky landing hardly does. Goals lie a step beyond it, too, at first a wide
one: so the box grows.
    goals = WithinReach(contexts, outcomes, rng, reached=memory)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.spaces import Array, Box

_FIRST: Final = 21  # exemplars; before, goals are uniform in T
_LOOKED_AT, _GROWTH = 1000, 1.05  # exemplars at about equal distances in time, whenever there are so many times more
_ALIKE: Final = 5  # movements whose mean outcome counts, fewer while a memory is small
_TAIL: Final = 0.02  # of these means on each side of a dimension: rare ones do not make the box larger
_BEYOND: Final = 0.2  # of the box's longest side, the step beyond it on all sides; at first the whole side
_ROUNDING: Final = 1e-9  # of a side of T: outcomes so near each other are all alike
_MOST: Final = 0.7  # of a side of T, in the geometric mean: the box is then as good as T


class Reached(Protocol):
    """What a `Memory` knows of outcomes."""

    @property
    def outcomes(self) -> Array:
        """``(n, outcome_dim)``, all that were reached, in their order."""
        ...

    def __len__(self) -> int: ...

    def neighbourhoods(self, rows: np.ndarray, k: int) -> Sequence[np.ndarray]:
        """For each of ``rows`` those of the ``k`` movements most like it."""
        ...


class WithinReach(UniformGoals):
    """Uniform goals in a box around what was reached, which is T where that is nearly as large; see `Goals`.

    Each draw is one of `UniformGoals`, moved from T to the box. The step beyond is the same on all sides, in the unit
    of T, so a dimension that nothing has moved yet is aimed at, too.

    Args:
        contexts: C; the box is the same in all of them.
        outcomes: T; no goal lies outside.
        rng: the only source of draws; ``add`` draws nothing.
        reached: the learner's memory; only read.
        effects: the exemplars with an effect, None where all have one, see `Effects`. Where only some have, goals are
            uniform in T: a few effects say little of what else could be had.
    """

    def __init__(
        self,
        contexts: Box,
        outcomes: Box,
        rng: np.random.Generator,
        *,
        reached: Reached,
        effects: Callable[[], object | None] = lambda: None,
    ) -> None:
        super().__init__(contexts, outcomes, rng)
        self.reached, self._effects = reached, effects
        self._low, self._high, self._looked = outcomes.low, outcomes.high, 0  # the box; exemplars at the last look

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` uniform in the box, or in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        goal, space = super().sample(context), self.outcomes
        n = len(self.reached)
        if n >= max(_FIRST, _GROWTH * self._looked):
            self._look()
        sides = self._high - self._low
        if np.prod(sides / space.sides) ** (1 / space.dim) >= _MOST or self._effects() is not None:
            return goal
        moved: Array = self._low + (goal - space.low) / space.sides * sides
        return moved

    def _look(self) -> None:
        """Where the box is now; T until anything had an effect."""
        n = self._looked = len(self.reached)
        rows = np.arange(0, n, 1 + n // _LOOKED_AT)
        alike = self.reached.neighbourhoods(rows, min(_ALIKE, n // _FIRST))
        means = [self.reached.outcomes[each].mean(axis=0) for each in alike]
        low, high = np.quantile(means, (_TAIL, 1 - _TAIL), axis=0)
        beyond = max(_BEYOND, _FIRST / n) * float((high - low).max())
        if beyond > _ROUNDING * self.outcomes.sides.max():
            self._low, self._high = self.outcomes.clip(low - beyond), self.outcomes.clip(high + beyond)
