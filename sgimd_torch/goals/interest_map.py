"""Goal interest mapping: regions of C x T (contexts x outcomes), and goals where competence changes fastest.

Section 3.2.1 of Nguyen & Oudeyer (2014). A region of C x T with too many goals is split, and each half then has its own
competence progress, eq. (3). Goals are drawn where progress is high, see `Tiling`.
    goals = InterestMap(problem); goal = goals.sample(context); goals.add(context, goal, competence)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.regions import Progress, Region, Tiling, gained_progress, interest_difference, interest_of
from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array

# Least side of a new region, relative to the side of its *parent*. A bound relative to C x T would stop the splits too
# early if the task space is 100 times larger than the reachable part.
_MIN_SIDE: Final = 1 / 15


class InterestMap(Goals):
    """Goals where competence changes fastest, from regions of C x T that split as goals accumulate.

    Args:
        problem: problem to learn.
        g_max: largest number of goals in a region; with one more goal, the region is split.
        window: number of recent competences in eq. (3), the paper's zeta; even, at least 4, at most ``g_max``.
        cuts: number of candidate cuts of a region in each dimension.
        modes: probabilities of the paper's three modes: a goal where interest is high (1), anywhere in T (2), or near a
            goal of least competence (3). The paper gives no numbers.
        near: largest distance from a region's goal of least competence at which mode 3 draws a new goal, relative to
            the region's sides.
        max_aspect: ratio of two sides of a region, relative to C x T, beyond which the shorter side is not cut.
            Deviation: the paper has no such rule (inf). Without it, regions become very thin when most goals lie in a
            small part of a large space.
        balanced: true: a cut scores its contrast times the numbers of goals on both sides; false: its contrast alone.
            Deviation: true is the default, the paper's is false. Then the best cut often leaves a handful of goals on
            one side.
        progress: measure of progress: `gained_progress`; `absolute_progress`, which is eq. (3); or a function of
            your own.
        contrast: function (region, mask of the goals below a cut) -> difference between the two sides of the cut.

    Raises:
        ValueError: a number is out of its range.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        g_max: int = 30,
        window: int = 24,
        cuts: int = 20,
        modes: tuple[float, float, float] = (0.7, 0.2, 0.1),
        near: float = 0.05,
        max_aspect: float = 5.0,
        balanced: bool = True,
        progress: Progress = gained_progress,
        contrast: Callable[[Region, NDArray[np.bool_]], float] = interest_difference,
    ) -> None:
        super().__init__(problem)
        if window % 2 or not 4 <= window <= g_max:
            raise ValueError(f"window must be even, from 4 to g_max={g_max}, got {window}")
        if cuts < 1 or not max_aspect >= 1:
            raise ValueError(f"needs cuts >= 1 and max_aspect >= 1, got {cuts} and {max_aspect}")
        self.g_max, self.cuts, self.max_aspect = g_max, cuts, max_aspect
        self.balanced, self.contrast = balanced, contrast
        interest = partial(interest_of, window=window, progress=progress)
        self._tiling = Tiling(problem, interest, modes=modes, near=near)

    @property
    def regions(self) -> list[Region]:
        """The leaves of the tree, which tile C x T; in this list the two halves of a split region take its place."""
        return list(self._tiling.regions)

    @property
    def sides(self) -> Array:
        """``(dim,)`` lengths of the sides of C x T."""
        return self._tiling.box.sides

    def regions_at(self, point: Array) -> list[Region]:
        """Regions that contain a ``point``: one if it is a point of C x T, some if it is a context ``(context_dim,)``,
        and all if it is the empty context of a robot without contexts."""
        return [self._tiling.regions[index] for index in np.flatnonzero(self._tiling.containing(point))]

    def sample(self, context: ArrayLike) -> Array:
        """Decide a goal, section 3.2.2: ``(outcome_dim,)`` in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        return self._tiling.sample(context)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Goal interest mapping, section 3.2.1: learn the competence at a goal that was attempted or emulated.
        ``strategy`` is kept for statistics; ``gain`` is the rise of the competence during the attempt.

        Raises:
            ValueError: see `Goals.add`.
        """
        index = self._tiling.add(context, goal, competence, strategy, gain)
        regions = self._tiling.regions
        region = regions[index]
        if len(region.goals) <= self.g_max:
            return
        best_cut = self._best_cut(region)
        if best_cut is None:
            # Deviation: the paper leaves open what happens without a valid cut. Here the oldest quarter is forgotten.
            regions[index] = region.keep(slice(len(region.goals) // 4, None))
        else:
            self._tiling.tile([*regions[:index], *region.split(*best_cut), *regions[index + 1 :]])

    def _best_cut(self, region: Region) -> tuple[int, float] | None:
        """Axis and position of the cut with the largest contrast, if the map is balanced times the numbers of goals on
        both sides; None when no cut is valid."""
        n, side = len(region.points), region.high - region.low
        shares = np.arange(1, self.cuts + 1) / (self.cuts + 1)
        positions = np.quantile(region.points, shares, axis=0)  # (cuts, dim)
        is_below = region.points[:, None] < positions  # (n, cuts, dim)
        n_below = is_below.sum(axis=0)
        is_sparse = np.minimum(n_below, n - n_below) < self.g_max / 20  # 5 % of the largest number
        is_thin = np.minimum(positions - region.low, region.high - positions) < _MIN_SIDE * side
        valid, relative_sides = ~is_sparse & ~is_thin, side / self._tiling.box.sides
        valid &= relative_sides * self.max_aspect >= relative_sides.max(where=valid.any(axis=0), initial=0.0)

        def score(candidate: tuple[int, int]) -> tuple[float, float, int]:
            below = is_below[:, candidate[0], candidate[1]]
            balance = int(n_below[candidate]) * (n - int(n_below[candidate]))
            # If all cuts score 0, for example because all competences are -1, the longest side is halved. Progress that
            # begins in a small part of a large space is only visible in a small region.
            weight = balance if self.balanced else 1
            return weight * self.contrast(region, below), float(relative_sides[candidate[1]]), balance

        candidates = [(int(row), int(axis)) for row, axis in np.argwhere(valid)]
        if not candidates:
            return None
        row, axis = max(candidates, key=score)
        return axis, float(positions[row, axis])
