"""What a learner can do by now: how near it has come to each place of T, as a map.

    chart = chart_of(memory, outcomes, rest, benchmark, context); picture = by_error(chart, outcomes)
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
from sgimd_torch.spaces import Array, Box

CELLS: Final = 60  # of the map, along each side
FAR: Final = 0.25  # of T's longer side: a predicted error that is drawn as hopeless
Colours = NDArray[np.uint8]

# From "cannot" to "can"; dark to light in this order, so that they are distinct in grey and with any colour vision.
SKILL: Final = np.array([[33, 60, 96], [40, 107, 142], [58, 154, 155], [135, 199, 132], [246, 232, 120]], float)


@dataclass(frozen=True, eq=False)
class Chart:
    """What it can do.

    ``error`` ``(CELLS, CELLS)`` m, predicted, by row of y and column of x; ``mean_error`` m is that at the goals of the
    benchmark, and ``met`` ``(n,)`` says which of them are near enough to count as reached.
    """

    error: Array
    mean_error: float
    met: NDArray[np.bool_]


def chart_of(memory: Memory, outcomes: Box, rest: Array, benchmark: Benchmark, context: Array) -> Chart:
    """The map of what ``memory`` can do in ``context``.

    Args:
        memory: of the learner; only read.
        outcomes: T; the map shows its first two dimensions, the others in their middle.
        rest: ``(outcome_dim,)`` the outcome of not moving.
        benchmark: its goals, and how near counts as reached: half the side of its tiles.
        context: ``(context_dim,)`` in which it is drawn.
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
    return Chart(error, float(at_goals.mean()), at_goals <= benchmark.side / 2)


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
    """``(CELLS, CELLS, 3)`` the predicted error as a picture, y upwards: light where it can, dark where it cannot."""
    skill = np.clip(1 - chart.error[::-1] / (FAR * outcomes.sides[:2].max()), 0, 1)
    places = np.linspace(0, 1, len(SKILL))
    return np.stack([np.interp(skill, places, channel) for channel in SKILL.T], axis=-1).astype(np.uint8)
