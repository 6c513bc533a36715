"""Strategies of exploration: the next movement, autonomous or after a demonstration.

Sections 3.1, 4.2 and 4.4 of Nguyen & Oudeyer (2014). An attempt is a generator: it yields a movement, and the learner
sends the outcome. So the code reads like the paper's, and a demonstration can interrupt an attempt at any movement.
    autonomous: Babble, Rest, GoalBabbling          social: Mimic, Imitate, Emulate, Remember
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sgimd_torch.competence import Competence
from sgimd_torch.parts import Explore, Goals, Judge, Part, Problem, Search, Social, Strategy
from sgimd_torch.searches.explore import Anywhere
from sgimd_torch.spaces import Array, Attempt, Demonstration, Estimate, Move, check_count


class Babble(Strategy):
    """Random exploration of the policy space: one uniform theta."""

    draws_from = "babble"

    def attempt(self, context: Array) -> Attempt:
        """One movement."""
        yield Move(self.problem.policies.sample(self.rng), None, "babble")


class Rest(Strategy):
    """Rest for one movement, for learning by observation, and for imitation before the first demonstration."""

    def attempt(self, context: Array) -> Attempt:
        """No movement."""
        yield None


class GoalBabbling(Strategy):
    """Goal-directed policy optimisation, section 4.4: choose a goal, then search for a movement that reaches it.

    The lower the competence at the goal, the more probable is a global movement instead of a local one.

    Args:
        problem: problem to learn, with the inverse model.
        goals: goal model.
        search: part that refines the estimate of the inverse model by movements.
        explore: part that makes the global movements.
        judge: part that measures the competence of an attempt for the goal model.
        budget: largest number of movements for one goal. Deviation: the paper has no such number. With a complete
            simplex of 26 movements a goal would take about 60 movements, and a run with the rod would try only a
            hundred goals.
        tolerance: distance, in the unit of outcomes, at which a goal counts as reached; None for the outcome noise, but
            at least .02. With a budget of 1 this option has no effect.
        global_range: least and greatest probability of a movement by the explorer instead of the search. The
            probability rises with the goal's distance from the nearest reached outcome; a `share` of the explorer wins.
        give_up: competence (0: reached, -1: worst) below which a goal is given up after a movement without progress; -1
            for never. With a budget of 1 this option has no effect. Deviation: the paper spends the whole budget on
            each goal. If the task space is far larger than the reachable part, nearly all movements are then wasted.

    Raises:
        ValueError: a number is out of its range, or a part is of another kind.
    """

    draws_from = "regime"  # the paper's word for global exploration and for local optimisation

    def __init__(
        self,
        problem: Problem,
        *,
        goals: Callable[[Problem], Goals],
        search: Callable[[Problem], Search],
        explore: Callable[[Problem], Explore] = Anywhere,
        judge: Callable[[Problem], Judge] = Competence,
        budget: int = 15,
        tolerance: float | None = None,
        global_range: tuple[float, float] = (0.05, 0.95),
        give_up: float = -0.5,
    ) -> None:
        super().__init__(problem)
        tolerance = problem.tolerance if tolerance is None else tolerance
        if not 0 <= tolerance < np.inf:
            raise ValueError(f"tolerance must be a distance, finite and >= 0, got {tolerance}")
        if len(global_range) != 2 or not 0 <= global_range[0] <= global_range[1] <= 1:
            raise ValueError(f"global_range must be two probabilities, the least first, got {global_range}")
        if not give_up <= 0:
            raise ValueError(f"give_up must be a competence, 0 at most, got {give_up}")
        self.memory, self.inverse = problem.memory, problem.inverse
        self.competence = Competence(problem)
        self.explore = Explore.of(explore, problem)
        self.goals = Goals.of(goals, problem)
        self.search = Search.of(search, problem)
        self.judge = Judge.of(judge, problem)
        self.budget = check_count("budget", budget, 1)
        self.tolerance, self.global_range, self.give_up = tolerance, global_range, give_up

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of the goal model."""
        return self.goals.regions

    def maker(self, origin: str) -> Part:
        """The explorer for global movements, the search for local ones."""
        return {"global": self.explore, "local": self.search}.get(origin, self)

    def attempt(self, context: Array) -> Attempt:
        """Choose a goal and pursue it."""
        yield from self.pursue(context, self.goals.sample(context))

    def pursue(self, context: Array, goal: Array, strategy: str = "autonomous") -> Attempt:
        """Pursue ``goal`` until it is reached or given up, the budget is spent, or a demonstration interrupts."""
        outcomes: list[Array] = []
        competence_before = best = self.competence_at(context, goal)
        moves = self._explore(context, goal)
        move = next(moves)
        try:
            while True:
                outcome = self.problem.outcomes.unwrapped((yield move), goal)
                outcomes.append(outcome)
                if move is not None and move.origin == "global":
                    self.explore.add(move.theta)
                if len(outcomes) == self.budget or np.linalg.norm(outcome - goal) <= self.tolerance:
                    return
                previous, best = best, self.competence_at(context, goal)
                if best <= previous and best < self.give_up:
                    return
                move = moves.send(outcome)
        finally:  # interruption by a demonstration included
            self.report_competence(context, goal, outcomes, competence_before, strategy)

    def competence_at(self, context: Array, goal: Array) -> float:
        """Competence at a goal, eq. (2). It is 0, which spares a search of the memory, where nothing depends on it: the
        goal model does not use it, and a goal gets one movement, so none is given up."""
        return self.competence(context, goal) if self.goals.by_competence or self.budget > 1 else 0.0

    def report_competence(
        self, context: Array, goal: Array, outcomes: list[Array], competence_before: float, strategy: str
    ) -> None:
        """Tell the goal model the competence now, and its rise during an attempt, unless the attempt had no movement.

        Args:
            outcomes: outcomes ``(outcome_dim,)`` of the attempt.
            competence_before: competence at the goal when the attempt began.
            strategy: name of the strategy that chose the goal: "autonomous", "social" or another name.
        """
        if outcomes:
            after = self.competence_at(context, goal)
            judged = self.judge(context, goal, np.stack(outcomes)) if self.goals.by_competence else after
            # The new nearest exemplar in (context, outcome) may be farther in outcome alone; this is no loss.
            gain = max(0.0, after - competence_before)
            if gain == 0 and judged != after:  # the judge rates the attempt alone, which may be worse than the memory
                gain = min(0.0, judged - competence_before)
            self.goals.add(context, goal, judged, strategy, gain)

    def _explore(self, context: Array, goal: Array) -> Attempt:
        """Movements without end, each by global exploration or by local optimisation."""
        while True:
            is_global = self.rng.random() < self._global_probability(context, goal)
            estimate = None if is_global else self.inverse(context, goal)
            if estimate is None or self.explore.instead(estimate, goal):
                # Deviation: the paper prints "theta in T", which must be Pi.
                yield Move(self.explore(context), goal, "global")
            else:
                yield from self._optimise(estimate, goal)

    def _global_probability(self, context: Array, goal: Array) -> float:
        """Probability of global exploration; the lower the competence at the goal, the higher."""
        if len(self.memory) == 0:
            return 1.0
        share = self.explore.share()
        if share is not None:
            return share
        # Deviation: the paper's probability is -J. Here it is clipped, so that both kinds are always possible.
        least, greatest = self.global_range
        return min(max(-self.competence(context, goal), least), greatest)

    def _optimise(self, estimate: Estimate, goal: Array) -> Attempt:
        """Movements of a search that begins at the estimate of the inverse model, until the search ends."""
        search = self.search(estimate, goal)
        theta = next(search, None)
        while theta is not None:
            outcome = yield Move(theta, goal, "local")
            try:
                theta = search.send(outcome)
            except StopIteration:
                return


