"""Regions of C x T (contexts x outcomes) with their interest, and the choice of a goal from regions that tile C x T.

Sections 3.2.1 and 3.2.2, eqs. (3) and (4) of Nguyen & Oudeyer (2014). The interest of a region is its competence
progress, over a sliding window of the last goals that were attempted there. `InterestMap` cuts C x T into regions and
gives them to a `Tiling`.
    tiling.tile(regions); goal = tiling.sample(context); index = tiling.add(context, goal, competence, strategy, gain)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.uniform import check_attempt, check_in
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box

Progress = Callable[[Array, Array, Array], float]
"""Function (points, competences, gains) of n >= 4 goals, oldest first -> progress. Points ``(n, dim)`` of C x T are
contexts and goals. Competences ``(n,)`` and gains ``(n,)`` are arguments of `Goals.add`, one for each goal."""


def gained_progress(points: Array, competences: Array, gains: Array) -> float:
    """Mean rise of the competence at a goal during the attempt at this goal.

    Deviation: eq. (3) compares competences at older goals with competences at newer goals. If only some goals of a
    region can be reached, as in most regions of a large task space, differences between goals hide progress.
    """
    return float(np.maximum(gains, 0).mean())


def absolute_progress(points: Array, competences: Array, gains: Array) -> float:
    """Difference between the newer and the older half of the competences, the paper's eq. (3).

    |sum of newer - sum of older| / number of values. If the number is odd, the oldest value is left out."""
    # Deviation: the two sums in the paper share their middle term. Here the halves are disjoint and of equal length.
    half = len(competences) // 2
    newer, older = competences[-half:], competences[-2 * half : -half]
    return abs(float(newer.sum() - older.sum()) / (2 * half))


def interest_of(points: Array, competences: Array, gains: Array, *, window: int, progress: Progress) -> float:
    """Progress over the last ``window`` goals, at ``points`` ``(n, dim)`` with ``competences`` and ``gains`` ``(n,)``.

    Deviation: with fewer than 4 goals the interest is 0, because each half in eq. (3) would have one value or none.
    """
    if len(competences) < 4:
        return 0.0
    return progress(points[-window:], competences[-window:], gains[-window:])


def interest_difference(region: Region, below: NDArray[np.bool_]) -> float:
    """Difference of the interests on the two sides of a cut; ``below`` ``(n,)`` marks the goals on one side."""
    return abs(region.interest_among(below) - region.interest_among(~below))


@dataclass(frozen=True, eq=False)
class Region:
    """R_i, a leaf of the tree. A Region is immutable: adding a goal makes a new Region.

    ``path`` is the name of the region: "R" is the root, "R0" its half below the cut, "R1" its half above the cut, and
    "R01" the upper half of "R0". ``low`` and ``high`` are the corners in C x T. ``points``
    ``(n, context_dim + outcome_dim)``, ``competences``, ``gains`` and ``strategies`` ``(n,)`` have a row for each goal.
    ``strategies`` are names, for goal models that choose strategies. ``attempts`` is the number of goals since this
    region was split off, forgotten ones included. ``interest_function`` is `interest_of` with its options. Arrays are
    read-only.
    """

    path: str
    low: Array
    high: Array
    context_dim: int
    points: Array
    competences: Array
    gains: Array
    strategies: NDArray[np.str_]
    attempts: int
    interest_function: Progress

    def __post_init__(self) -> None:
        for name in ("low", "high", "points", "competences", "gains", "strategies"):
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)

    @property
    def contexts(self) -> Array:
        """Contexts ``(n, context_dim)`` of the attempts."""
        return self.points[:, : self.context_dim]

    @property
    def goals(self) -> Array:
        """Goals ``(n, outcome_dim)`` in order of time."""
        return self.points[:, self.context_dim :]

    def interest(self) -> float:
        """Local competence progress, eq. (3)."""
        return self._interest

    def interest_among(self, rows: NDArray[np.bool_] | slice) -> float:
        """Interest over the goals in ``rows`` alone."""
        return self.interest_function(self.points[rows], self.competences[rows], self.gains[rows])

    @cached_property
    def _interest(self) -> float:
        return self.interest_among(slice(None))

    def extend(self, point: Array, competence: ArrayLike, gain: ArrayLike, strategy: ArrayLike) -> Region:
        """This region with one more goal, or with an array of ``n`` more goals, the oldest first."""
        return replace(
            self,
            points=np.vstack((self.points, point)),
            competences=np.append(self.competences, competence),
            gains=np.append(self.gains, gain),
            strategies=np.append(self.strategies, strategy),
            attempts=self.attempts + np.size(competence),
        )

    def keep(self, rows: NDArray[np.bool_] | slice) -> Region:
        """This region with only the goals in ``rows``."""
        return replace(
            self,
            points=self.points[rows],
            competences=self.competences[rows],
            gains=self.gains[rows],
            strategies=self.strategies[rows],
        )

    def split(self, axis: int, cut: float) -> tuple[Region, Region]:
        """The halves below and above a cut; goals on the cut belong to the upper half."""
        is_below = self.points[:, axis] < cut
        low, high = self.low.copy(), self.high.copy()
        low[axis] = high[axis] = cut
        below = replace(self.keep(is_below), path=f"{self.path}0", high=high, attempts=int(is_below.sum()))
        above = replace(self.keep(~is_below), path=f"{self.path}1", low=low, attempts=int((~is_below).sum()))
        return below, above


class Tiling:
    """Regions that tile C x T; at first, one region covers C x T.

    Args:
        problem: problem to learn.
        interest_function: function (points, competences, gains) -> interest of a region.
        modes: probabilities of the paper's modes: a goal where interest is high (1), anywhere (2), where competence is
            least (3).
        near: largest distance from a region's goal of least competence at which mode 3 draws a new goal, relative to
            the region's sides.

    Raises:
        ValueError: a number is out of its range.
    """

    def __init__(
        self, problem: Problem, interest_function: Progress, *, modes: tuple[float, float, float], near: float
    ) -> None:
        if len(modes) != 3 or not (min(modes) >= 0 and abs(sum(modes) - 1) < 1e-9):
            raise ValueError(f"modes must be three probabilities with the sum 1, got {modes}")
        if not 0 < near <= 1:
            raise ValueError(f"near must lie in (0, 1], got {near}; it is a fraction of a region's sides")
        self.problem, self._modes, self._near = problem, modes, near
        self._interest_function, self._rng = interest_function, problem.stream("goals")
        contexts, outcomes = problem.contexts, problem.outcomes
        self.box = Box(np.concatenate((contexts.low, outcomes.low)), np.concatenate((contexts.high, outcomes.high)))
        self.tile([self._empty_region("R", self.box.low, self.box.high)])

    def _empty_region(self, path: str, low: Array, high: Array) -> Region:
        """A region without goals."""
        nothing = np.empty((0, self.box.dim)), np.empty(0), np.empty(0), np.empty(0, dtype=np.str_)
        return Region(path, low, high, self.problem.contexts.dim, *nothing, 0, self._interest_function)

    def tile(self, regions: list[Region]) -> None:
        """Use these regions from now on; they must tile C x T."""
        self.regions = regions
        self._lows = np.stack([region.low for region in regions])
        self._highs = np.stack([region.high for region in regions])
        # Regions are half open, [low, high), but closed at the border of C x T, so each point is in exactly one region.
        self._ends = np.where(self._highs == self.box.high, np.inf, self._highs)

    def add(self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str, gain: float) -> int:
        """Add a goal to its region, and return the index of this region."""
        point = check_attempt(self.problem, context, goal, competence, gain)
        index = int(self.containing(point).argmax())
        self.regions[index] = self.regions[index].extend(point, competence, gain, strategy)
        return index

    def sample(self, context: ArrayLike) -> Array:
        """Decide a goal, section 3.2.2: choose a mode, a region that contains the context, and a goal in it."""
        context = check_in(self.problem.contexts, "context", context)
        mode = 1 + self._rng.choice(3, p=self._modes)
        if mode == 2:
            return self.problem.outcomes.sample(self._rng)
        region = self._choose(context)
        dim = self.problem.contexts.dim
        low, high = region.low[dim:], region.high[dim:]
        if mode == 1 or len(region.goals) == 0:
            return self._rng.uniform(low, high)
        # Ties are common, as competence is -1, its least, far from all outcomes. Without a draw one goal would recur.
        worst = self._rng.choice(np.flatnonzero(region.competences == region.competences.min()))
        step = self._near * (high - low)
        return Box(low, high).clip(region.goals[worst] + self._rng.uniform(-step, step))

    def containing(self, point: Array) -> NDArray[np.bool_]:
        """Mask ``(n_regions,)`` of the regions that contain a point of C, or of C x T."""
        dim = len(point)
        inside = (self._lows[:, :dim] <= point) & (point < self._ends[:, :dim])  # (n_regions, dim)
        contain: NDArray[np.bool_] = np.all(inside, axis=1)
        return contain

    def _choose(self, context: Array) -> Region:
        """A region that contains the context, drawn with the probabilities of eq. (4)."""
        indices = np.flatnonzero(self.containing(context))
        interests = np.array([self.regions[index].interest() for index in indices])
        weights = interests - interests.min()  # eq. (4)
        # Deviation: eq. (4) is 0/0 if all interests are equal. Then weights are the volumes in T, so goals are uniform.
        if not weights.any():
            sides = (self._highs - self._lows)[indices, self.problem.contexts.dim :]
            weights = (sides / self.problem.outcomes.sides).prod(axis=1)
        return self.regions[int(self._rng.choice(indices, p=weights / weights.sum()))]
