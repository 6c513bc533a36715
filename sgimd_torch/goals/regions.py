"""Regions of C x T, the leaves of the interest map, and their interest.

Section 3.2.1 and eq. (3) of Nguyen & Oudeyer (2014): the interest of a region is its competence progress, over a
sliding window of the last goals that were attempted there.    region.goals, region.competences, region.interest()
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.spaces import Array

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


def paired_progress(points: Array, competences: Array, gains: Array) -> float:
    """Mean difference between the competence at a goal and the competence at the nearest earlier goal.

    Forestier et al. (2017) and Portelas et al. (2019) measure progress in this way. The pairs separate change in time
    from differences between places, but the noise of single goals is not averaged out. Of equally near goals the latest
    counts. Distances are measured in C x T, so contexts should have the scale of goals.
    """
    n = len(points)
    apart = np.square(points[:, None] - points).sum(axis=2)  # (n, n)
    apart[np.triu_indices(n)] = np.inf  # the goal itself, and later ones
    nearest = n - 1 - apart[1:, ::-1].argmin(axis=1)
    return float(np.abs(competences[1:] - competences[nearest]).mean())


def interest_of(points: Array, competences: Array, gains: Array, *, window: int, progress: Progress) -> float:
    """Progress over the last ``window`` goals, at ``points`` ``(n, dim)`` with ``competences`` and ``gains`` ``(n,)``.

    Deviation: with fewer than 4 goals the interest is 0, because each half in eq. (3) would have one value or none.
    """
    if len(competences) < 4:
        return 0.0
    return progress(points[-window:], competences[-window:], gains[-window:])


def between_interests(region: Region, below: NDArray[np.bool_]) -> float:
    """Difference of the interests on the two sides of a cut; ``below`` ``(n,)`` marks the goals on one side."""
    return abs(region.interest_among(below) - region.interest_among(~below))


@dataclass(frozen=True, eq=False)
class Region:
    """R_i, a leaf of the tree. A Region is immutable: adding a goal makes a new Region.

    ``path`` is the name of the region: "R" is the root, "R0" its half below the cut, "R1" its half above the cut, and
    "R01" the upper half of "R0". ``low`` and ``high`` are the corners in C x T. ``points``
    ``(n, context_dim + outcome_dim)``, ``competences``, ``gains`` and ``strategies`` ``(n,)`` have a row for each goal.
    ``attempts`` also counts goals that the region forgot, but not goals that its parent forgot. Arrays are read-only.
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
    progress: Progress

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

    def interest(self, strategy: str | None = None) -> float:
        """Local competence progress, eq. (3); with a ``strategy``, over the goals of this strategy alone."""
        return self._interest if strategy is None else self.interest_among(self.strategies == strategy)

    def interest_among(self, rows: NDArray[np.bool_] | slice) -> float:
        """Interest over the goals in ``rows`` alone."""
        return self.progress(self.points[rows], self.competences[rows], self.gains[rows])

    @cached_property
    def _interest(self) -> float:
        return self.interest_among(slice(None))

    def extend(self, point: Array, competence: float, gain: float, strategy: str) -> Region:
        """This region with one more goal."""
        return replace(
            self,
            points=np.vstack((self.points, point)),
            competences=np.append(self.competences, competence),
            gains=np.append(self.gains, gain),
            strategies=np.append(self.strategies, strategy),
            attempts=self.attempts + 1,
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
