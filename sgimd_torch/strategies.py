"""Policy space exploration: what the robot does next, on its own or after a demonstration.

Sections 3.1, 4.2 and 4.4 of Nguyen & Oudeyer (2014). An attempt is a generator: it yields a movement and is sent the
outcome. So it reads like the paper's pseudo-code, and a demonstration can interrupt it at any movement.
    autonomous: Babble, Rest, GoalBabbling          social: Imitate, Emulate, Remember
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Protocol

import numpy as np

from sgimd_torch.competence import Competence
from sgimd_torch.goals.protocol import Goals
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, AskingAttempt, Attempt, Box, Demonstration, Estimate, Move, Search, check_count

Judge = Callable[[Array, Array, Array], float]
"""(context, goal, outcomes of the attempt) -> the competence at the goal when the attempt has ended, in [-1, 0]."""


Explore = Callable[[Array], Array]
"""context -> the next theta of global exploration. If it has an attribute ``share`` that is not None, this is the
probability of the global regime, whatever the competence."""


class Strategy(Protocol):
    """What a learner does on its own. An attempt stays in one context, and has to yield at least one movement or rest,
    also if its requests are not answered."""

    def attempt(self, context: Array) -> AskingAttempt:
        """Movements for one goal, or one movement without a goal."""
        ...


class SocialStrategy(Protocol):
    """How a learner answers a demonstration. It may yield nothing."""

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """Movements after ``demonstration``, which corresponds to the policy ``theta_d``."""
        ...


class Babble:
    """Random exploration of the policy space: one uniform theta."""

    def __init__(self, policies: Box, rng: np.random.Generator) -> None:
        self.policies = policies
        self.rng = rng

    def attempt(self, context: Array) -> Attempt:
        """One movement."""
        yield Move(self.policies.sample(self.rng), None, "babble")


class Rest:
    """Stay still for one movement: the observation learner, or the imitation learner before the first demonstration."""

    def attempt(self, context: Array) -> Attempt:
        """No movement."""
        yield None


class GoalBabbling:
    """Goal-directed policy optimisation, section 4.4: choose a goal, then search for a movement that reaches it.

    Args:
        policies: Pi.
        memory: what has been reached so far; only read.
        goals: gives goals, and is told the competence at them.
        inverse: the inverse model, (context, goal) -> estimate.
        search: refines the estimate movement by movement.
        competence: gamma, from memory; decides between the regimes.
        judge: the competence that ``goals`` is told at the end of an attempt.
        rng: draws the regimes.
        budget: the most movements for one goal.
        tolerance: distance (m) at which a goal counts as reached.
        explore: draws the movements of the global regime; None: uniformly from Pi, by ``rng``.
        global_range: least and greatest probability of the global exploration regime.
        give_up: a goal with competence below this is given up at the first movement that does not raise it; -1 never
            gives up. Deviation: the paper spends the whole budget on every goal. But in a task space far larger than
            what can be reached nearly all goals are hopeless, and movements spent on them are lost.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        policies: Box,
        memory: Memory,
        goals: Goals,
        inverse: Callable[[Array, Array], Estimate],
        search: Search,
        competence: Competence,
        judge: Judge,
        rng: np.random.Generator,
        *,
        budget: int = 15,
        tolerance: float = 0.02,
        explore: Explore | None = None,
        global_range: tuple[float, float] = (0.05, 0.95),
        give_up: float = -0.5,
    ) -> None:
        if not 0 <= tolerance < np.inf:
            raise ValueError(f"tolerance must be a distance (m), finite and >= 0, got {tolerance}")
        if len(global_range) != 2 or not 0 <= global_range[0] <= global_range[1] <= 1:
            raise ValueError(f"global_range must be two probabilities, the least first, got {global_range}")
        if not give_up <= 0:
            raise ValueError(f"give_up must be a competence, 0 at most, got {give_up}")
        self.policies = policies
        self.memory = memory
        self.goals = goals
        self.inverse = inverse
        self.search = search
        self.competence = competence
        self.judge = judge
        self.rng = rng
        self.budget = check_count("budget", budget, 1)
        self.tolerance = tolerance
        self.explore: Explore = explore if explore is not None else lambda context: policies.sample(rng)
        self.global_range = global_range
        self.give_up = give_up

    def attempt(self, context: Array) -> Attempt:
        """Choose a goal and pursue it."""
        yield from self.pursue(context, self.goals.sample(context))

    def pursue(self, context: Array, goal: Array, strategy: str = "autonomous") -> Attempt:
        """Search until ``goal`` is reached or given up, the budget is spent, or a demonstration interrupts."""
        outcomes: list[Array] = []
        before = best = self.competence(context, goal)
        moves = self._explore(context, goal)
        move = next(moves)
        try:
            while True:
                outcome = yield move
                outcomes.append(outcome)
                if len(outcomes) == self.budget or np.linalg.norm(outcome - goal) <= self.tolerance:
                    return
                last, best = best, self.competence(context, goal)
                if best <= last and best < self.give_up:
                    return
                move = moves.send(outcome)
        finally:  # also when a demonstration interrupts
            self.conclude(context, goal, outcomes, before, strategy)

    def conclude(self, context: Array, goal: Array, outcomes: list[Array], before: float, strategy: str) -> None:
        """Goal interest mapping at the end of an attempt with these ``outcomes``; nothing if it made no movement.

        Args:
            before: competence at the goal when the attempt began.
            strategy: "autonomous", "social" or another name: who had chosen the goal, and how it was pursued.
        """
        if outcomes:
            judged, after = self.judge(context, goal, np.stack(outcomes)), self.competence(context, goal)
            # Where contexts vary, a new exemplar nearer in (context, outcome) may be farther in outcome alone: no loss.
            gain = max(0.0, after - before)
            if gain == 0 and judged != after:  # an attempt judged by itself, which may be worse than what was known
                gain = min(0.0, judged - before)
            self.goals.add(context, goal, judged, strategy, gain)

    def _explore(self, context: Array, goal: Array) -> Attempt:
        """Endless movements, in the global exploration or the local optimisation regime."""
        while True:
            if self.rng.random() < self._global_probability(context, goal):
                # Deviation: the paper prints "theta in T", which must be Pi.
                yield Move(self.explore(context), goal, "global")
            else:
                yield from self._optimise(context, goal)

    def _global_probability(self, context: Array, goal: Array) -> float:
        """Global exploration is the more likely, the farther the goal is from all that was reached."""
        if len(self.memory) == 0:
            return 1.0
        share: float | None = getattr(self.explore, "share", None)
        if share is not None:
            return share
        # Deviation: the paper's probability is -J itself. It is kept off 0 and 1, so that both regimes stay possible.
        return float(np.clip(-self.competence(context, goal), *self.global_range))

    def _optimise(self, context: Array, goal: Array) -> Attempt:
        """The movements of a search from the inverse model's estimate, until the search ends by itself."""
        search = self.search(self.inverse(context, goal), goal)
        theta = next(search, None)
        while theta is not None:
            outcome = yield Move(theta, goal, "local")
            try:
                theta = search.send(outcome)
            except StopIteration:
                return


