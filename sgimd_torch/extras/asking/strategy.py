"""Strategic learning: each attempt chooses a goal, and whether to pursue it alone or to ask a teacher.

SGIM-IM and SGIM-ACTS, Nguyen & Oudeyer (2012): "Interactive learning gives the tempo to an intrinsically motivated
robot learner", and "Active choice of teachers, learning strategies and goals for a socially guided intrinsic motivation
learner". An attempt chooses a strategy and a goal together. If the strategy is to ask, the attempt requests a
demonstration of the goal. The goal model is then told the competence at the goal and at the demonstrated outcome.
    StrategicBabbling(babbling, {"imitate left": Asking("left", Mimic(problem), cost=2.0)})
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from sgimd_torch.extras.asking.interest import AUTONOMOUS, StrategicGoals
from sgimd_torch.parts import Part, Social, Strategy
from sgimd_torch.spaces import Array, AskingAttempt, Request
from sgimd_torch.strategies import GoalBabbling, recording_outcomes


class Asking(NamedTuple):
    """Strategy that asks: name of the teacher, social strategy that uses the demonstration, cost of an attempt relative
    to an autonomous one, and duration of a reply: number of movements for which the learner then rests."""

    teacher: str
    social: Social
    cost: float = 1.0
    takes: int = 0


class StrategicBabbling(Strategy):
    """Goal babbling, or a request to a teacher; the goal model chooses between them by progress and cost.

    Args:
        babbling: autonomous strategy; its goal model chooses among all strategies.
        asking: mapping from names, other than "autonomous", to strategies that ask a teacher.

    Raises:
        ValueError: a cost is not positive, or the goal model is no `StrategicGoals`.
    """

    def __init__(self, babbling: GoalBabbling, asking: Mapping[str, Asking]) -> None:
        super().__init__(babbling.problem)
        if not isinstance(babbling.goals, StrategicGoals):
            raise ValueError(
                f"goals must be StrategicGoals, which choose strategies, too, got a {type(babbling.goals).__name__}"
            )
        self.costs = {AUTONOMOUS: 1.0, **{name: option.cost for name, option in asking.items()}}
        if not all(0 < cost < np.inf for cost in self.costs.values()):
            raise ValueError(f"costs must be positive and finite, got {self.costs}")
        self.babbling, self.asking, self.goals = babbling, asking, babbling.goals

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of the goal model."""
        return self.babbling.regions

    def maker(self, origin: str) -> Part:
        """See `GoalBabbling.maker`."""
        return self.babbling.maker(origin)

    def attempt(self, context: Array) -> AskingAttempt:
        """Movements by one strategy for one goal; if the teacher has no reply, the movements are autonomous.

        Deviation: competence is measured only at the goal and at the demonstrated outcome. The papers measure it at
        every outcome of the attempt; then a teacher whose demonstrations miss the requested goal would look good.
        """
        strategy, goal = self.goals.choose(context, self.costs)
        if strategy == AUTONOMOUS:
            yield from self.babbling.pursue(context, goal)
            return
        teacher, social, _, takes = self.asking[strategy]
        lesson = yield Request(teacher, goal, strategy)
        competence_before = self.babbling.competence_at(context, goal)
        if lesson is None:  # a request without a reply has the lowest competence and gain, so it is repeated rarely
            self.goals.add(context, goal, competence=-1.0, strategy=strategy, gain=-1.0)
            yield from self.babbling.pursue(context, goal)
            return
        for _ in range(takes):
            yield None  # a rest
        outcome_d = lesson.demonstration.outcome
        executed: list[tuple[Array, Array]] = []  # thetas and outcomes
        competence_before_d = self.babbling.competence_at(context, outcome_d)
        try:
            yield from recording_outcomes(social.attempt(context, *lesson), executed)
        finally:  # also if another demonstration interrupts the imitation
            outcomes = [outcome for _, outcome in executed]
            self.babbling.report_competence(context, goal, outcomes, competence_before, strategy)
            if self.problem.outcomes.contains(outcome_d):
                self.babbling.report_competence(context, outcome_d, outcomes, competence_before_d, strategy)
