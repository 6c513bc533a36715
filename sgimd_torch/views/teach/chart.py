"""How a session stands, and what its learner can do by now: how near it has come to each place of T, as a map.

    before = run.chart(); ...; after = run.chart(); by_change(before, after, outcomes)
The predicted error at a goal is the distance from it to the nearest place where a movement landed. Nothing is executed,
so a map takes milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from sgimd_torch.evaluation import Benchmark
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box, Episode

CELLS: Final = 60  # of the map, along each side
FAR: Final = 0.25  # of T's longer side: a predicted error that is drawn as hopeless
Colours = NDArray[np.uint8]

# From "cannot" to "can"; dark to light in this order, so that they are distinct in grey and with any colour vision.
SKILL: Final = np.array([[33, 60, 96], [40, 107, 142], [58, 154, 155], [135, 199, 132], [246, 232, 120]], float)
# From "worse" over "as before" to "better".
CHANGE: Final = np.array([[150, 60, 130], [214, 170, 205], [236, 241, 244], [160, 214, 130], [44, 134, 58]], float)


@dataclass(frozen=True, eq=False)
class Chart:
    """What it can do after ``movements`` and ``lessons``.

    ``error`` ``(CELLS, CELLS)`` m, predicted, by row of y and column of x; ``mean_error`` m is that at the goals of the
    benchmark, and ``met`` ``(n,)`` says which of them are near enough to count as reached.
    """

    movements: int
    lessons: int
    error: Array
    mean_error: float
    met: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class State:
    """How it stands: after how many ``movements`` of ``total``, and before which of them a lesson was given.

    ``busy`` says what it does if it neither learns nor pauses; ``problem`` what ended it. ``asked`` ``(outcome_dim,)``
    is a goal that the learner would like to be shown, and ``waiting`` whether it waits for an answer. ``latest`` are
    the last episodes. ``chart`` is the newest map, ``before`` that from before the last lesson.
    """

    total: int
    movements: int = 0
    lessons: tuple[int, ...] = ()
    paused: bool = False
    busy: str = "starting"
    problem: str = ""
    asked: Array | None = None
    waiting: bool = False
    latest: tuple[Episode, ...] = ()
    chart: Chart | None = None
    before: Chart | None = None


def chart_of(
    memory: Memory, outcomes: Box, rest: Array, benchmark: Benchmark, context: Array, *, movements: int, lessons: int
) -> Chart:
    """The map of what ``memory`` can do in ``context``.

    Args:
        memory: of the learner; only read.
        outcomes: T; the map shows its first two dimensions, the others in their middle.
        rest: ``(outcome_dim,)`` the outcome of not moving.
        benchmark: its goals, and how near counts as reached: half the side of its tiles.
        context: ``(context_dim,)`` in which it is drawn.
        movements, lessons: so far.
    """
    cells = _cells(outcomes)
    everywhere = np.concatenate([cells, benchmark.goals])
    if len(memory):
        near = KDTree(np.concatenate([memory.contexts, memory.outcomes], axis=1))
        rows = np.concatenate([np.tile(context, (len(everywhere), 1)), everywhere], axis=1)
        nearest = memory.outcomes[near.query(rows)[1]]
    else:
        nearest = np.tile(rest, (len(everywhere), 1))
    distances = np.linalg.norm(nearest - everywhere, axis=1)
    error, at_goals = distances[: len(cells)].reshape(CELLS, CELLS), distances[len(cells) :]
    return Chart(movements, lessons, error, float(at_goals.mean()), at_goals <= benchmark.side / 2)


def _cells(outcomes: Box) -> Array:
    """``(CELLS**2, outcome_dim)``, the middles of the map's cells, row by row from the least y on."""
    low, sides = outcomes.low, outcomes.sides
    steps = (np.arange(CELLS) + 0.5) / CELLS
    points = np.tile(low + sides / 2, (CELLS * CELLS, 1))
    points[:, 0] = low[0] + sides[0] * np.tile(steps, CELLS)
    if outcomes.dim > 1:
        points[:, 1] = low[1] + sides[1] * np.repeat(steps, CELLS)
    return points


def by_error(chart: Chart, outcomes: Box) -> Colours:
    """The predicted error as a picture: light where it can, dark where it cannot."""
    return _painted(_skill(chart, outcomes), SKILL)


def by_change(before: Chart, after: Chart, outcomes: Box) -> Colours:
    """What changed in the predicted error: green where it fell, purple where it rose."""
    return _painted(0.5 + _skill(after, outcomes) - _skill(before, outcomes), CHANGE)


def _skill(chart: Chart, outcomes: Box) -> Array:
    """The predicted error as a share, 1 for none and 0 where it is hopeless."""
    return np.clip(1 - chart.error / (FAR * outcomes.sides[:2].max()), 0, 1)


def _painted(shares: Array, colours: Array) -> Colours:
    """``(CELLS, CELLS, 3)``: 0 is the first of the colours, 1 the last; y grows upwards in the picture."""
    places = np.linspace(0, 1, len(colours))
    channels = [np.interp(np.clip(shares[::-1], 0, 1), places, channel) for channel in colours.T]
    return np.stack(channels, axis=-1).astype(np.uint8)
