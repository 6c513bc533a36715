"""Teachers who are asked for a demonstration of a goal; they reply with their nearest demonstration, or not at all.

Nguyen & Oudeyer (2012), "Active choice of teachers, learning strategies and goals for a socially guided intrinsic
motivation learner". A learner of `sgimd_torch.extras.asking` asks; `run` hands its requests to the teachers.
    teachers = {"left": AnsweringTeacher(demonstrations, stream(seed, "left"), knows=low_half)}
    teachers["left"].demonstrate(context, goal, memory)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Demonstrator
from sgimd_torch.spaces import Array, Demonstration, check_count, check_point
from sgimd_torch.teachers import check_demonstrations

Knows = Callable[[Sequence[Demonstration], np.random.Generator], Sequence[Demonstration]]
"""Function (demonstrations, rng) -> demonstrations that a teacher has, with the outcomes that the teacher states."""


def everything(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> Sequence[Demonstration]:
    """All demonstrations, unchanged."""
    return demonstrations


def low_half(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> Sequence[Demonstration]:
    """Demonstrations whose first outcome coordinate is below the median."""
    return [demonstration for demonstration in demonstrations if demonstration.outcome[0] < middle(demonstrations)]


def high_half(demonstrations: Sequence[Demonstration], rng: np.random.Generator) -> Sequence[Demonstration]:
    """Demonstrations whose first outcome coordinate is the median or above."""
    return [demonstration for demonstration in demonstrations if demonstration.outcome[0] >= middle(demonstrations)]


def _of_demonstrator(
    number: int, demonstrations: Sequence[Demonstration], rng: np.random.Generator
) -> list[Demonstration]:
    example = demonstrations[0]
    recorded = load_demonstrations(SHIPPED.with_name(f"demonstrator_{number}.npz"))
    if recorded[0].trajectory.shape[1] != example.trajectory.shape[1]:
        raise ValueError(f"demonstrator {number} has shown movements of the fishing rod, which this robot cannot make")
    return [replace(demonstration, context=np.zeros_like(example.context)) for demonstration in recorded]


class AnsweringTeacher(Demonstrator):
    """Has all demonstrations; shows the one nearest to the goal.

    If several demonstrations are equally near, the teacher shows the first.

    Args:
        demonstrations: demonstrations to choose from.
        rng: random stream of ``knows``, which is called once.
        knows: function that chooses the demonstrations of this teacher: `everything`, `low_half`, `high_half`, or a
            function of your own.
        within: distance in C x T beyond which there is no reply.
        takes: number of movements for which the learner rests until the reply has come.

    Raises:
        ValueError: there is no demonstration, or a number is out of its range.
    """

    def __init__(
        self,
        demonstrations: Sequence[Demonstration],
        rng: np.random.Generator,
        *,
        knows: Knows = everything,
        within: float = np.inf,
        takes: int = 0,
    ) -> None:
        self.demonstrations = check_demonstrations(knows(check_demonstrations(demonstrations), rng))
        if not within > 0:
            raise ValueError(f"within must be a distance above 0, got {within}")
        self.within, self.takes = within, check_count("takes", takes, 0)
        self._points = np.stack(
            [np.concatenate((demonstration.context, demonstration.outcome)) for demonstration in self.demonstrations]
        )

    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """See `Demonstrator`."""
        point = check_point("context and goal asked for", np.concatenate((context, goal)), self._points.shape[1])
        distances = np.linalg.norm(self._points - point, axis=1)
        nearest = int(distances.argmin())
        return self.demonstrations[nearest] if distances[nearest] <= self.within else None


low_half_teacher = partial(AnsweringTeacher, knows=low_half)
"""Has the lower half of the demonstrations, by the first outcome coordinate."""
high_half_teacher = partial(AnsweringTeacher, knows=high_half)
"""Has the upper half of the demonstrations, by the first outcome coordinate."""
demonstrator_1 = partial(AnsweringTeacher, knows=partial(_of_demonstrator, 1))
"""Has the recordings of the rod's demonstrator 1."""
demonstrator_2 = partial(AnsweringTeacher, knows=partial(_of_demonstrator, 2))
"""Has the recordings of the rod's demonstrator 2."""
demonstrator_3 = partial(AnsweringTeacher, knows=partial(_of_demonstrator, 3))
"""Has the recordings of the rod's demonstrator 3."""


def middle(demonstrations: Sequence[Demonstration]) -> float:
    """The median of the first outcome coordinate, the border between the two halves."""
    return float(np.median([demonstration.outcome[0] for demonstration in demonstrations]))
