"""Tasks: a task is an environment with benchmark goals, demonstrations and a correspondence to translate them.

``robots.py`` and ``rod.py`` have the tasks of the catalogue. A function of your own can return a task:
    def make(): return Task(Toss(), benchmark=my_goals, demonstrations=Path("shown.npz"), correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment, FromFiles, check_instance
from sgimd_torch.evaluation import Benchmark, load_benchmark, tile_goals, tile_side
from sgimd_torch.files import checksum
from sgimd_torch.learner import Correspondence
from sgimd_torch.spaces import Array, Box, Demonstration, stream

MAX_GOALS: Final = 500  # largest number of benchmark goals for a task that brings none


@dataclass(frozen=True, eq=False)
class Task:
    """An environment, its goals of evaluation and its demonstrations.

    Args:
        environment: robot and world.
        benchmark: file of benchmark goals, or function that makes them; None: goals in T
            within reach, if the environment knows what is within reach, or else all over T.
        demonstrations: file of a teacher's demonstrations, or function that makes them; None: no teacher.
        correspondence: function (times, trajectory) -> theta_d, eq. (6); None: method of the environment.

    Raises:
        ValueError: a class was given instead of an environment.
    """

    environment: Environment
    benchmark: Path | Callable[[], Benchmark] | None = None
    demonstrations: Path | Callable[[], Sequence[Demonstration]] | None = None
    correspondence: Correspondence | None = None

    def __post_init__(self) -> None:
        check_instance(self.environment)


def grid_over(box: Box, counts: Sequence[int] | Array) -> Array:
    """``(n, dim)`` centres of equal cells of a box, so many in each dimension."""
    centres = [low + (np.arange(n) + 0.5) / n * side for low, side, n in zip(box.low, box.sides, counts, strict=True)]
    return np.stack(np.meshgrid(*centres), axis=-1).reshape(-1, box.dim)


def goals_all_over(environment: Environment) -> Benchmark:
    """At most ``MAX_GOALS`` goals all over T: a grid in one or two dimensions, Sobol points in more."""
    box = environment.outcomes
    per_side = int(MAX_GOALS ** (1 / box.dim))
    if box.dim <= 2:
        goals = grid_over(box, [per_side] * box.dim)
    else:
        from scipy.stats import qmc  # slower to import than this whole library

        goals = box.low + qmc.Sobol(box.dim, scramble=False).random_base2(int(np.log2(MAX_GOALS)))[1:] * box.sides
    return Benchmark(type(environment).__name__, goals, float(box.sides.max()) / per_side)


def goals_within_reach(environment: Environment) -> Benchmark:
    """One random goal in each tile of T that is known to be within reach; there may be none."""
    box = environment.outcomes
    outcomes = environment.within_reach() if isinstance(environment, FromFiles) else np.empty((0, box.dim))
    side = tile_side(outcomes, box)
    return Benchmark(type(environment).__name__, tile_goals(outcomes, box, side, stream(0, "goals within reach")), side)


def benchmark_of(task: Task, file: Path | None) -> tuple[Benchmark, list[str], str | None]:
    """Goals of evaluation, messages about the robot and its goals, and the checksum of their file (None: no file).

    Args:
        task: task of the run.
        file: file of goals to use in place of the task's goals, or None.

    Raises:
        ValueError: the goals do not fit the environment, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot, crc32 = file or task.benchmark, task.environment, None
    notes = [*robot.remarks] if isinstance(robot, FromFiles) else []
    if isinstance(source, Path):
        crc32 = checksum(source)
        benchmark = load_benchmark(source)
    elif source is not None:
        benchmark = source()
    elif len((benchmark := goals_within_reach(robot)).goals):
        notes.append(f"evaluations use {len(benchmark.goals)} goals, one in each tile of T that random postures reach")
    else:
        benchmark = goals_all_over(robot)
        notes.append(
            f"{type(robot).__name__} has no benchmark goals: evaluations use {len(benchmark.goals)} points all over T, "
            "reachable or not; for reachable goals, make a file with sgimd benchmark and use it as --benchmark"
        )
    benchmark.check(robot)
    return benchmark, notes, crc32
