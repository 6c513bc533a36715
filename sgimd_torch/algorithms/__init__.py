"""Learners in a few lines each: the five of the paper in ``paper``, our own in ``practice``."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from sgimd_torch.parts import Inverse, Part, Problem, Strategy
from sgimd_torch.strategies import GoalBabbling

MakeInverse: TypeAlias = Callable[[Problem], Inverse]


class ThroughBabbling(Strategy):
    """Base of strategies whose goals are pursued by goal babbling.

    Args:
        babbling: goal babbling; its goal model and its parts are those of the strategy.
    """

    def __init__(self, babbling: GoalBabbling) -> None:
        super().__init__(babbling.problem)
        self.babbling = babbling

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of the goal model."""
        return self.babbling.regions

    def maker(self, origin: str) -> Part:
        """See `GoalBabbling.maker`."""
        return self.babbling.maker(origin)
