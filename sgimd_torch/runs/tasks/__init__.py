"""Tasks: a task is an environment with benchmark goals, demonstrations and a correspondence to translate them.

The catalogue has the tasks of ``rods.py`` and ``robots.py``. A function of your own can return a task:
    def make(): return Task(Toss(), benchmark=my_goals, demonstrations=Path("shown.npz"), correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

import numpy as np

from sgimd_torch.environments.protocol import Environment, Trace, Tracer, check_instance, primitive_of, traced
from sgimd_torch.evaluation import Benchmark, load_benchmark
from sgimd_torch.files import checksum
from sgimd_torch.learner import Correspondence
from sgimd_torch.spaces import Array, Demonstration

MOST_GOALS: Final = 500  # largest number of benchmark goals for a task that brings none
FASTER: Final = 3.0  # ratio of durations, shortest movement to recording; a larger ratio means times in a wrong unit
TOO_FAR: Final = 0.25  # share of a joint's range; a recording with a larger misfit is refused


@runtime_checkable
class Drawn(Protocol):
    """An environment whose movements can be filmed (optional)."""

    def trace(self, context: Array, theta: Array, rng: np.random.Generator) -> Trace:
        """The trajectory of a movement. Its outcome must equal that of ``execute`` with an equal random stream."""
        ...


@runtime_checkable
class Translating(Protocol):
    """An environment that can translate demonstrations (optional)."""

    def correspondence(self, times: Array, trajectory: Array) -> Array:
        """theta_d ``(theta_dim,)``, eq. (6); ``times`` ``(n_times,)`` s, ``trajectory`` ``(n_times, n_joints)``."""
        ...


@dataclass(frozen=True, eq=False)
class Task:
    """An environment, its goals of evaluation and its demonstrations.

    Args:
        environment: robot and world.
        benchmark: file of benchmark goals, or function that makes them; None: goals all over T.
        demonstrations: file of a teacher's demonstrations, or function that makes them; None: no teacher.
        correspondence: function (times, trajectory) -> theta_d, eq. (6); None: method of a `Translating` environment.

    Raises:
        ValueError: a class was given instead of an environment.
    """

    environment: Environment
    benchmark: Path | Callable[[], Benchmark] | None = None
    demonstrations: Path | Callable[[], Sequence[Demonstration]] | None = None
    correspondence: Correspondence | None = None

    def __post_init__(self) -> None:
        check_instance(self.environment)

    @property
    def picture(self) -> Tracer | None:
        """The method ``trace`` of a `Drawn` environment, with checks of its result; None for other environments."""
        robot = self.environment
        return partial(traced, robot, robot.trace) if isinstance(robot, Drawn) else None


def goals_all_over(environment: Environment) -> Benchmark:
    """At most ``MOST_GOALS`` goals all over T: a grid in one or two dimensions, Sobol points in more."""
    box = environment.outcomes
    per_side = int(MOST_GOALS ** (1 / box.dim))
    if box.dim <= 2:
        steps = (np.arange(per_side) + 0.5) / per_side
        points = np.stack(np.meshgrid(*[steps] * box.dim), axis=-1).reshape(-1, box.dim)
    else:
        from scipy.stats import qmc  # slower to import than this whole library

        points = qmc.Sobol(box.dim, scramble=False).random_base2(int(np.log2(MOST_GOALS)))[1:]
    return Benchmark(type(environment).__name__, box.low + points * box.sides, float(box.sides.max()) / per_side)


def benchmark_of(task: Task, file: Path | None) -> tuple[Benchmark, list[str], str | None]:
    """Goals of evaluation, messages about them, and the checksum of their file (None: no file).

    Args:
        task: task of the run.
        file: file of goals to use in place of the task's goals, or None.

    Raises:
        ValueError: the goals do not fit the environment, or the file is damaged.
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
            "reachable or not; for reachable goals, make a file with sgimd benchmark and use it as --benchmark"
        )
    benchmark.check(robot)
    return benchmark, notes, crc32


def demonstrations_of(task: Task, file: Path | None) -> tuple[Sequence[Demonstration], list[str], str | None]:
    """Demonstrations of a teacher, messages about them, and the checksum of their file (None: no file).

    Args:
        task: task of the run.
        file: file of demonstrations to use in place of the task's demonstrations, or None.

    Raises:
        ValueError: there are no demonstrations, one cannot be translated, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot = file or task.demonstrations, task.environment
    if source is None:
        raise ValueError(
            f"{type(robot).__name__} has no demonstrations, but this algorithm needs a teacher; give --demonstrations "
            "FILE, or choose an algorithm that learns alone: --algorithm practice"
        )
    shown: Sequence[Demonstration]
    crc32: str | None = None
    if isinstance(source, Path):
        from sgimd_torch.demonstrations import load_demonstrations  # imported here, as few runs need it
        from sgimd_torch.demonstrations.fit import misfit_of

        crc32 = checksum(source)
        shown = load_demonstrations(source, outcome_dim=robot.outcomes.dim, context_dim=robot.contexts.dim)
        translate, primitive = correspondence_of(task), primitive_of(robot)
        shortest, ranges = primitive.durations[0], primitive.ranges
        for row, each in enumerate(shown):
            try:
                if (lasts := each.times[-1] - each.times[0]) < shortest / FASTER:
                    raise ValueError(f"it lasts {lasts:g} s, movements at least {shortest:g} s; is it in milliseconds?")
                misfit = misfit_of(robot, translate(each.times, each.trajectory), each)
                if ranges is not None and misfit > TOO_FAR * ranges.sides.mean():
                    raise ValueError(
                        f"the nearest movement of the robot misses it by {misfit:.2f} (root mean square); is it in "
                        "degrees, or with the joints in another order?"
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
    """The function (times, trajectory) -> theta_d of a task.

    Raises:
        ValueError: neither the task nor its environment has a correspondence.
    """
    if task.correspondence is not None:
        return task.correspondence
    if isinstance(task.environment, Translating):
        return task.environment.correspondence
    raise ValueError(
        f"{type(task.environment).__name__} has no correspondence, so demonstrations cannot be translated; give it "
        "a method correspondence(times, trajectory) -> theta, or return Task(environment, correspondence=...)"
    )
