"""Lessons by hand: a person shows something now and then; the record of the run keeps it.

Section 2.3 of Nguyen & Oudeyer (2014): kinesthetic demonstrations.
    hand = ByHand(teacher); hand.give(demonstration); hand.offer(120, memory)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.teachers import Teacher

BY_HAND: Final = "by-hand"
"""Who has shown a lesson, in the record of a run."""

Ask = Callable[[Array, Array, Memory], Demonstration | None]
"""(context, goal, memory) -> what a person shows when the learner asks, or None."""


class ByHand:
    """Gives the lessons of a person; where there is none, what another teacher offers.

    That teacher is asked before each movement, also where a person shows something, so that its draws stay the same.

    Args:
        teacher: another one, None if there is none.
    """

    def __init__(self, teacher: Teacher | None = None) -> None:
        self.teacher = teacher
        self.ask: Ask | None = None
        """Asks the person who is there; None if nobody is."""
        self.who = "teacher"
        """Who made the last offer, for the record."""
        self._given: Demonstration | None = None

    def give(self, lesson: Demonstration) -> None:
        """Show this before the next movement."""
        self._given = lesson

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """See ``Teacher``."""
        offered = None if self.teacher is None else self.teacher.offer(index, memory)
        given, self._given = self._given, None
        self.who = "teacher" if given is None else BY_HAND
        return offered if given is None else given

    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """See ``Demonstrator``."""
        return None if self.ask is None else self.ask(context, goal, memory)


def nobody(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> ByHand:
    """A person who has shown nothing yet."""
    return ByHand()
