"""Tasks: a task is an environment with benchmark goals, demonstrations and a correspondence to translate them.

``robots.py`` and ``rod.py`` have the tasks of the catalogue. A function of your own can return a task:
    def make(): return Task(Toss(), benchmark=my_goals, demonstrations=Path("shown.npz"), correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sgimd_torch.environments.protocol import Environment, check_instance
from sgimd_torch.evaluation import Benchmark, load_benchmark
from sgimd_torch.files import checksum
from sgimd_torch.learner import Correspondence
from sgimd_torch.spaces import Demonstration


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


def benchmark_of(task: Task, file: Path | None) -> tuple[Benchmark, list[str], str | None]:
    """Goals of evaluation, messages about them, and the checksum of their file (None: no file).

    Args:
        task: task of the run.
        file: file of goals to use in place of the task's goals, or None.

    Raises:
        ValueError: the goals do not fit the environment, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot, crc32, notes = file or task.benchmark, task.environment, None, list[str]()
    if isinstance(source, Path):
        crc32 = checksum(source)
        benchmark = load_benchmark(source)
    elif source is not None:
        benchmark = source()
    else:
        from sgimd_torch.tasks.goals import goals_for  # most tasks bring goals

        benchmark, where = goals_for(robot)
        notes.append(f"{type(robot).__name__} has no benchmark goals: evaluations use {where}")
    benchmark.check(robot)
    return benchmark, notes, crc32
