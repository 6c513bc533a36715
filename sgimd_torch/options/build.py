"""The function ``build``, which builds all parts of a run from its ``Config``.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from sgimd_torch.changes import check_watcher
from sgimd_torch.environments.protocol import Environment, FromFiles
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.files import checksum
from sgimd_torch.learner import Learner
from sgimd_torch.options.catalogue import call_checked, function_of, load_word
from sgimd_torch.options.config import ALGORITHM, OWN, Config
from sgimd_torch.parts import Demonstrator, Inverse, Teacher
from sgimd_torch.runs.at_once import check_at_once
from sgimd_torch.runs.tasks import Task, benchmark_of
from sgimd_torch.spaces import Demonstration, stream


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
    shown: dict[str, Any] = {}
    teacher: Teacher | None = None
    teachers: dict[str, Demonstrator] = {}
    demonstrations_crc32 = None
    if config.teaching:
        from sgimd_torch.runs.tasks.taught import correspondence_of, demonstrations_of  # not for learners alone

        asked = (config.teachers or ("all",)) if config.teaching == "teachers" else ()
        makers = {word: load_word("teachers", word) for word in asked}
        own = [config.constructor("teacher")] if "teacher" in config else []
        demonstrations: Sequence[Demonstration] = []
        if any(map(_needs_demonstrations, (*makers.values(), *own))):
            demonstrations, about_them, demonstrations_crc32 = demonstrations_of(task, config.demonstrations)
            notes += about_them
        shown["correspondence"] = correspondence_of(task)
        for make in own:
            teacher = Teacher.of(make, demonstrations, stream(config.seed, "teacher"))
        for word, make in makers.items():
            teachers[word] = Demonstrator.of(make, demonstrations, stream(config.seed, f"teacher {word}"))
        if teachers:
            shown["teachers"] = teachers
    begin_with_crc32 = None
    if config.begin_with is not None:
        from sgimd_torch.runs.past import past_of  # few runs begin with a past

        shown["prior"] = past_of(config.begin_with, task.environment)
        notes = [*notes, f"begins with {len(shown['prior'])} movements of {config.begin_with}, as far as they help"]
        begin_with_crc32 = checksum(config.begin_with)
    algorithm = f"algorithm {config.algorithm}"
    learner = call_checked(algorithm, config.constructor(ALGORITHM), task.environment, config.seed, **shown)
    if not isinstance(learner, Learner):
        raise ValueError(f"{algorithm} must return a Learner, got a {type(learner).__name__}")
    if config.until is not None and not learner.inverse.says_how_sure:
        name = type(learner.inverse).__name__
        raise ValueError(f"--until needs an inverse model that says how sure it is, such as process; {name} does not")
    _inverses(config, learner)  # made now, so that their remarks are among the notes
    check_watcher(learner)  # an answer may have a forward model
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
            "begin_with_crc32": begin_with_crc32,
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


def _inverses(config: Config, learner: Learner) -> dict[str, Inverse]:
    problem, found = learner.problem, {OWN: learner.inverse}
    for word in config.evaluated_by[1:]:
        make = partial(Inverse.of, load_word("inverse", word), problem)
        learnt_with = config.values.get("inverse") == word
        found[word] = learner.inverse if learnt_with else problem.shared(f"answer {word}", make)
    return found


def with_found(config: Config, robot: Environment) -> Config:
    """The settings, with the options that the robot found by movements, such as the corners of T."""
    found = {
        f"environment.{name}": value for name, value in (robot.found if isinstance(robot, FromFiles) else {}).items()
    }
    return replace(config, parts={**dict(config.parts), **{name: found[name] for name in found if name in config}})


def _needs_demonstrations(make: Callable[..., Any]) -> bool:
    kind = function_of(make)
    return not (isinstance(kind, type) and issubclass(kind, Teacher)) or kind.needs_demonstrations
