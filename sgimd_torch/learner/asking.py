"""Strategic learning: alone or with a teacher, with which one, how, and for which goal?

SGIM-IM and SGIM-ACTS, Nguyen & Oudeyer (2012): "Interactive learning gives the tempo to an intrinsically motivated
robot learner", and "Active choice of teachers, learning strategies and goals for a socially guided intrinsic motivation
learner". An attempt chooses a strategy and a goal together, asks for a demonstration of the goal if the strategy needs
one, and tells the goal model what the strategy brought: at the goal, and at each outcome on the way.
    StrategicBabbling(babbling, outcomes, {"imitate left": Asking("left", Imitate(...), cost=2.0)})
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sgimd_torch.goals.strategic import AUTONOMOUS, StrategicGoals
from sgimd_torch.spaces import Array, AskingAttempt, Box, Request
from sgimd_torch.strategies import GoalBabbling, SocialStrategy


class Asking(NamedTuple):
    """A strategy with a teacher: who is asked, how a demonstration is ``answer``-ed, what it costs, and at how many
    movements the learner rests until it comes."""

    teacher: str
    answer: SocialStrategy
    cost: float = 1.0
    takes: int = 0


class StrategicBabbling:
    """Goal babbling, or asking a teacher: whatever brings most progress for its cost.

    Args:
        babbling: the autonomous strategy; its goal model chooses among the strategies.
        outcomes: T.
        asking: by name, the strategies with a teacher.

    Raises:
        ValueError: a cost is not positive, or the goal model does not choose strategies.
    """

    def __init__(self, babbling: GoalBabbling, outcomes: Box, asking: Mapping[str, Asking]) -> None:
        if not isinstance(babbling.goals, StrategicGoals):
            raise ValueError(f"goals must have choose(context, costs), got a {type(babbling.goals).__name__}")
        self.costs = {AUTONOMOUS: 1.0, **{name: each.cost for name, each in asking.items()}}
        if not all(0 < cost < np.inf for cost in self.costs.values()):
            raise ValueError(f"costs must be positive and finite, got {self.costs}")
        self.babbling, self.outcomes, self.asking = babbling, outcomes, asking
        self.goals: StrategicGoals = babbling.goals

    def attempt(self, context: Array) -> AskingAttempt:
        """Movements by one strategy for one goal; alone if the teacher has no answer."""
        strategy, goal = self.goals.choose(context, self.costs)
        if strategy == AUTONOMOUS:
            yield from self._credited(context, strategy, self.babbling.pursue(context, goal))
            return
        teacher, answer, _, takes = self.asking[strategy]
        lesson = yield Request(teacher, goal)
        before = self.babbling.competence(context, goal)
        if lesson is None:
            self.goals.add(context, goal, before, strategy)  # it brought nothing
            yield from self._credited(context, AUTONOMOUS, self.babbling.pursue(context, goal))
            return
        for _ in range(takes):
            yield None
        try:
            yield from self._credited(context, strategy, answer.attempt(context, *lesson))
        finally:  # also when another demonstration interrupts
            after = self.babbling.competence(context, goal)
            self.goals.add(context, goal, after, strategy, max(0.0, after - before))

    def _credited(self, context: Array, strategy: str, movements: AskingAttempt) -> AskingAttempt:
        """The ``movements``; at their end, the progress of each exemplar at its own outcome."""
        memory = self.babbling.memory
        first = len(memory)
        try:
            yield from movements
        finally:
            for row in range(first, len(memory)):
                outcome = memory.outcomes[row]
                if self.outcomes.contains(outcome):
                    # Reached now, as the exemplar itself shows; before, as nearly as the nearest earlier one came.
                    near = memory.near_outcomes(context, outcome, len(memory) - first + 1)
                    nearest = memory.outcomes[near[near < row][:1]]
                    before = np.max(self.babbling.competence.performance(outcome, nearest), initial=-1.0)
                    self.goals.add(context, outcome, 0.0, strategy, float(-before))
