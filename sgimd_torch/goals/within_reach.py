"""Goals within reach: of a few goals near the reached outcomes, the one with the least sure answer.

Our addition. It is active learning by uncertainty (Lewis & Gale 1994). If T is far larger than the reachable part,
nearly all goals of T are out of reach, and a learner that aims at them learns only its most extreme movements. So goals
lie in a box of outcomes that can be reached again: each movement counts with the mean outcome of similar movements, so
lucky outcomes hardly matter. Goals also lie within a step outside the box, so that the box can grow. The step is wide
at first, and narrows if goals outside the box are missed. If T is hardly larger than the box, goals lie in T.
    goals = WithinReach(problem); goal = goals.sample(context)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.memory import Rows
from sgimd_torch.memory.reached import Reached
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, check_count

_FEWEST: Final = 21  # least number of exemplars that determine a box; with fewer, goals are uniform in T
_SAMPLED: Final = 1000  # largest number of exemplars from which the box is computed
_GROWTH: Final = 1.05  # factor by which the memory grows from one box to the next
_SIMILAR: Final = 5  # largest number of similar movements whose mean outcome counts
_PER_SIMILAR: Final = 21  # number of exemplars in memory for each of these similar movements
_TAIL: Final = 0.02  # share of the mean outcomes that is left out at each end of a dimension
_NARROWEST: Final = 0.02  # least width of the step, relative to the box's longest side
_WIDEST: Final = 0.2  # greatest width of the step after the first exemplars, relative to the box's longest side
_EARLY: Final = 21  # least width of the step, relative to that side, times the number of exemplars
_WIDE_FOR: Final = 250  # number of exemplars up to which the step stays wide
_STEP_FACTOR: Final = 1.4  # factor of the step after a met goal outside the box; 1.4^(-1/3) after a missed one
_MEDIAN_FACTOR: Final = 1.1  # factor of the running median error after a larger error; 1 / 1.1 after a smaller one
_ROUNDING: Final = 1e-9  # largest spread of outcomes that counts as none, relative to the longest side of T
_HOME: Final = 0.5  # share of the goals in the box of global movements, if T is large and the box of all is larger
_HOME_STEP: Final = 0.05  # width of the step outside that box, relative to its longest side
_LARGE_T: Final = 0.2  # geometric mean of the sides of the widened box, relative to T's, below which T is large
_SMALL_HOME: Final = 0.7  # the same of the box of global movements, relative to the box of all, below which it counts
_ALL_OF_T: Final = 0.7  # geometric mean of the box's sides, relative to T's, from which on goals are uniform in T


class WithinReach(UniformGoals):
    """Goals in a box around the outcomes that were reached, where the inverse model is least sure of its answer.

    The step outside the box has one width on all sides, in the unit of T. So goals also lie in directions in which
    outcomes have not varied yet. The width follows a success rule (Rechenberg 1973), by which one of four goals outside
    the box is met. Such a goal is met if its error is below its distance from the box, or below the median error of
    goals in the box. All contexts share the box. If the inverse model reports movements without an effect, goals are
    uniform in T, because a few effects do not show what can be reached.

    If T is far larger than the box, half of the goals lie where global movements landed, because the box grows with
    the learner's own extreme movements, too. The box contains outcomes that came again, see `searches.doubt`.

    Args:
        problem: problem to learn. If its inverse model does not say how sure it is, the first candidate is the goal.
        candidates: number of uniform goals of which the one with the least sure answer is chosen; 1: goals are uniform.

    Raises:
        ValueError: ``candidates`` is no count.
    """

    by_competence = False  # `add` uses the error of the last movement; a subclass that uses competence says True

    def __init__(self, problem: Problem, *, candidates: int = 4) -> None:
        super().__init__(problem)
        self.candidates = check_count("candidates", candidates, 1)
        inverse = type(problem.inverse)
        if candidates > 1 and not inverse.says_how_sure:
            problem.remarks.append(f"goals are uniform within reach: {inverse.__name__} does not say how sure it is")
        self._box: Array | None = None  # (2, outcome_dim), the box; None while all outcomes are equal
        self._home: Array | None = None  # box of global movements, if half of the goals lie there
        self._reached = problem.shared(Reached, Reached)
        self._wraps = np.array(problem.outcomes.periodic or [False] * problem.outcomes.dim)
        self._n_confirmed = 0  # number of confirmed outcomes when the box was computed
        self._step = _WIDEST  # width of the step outside the box, relative to the box's longest side
        self._n_updated = 0  # number of exemplars when the box was computed
        self._median_error = 0.0  # running median of the errors of goals in the box
        self._all_of_t = False  # whether T is hardly larger than the box with its widest step

    def sample(self, context: ArrayLike) -> Array:
        """A goal ``(outcome_dim,)`` in T, or in the box that is widened by the step.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        at_home = self._home is not None and bool(self.rng.random() < _HOME)
        goal, inverse = self._within_reach(context, at_home), self.problem.inverse
        if self.candidates == 1 or not inverse.says_how_sure or inverse.effects() is not None or not self._n_updated:
            return goal
        goals = np.stack([goal, *(self._within_reach(context, at_home) for _ in range(self.candidates - 1))])
        return np.asarray(goals[inverse.uncertainty(np.asarray(context, dtype=np.float64), goals).argmax()])

    def _within_reach(self, context: ArrayLike, at_home: bool) -> Array:
        """A goal ``(outcome_dim,)``: uniform in T, in the widened box, or in that of global movements (``at_home``)."""
        goal, space = super().sample(context), self.problem.outcomes
        n = len(self.problem.memory)
        if n >= max(_FEWEST, _GROWTH * self._n_updated) or len(self._reached.confirmed) > self._n_confirmed:
            self._update_box()
        if self._box is None or self._all_of_t or self.problem.inverse.effects() is not None:
            return goal
        home = self._home if at_home else None
        low, high = self._around(self._box, self._step) if home is None else self._around(home, _HOME_STEP)
        moved: Array = low + (goal - space.low) / space.sides * (high - low)
        return moved

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Learn from the error of the last movement: widen or narrow the step after a goal outside the box.

        Raises:
            ValueError: see `Goals.add`.
        """
        super().add(context, goal, competence, strategy, gain)
        if self._box is None:
            return
        goal, (low, high) = np.asarray(goal, dtype=np.float64), self._box
        beyond = math.dist(goal, np.minimum(np.maximum(goal, low), high))
        error = float(self.problem.outcomes.distance(self.problem.memory.outcomes[-1], goal))
        if beyond == 0:
            median = self._median_error or error
            self._median_error = median * _MEDIAN_FACTOR if error > median else median / _MEDIAN_FACTOR
        elif len(self.problem.memory) >= _WIDE_FOR:
            is_met = error < max(beyond, self._median_error)
            step = self._step * _STEP_FACTOR if is_met else self._step / _STEP_FACTOR ** (1 / 3)
            self._step = min(max(step, _NARROWEST), _WIDEST)

    def _update_box(self) -> None:
        """Update the box."""
        n = self._n_updated = len(self.problem.memory)
        self._n_confirmed = len(self._reached.confirmed)
        box = self._box_of(np.arange(0, n, 1 + n // _SAMPLED), self._reached.confirmed)
        self._box = self._box if box is None else box
        if self._box is None:
            return
        share = self._share_of(self._around(self._box, _WIDEST), self.problem.outcomes.sides)
        self._all_of_t = share >= _ALL_OF_T
        self._home = self._box_of(np.array(self._reached.rows, np.intp)) if share < _LARGE_T else None
        if self._home is not None:
            low, high = self._around(self._box, self._step)
            if self._share_of(self._around(self._home, _HOME_STEP), high - low) >= _SMALL_HOME:
                self._home = None

    def _box_of(self, rows: Rows, confirmed: Sequence[Array] = ()) -> Array | None:
        """Box ``(2, outcome_dim)`` around most mean outcomes of movements like those in ``rows``, and around the
        ``confirmed`` ones; None if there are too few, or all are equal."""
        memory = self.problem.memory
        if len(rows) < _FEWEST:
            return None
        similar = memory.neighbourhoods(rows, min(_SIMILAR, len(memory) // _PER_SIMILAR))
        low, high = np.quantile(memory.outcomes[similar].mean(axis=1), (_TAIL, 1 - _TAIL), axis=0)
        box = np.stack((np.min((low, *confirmed), axis=0), np.max((high, *confirmed), axis=0)))
        box = np.where(self._wraps, (self.problem.outcomes.low, self.problem.outcomes.high), box)
        return box if np.ptp(box, axis=0).max() > _ROUNDING * self.problem.outcomes.sides.max() else None

    def _share_of(self, box: tuple[Array, Array], sides: Array) -> float:
        """Geometric mean of the sides of a box, relative to these ``sides``."""
        low, high = box
        return float(np.prod((high - low) / sides) ** (1 / len(sides)))

    def _around(self, box: Array, step: float) -> tuple[Array, Array]:
        """Low and high corners of the box that is widened by the step, within T."""
        low, high = box
        beyond = max(step, _EARLY / self._n_updated) * float(((high - low) * ~self._wraps).max())
        return self.problem.outcomes.clip(low - beyond), self.problem.outcomes.clip(high + beyond)
