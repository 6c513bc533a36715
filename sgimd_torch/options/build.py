"""The function ``build``, which builds all parts of a run from its ``Config``.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from sgimd_torch.changes import check_watcher
from sgimd_torch.environments.protocol import Environment, FromFiles
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.files import checksum
from sgimd_torch.learner import Learner
from sgimd_torch.options.built import call_checked
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.options.config import OWN, Config
from sgimd_torch.parts import Demonstrator, Inverse, Teacher
from sgimd_torch.runs.at_once import check_at_once
from sgimd_torch.runs.tasks import Task, benchmark_of


@dataclass(frozen=True, eq=False)
class RunParts:
    """Parts of a run.

    Attributes:
        config: settings of the run, with what its robot found by movements.
        task: robot with its goals and demonstrations.
        learner: learner, freshly built.
        teacher: teacher who demonstrates without being asked; None: no teacher.
        teachers: teachers who are asked, by name.
        benchmark: goals of evaluations.
        data: checksums of the files that were read.
        notes: messages for the user.
    """

    config: Config
    task: Task
    learner: Learner
    teacher: Teacher | None
    teachers: Mapping[str, Demonstrator]
    benchmark: Benchmark
    data: dict[str, str | None]
    notes: Sequence[str]

    @property
    def environment(self) -> Environment:
        """Robot of the task."""
        return self.task.environment

    @property
    def inverses(self) -> dict[str, Inverse]:
        """Inverse models for evaluations, by name, the run's own first; after a change of the robot they are others."""
        return _inverses(self.config, self.learner)


def build(config: Config) -> RunParts:
    """Build the parts of a run; nothing is executed yet.

    Raises:
        ValueError: a part refuses an option, or a file does not fit the robot.
        FileNotFoundError: a file does not exist.
    """
    task = task_of(config)
    config = with_found(config, task.environment)
    check_at_once(task.environment, config.at_once)
    benchmark, notes, benchmark_crc32 = benchmark_of(task, config.benchmark)
    teacher, teachers, demonstrations_crc32 = None, dict[str, Demonstrator](), None
    given: dict[str, Any] = {}  # arguments of the algorithm that not every algorithm has
    if config.teaching:
        from sgimd_torch.runs.tasks.taught import correspondence_of, teachers_of  # not for learners alone

        teacher, teachers, demonstrations_crc32 = teachers_of(config, task, notes)
        given = {"correspondence": correspondence_of(task), **({"teachers": teachers} if teachers else {})}
    if config.begin_with is not None:
        from sgimd_torch.runs.past import past_of  # few runs begin with a past

        given["prior"] = past_of(config.begin_with, task.environment)
        notes.append(f"begins with {len(given['prior'])} movements of {config.begin_with}, as far as they help")
    algorithm = f"algorithm {config.algorithm}"
    learner = call_checked(algorithm, config.constructor("algorithm"), task.environment, config.seed, **given)
    if not isinstance(learner, Learner):
        raise ValueError(f"{algorithm} must return a Learner, got a {type(learner).__name__}")
    if config.until is not None and not learner.inverse.says_how_sure:
        name = type(learner.inverse).__name__
        raise ValueError(f"--until needs an inverse model that says how sure it is, such as process; {name} does not")
    _inverses(config, learner)  # made here, so that their remarks are among the notes
    check_watcher(learner)  # an inverse model of the evaluations may have a forward model
    return RunParts(
        config=config,
        task=task,
        learner=learner,
        teacher=teacher,
        teachers=teachers,
        benchmark=benchmark,
        data={
            "demonstrations_crc32": demonstrations_crc32,
            "benchmark_crc32": benchmark_crc32,
            "begin_with_crc32": checksum(config.begin_with) if config.begin_with else None,
        },
        notes=[*notes, *learner.problem.remarks],
    )


def task_of(config: Config) -> Task:
    """The environment of a run, with its goals and demonstrations.

    Raises:
        ValueError: the environment cannot be built, or is no environment.
    """
    task = call_checked(f"environment {config['environment']}", config.constructor("environment"))
    return task if isinstance(task, Task) else Task(task)


def with_found(config: Config, robot: Environment) -> Config:
    """The settings, with the options that the robot found by movements, such as the corners of T."""
    values = robot.found_options if isinstance(robot, FromFiles) else {}
    options = {f"environment.{name}": value for name, value in values.items() if f"environment.{name}" in config}
    return replace(config, parts={**dict(config.parts), **options})


def _inverses(config: Config, learner: Learner) -> dict[str, Inverse]:
    problem, inverses = learner.problem, {OWN: learner.inverse}
    for word in config.evaluated_by[1:]:
        make = partial(Inverse.of, load_word("inverse", word), problem)
        learnt_with = config.values.get("inverse") == word
        inverses[word] = learner.inverse if learnt_with else problem.shared(f"answer {word}", make)
    return inverses
