"""Goals within reach: uniform in T where most of it is near what was reached, else in a box around that.

Our addition. Where T is far wider than what can be reached, nearly all of its points are hopeless, and a learner that
aims at them learns its most extreme movements. The box holds what can be reached again: for each movement, the mean
outcome of those most like it counts, so a lucky landing hardly does. Goals lie a step beyond it, too, at first a wide
one: so the box grows. The step narrows where such goals are missed: what lies there was reached by noise alone.
    goals = WithinReach(problem); goal = goals.sample(context)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array

_FIRST: Final = 21  # exemplars; before, goals are uniform in T
_LOOKED_AT, _GROWTH = 1000, 1.05  # exemplars at about equal distances in time, whenever there are so many times more
_ALIKE: Final = 5  # movements whose mean outcome counts, fewer while a memory is small
_TAIL: Final = 0.02  # of these means on each side of a dimension: rare ones do not make the box larger
_NARROWEST, _WIDEST = 0.02, 0.2  # of the box's longest side, the step beyond it on all sides; at first the whole side
_WIDE_FOR: Final = 250  # exemplars; before, the step is not narrowed
_FACTOR: Final = 1.4  # the step times this after a goal beyond was met, over its cube root after one was missed
_MEDIAN: Final = 1.1  # the median miss within the box times this after a larger miss, over it after a smaller one
_ROUNDING: Final = 1e-9  # of a side of T: outcomes so near each other are all alike
_MOST: Final = 0.7  # of a side of T, in the geometric mean: the box is then as good as T


class WithinReach(UniformGoals):
    """Uniform goals in a box around the outcomes that were reached.

    The box is T where T is nearly as large.

    Each draw is one of `UniformGoals`, moved from T to the box. The step beyond is the same on all sides, in the unit
    of T, so a dimension that nothing has moved yet is aimed at, too. It follows a success rule (Rechenberg 1973): of
    four goals beyond the box one should be met, that is, missed by less than it lies beyond, or by less than half of
    the goals within the box are. The box is the same in all contexts. Where only some movements have an effect, by the
    inverse model, goals are uniform in T: a few effects say little of what else could be had.

    Args:
        problem: T, the memory and the inverse model are read; ``add`` draws nothing.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._reach: Array | None = None  # (2, outcome_dim), the box; None until anything had an effect
        self._step, self._looked = _WIDEST, 0  # how far beyond; exemplars at the last look
        self._missed = 0.0  # by how much half of the goals within the box are, about
        self._all_of_t = False  # T is hardly larger than the box at its widest

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` uniform in the box, or in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        goal, space = super().sample(context), self.problem.outcomes
        n = len(self.problem.memory)
        if n >= max(_FIRST, _GROWTH * self._looked):
            self._look()
        if self._reach is None or self._all_of_t or self.problem.inverse.effects() is not None:
            return goal
        low, high = self._around(self._reach, self._step)
        moved: Array = low + (goal - space.low) / space.sides * (high - low)
        return moved

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """After an attempt at a goal beyond the box the step is wider or narrower.

        Raises:
            ValueError: see `Goals.add`.
        """
        super().add(context, goal, competence, strategy, gain)
        if self._reach is None:
            return
        beyond = float(np.linalg.norm(goal - np.clip(goal, *self._reach)))
        missed = float(np.linalg.norm(goal - self.problem.memory.outcomes[-1]))
        if beyond == 0:
            median = self._missed or missed
            self._missed = median * _MEDIAN if missed > median else median / _MEDIAN
        elif len(self.problem.memory) >= _WIDE_FOR:
            met = missed < max(beyond, self._missed)
            step = self._step * _FACTOR if met else self._step / _FACTOR ** (1 / 3)
            self._step = float(np.clip(step, _NARROWEST, _WIDEST))

    def _look(self) -> None:
        """Where the box is now."""
        memory, space = self.problem.memory, self.problem.outcomes
        n = self._looked = len(memory)
        rows = np.arange(0, n, 1 + n // _LOOKED_AT)
        alike = memory.neighbourhoods(rows, min(_ALIKE, n // _FIRST))
        means = [memory.outcomes[each].mean(axis=0) for each in alike]
        reach = np.quantile(means, (_TAIL, 1 - _TAIL), axis=0)
        if np.ptp(reach, axis=0).max() > _ROUNDING * space.sides.max():
            self._reach = reach
        if self._reach is not None:
            low, high = self._around(self._reach, _WIDEST)
            share = np.prod((high - low) / space.sides) ** (1 / space.dim)
            self._all_of_t = bool(share >= _MOST)

    def _around(self, reach: Array, step: float) -> tuple[Array, Array]:
        """Low and high ends of the box and a step beyond, within T."""
        low, high = reach
        beyond = max(step, _FIRST / self._looked) * float((high - low).max())
        return self.problem.outcomes.clip(low - beyond), self.problem.outcomes.clip(high + beyond)
