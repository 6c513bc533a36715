"""Tasks: an environment with what a study of it needs: benchmark goals, demonstrations, their correspondence.

Those of the catalogue are in ``rods.py`` and ``robots.py``. One of your own may come alone, or as a ``Task``:
    def make(): return Task(Toss(), benchmark=my_goals, demonstrations=Path("shown.npz"), correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment, Tracer, check_instance, primitive_of, traced
from sgimd_torch.evaluation import Benchmark, load_benchmark
from sgimd_torch.files import checksum
from sgimd_torch.learner import Correspondence
from sgimd_torch.spaces import Demonstration

MOST_GOALS: Final = 500  # of a task that has none
FASTER: Final = 3.0  # than the shortest movement, and more: such a recording has wrong times
TOO_FAR: Final = 0.25  # of a joint's range: a robot that misses a demonstration by more cannot make that movement


@dataclass(frozen=True, eq=False)
class Task:
    """What can be learnt, and how it is judged.

    Args:
        environment: the robot and its world.
        benchmark: goals of evaluation: a file, or a function that makes them; None for goals all over T.
        demonstrations: what a teacher has to show: a file, or a function that makes it; None for no teacher.
        correspondence: (times, trajectory) -> theta_d, eq. (6); None for the environment's own, if it has one.

    Raises:
        ValueError: a class in the place of an environment.
    """

    environment: Environment
    benchmark: Path | Callable[[], Benchmark] | None = None
    demonstrations: Path | Callable[[], Sequence[Demonstration]] | None = None
    correspondence: Correspondence | None = None

    def __post_init__(self) -> None:
        check_instance(self.environment)

    @property
    def picture(self) -> Tracer | None:
        """The environment's ``trace``, which gives a movement to film, checked; None if it has none."""
        found = getattr(self.environment, "trace", None)
        return partial(traced, self.environment, found) if callable(found) else None


def goals_all_over(environment: Environment) -> Benchmark:
    """At most 500 goals over T, for a task that has none: a grid in one or two dimensions, Sobol points above."""
    box = environment.outcomes
    per_side = int(MOST_GOALS ** (1 / box.dim))
    if box.dim <= 2:
        steps = (np.arange(per_side) + 0.5) / per_side
        points = np.stack(np.meshgrid(*[steps] * box.dim), axis=-1).reshape(-1, box.dim)
    else:
        from scipy.stats import qmc  # takes longer to import than this whole library

        points = qmc.Sobol(box.dim, scramble=False).random_base2(int(np.log2(MOST_GOALS)))[1:]
    return Benchmark(type(environment).__name__, box.low + points * box.sides, float(box.sides.max()) / per_side)


def benchmark_of(task: Task, file: Path | None) -> tuple[Benchmark, list[str], str | None]:
    """The goals of a run, messages on them, and the checksum of their file, None of goals that are made.

    Args:
        task: has the goals if there is no file.
        file: replaces them.

    Raises:
        ValueError: they do not fit the environment, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot, notes, crc32 = file or task.benchmark, task.environment, list[str](), None
    if isinstance(source, Path):
        crc32 = checksum(source)
        benchmark = load_benchmark(source)
    elif source is not None:
        benchmark = source()
    else:
        benchmark = goals_all_over(robot)
        notes.append(
            f"{type(robot).__name__} has no benchmark goals: evaluations use {len(benchmark.goals)} points all over T, "
            "also where it cannot reach; sgimd benchmark makes goals from runs for --benchmark; a Task may have its own"
        )
    benchmark.check(robot)
    return benchmark, notes, crc32


def demonstrations_of(task: Task, file: Path | None) -> tuple[Sequence[Demonstration], list[str], str | None]:
    """What a teacher can show, messages on it, and the checksum of the file.

    Args:
        task: has the demonstrations if there is no file.
        file: replaces them.

    Raises:
        ValueError: there are none, or one cannot be translated, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot = file or task.demonstrations, task.environment
    if source is None:
        raise ValueError(
            f"{type(robot).__name__} comes without demonstrations, and this algorithm needs a teacher; "
            "give --demonstrations FILE, or choose one that learns alone: --algorithm practice"
        )
    shown: Sequence[Demonstration]
    crc32: str | None = None
    if isinstance(source, Path):
        from sgimd_torch.demonstrations import load_demonstrations  # most learners read none
        from sgimd_torch.demonstrations.fit import misfit_of

        crc32 = checksum(source)
        shown = load_demonstrations(source, outcome_dim=robot.outcomes.dim, context_dim=robot.contexts.dim)
        translate, primitive = correspondence_of(task), primitive_of(robot)
        shortest, ranges = primitive.durations[0], primitive.ranges
        for row, each in enumerate(shown):
            try:
                if (lasts := each.times[-1] - each.times[0]) < shortest / FASTER:
                    raise ValueError(f"movements last {shortest:g} s at least, it {lasts:g} s; is it in milliseconds?")
                misfit = misfit_of(robot, translate(each.times, each.trajectory), each)
                if ranges is not None and misfit > TOO_FAR * ranges.sides.mean():
                    raise ValueError(
                        f"it is {misfit:.2f} (root mean square) away from anything that the robot can play; was it "
                        "recorded in degrees, or with the joints in another order?"
                    )
            except ValueError as error:
                raise ValueError(f"{source}: recording {row} cannot be translated: {error}") from error
    else:
        shown = source()
    notes = [f"{len(shown)} demonstrations"] if shown else []
    outside = [row for row, each in enumerate(shown) if not robot.outcomes.contains(each.outcome)]
    if outside:
        unit = robot.outcomes.unit or "the unit of T"
        more = f", as do {len(outside) - 1} more" if len(outside) > 1 else ""
        notes.append(f"recording {outside[0]} lands outside T{more}; were they not recorded in {unit}?")
    return shown, notes, crc32


def correspondence_of(task: Task) -> Correspondence:
    """From a demonstrated trajectory to theta.

    Raises:
        ValueError: neither the task nor its environment has one.
    """
    found = task.correspondence or getattr(task.environment, "correspondence", None)
    if found is None:
        raise ValueError(
            f"{type(task.environment).__name__} has no correspondence, so demonstrations cannot be translated; give it "
            "a method correspondence(times, trajectory) -> theta, or return Task(environment, correspondence=...)"
        )
    return found
