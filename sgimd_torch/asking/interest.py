"""Which strategy, for which goal? Progress of each strategy in each region of C x T; both are drawn together.

SGIM-ACTS: Nguyen & Oudeyer (2012), "Active choice of teachers, learning strategies and goals for a socially guided
intrinsic motivation learner". The measure of progress follows later work of that line: Duminy, Nguyen & Duhaut (2019),
"Learning a set of interrelated tasks by using a succession of motor policies for a socially guided intrinsically
motivated learner".
    goals = StrategicInterest(problem)
    strategy, goal = goals.choose(context, {"autonomous": 1.0, "imitate left": 2.0})      # name: cost
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.checks import check_in
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import Region
from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array

AUTONOMOUS: Final = "autonomous"
_FEWEST, _LAST = 4, 10  # attempts that say something, and that progress is measured over
# Share of the choices whose goal is drawn from all of T, and whose strategy by its interest there.
_ANYWHERE: Final = 0.5
_GREATEST: Final = 10  # pairs (region, strategy) of the greatest interest, from which the others are drawn
_TEMPERATURE: Final = 0.03  # difference of progress that makes interest e times as large
_UNTRIED: Final = 1.0  # progress that is hoped for: the most that there can be


def progresses(competences: Array, gains: Array) -> Array:
    """(after - before) * max(after, before)^2 of each attempt, of competences in [0, 1]; ours lie in [-1, 0].

    Deviation: ``after`` is what the attempt itself came to, so progress is negative where it came to less than what
    memory holds. Only this distinguishes a mislabelling teacher from one with nothing new.
    """
    return gains * (1 + competences + np.maximum(-gains, 0)) ** 2


def strategic_progress(points: Array, competences: Array, gains: Array) -> float:
    """The mean of these without its least and its greatest: one exemplar in a new place says nothing of the next one
    there, but a cut that tells means apart puts it into a small region with few others."""
    return float(np.sort(progresses(competences, gains))[1:-1].mean())


def between_means(region: Region, below: NDArray[np.bool_]) -> float:
    """Squared difference of the mean progresses on the two sides of a cut."""
    found = progresses(region.competences, region.gains)
    return float((found[below].mean() - found[~below].mean()) ** 2)


BY_STRATEGY: Final = partial(InterestMap, g_max=50, window=_LAST, progress=strategic_progress, contrast=between_means)


class StrategicGoals(Goals):
    """A goal model that also chooses the strategy by which the goal is pursued."""

    @abstractmethod
    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """A strategy of those that have ``costs``, and a goal ``(outcome_dim,)`` for it in this context."""

    def sample(self, context: ArrayLike) -> Array:
        """A goal for a learner that has no other strategy than the autonomous one."""
        return self.choose(context, {AUTONOMOUS: 1.0})[1]


class StrategicInterest(StrategicGoals):
    """Goals and strategies of most progress for their cost, to ask teachers.

    Interest of each (region, strategy): e^(progress / temperature), over the cost of the strategy. Of its progress,
    what exceeds that of the cheapest strategy there is divided by the cost, too. See `StrategicGoals`.

    The papers draw in proportion to progress, and try strategies by chance where they were not tried. Ours: progress
    can be negative, hence e; and where a strategy was hardly tried, its progress is that of where it was tried nearest.
    So no choice has to be spent on a strategy drawn at random.

    Args:
        problem: C and T.
        make: constructor of the map of regions; interest is its progress.
    """

    def __init__(self, problem: Problem, *, make: Callable[[Problem], InterestMap] = BY_STRATEGY) -> None:
        super().__init__(problem)
        self._map = make(problem)
        self._tried: dict[str, _Tried] = {}

    @property
    def regions(self) -> list[Region]:
        """The leaves of the map, which tile C x T."""
        return self._map.regions

    def progress(self, region: Region, strategy: str) -> float:
        """Of a strategy in a region, over its last ten attempts there; or, where it made fewer than 4, over the ten
        that were nearest to the middle of the region. 1, which is the most, if it made fewer than 4 at all."""
        tried = self._tried.get(strategy)
        if tried is None or len(tried.points) < _FEWEST:
            return _UNTRIED
        now = region, len(tried.points)
        known = tried.known.get(region.path)
        if known is not None and known[:2] == now:
            return known[2]
        here = region.strategies == strategy
        if here.sum() >= _FEWEST:
            found = region.interest_among(here)
        else:
            found = tried.progress_near((region.low + region.high) / 2, self._map.sides)
        tried.known[region.path] = *now, found
        return found

    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """A strategy of those that have ``costs``, and a goal ``(outcome_dim,)`` for it.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context, goal = check_in(self.problem.contexts, "context", context), self.problem.outcomes.sample(self.rng)
        given = self.rng.random() < _ANYWHERE
        regions = self._map.regions_at(np.concatenate((context, goal)) if given else context)
        pairs = [(region, name) for region in regions for name in costs]
        progress = np.array([[self.progress(region, name) for name in costs] for region in regions])
        cost = np.array([*costs.values()])
        cheapest = progress[:, [int(cost.argmin())]]
        more = progress - cheapest
        worth = cheapest + np.minimum(more, more / cost)
        logarithms = (worth / _TEMPERATURE - np.log(cost)).ravel()
        best = np.argsort(-logarithms, kind="stable")[:_GREATEST]
        interests = np.exp(logarithms[best] - logarithms[best[0]])
        region, name = pairs[int(self.rng.choice(best, p=interests / interests.sum()))]
        dim = len(context)
        return name, goal if given else self.rng.uniform(region.low[dim:], region.high[dim:])

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = AUTONOMOUS, gain: float = 0.0
    ) -> None:
        """What ``strategy`` came to at the goal that it was chosen for.

        Raises:
            ValueError: see `Goals.add`.
        """
        self._map.add(context, goal, competence, strategy, gain)
        point = np.concatenate((np.asarray(context, dtype=np.float64), np.asarray(goal, dtype=np.float64)))
        nothing = _Tried(np.empty((0, len(point))), np.empty(0), np.empty(0), {})
        self._tried[strategy] = self._tried.get(strategy, nothing).extend(point, competence, gain)


class _Tried(NamedTuple):
    """All attempts of a strategy. ``known``: by the path of a region, its progress there, and for which region and
    number of attempts that is right."""

    points: Array
    competences: Array
    gains: Array
    known: dict[str, tuple[Region, int, float]]

    def extend(self, point: Array, competence: float, gain: float) -> _Tried:
        """These with one more attempt."""
        competences, gains = np.append(self.competences, competence), np.append(self.gains, gain)
        return _Tried(np.vstack((self.points, point)), competences, gains, self.known)

    def progress_near(self, point: Array, sides: Array) -> float:
        """Of the ten attempts that were nearest to a point of C x T with these ``sides``."""
        nearest = np.argsort(np.square((self.points - point) / sides).sum(axis=1), kind="stable")[:_LAST]
        return strategic_progress(self.points[nearest], self.competences[nearest], self.gains[nearest])
