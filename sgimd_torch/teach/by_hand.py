"""A person who teaches by hand: the learner is shown each lesson at once.

Section 2.3 of Nguyen & Oudeyer (2014): kinesthetic demonstrations.
    teacher = ByHand(teacher); teacher.give(demonstration); teacher.offer(120, memory)
Nothing is drawn at random here. The record of a run keeps the lessons, so a replay needs no person.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Demonstration
from sgimd_torch.teachers import Teacher

BY_HAND: Final = "by-hand"
"""Name of the person in a record, and on the command line."""


class ByHand:
    """Offers what a person gives; otherwise, what another teacher offers.

    The other teacher is asked before each movement, even when a person gives a lesson, so that its draws do not change.

    Args:
        teacher: the other teacher, None for a person alone.

    Attributes:
        who: name, in a record, of whoever made the last offer.
    """

    def __init__(self, teacher: Teacher | None = None) -> None:
        self.teacher, self.who = teacher, "teacher"
        self._given: Demonstration | None = None

    def give(self, demonstration: Demonstration) -> None:
        """Offer this demonstration before the next movement for which the learner takes an offer."""
        self._given = demonstration

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """See ``Teacher``."""
        offered = None if self.teacher is None else self.teacher.offer(index, memory)
        given, self._given = self._given, None
        self.who = "teacher" if given is None else BY_HAND
        return offered if given is None else given


def nobody(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> ByHand:
    """A person without prepared demonstrations; `sgimd teach` brings the lessons."""
    return ByHand()