class Imitate:
    """Imitate a policy, section 4.2: repeat theta_d with small variations, the first time exactly.

    Args:
        policies: Pi.
        rng: draws the variations.
        repeats: movements for one demonstration; None goes on until the next demonstration.
        epsilon: bound of the variation in each parameter, |theta_rand| < epsilon.
        babbling: its interest map is told the competence at the demonstrated outcome afterwards (emulate a goal,
            section 3.2.3); None to imitate only. A demonstrated outcome outside T is imitated, but never a goal.
        outcomes: T; needed with ``babbling``.
        strategy: by what name the interest map is told of it.

    Raises:
        ValueError: a number out of its range, or ``babbling`` without ``outcomes``.
    """

    def __init__(
        self,
        policies: Box,
        rng: np.random.Generator,
        *,
        repeats: int | None = 10,
        epsilon: float = 0.05,
        babbling: GoalBabbling | None = None,
        outcomes: Box | None = None,
        strategy: str = "social",
    ) -> None:
        if (babbling is None) != (outcomes is None):
            raise ValueError("Imitate needs babbling and outcomes together, or neither of them")
        if repeats is not None:
            check_count("repeats", repeats, 1)
        if not 0 <= epsilon < np.inf:
            raise ValueError(f"epsilon must be a bound of variations, finite and >= 0, got {epsilon}")
        self.policies = policies
        self.rng = rng
        self.repeats = repeats
        self.epsilon = epsilon
        self.babbling = babbling
        self.outcomes = outcomes
        self.strategy = strategy

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """theta_d, then its variations."""
        goal = demonstration.outcome
        if self.babbling is None or self.outcomes is None or not self.outcomes.contains(goal):
            yield from self._repeat(theta_d, goal, [])
            return
        outcomes: list[Array] = []
        before = self.babbling.competence(context, goal)
        try:
            yield from self._repeat(theta_d, goal, outcomes)
        finally:  # also when the next demonstration interrupts
            self.babbling.conclude(context, goal, outcomes, before, self.strategy)

    def _repeat(self, theta_d: Array, goal: Array, outcomes: list[Array]) -> Attempt:
        """Movements; their outcomes are appended to ``outcomes``."""
        for repeat in range(self.repeats) if self.repeats is not None else itertools.count():
            # Deviation: the paper varies all repeats; the exact one shows what theta_d itself leads to.
            theta = theta_d if repeat == 0 else self._vary(theta_d)
            outcomes.append((yield Move(theta, goal, "imitate")))

    def _vary(self, theta_d: Array) -> Array:
        return self.policies.clip(theta_d + self.rng.uniform(-self.epsilon, self.epsilon, theta_d.shape))


class Emulate:
    """Take over the teacher's goal but not the movement: pursue the demonstrated outcome by goal babbling."""

    def __init__(self, babbling: GoalBabbling, outcomes: Box, *, strategy: str = "social") -> None:
        self.babbling, self.outcomes, self.strategy = babbling, outcomes, strategy

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """Movements towards the demonstrated outcome; none if it lies outside T."""
        if self.outcomes.contains(demonstration.outcome):
            yield from self.babbling.pursue(context, demonstration.outcome, self.strategy)


class Remember:
    """Learn by observation: remember (theta_d, tau_d) as if it had been executed, and do not move."""

    def __init__(self, memory: Memory) -> None:
        self.memory = memory

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """No movement."""
        self.memory.add(context, theta_d, demonstration.outcome)
        yield from ()  # makes this a generator
