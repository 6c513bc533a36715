"""The function ``build``, which builds all parts of a run from its ``Config``.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from sgimd_torch.changes import check_watcher
from sgimd_torch.environments.protocol import Environment, FromFiles
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options import function_of
from sgimd_torch.options.built import call_checked
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.options.config import OWN, Config
from sgimd_torch.parts import Demonstrator, Inverse, Teacher
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
        prior: movements of another robot with which the learner begins; None: there are none.
        data: checksums of the files that were read.
        notes: messages for the user.
    """

    config: Config
    task: Task
    learner: Learner
    teacher: Teacher | None
    teachers: Mapping[str, Demonstrator]
    benchmark: Benchmark
    prior: Memory | None
    data: dict[str, str | None]
    notes: Sequence[str]

    @property
    def environment(self) -> Environment:
        """Robot of the task."""
        return self.task.environment

    @property
    def inverses(self) -> dict[str, Inverse]:
        """Inverse models for evaluations, by name, the run's own first; after a change of the robot they are others."""
        learner, inverses = self.learner, {OWN: self.learner.inverse}
        for word in self.config.evaluated_by[1:]:
            make = partial(Inverse.of, load_word("inverse", word), learner.problem)
            learnt_with = self.config.values.get("inverse") == word
            inverses[word] = learner.inverse if learnt_with else learner.problem.shared(f"answer {word}", make)
        return inverses


def build(config: Config, record: Path | None = None) -> RunParts:
    """Build the parts of a run; nothing is executed yet.

    Args:
        config: settings of the run.
        record: record of the run, which keeps the movements of --begin-with; None: the run is not on disk.

    Raises:
        ValueError: a part refuses an option, or a file does not fit the robot.
        FileNotFoundError: a file does not exist.
    """
    task = task_of(config)
    robot = task.environment
    config = config.with_found(robot.found_options if isinstance(robot, FromFiles) else {})
    if config.at_once > 1:
        from sgimd_torch.runs.at_once import check_at_once  # most runs have one robot

        check_at_once(robot, config.at_once)
    benchmark, notes, crc32 = benchmark_of(task, config.benchmark)
    data = {"benchmark_crc32": crc32, "demonstrations_crc32": None, "begin_with_crc32": None}
    own = [config.constructor("teacher")] if config.teaching == "teacher" else []
    asked = {word: load_word("teachers", word) for word in config.asked}
    demonstrations: Sequence[Demonstration] = ()
    if any(map(_needs_demonstrations, (*own, *asked.values()))):
        from sgimd_torch.runs.tasks.taught import demonstrations_of  # not for learners alone

        demonstrations, remarks, data["demonstrations_crc32"] = demonstrations_of(task, config.demonstrations)
        notes += remarks
    given = dict[str, Any]()
    if config.begin_with is not None:
        from sgimd_torch.runs.past import past_of  # few runs begin with a past

        given["prior"], remarks, data["begin_with_crc32"] = past_of(task, config.begin_with, record)
        notes += remarks
    teacher, teachers = None, dict[str, Demonstrator]()
    if config.teaching:
        from sgimd_torch.runs.tasks.taught import correspondence_of

        given["correspondence"] = correspondence_of(task)
        for make in own:
            teacher = Teacher.of(make, demonstrations, stream(config.seed, "teacher"))
        for word, make in asked.items():
            teachers[word] = Demonstrator.of(make, demonstrations, stream(config.seed, f"teacher {word}"))
        given |= {"teachers": teachers} if teachers else {}
    algorithm = f"algorithm {config.algorithm}"
    learner = call_checked(algorithm, config.constructor("algorithm"), robot, config.seed, **given)
    if not isinstance(learner, Learner):
        raise ValueError(f"{algorithm} must return a Learner, got a {type(learner).__name__}")
    if config.until is not None and not learner.inverse.says_how_sure:
        name = type(learner.inverse).__name__
        raise ValueError(f"--until needs an inverse model that says how sure it is, such as process; {name} does not")
    parts = RunParts(config, task, learner, teacher, teachers, benchmark, given.get("prior"), data, notes)
    assert parts.inverses  # made here, so that their remarks are among the notes
    if config.checkpoints and not learner.problem.trained:
        raise ValueError("--checkpoints true needs a forward model, such as --inverse model")
    check_watcher(learner)  # an inverse model of the evaluations may have a forward model
    notes += learner.problem.remarks
    return parts


def task_of(config: Config) -> Task:
    """The environment of a run, with its goals and demonstrations.

    Raises:
        ValueError: the environment cannot be built, or is no environment.
    """
    task = call_checked(f"environment {config['environment']}", config.constructor("environment"))
    task = task if isinstance(task, Task) else Task(task)
    if not config.context:
        return task
    from sgimd_torch.environments.previous import with_previous  # few robots have a memory

    return replace(task, environment=with_previous(task.environment))


def _needs_demonstrations(make: Callable[..., Any]) -> bool:
    kind = function_of(make)
    return not (isinstance(kind, type) and issubclass(kind, Teacher)) or kind.needs_demonstrations
