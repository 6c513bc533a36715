"""Which strategy, for which goal? Progress of each strategy in each region of C x T; both are drawn together.

SGIM-ACTS: Nguyen & Oudeyer (2012), "Active choice of teachers, learning strategies and goals for a socially guided
intrinsic motivation learner". The measure of progress follows later work of that line: Duminy, Nguyen & Duhaut (2019),
"Learning a set of interrelated tasks by using a succession of motor policies for a socially guided intrinsically
motivated learner".
    goals = StrategicInterest(contexts, outcomes, rng)
    strategy, goal = goals.choose(context, {"autonomous": 1.0, "imitate left": 2.0})      # name: cost
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.protocol import Goals, check_in
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box

AUTONOMOUS: Final = "autonomous"


def exemplar_progress(points: Array, competences: Array, gains: Array) -> float:
    """Mean of (after - before) * max(after, before)^2 without its least and its greatest, of competences in [0, 1].

    Ours lie in [-1, 0], so 1 is added. A gain is after - before and never negative, so the greater one is ``after``.
    Without the greatest, since one exemplar in a new place says nothing of the next one there, but a cut that tells
    means apart puts it into a small region with few others.
    """
    return float(np.sort(gains * (1 + competences) ** 2)[1:-1].mean())


def between_means(region: Region, below: NDArray[np.bool_]) -> float:
    """Squared difference of the mean progresses on the two sides of a cut."""
    progresses = region.gains * (1 + region.competences) ** 2
    return float((progresses[below].mean() - progresses[~below].mean()) ** 2)


EXEMPLARS: Final = partial(InterestMap, g_max=50, window=10, progress=exemplar_progress, contrast=between_means)


@runtime_checkable
class StrategicGoals(Goals, Protocol):
    """A goal model that also chooses the strategy by which the goal is pursued."""

    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """A strategy of those that have ``costs``, and a goal ``(outcome_dim,)`` for it in this context."""
        ...


class StrategicInterest:
    """Interest of each (region, strategy): its progress over the cost of the strategy. See `StrategicGoals`.

    Args:
        contexts, outcomes, rng: as in `InterestMap`.
        share: of the choices in which strategy and goal are drawn uniformly.
        greatest: so many (region, strategy) of the greatest interest are drawn from, in proportion to it.
        make: (contexts, outcomes, rng) -> the map of regions; interest is its progress.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        contexts: Box,
        outcomes: Box,
        rng: np.random.Generator,
        *,
        share: float = 0.2,
        greatest: int = 10,
        make: Callable[[Box, Box, np.random.Generator], InterestMap] = EXEMPLARS,
    ) -> None:
        if not 0 <= share <= 1 or greatest < 1:
            raise ValueError(f"share must lie in [0, 1] and greatest be at least 1, got {share} and {greatest}")
        self.contexts, self.outcomes, self.share, self.greatest = contexts, outcomes, share, greatest
        self._rng = rng
        self._map = make(contexts, outcomes, rng)

    @property
    def regions(self) -> list[Region]:
        """The leaves of the map, which tile C x T."""
        return self._map.regions

    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """A strategy of those that have ``costs``, and a goal ``(outcome_dim,)`` for it.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context, names = check_in(self.contexts, "context", context), list(costs)
        if self._rng.random() >= self.share:
            pairs = [(region, name) for region in self._map.regions_at(context) for name in names]
            interests = np.array([region.interest(name) / costs[name] for region, name in pairs])
            best = np.argsort(-interests, kind="stable")[: self.greatest]
            if interests[best].any():
                shares = interests[best] / interests[best].sum()
                region, name = pairs[int(self._rng.choice(best, p=shares))]
                dim = self.contexts.dim
                return name, self._rng.uniform(region.low[dim:], region.high[dim:])
        return names[int(self._rng.integers(len(names)))], self.outcomes.sample(self._rng)

    def sample(self, context: ArrayLike) -> Array:
        """A goal for a learner that has no other strategy than the autonomous one."""
        return self.choose(context, {AUTONOMOUS: 1.0})[1]

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = AUTONOMOUS, gain: float = 0.0
    ) -> None:
        """What ``strategy`` has gained at a goal, or at an outcome that it led to.

        Raises:
            ValueError: see `Goals.add`.
        """
        self._map.add(context, goal, competence, strategy, gain)
