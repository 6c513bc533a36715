"""A person who teaches by hand: what they give is shown at once.

Section 2.3 of Nguyen & Oudeyer (2014): kinesthetic demonstrations.
    teacher = ByHand(teacher); teacher.give(demonstration); teacher.offer(120, memory)
Nothing is drawn here, and the record of a run keeps what was shown, so a replay needs no person.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Demonstration

BY_HAND: Final = "by-hand"
"""Who has shown a lesson by hand, in the record; also the word of the command line."""


class ByHand(Teacher):
    """A person who shows what they like, when they like: sgimd teach.

    What a person gives is offered; otherwise, what another teacher offers.

    That teacher is asked before each movement, also where a person shows something, so that its draws stay the same.

    Args:
        demonstrations: not needed.
        rng: not needed, as nothing is drawn.
        teacher: another teacher; None if there is none.
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
        """Have this offered before the next movement for which the learner takes an offer."""
        self._given = demonstration

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """See ``Teacher``."""
        offered = None if self.teacher is None else self.teacher.offer(index, memory)
        given, self._given = self._given, None
        self.who = "teacher" if given is None else BY_HAND
        return offered if given is None else given