class Mimic(Social):
    """Imitate a policy, section 4.2: execute theta_d, exactly at first, then with small variations.

    Args:
        problem: problem to learn.
        repeats: number of movements for one demonstration; None: keep imitating until the next demonstration.
        epsilon: largest variation of each parameter, in the unit of the parameter.
        exact_first: true: the first movement is theta_d itself, so its outcome is known; false: all are varied.
            Deviation: the paper varies all.
        draws_from: name of the random stream of the variations.

    Raises:
        ValueError: a number is out of its range.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        repeats: int | None = 10,
        epsilon: float = 0.05,
        exact_first: bool = True,
        draws_from: str = "imitate",
    ) -> None:
        super().__init__(problem)
        if not 0 <= epsilon < np.inf:
            raise ValueError(f"epsilon must be a bound of variations, finite and >= 0, got {epsilon}")
        self.repeats = repeats if repeats is None else check_count("repeats", repeats, 1)
        self.epsilon, self.exact_first, self.draws_from = epsilon, exact_first, draws_from

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """theta_d, then its variations."""
        yield from self.repeat(theta_d, demonstration.outcome, [])

    def repeat(self, theta_d: Array, goal: Array, outcomes: list[Array]) -> Attempt:
        """The movements of an imitation; their outcomes are appended to ``outcomes``."""
        for repeat in range(self.repeats) if self.repeats is not None else itertools.count():
            theta = theta_d if repeat == 0 and self.exact_first else self._vary(theta_d)
            outcomes.append((yield Move(theta, goal, "imitate")))

    def _vary(self, theta_d: Array) -> Array:
        return self.problem.policies.clip(theta_d + self.rng.uniform(-self.epsilon, self.epsilon, theta_d.shape))


class Imitate(Mimic):
    """Imitates the demonstration, then tells the goal model the competence at the demonstrated outcome, as in SGIM-D.

    Section 3.2.3. If the demonstrated outcome lies outside T, the goal model is told nothing.

    Args:
        problem: problem to learn, with the goal babbling of the learner.
        repeats: number of movements for one demonstration; None: keep imitating until the next demonstration.
        epsilon: largest variation of each parameter, in the unit of the parameter.
        exact_first: true: the first movement is theta_d itself, so its outcome is known; false: all are varied.
            Deviation: the paper varies all.
    """

    def __init__(
        self, problem: Problem, *, repeats: int | None = 10, epsilon: float = 0.05, exact_first: bool = True
    ) -> None:
        super().__init__(problem, repeats=repeats, epsilon=epsilon, exact_first=exact_first)
        self.babbling = _babbling(problem)

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """theta_d, then its variations."""
        goal = demonstration.outcome
        if not self.problem.outcomes.contains(goal):
            yield from super().attempt(context, theta_d, demonstration)
            return
        outcomes: list[Array] = []
        competence_before = self.babbling.competence_at(context, goal)
        try:
            yield from self.repeat(theta_d, goal, outcomes)
        finally:  # interruption by the next demonstration included
            self.babbling.report_competence(context, goal, outcomes, competence_before, "social")


class Emulate(Social):
    """Pursues the demonstrated outcome as a goal, but does not use the demonstrated movement.

    Args:
        problem: problem to learn, with the goal babbling of the learner.
        strategy: name of the strategy, for the goal model.
    """

    def __init__(self, problem: Problem, *, strategy: str = "social") -> None:
        super().__init__(problem)
        self.babbling, self.strategy = _babbling(problem), strategy

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """Movements towards the demonstrated outcome; none if it lies outside T."""
        if self.problem.outcomes.contains(demonstration.outcome):
            yield from self.babbling.pursue(context, demonstration.outcome, self.strategy)


class Remember(Social):
    """Learn by observation: remember (theta_d, tau_d) like an executed movement, and do not move."""

    remembers = True

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """No movement."""
        self.problem.memory.add(context, theta_d, demonstration.outcome)
        yield from ()  # makes this a generator


def recording_outcomes(attempt: Attempt, executed: list[tuple[Array, Array]]) -> Attempt:
    """The movements of ``attempt``; each theta is appended to ``executed`` with its outcome.

    The memory may have outcomes of other robots in between.
    """
    outcome: Array | None = None
    try:
        while True:
            move = attempt.send(outcome)  # type: ignore[arg-type]
            outcome = yield move
            if move is not None:
                executed.append((move.theta, outcome))
    except StopIteration:
        return
    finally:
        attempt.close()


def _babbling(problem: Problem) -> GoalBabbling:
    """The goal babbling of the learner, whose goal model is told about demonstrated goals."""
    if not isinstance(problem.autonomous, GoalBabbling):
        raise ValueError(f"a demonstrated goal needs goal babbling, got a {type(problem.autonomous).__name__}")
    return problem.autonomous
