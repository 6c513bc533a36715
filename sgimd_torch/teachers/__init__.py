"""Teachers, who choose demonstrations and the times at which they show them.

Sections 2.3 and 5.3 of Nguyen & Oudeyer (2014). The paper's teacher demonstrates every 30 movements. The demonstration
is drawn from the tile of T that the learner has reached least.
    teacher = PeriodicTeacher(load_demonstrations(), stream(seed, "teacher")); teacher.offer(index, memory)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Array, Demonstration, check_count, check_rng, check_vector

ROUNDED: Final = 1e-9  # share of a tile's side
_STALLED: Final = 0.01  # least relative fall of the mean distance between two checks; below, the learner has stalled


Choose = Callable[[Sequence[Demonstration], Memory, np.random.Generator], Demonstration]
"""Function (demonstrations, memory of the learner, rng) -> the demonstration to show."""


def at_random(demonstrations: Sequence[Demonstration], memory: Memory, rng: np.random.Generator) -> Demonstration:
    """Random demonstration; all are equally likely."""
    return demonstrations[int(rng.integers(len(demonstrations)))]


def least_explored(
    demonstrations: Sequence[Demonstration], memory: Memory, rng: np.random.Generator, *, tiles: int = 10
) -> Demonstration:
    """Demonstration from the tile of outcomes that the learner has reached least.

    Only tiles with demonstrations count. If several tiles have the least number of outcomes, one of them is drawn.

    Args:
        demonstrations: demonstrations to choose from.
        memory: exemplars of the learner.
        rng: random stream of the choice.
        tiles: number of tiles in each dimension of the box around the demonstrated outcomes.

    Raises:
        ValueError: demonstrated outcomes and the memory have different dimensions.
    """
    outcomes = [demonstration.outcome for demonstration in demonstrations]
    demonstrated = check_vector(
        "outcomes of the demonstrations", outcomes, memory.outcome_dim, "is it another robot's?"
    )
    low, high = demonstrated.min(axis=0), demonstrated.max(axis=0)
    side = np.maximum(high - low, 1e-9) / tiles  # above 0 even if all demonstrations lie on a line

    def cells(outcomes: Array) -> Array:
        # The upper border belongs to the last tile; otherwise the farthest demonstrations would have their own tile.
        # Rounding, which differs between processors, moves no outcome to another tile.
        place = (outcomes - low) / side + ROUNDED
        return np.where(np.abs(outcomes - high) <= ROUNDED * side, tiles - 1, np.floor(place))

    occupied, tile_of = np.unique(cells(demonstrated), axis=0, return_inverse=True)
    reached = Counter(map(tuple, cells(memory.outcomes).tolist()))
    counts = np.array([reached[tuple(tile)] for tile in occupied.tolist()])
    chosen = rng.choice(np.flatnonzero(counts == counts.min()))
    return demonstrations[int(rng.choice(np.flatnonzero(tile_of.ravel() == chosen)))]


class PeriodicTeacher(Teacher):
    """Demonstrates at regular intervals, as in the paper.

    A demonstration comes before the movements ``every``, 2 ``every``, ...

    Args:
        demonstrations: demonstrations to choose from.
        rng: random stream of ``choose``.
        every: number of movements from one demonstration to the next.
        choose: choice of the next demonstration.
    """

    def __init__(
        self,
        demonstrations: Sequence[Demonstration],
        rng: np.random.Generator,
        *,
        every: int = 30,
        choose: Choose = least_explored,
    ) -> None:
        self.demonstrations = check_demonstrations(demonstrations)
        check_rng(rng)
        self.rng = rng
        self.every = check_count("every", every, 1)
        self.choose = choose

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """A demonstration, if one is due."""
        if index == 0 or index % self.every:
            return None
        return self.choose(self.demonstrations, memory, self.rng)


class InitialTeacher(Teacher):
    """Shows each demonstration once, at regular intervals from the start, in random order.

    A demonstration comes before the movements 0, ``every``, ...

    Args:
        demonstrations: demonstrations to show.
        rng: random stream of the order.
        every: number of movements from one demonstration to the next.
    """

    def __init__(self, demonstrations: Sequence[Demonstration], rng: np.random.Generator, *, every: int = 10) -> None:
        self.demonstrations = check_demonstrations(demonstrations)
        check_rng(rng)
        self.every = check_count("every", every, 1)
        self._order = rng.permutation(len(demonstrations))

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """A demonstration, if one is due."""
        lesson, rest = divmod(index, self.every)
        if rest or lesson >= len(self._order):
            return None
        return self.demonstrations[self._order[lesson]]


at_once = partial(InitialTeacher, every=1)
"""Shows each demonstration once: one before each of the first movements, in random order."""


class AskedTeacher(Teacher):
    """Demonstrates when the learner's competence stalls.

    Every ``patience`` movements the teacher measures the distance of each demonstrated outcome from the learner's
    nearest outcome. If the mean distance fell by less than 1 % since the last check, the teacher demonstrates.

    Args:
        demonstrations: demonstrations to choose from.
        rng: random stream of ``choose``.
        patience: number of movements between two checks of the learner.
        choose: choice of the next demonstration.
    """

    def __init__(
        self,
        demonstrations: Sequence[Demonstration],
        rng: np.random.Generator,
        *,
        patience: int = 30,
        choose: Choose = least_explored,
    ) -> None:
        self.demonstrations = check_demonstrations(demonstrations)
        check_rng(rng)
        self.rng = rng
        self.patience = check_count("patience", patience, 1)
        self.choose = choose
        self._distance = np.inf

    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """A demonstration, if one is due."""
        if index == 0 or index % self.patience:
            return None
        before, self._distance = self._distance, self._distance_left(memory)
        if self._distance < (1 - _STALLED) * before:
            return None
        return self.choose(self.demonstrations, memory, self.rng)

    def _distance_left(self, memory: Memory) -> float:
        if len(memory) == 0:  # a learner without exemplars counts as stalled
            return np.inf
        distances = [
            np.linalg.norm(memory.outcomes_around(d.outcome, memory.near_outcomes(d.context, d.outcome, 1)) - d.outcome)
            for d in self.demonstrations
        ]
        return float(np.mean(distances))


def check_demonstrations(demonstrations: Sequence[Demonstration]) -> Sequence[Demonstration]:
    """The ``demonstrations``, checked.

    Raises:
        ValueError: there are no demonstrations, or contexts or outcomes differ in shape.
    """
    if not demonstrations:
        raise ValueError("a teacher needs at least one demonstration; use no teacher to learn alone")
    shapes = {(np.shape(demonstration.context), np.shape(demonstration.outcome)) for demonstration in demonstrations}
    if len(shapes) > 1 or any(len(shape) != 1 for pair in shapes for shape in pair):
        wanted = "contexts (context_dim,) and outcomes (outcome_dim,), all alike"
        raise ValueError(f"demonstrations must have {wanted}, got {sorted(shapes)}; are they of two robots?")
    return demonstrations
