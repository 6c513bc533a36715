"""A map of T: the distance from each point to the nearest outcome that the learner remembers.

    chart = chart_of(robot, memory, benchmark); colours = picture_of(chart, robot.outcomes)
No movement is executed and no inverse model is asked (1 ms a point), so a map takes milliseconds.
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
FAR: Final = 0.25  # distance of the darkest colour, as a share of T's longer side
# Colours from a large distance (dark) to none (light). They differ in brightness, for colour-blind readers.
COLOURS: Final = np.array([[33, 60, 96], [40, 107, 142], [58, 154, 155], [135, 199, 132], [246, 232, 120]], float)


@dataclass(frozen=True, eq=False)
class Chart:
    """Distances to the nearest outcomes of a learner, in the unit of T.

    Attributes:
        distances: ``(CELLS, CELLS)`` distance from each cell, with a row for each y and a column for each x.
        mean_distance: mean distance from the goals of the benchmark.
        reached: ``(n_goals,)`` mask of the goals whose distance is at most half the side of a benchmark tile.
    """

    distances: Array
    mean_distance: float
    reached: NDArray[np.bool_]


def chart_of(robot: Environment, memory: Memory, benchmark: Benchmark) -> Chart:
    """The map of a learner for the context at the middle of C.

    Args:
        robot: environment; the map spans the first two dimensions of its T, at the middle of its other dimensions.
        memory: memory of the learner; only read.
        benchmark: goals over which the distance is averaged, and the side of their tiles.
    """
    points = np.concatenate([_cells(robot.outcomes), benchmark.goals])
    if len(memory):
        tree = KDTree(np.concatenate([memory.contexts, memory.outcomes], axis=1))
        context = robot.contexts.low + robot.contexts.sides / 2
        queries = np.concatenate([np.tile(context, (len(points), 1)), points], axis=1)
        nearest = memory.outcomes[tree.query(queries)[1]]
    else:
        nearest = np.tile(robot.rest, (len(points), 1))
    of_cells, of_goals = np.split(np.linalg.norm(nearest - points, axis=1), [CELLS**2])
    return Chart(of_cells.reshape(CELLS, CELLS), float(of_goals.mean()), of_goals <= benchmark.side / 2)


def _cells(outcomes: Box) -> Array:
    """``(CELLS**2, outcome_dim)``, the middles of the map's cells, row by row, with y increasing."""
    steps = (np.arange(CELLS) + 0.5) / CELLS
    shares = np.full((CELLS, CELLS, outcomes.dim), 0.5)
    shares[..., 0], shares[..., 1:2] = steps, steps[:, None, None]
    return outcomes.low + shares.reshape(-1, outcomes.dim) * outcomes.sides


def picture_of(chart: Chart, outcomes: Box) -> NDArray[np.uint8]:
    """Picture ``(CELLS, CELLS, 3)`` of the distances, y upwards: light where they are small, dark where large."""
    lightness = np.clip(1 - chart.distances[::-1] / (FAR * outcomes.sides[:2].max()), 0, 1)
    steps = np.linspace(0, 1, len(COLOURS))
    return np.stack([np.interp(lightness, steps, channel) for channel in COLOURS.T], axis=-1).astype(np.uint8)
