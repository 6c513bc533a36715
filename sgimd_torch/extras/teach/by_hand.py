"""A person who teaches by hand: the learner is shown each lesson at once.

Section 2.3 of Nguyen & Oudeyer (2014): kinesthetic demonstrations.
    teacher = ByHand(teacher=other); teacher.give(demonstration); teacher.offer(120, memory)
Nothing is drawn at random here. The record of a run keeps the lessons, so a replay needs no person.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Demonstration

BY_HAND: Final = "by-hand"
"""Name of this teacher in records and on the command line."""


class ByHand(Teacher):
    """A person who gives lessons at any time, with sgimd teach.

    A run may have a second teacher. This teacher is asked before each movement, even if the person gives a lesson.
    So the random draws of this teacher do not depend on the lessons.

    Args:
        demonstrations: unused list, as ``give`` brings the lessons.
        rng: unused stream, as nothing is drawn.
        teacher: second teacher, None for a person alone.
    """

    needs_demonstrations = False

    def __init__(
        self,
        demonstrations: Sequence[Demonstration] = (),
        rng: np.random.Generator | None = None,
        *,
        teacher: Teacher | None = None,
    ) -> None:
        self.teacher, self.who = teacher, "teacher"
        self._given: Demonstration | None = None

    def give(self, demonstration: Demonstration) -> None:
        """Offer this demonstration when the learner next asks for an offer."""
        self._given = demonstration

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """The given lesson, or else the offer of the second teacher."""
        offered = None if self.teacher is None else self.teacher.offer(index, memory)
        given, self._given = self._given, None
        self.who = "teacher" if given is None else BY_HAND
        return offered if given is None else given
