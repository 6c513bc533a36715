"""Regions that tile C x T, and the choice of a goal from them, for the interest map and the progress grid.

Section 3.2.2 and eq. (4) of Nguyen & Oudeyer (2014). A map cuts C x T into regions and gives them to a `Tiling`.
    tiling.plant(regions); goal = tiling.sample(context); index = tiling.add(context, goal, competence, strategy, gain)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.regions import Progress, Region
from sgimd_torch.goals.uniform import check_attempt, check_in
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box

# Probabilities of the paper's modes: a goal where interest is high (1), anywhere (2), where competence is least (3).
_MODES: Final = (0.7, 0.2, 0.1)


class Tiling:
    """Regions that tile C x T; at first, one region covers C x T.

    Args:
        problem: problem to learn.
        progress: function (points, competences, gains) -> interest of a region.
        near: largest distance from a region's goal of least competence at which mode 3 draws a new goal, relative to
            the region's sides.

    Raises:
        ValueError: a number is out of its range.
    """

    def __init__(self, problem: Problem, progress: Progress, *, near: float) -> None:
        if not 0 < near <= 1:
            raise ValueError(f"near must lie in (0, 1], got {near}; it is a fraction of a region's sides")
        self.problem, self._near, self._progress, self._rng = problem, near, progress, problem.stream("goals")
        contexts, outcomes = problem.contexts, problem.outcomes
        self.box = Box(np.concatenate((contexts.low, outcomes.low)), np.concatenate((contexts.high, outcomes.high)))
        self.plant([self.region("R", self.box.low, self.box.high)])

    def region(self, path: str, low: Array, high: Array) -> Region:
        """A region without goals."""
        nothing = np.empty((0, self.box.dim)), np.empty(0), np.empty(0), np.empty(0, dtype=np.str_)
        return Region(path, low, high, self.problem.contexts.dim, *nothing, 0, self._progress)

    def plant(self, regions: list[Region]) -> None:
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
        mode = 1 + self._rng.choice(3, p=_MODES)
        if mode == 2:
            return self.problem.outcomes.sample(self._rng)
        region = self._choose(context)
        dim = self.problem.contexts.dim
        low, high = region.low[dim:], region.high[dim:]
        if mode == 1 or len(region.goals) == 0:
            return self._rng.uniform(low, high)
        # Ties are common, as competence is -1 far from all outcomes. Without a draw one goal would be repeated forever.
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
