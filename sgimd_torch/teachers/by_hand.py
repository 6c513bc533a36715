"""Lessons by hand: a person shows something now and then, and the run keeps it, so that it can be lived again alone.

Section 2.3 of Nguyen & Oudeyer (2014): kinesthetic demonstrations. A lesson is a demonstration file in a folder of the
run, ``lessons/before-000120.npz``: shown before movement 120. ``answer-000120.npz`` was shown because the learner had
asked. Whoever runs this again, with or without a person, gets the same lessons at the same movements.
    keep_lesson(folder, 120, demonstration); teacher = ByHand(read_lessons(folder), teacher); teacher.offer(120, memory)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.files import make_folder
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.teachers import Teacher

FOLDER: Final = "lessons"  # of a run directory
_NAME: Final = re.compile(r"(before|answer)-([0-9]{6,})\.npz")

Ask = Callable[[int, Array, Array, Memory], Demonstration | None]
"""(index, context, goal, memory) -> what a person shows when the learner asks before movement ``index``, or None."""


@dataclass(frozen=True, eq=False)
class GivenLesson:
    """A ``demonstration`` that was shown before movement ``index``; ``asked``: because the learner had asked for it."""

    index: int
    demonstration: Demonstration
    asked: bool = False


class ByHand:
    """Gives the lessons of a person at their movements; at the others, what another teacher offers.

    That teacher is asked before each movement, also where a person shows something, so that its draws stay the same.

    Args:
        lessons: that were given so far; ``add`` takes more.
        teacher: another one, None if there is none.
    """

    def __init__(self, lessons: Sequence[GivenLesson] = (), teacher: Teacher | None = None) -> None:
        self.teacher = teacher
        self.ask: Ask | None = None
        """Asks the person who is there; None if nobody is."""
        self._lessons = {lesson.index: lesson for lesson in lessons}
        self._index = -1

    @property
    def lessons(self) -> Mapping[int, GivenLesson]:
        """By the movement that each came before."""
        return self._lessons

    def add(self, lesson: GivenLesson) -> None:
        """Take one more lesson, for a movement that is still to come."""
        self._lessons[lesson.index] = lesson

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """See ``Teacher``."""
        self._index = index
        offered = None if self.teacher is None else self.teacher.offer(index, memory)
        lesson = self._lessons.get(index)
        return offered if lesson is None or lesson.asked else lesson.demonstration

    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """See ``Demonstrator``; ``offer`` comes first, and says which movement this is about."""
        lesson = self._lessons.get(self._index)
        if lesson is not None:
            return lesson.demonstration if lesson.asked else None
        return None if self.ask is None else self.ask(self._index, context, goal, memory)


def nobody(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> ByHand:
    """A person who has shown nothing yet; the run gives them its lessons."""
    return ByHand()


def lesson_path(folder: Path, lesson: GivenLesson) -> Path:
    """Where a lesson is kept, ``folder`` being the ``lessons`` of a run."""
    return folder / f"{'answer' if lesson.asked else 'before'}-{lesson.index:06d}.npz"


def keep_lesson(folder: Path, lesson: GivenLesson) -> Path:
    """Write a lesson to its file, whole or not at all.

    Raises:
        ValueError: ``load_demonstrations`` would refuse it.
        OSError: it cannot be written.
    """
    make_folder(folder)
    save_demonstrations(lesson_path(folder, lesson), [lesson.demonstration])
    return lesson_path(folder, lesson)


def read_lessons(folder: Path) -> list[GivenLesson]:
    """The lessons of a run, in order; none if there is no such folder.

    Raises:
        ValueError: a file is damaged, or holds several demonstrations.
        OSError: one cannot be read.
    """
    found = []
    for path in sorted(folder.glob("*.npz")):
        name = _NAME.fullmatch(path.name)
        if name is None:
            continue
        shown = load_demonstrations(path)
        if len(shown) != 1:
            raise ValueError(f"{path} must hold one lesson, got {len(shown)}; was another file put in its place?")
        found.append(GivenLesson(int(name[2]), shown[0], name[1] == "answer"))
    return sorted(found, key=lambda lesson: lesson.index)
