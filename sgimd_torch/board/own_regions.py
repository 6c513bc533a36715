"""Regions of C x T for a learner whose goal model has none, such as practice; the board makes them, for itself alone.

They are those of section 3.2.1 of Nguyen & Oudeyer (2014), eqs. (3) and (7), but cut at medians. Nothing is drawn.
    own = OwnRegions(problem); own.follow(behaviour); region_curves(own.regions)
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.board.curves import DEPTH, Behaviour
from sgimd_torch.goals.regions import Region, Tiling, absolute_progress, interest_of
from sgimd_torch.parts import Problem

MOST: Final = 40  # largest number of goals in a region; with more, it is cut, or forgets the oldest quarter
INTEREST: Final = partial(interest_of, window=24, progress=absolute_progress)  # eq. (3)


class OwnRegions:
    """Regions that tile C x T and remember their latest goals.

    Args:
        problem: problem of the learner, whose spaces, rest and tolerance are read.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem, self._whole = problem, Tiling(problem, INTEREST, modes=(0, 1, 0), near=1)
        self._n_added, self.regions = 0, list[Region]()  # no regions before the first goal

    def follow(self, behaviour: Behaviour) -> None:
        """Add the new goals of a learner, but not yet the last ones, which may still be pursued."""
        new = slice(self._n_added, len(behaviour.points) - behaviour.own.at_once)
        if new.start >= new.stop:
            return
        self._n_added, problem, box = new.stop, self._problem, self._whole.box
        contexts, goals = map(np.array, zip(*behaviour.points[new], strict=True))
        points, missed_by = np.hstack((contexts, goals)), np.array(behaviour.own.missed[new])
        far = np.linalg.norm(goals - problem.rest, axis=1)
        competences = -np.minimum(1.0, missed_by / np.maximum(far, problem.tolerance))  # eq. (7)
        points = np.clip(points, box.low, np.nextafter(box.high, box.low))  # goals outside T count at its border
        leaves = []
        for region in self.regions or self._whole.regions:
            inside = ((region.low <= points) & (points < region.high)).all(axis=1)
            if n := int(inside.sum()):
                region = region.extend(points[inside], competences[inside], np.zeros(n), np.full(n, "autonomous"))
            leaves += self._cut(region)
        self.regions = leaves

    def _cut(self, region: Region) -> list[Region]:
        """The parts of a region, cut at the median of its goals along the axis in which they differ most."""
        if len(region.points) <= MOST:
            return [region]
        if len(region.path) <= DEPTH:
            cuts = np.median(region.points, axis=0)
            spread = region.points.std(axis=0) / self._whole.box.sides * (region.points < cuts).any(axis=0)
            axis = int(spread.argmax())
            if spread[axis]:
                return [part for half in region.split(axis, float(cuts[axis])) for part in self._cut(half)]
        return [region.keep(slice(-MOST * 3 // 4, None))]
