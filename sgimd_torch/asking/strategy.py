"""Strategic learning: alone or with a teacher, with which one, how, and for which goal?

SGIM-IM and SGIM-ACTS, Nguyen & Oudeyer (2012): "Interactive learning gives the tempo to an intrinsically motivated
robot learner", and "Active choice of teachers, learning strategies and goals for a socially guided intrinsic motivation
learner". An attempt chooses a strategy and a goal together, asks for a demonstration of the goal if the strategy needs
one, and tells the goal model what the strategy came to, at the goal and at what was shown.
    StrategicBabbling(problem, babbling, {"imitate left": Asking("left", Mimic(problem), cost=2.0)})
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sgimd_torch.asking.interest import AUTONOMOUS, StrategicGoals
from sgimd_torch.goals.regions import Region
from sgimd_torch.parts import Problem, Social, Strategy
from sgimd_torch.spaces import Array, AskingAttempt, Request
from sgimd_torch.strategies import GoalBabbling


class Asking(NamedTuple):
    """A strategy with a teacher: who is asked, how a demonstration is ``answer``-ed, what it costs, and at how many
    movements the learner rests until it comes."""

    teacher: str
    answer: Social
    cost: float = 1.0
    takes: int = 0


class StrategicBabbling(Strategy):
    """Goal babbling, or asking a teacher: whatever brings most progress for its cost.

    Args:
        problem: what has to be learnt.
        babbling: autonomous strategy, whose goal model chooses among all strategies.
        asking: strategies with a teacher, by name.

    Raises:
        ValueError: a cost is not positive, or the goal model does not choose strategies.
    """

    def __init__(self, problem: Problem, babbling: GoalBabbling, asking: Mapping[str, Asking]) -> None:
        super().__init__(problem)
        if not isinstance(babbling.goals, StrategicGoals):
            raise ValueError(
                f"goals must be StrategicGoals, which choose strategies, too, got a {type(babbling.goals).__name__}"
            )
        self.costs = {AUTONOMOUS: 1.0, **{name: each.cost for name, each in asking.items()}}
        if not all(0 < cost < np.inf for cost in self.costs.values()):
            raise ValueError(f"costs must be positive and finite, got {self.costs}")
        self.babbling, self.asking = babbling, asking
        self.goals: StrategicGoals = babbling.goals

    @property
    def regions(self) -> Sequence[Region]:
        """Regions of its goal model."""
        return self.goals.regions

    def attempt(self, context: Array) -> AskingAttempt:
        """Movements by one strategy for one goal; alone if the teacher has no answer.

        Deviation: what it came to is measured at the goal and at what was shown, not at all outcomes on the way.
        Somebody who mislabels has movements as good as any, only not for what they are asked for.
        """
        strategy, goal = self.goals.choose(context, self.costs)
        if strategy == AUTONOMOUS:
            yield from self.babbling.pursue(context, goal)
            return
        teacher, answer, _, takes = self.asking[strategy]
        lesson = yield Request(teacher, goal, strategy)
        before = self.babbling.competence(context, goal)
        if lesson is None:  # no answer counts as no progress
            self.goals.add(context, goal, -1.0, strategy, -1.0)
            yield from self.babbling.pursue(context, goal)
            return
        for _ in range(takes):
            yield None
        memory, shown = self.babbling.memory, lesson.demonstration.outcome
        first = len(memory)
        there = self.babbling.competence(context, shown)
        try:
            yield from answer.attempt(context, *lesson)
        finally:  # also when another demonstration interrupts
            outcomes = list(memory.outcomes[first:])
            self.babbling.conclude(context, goal, outcomes, before, strategy)
            if self.problem.outcomes.contains(shown):
                self.babbling.conclude(context, shown, outcomes, there, strategy)
