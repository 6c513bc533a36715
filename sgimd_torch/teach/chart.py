"""A map of T with the predicted error of a learner at each place.

    chart = chart_of(robot, memory, benchmark); picture = by_error(chart, robot.outcomes)
The predicted error at a goal is the distance from the goal to the nearest outcome in memory. No movement is executed,
so a map takes milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box

CELLS: Final = 60  # number of cells along each side of the map
FAR: Final = 0.25  # predicted error of the darkest colour, as a share of T's longer side
Colours = NDArray[np.uint8]

# Colours from a large predicted error (dark) to none (light). They differ in brightness, for colour-blind readers.
SKILL: Final = np.array([[33, 60, 96], [40, 107, 142], [58, 154, 155], [135, 199, 132], [246, 232, 120]], float)


@dataclass(frozen=True, eq=False)
class Chart:
    """The predicted errors of a learner.

    Attributes:
        error: ``(CELLS, CELLS)`` predicted error (m), with a row for each y and a column for each x.
        mean_error: mean predicted error (m) at the goals of the benchmark.
        met: ``(n_goals,)`` mask of the goals whose predicted error is at most half the side of a benchmark tile.
    """

    error: Array
    mean_error: float
    met: NDArray[np.bool_]


def chart_of(robot: Environment, memory: Memory, benchmark: Benchmark) -> Chart:
    """The predicted errors of a learner in the context at the middle of C.

    Args:
        robot: environment; the map spans the first two dimensions of its T, at the middle of its other dimensions.
        memory: memory of the learner; only read.
        benchmark: goals over which the error is averaged, and the side of their tiles.
    """
    places = np.concatenate([_cells(robot.outcomes), benchmark.goals])
    if len(memory):
        near = KDTree(np.concatenate([memory.contexts, memory.outcomes], axis=1))
        context = robot.contexts.low + robot.contexts.sides / 2
        rows = np.concatenate([np.tile(context, (len(places), 1)), places], axis=1)
        nearest = memory.outcomes[near.query(rows)[1]]
    else:
        nearest = np.tile(robot.rest, (len(places), 1))
    error, at_goals = np.split(np.linalg.norm(nearest - places, axis=1), [CELLS**2])
    return Chart(error.reshape(CELLS, CELLS), float(at_goals.mean()), at_goals <= benchmark.side / 2)


def _cells(outcomes: Box) -> Array:
    """``(CELLS**2, outcome_dim)``, the middles of the map's cells, row by row, with y increasing."""
    steps = (np.arange(CELLS) + 0.5) / CELLS
    shares = np.full((CELLS, CELLS, outcomes.dim), 0.5)
    shares[..., 0], shares[..., 1:2] = steps, steps[:, None, None]
    return outcomes.low + shares.reshape(-1, outcomes.dim) * outcomes.sides


def by_error(chart: Chart, outcomes: Box) -> Colours:
    """Picture ``(CELLS, CELLS, 3)`` of the predicted error, y upwards: light where it is small, dark where large."""
    skill = np.clip(1 - chart.error[::-1] / (FAR * outcomes.sides[:2].max()), 0, 1)
    places = np.linspace(0, 1, len(SKILL))
    return np.stack([np.interp(skill, places, channel) for channel in SKILL.T], axis=-1).astype(np.uint8)
