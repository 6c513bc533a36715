"""Regions of C x T, and how interesting they are: the leaves of the interest map.

Section 3.2.1 and eq. (3) of Nguyen & Oudeyer (2014): interest is local competence progress over a sliding window of
the goals that were attempted last.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.spaces import Array

Progress = Callable[[Array], float]
"""The competences ``(n,)`` of a window, oldest first, n >= 4 -> how much they change."""


def absolute_progress(competences: Array) -> float:
    """Eq. (3): |newer half - older half| over the number of values; an odd window loses its oldest."""
    return abs(_rise(competences))


def signed_progress(competences: Array) -> float:
    """Eq. (3) without its absolute value: competence that falls is of no interest."""
    return max(0.0, _rise(competences))


def _rise(competences: Array) -> float:
    # Deviation: the paper's two sums share their middle term; these halves are disjoint and of equal length.
    half = len(competences) // 2
    newer, older = competences[-half:], competences[-2 * half : -half]
    return float(newer.sum() - older.sum()) / (2 * half)


def interest_of(competences: Array, *, window: int, progress: Progress) -> float:
    """Progress over the last ``window`` of ``competences`` ``(n,)``.

    Deviation: 0 while fewer than 4 are known, where eq. (3) has halves of one value or none.
    """
    return progress(competences[-window:]) if len(competences) >= 4 else 0.0


@dataclass(frozen=True, eq=False)
class Region:
    """R_i, a leaf of the tree as it stood when it was read: later goals make a new Region.

    ``path`` leads from the root: "R", then "R0" below and "R1" above its cut, "R01" ... It never changes meaning.
    ``low`` and ``high`` are its corners in C x T. In order of time: ``points`` ``(n, context_dim + outcome_dim)``,
    ``competences`` ``(n,)``, ``strategies`` ``(n,)`` names. ``attempts`` counts the goals met here, those since
    forgotten too, but not those a parent had forgotten before it was cut. Arrays are read-only.
    """

    path: str
    low: Array
    high: Array
    context_dim: int
    points: Array
    competences: Array
    strategies: NDArray[np.str_]
    attempts: int
    measure: Callable[[Array], float]

    def __post_init__(self) -> None:
        for name in ("low", "high", "points", "competences", "strategies"):
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)

    @property
    def contexts(self) -> Array:
        """``(n, context_dim)`` in which the goals were attempted."""
        return self.points[:, : self.context_dim]

    @property
    def goals(self) -> Array:
        """``(n, outcome_dim)`` in order of time."""
        return self.points[:, self.context_dim :]

    def interest(self, strategy: str | None = None) -> float:
        """Local competence progress, eq. (3); with a ``strategy``, over the goals chosen by it alone."""
        if strategy is None:
            return self._interest
        return self.measure(self.competences[self.strategies == strategy])

    @cached_property
    def _interest(self) -> float:
        return self.measure(self.competences)

    def extend(self, point: Array, competence: float, strategy: str) -> Region:
        """This region with one more goal."""
        return replace(
            self,
            points=np.vstack((self.points, point)),
            competences=np.append(self.competences, competence),
            strategies=np.append(self.strategies, strategy),
            attempts=self.attempts + 1,
        )

    def keep(self, rows: NDArray[np.bool_] | slice) -> Region:
        """This region with some of its goals, in their order."""
        points, competences, strategies = self.points[rows], self.competences[rows], self.strategies[rows]
        return replace(self, points=points, competences=competences, strategies=strategies)

    def split(self, axis: int, cut: float) -> tuple[Region, Region]:
        """The halves below and above a cut; goals on the cut belong above."""
        is_below = self.points[:, axis] < cut
        low, high = self.low.copy(), self.high.copy()
        low[axis] = high[axis] = cut
        below = replace(self.keep(is_below), path=f"{self.path}0", high=high, attempts=int(is_below.sum()))
        above = replace(self.keep(~is_below), path=f"{self.path}1", low=low, attempts=int((~is_below).sum()))
        return below, above
