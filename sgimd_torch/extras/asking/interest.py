"""Progress of each strategy in each region of C x T, by which a strategy and its goal are drawn together.

SGIM-ACTS: Nguyen & Oudeyer (2012), "Active choice of teachers, learning strategies and goals for a socially guided
intrinsic motivation learner". The measure of progress is that of Duminy, Nguyen & Duhaut (2019), "Learning a set of
interrelated tasks by using a succession of motor policies for a socially guided intrinsically motivated learner".
    goals = StrategicInterest(problem)
    strategy, goal = goals.choose(context, {"autonomous": 1.0, "imitate left": 2.0})      # names and costs
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import Region
from sgimd_torch.goals.uniform import check_in
from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array

AUTONOMOUS: Final = "autonomous"
_FEWEST: Final = 4  # least number of attempts from which progress is computed
_MOST: Final = 10  # greatest number of attempts from which progress is computed
# Probability that first a goal uniform in T is drawn, and then a strategy by its interest at this goal.
_GOAL_FIRST: Final = 0.5
_BEST_PAIRS: Final = 10  # number of pairs (region, strategy), those with the greatest interest, of which one is drawn
_TEMPERATURE: Final = 0.03  # difference of progress for which interest is e times as large
_UNTRIED: Final = 1.0  # progress of a strategy with too few attempts, the greatest possible


def progresses(competences: Array, gains: Array) -> Array:
    """Progress of each attempt: (after - before) * max(after, before)^2, with competences shifted from [-1, 0] to [0,
    1].

    Deviation: ``after`` is the competence of the attempt alone. So progress is negative if the attempt is worse than
    the memory. Without negative progress, a mislabelling teacher would look like a teacher with nothing new.
    """
    return gains * (1 + competences + np.maximum(-gains, 0)) ** 2


def strategic_progress(points: Array, competences: Array, gains: Array) -> float:
    """Mean progress without the least and the greatest value, so that one lucky exemplar cannot dominate a small
    region."""
    return float(np.sort(progresses(competences, gains))[1:-1].mean())


def between_means(region: Region, below: NDArray[np.bool_]) -> float:
    """Squared difference of the mean progresses on the two sides of a cut."""
    values = progresses(region.competences, region.gains)
    return float((values[below].mean() - values[~below].mean()) ** 2)


BY_STRATEGY: Final = partial(InterestMap, g_max=50, window=_MOST, progress=strategic_progress, contrast=between_means)


class StrategicGoals(Goals):
    """Goal model that also chooses a strategy for the goal."""

    @abstractmethod
    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """One of the strategies in ``costs``, and a goal ``(outcome_dim,)`` for this strategy in this context."""

    def sample(self, context: ArrayLike) -> Array:
        """A goal for a learner that has only the autonomous strategy."""
        return self.choose(context, {AUTONOMOUS: 1.0})[1]


class StrategicInterest(StrategicGoals):
    """Goals and strategies with the most progress for their cost, for learners that ask teachers.

    The interest of a pair (region, strategy) is e^(progress / temperature), divided by the cost of the strategy. If the
    progress exceeds that of the cheapest strategy in the region, the excess is divided by the cost first.

    The papers draw in proportion to progress, and sometimes draw a strategy at random. Here progress can be negative,
    so interest is an exponential. If a strategy has few attempts in a region, its progress is estimated from its
    nearest attempts, so no strategy has to be drawn at random.

    Args:
        problem: problem to learn.
        make: constructor of the map of regions; it also sets the map's measure of progress.
    """

    def __init__(self, problem: Problem, *, make: Callable[[Problem], InterestMap] = BY_STRATEGY) -> None:
        super().__init__(problem)
        self._map = make(problem)
        self._attempts: dict[str, _Attempts] = {}

    @property
    def regions(self) -> list[Region]:
        """The leaves of the map, which tile C x T."""
        return self._map.regions

    def progress(self, region: Region, strategy: str) -> float:
        """Progress of a strategy in a region, over its last ten attempts there. If there are fewer than 4, its ten
        attempts nearest to the middle of the region count. A strategy with fewer than 4 attempts in all has progress 1,
        the greatest possible."""
        attempts = self._attempts.get(strategy)
        if attempts is None or len(attempts.points) < _FEWEST:
            return _UNTRIED
        cached = attempts.cache.get(region.path)
        if cached is not None and cached[:2] == (region, len(attempts.points)):
            return cached[2]
        rows = region.strategies == strategy
        if rows.sum() >= _FEWEST:
            progress = region.interest_among(rows)
        else:
            progress = attempts.progress_near((region.low + region.high) / 2, self._map.sides)
        attempts.cache[region.path] = region, len(attempts.points), progress
        return progress

    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """One of the strategies in ``costs``, and a goal ``(outcome_dim,)`` for this strategy.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context, goal = check_in(self.problem.contexts, "context", context), self.problem.outcomes.sample(self.rng)
        goal_first = self.rng.random() < _GOAL_FIRST
        regions = self._map.regions_at(np.concatenate((context, goal)) if goal_first else context)
        pairs = [(region, name) for region in regions for name in costs]
        progress = np.array([[self.progress(region, name) for name in costs] for region in regions])
        cost = np.array([*costs.values()])
        cheapest = progress[:, [int(cost.argmin())]]
        excess = progress - cheapest
        worth = cheapest + np.minimum(excess, excess / cost)
        logarithms = (worth / _TEMPERATURE - np.log(cost)).ravel()
        best = np.argsort(-logarithms, kind="stable")[:_BEST_PAIRS]
        interests = np.exp(logarithms[best] - logarithms[best[0]])
        region, name = pairs[int(self.rng.choice(best, p=interests / interests.sum()))]
        dim = len(context)
        return name, goal if goal_first else self.rng.uniform(region.low[dim:], region.high[dim:])

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = AUTONOMOUS, gain: float = 0.0
    ) -> None:
        """Learn the competence and the gain of an attempt by ``strategy`` at its goal.

        Raises:
            ValueError: see `Goals.add`.
        """
        self._map.add(context, goal, competence, strategy, gain)
        point = np.concatenate((np.asarray(context, dtype=np.float64), np.asarray(goal, dtype=np.float64)))
        nothing = _Attempts(np.empty((0, len(point))), np.empty(0), np.empty(0), {})
        self._attempts[strategy] = self._attempts.get(strategy, nothing).extend(point, competence, gain)


class _Attempts(NamedTuple):
    """All attempts of a strategy. For the path of each region, ``cache`` holds the region, the number of attempts and
    the progress."""

    points: Array
    competences: Array
    gains: Array
    cache: dict[str, tuple[Region, int, float]]

    def extend(self, point: Array, competence: float, gain: float) -> _Attempts:
        """All attempts and one more."""
        competences, gains = np.append(self.competences, competence), np.append(self.gains, gain)
        return _Attempts(np.vstack((self.points, point)), competences, gains, self.cache)

    def progress_near(self, point: Array, sides: Array) -> float:
        """Progress over the ten attempts nearest to a point of C x T; distances are relative to ``sides``."""
        nearest = np.argsort(np.square((self.points - point) / sides).sum(axis=1), kind="stable")[:_MOST]
        return strategic_progress(self.points[nearest], self.competences[nearest], self.gains[nearest])
