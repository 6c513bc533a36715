"""Goal interest mapping and deciding a goal: where in C x T does competence change fastest?

Sections 3.2.1 and 3.2.2 of Nguyen & Oudeyer (2014). Regions of C x T split as goals accumulate, so as to tell areas of
different competence progress apart, eq. (3); goals are drawn where progress is high, eq. (4).
``goals = InterestMap(contexts, outcomes, rng); goal = goals.sample(context); goals.add(context, goal, competence)``
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.regions import Progress, Region, gained_progress, interest_of
from sgimd_torch.spaces import Array, Box, check_vector


class Goals(Protocol):
    """Which goal to aim at next, given what came of the earlier ones. What is invalid raises as in `InterestMap`."""

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` a goal in T for this ``context`` ``(context_dim,)``."""
        ...

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Competence in [-1, 0] was measured at this goal, which ``strategy`` had chosen; in this attempt the best that
        is remembered there had risen by ``gain``, in [0, 1]."""
        ...


class InterestMap:
    """The interest map over C x T, a tree of regions, and the choice of goals from it.

    Args:
        contexts: C; ``dim`` 0 when there is only one context.
        outcomes: T.
        rng: the only source of draws; reading ``regions`` draws nothing.
        g_max: a region that holds more goals than this is cut in two.
        window: the paper's zeta, how many recent competences eq. (3) looks at; even, at least 4, at most ``g_max``.
        modes: probabilities of a goal (1) in a region of high interest, (2) anywhere, (3) near a region's worst goal.
        cuts: candidate cuts for each dimension, at equal counts of goals.
        near: mode 3 stays this close to the worst goal, as a part of the region's sides.
        min_side: the least side of a new region as a part of its *parent's*: an absolute bound would stop the zoom into
            a task space 100 times larger than what can be reached.
        max_aspect: a side this many times shorter than another that can be cut, both as parts of C x T, is cut no
            further. Deviation: the paper has no such rule (inf), and ends in slivers when goals crowd in a small part
            of a large space.
        progress: what counts as progress: `gained_progress`, or `absolute_progress`, which is eq. (3),
            `signed_progress`, `paired_progress`, or yours.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        contexts: Box,
        outcomes: Box,
        rng: np.random.Generator,
        *,
        g_max: int = 30,
        window: int = 24,
        modes: tuple[float, float, float] = (0.7, 0.2, 0.1),
        cuts: int = 20,
        near: float = 0.05,
        min_side: float = 1 / 15,
        max_aspect: float = 5.0,
        progress: Progress = gained_progress,
    ) -> None:
        if window % 2 or not 4 <= window <= g_max:
            raise ValueError(f"window must be even, from 4 to g_max={g_max}, got {window}")
        if cuts < 1 or not 0 < min_side <= 0.5 or not max_aspect >= 1:
            wanted = "cuts >= 1, min_side in (0, .5], max_aspect >= 1"
            raise ValueError(f"needs {wanted}, got {cuts}, {min_side}, {max_aspect}")
        self.g_max, self.cuts, self.min_side, self.max_aspect = g_max, cuts, min_side, max_aspect
        measure = partial(interest_of, window=window, progress=progress)
        self._tiling = Tiling(contexts, outcomes, rng, measure, modes=modes, near=near)

    @property
    def regions(self) -> list[Region]:
        """The leaves, which tile C x T, in the order of the tree: a region's halves stand where it stood."""
        return list(self._tiling.regions)

    def sample(self, context: ArrayLike) -> Array:
        """Decide a goal, section 3.2.2: ``(outcome_dim,)`` in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        return self._tiling.sample(context)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Goal interest mapping, section 3.2.1: competence was measured at a goal, attempted or emulated.

        Raises:
            ValueError: ``context`` is not one point of C, ``competence`` not in [-1, 0], or ``goal`` not one point of
                T: a demonstrated outcome may lie outside, so ask ``outcomes.contains`` first.
        """
        index = self._tiling.add(context, goal, competence, strategy, gain)
        regions = self._tiling.regions
        region = regions[index]
        if len(region.goals) <= self.g_max:
            return
        cut = self._best_cut(region)
        if cut is None:
            regions[index] = region.keep(slice(len(region.goals) // 4, None))
        else:
            self._tiling.plant([*regions[:index], *region.split(*cut), *regions[index + 1 :]])

    def _best_cut(self, region: Region) -> tuple[int, float] | None:
        """(axis, cut) that tells interests apart best, n1 * n2 * |interest1 - interest2|; None when no cut is valid."""
        n, side = len(region.points), region.high - region.low
        cuts = np.quantile(region.points, np.arange(1, self.cuts + 1) / (self.cuts + 1), axis=0)  # (cuts, dim)
        is_below = region.points[:, None] < cuts  # (n, cuts, dim)
        n_below = is_below.sum(axis=0)
        few = np.minimum(n_below, n - n_below) < self.g_max / 20
        thin = np.minimum(cuts - region.low, region.high - cuts) < self.min_side * side
        valid, shares = ~few & ~thin, side / self._tiling.box.sides
        valid &= shares * self.max_aspect >= shares.max(where=valid.any(axis=0), initial=0.0)

        def score(candidate: tuple[int, int]) -> tuple[float, float, int]:
            below = is_below[:, candidate[0], candidate[1]]
            balance = int(n_below[candidate]) * (n - int(n_below[candidate]))
            difference = abs(region.interest_among(below) - region.interest_among(~below))
            # When no cut tells interests apart (all competences -1, say), the region is halved across its longest side
            # rather than kept: progress that starts in a small part of a large space shows up in a small region only.
            return balance * difference, float(shares[candidate[1]]), balance

        candidates = [(int(row), int(axis)) for row, axis in np.argwhere(valid)]
        if not candidates:
            return None
        row, axis = max(candidates, key=score)
        return axis, float(cuts[row, axis])


class Tiling:
    """Regions that tile C x T, and the choice of a goal from them: what all maps of interest share.

    Args:
        contexts, outcomes, rng, modes, near: as of `InterestMap`.
        measure: (points, competences, gains) -> the interest of a region.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        contexts: Box,
        outcomes: Box,
        rng: np.random.Generator,
        measure: Callable[[Array, Array, Array], float],
        *,
        modes: tuple[float, float, float],
        near: float,
    ) -> None:
        if min(modes) < 0 or not np.isclose(sum(modes), 1):
            raise ValueError(f"modes must be three probabilities that sum to 1, got {modes}")
        if not 0 < near <= 1:
            raise ValueError(f"near must lie in (0, 1], got {near}; it is a part of a region's sides")
        self.contexts, self.outcomes = contexts, outcomes
        self.box = Box(np.concatenate((contexts.low, outcomes.low)), np.concatenate((contexts.high, outcomes.high)))
        self._modes, self._near, self._rng, self._measure = modes, near, rng, measure
        self.plant([self.region("R", self.box.low, self.box.high)])

    def region(self, path: str, low: Array, high: Array) -> Region:
        """One that has met no goal yet."""
        nothing = np.empty((0, self.box.dim)), np.empty(0), np.empty(0), np.empty(0, dtype=np.str_)
        return Region(path, low, high, self.contexts.dim, *nothing, 0, self._measure)

    def plant(self, regions: list[Region]) -> None:
        """Take these, which must tile C x T."""
        self.regions = regions
        self._lows = np.stack([region.low for region in regions])
        self._highs = np.stack([region.high for region in regions])
        # Regions are half open, [low, high), but closed at the border of C x T: each point is in exactly one.
        self._ends = np.where(self._highs == self.box.high, np.inf, self._highs)

    def add(self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str, gain: float) -> int:
        """One more goal for the region that it lies in; returns that region's index."""
        point = one_attempt(self.contexts, self.outcomes, context, goal, competence, gain)
        index = int(self._around(point).argmax())
        self.regions[index] = self.regions[index].extend(point, competence, gain, strategy)
        return index

    def sample(self, context: ArrayLike) -> Array:
        """Decide a goal, section 3.2.2: a mode, a region that contains the context, a goal in it."""
        context = one_point(self.contexts, "context", context)
        mode = 1 + self._rng.choice(3, p=self._modes)
        if mode == 2:
            return self.outcomes.sample(self._rng)
        region = self._choose(context)
        low, high = region.low[self.contexts.dim :], region.high[self.contexts.dim :]
        if mode == 1 or len(region.goals) == 0:
            return self._rng.uniform(low, high)
        # Ties are common, competence being -1 wherever nothing came near: the first would be tried again and again.
        worst = self._rng.choice(np.flatnonzero(region.competences == region.competences.min()))
        step = self._near * (high - low)
        return Box(low, high).clip(region.goals[worst] + self._rng.uniform(-step, step))

    def _around(self, point: Array) -> NDArray[np.bool_]:
        """Which regions contain a point, given by its first coordinates: a context, or a context and a goal."""
        dim = len(point)
        inside = (self._lows[:, :dim] <= point) & (point < self._ends[:, :dim])  # (n_regions, dim)
        is_around: NDArray[np.bool_] = np.all(inside, axis=1)
        return is_around

    def _choose(self, context: Array) -> Region:
        """A region with the probability of eq. (4), among those that contain the context."""
        here = np.flatnonzero(self._around(context))
        interests = np.array([self.regions[index].interest() for index in here])
        weights = interests - interests.min()  # eq. (4)
        # Deviation: eq. (4) is 0/0 where no region stands out; their shares of T then make goals uniform.
        if not weights.any():
            sides = (self._highs - self._lows)[here, self.contexts.dim :]
            weights = (sides / self.outcomes.sides).prod(axis=1)
        return self.regions[int(self._rng.choice(here, p=weights / weights.sum()))]


class UniformGoals:
    """Goals anywhere in T, whatever was learnt: takes `InterestMap`'s place to show what interest is worth."""

    def __init__(self, contexts: Box, outcomes: Box, rng: np.random.Generator) -> None:
        self.contexts, self.outcomes, self._rng = contexts, outcomes, rng

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` uniform in T."""
        one_point(self.contexts, "context", context)
        return self.outcomes.sample(self._rng)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Checked like `InterestMap.add`, then forgotten."""
        one_attempt(self.contexts, self.outcomes, context, goal, competence, gain)


def one_point(box: Box, name: str, value: ArrayLike, hint: str = "was a goal passed instead?") -> Array:
    point = check_vector(name, value, box.dim, hint)
    if point.ndim != 1 or not box.contains(point):
        raise ValueError(f"{name} must be one point of [{box.low}, {box.high}], got {point}; {hint}")
    return point


def one_attempt(
    contexts: Box, outcomes: Box, context: ArrayLike, goal: ArrayLike, competence: float, gain: float
) -> Array:
    """The point (context, goal) of C x T."""
    point = one_point(contexts, "context", context)
    goal = one_point(outcomes, "goal", goal, "ask outcomes.contains before a demonstrated outcome becomes a goal")
    if not -1 <= competence <= 0:  # NaN too
        raise ValueError(f"competence must lie in [-1, 0], got {competence}; was a distance passed instead?")
    if not 0 <= gain <= 1:
        raise ValueError(f"gain must lie in [0, 1], got {gain}; it is how much competence rose, and memory only grows")
    return np.concatenate((point, goal))
