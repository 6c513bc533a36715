"""The composition root: makes the parts of a run from a ``Config``, as the catalogue describes each choice.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sgimd_torch.catalogue import CATALOGUE, SHARED, checked, find
from sgimd_torch.environments.protocol import Environment, Record
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.goals.regions import Region
from sgimd_torch.learner import Learner
from sgimd_torch.runs.config import OWN, Config
from sgimd_torch.runs.tasks import Task, benchmark_of, correspondence_of, demonstrations_of
from sgimd_torch.spaces import Array, Demonstration, Estimate, stream
from sgimd_torch.teachers import Teacher
from sgimd_torch.teachers.answering import Demonstrator

if TYPE_CHECKING:
    from sgimd_torch.forward_model.anchored import Trust
    from sgimd_torch.forward_model.model import ForwardModel

LEAST_NOISE: Final = 0.01  # m; predictions are not better than this, even if outcomes have no noise


@dataclass(frozen=True, eq=False)
class RunParts:
    """What a run needs. ``config`` is what it was made from. ``answers`` are the inverses to evaluate by, the run's own
    first; they read the learner's memory. ``model`` is refreshed after each movement; it and its ``trust`` are None for
    a run without a model. ``teacher`` demonstrates, ``teachers`` are asked for it; without any of them there are no
    ``demonstrations``: those of the file, and what teachers have besides.
    ``data`` holds checksums of the files that were read, ``notes`` messages for the user. ``record`` gives a movement
    to be filmed, None if the task has no picture of its own."""

    config: Config
    environment: Environment
    learner: Learner
    teacher: Teacher | None
    demonstrations: Sequence[Demonstration]
    answers: dict[str, Callable[[Array, Array], Estimate]]
    benchmark: Benchmark
    data: dict[str, str | None]
    model: ForwardModel | None
    trust: Trust | None
    notes: Sequence[str] = ()
    record: Record | None = None
    teachers: Mapping[str, Demonstrator] = field(default_factory=dict)
    task: Task | None = None

    @property
    def inverse(self) -> Callable[[Array, Array], Estimate]:
        """The run's own inverse for evaluations."""
        return self.answers[OWN]

    @property
    def regions(self) -> Sequence[Region]:
        """Of the learner's goal model as they are now, whichever it is; none if it has no regions."""
        return list(getattr(getattr(self.learner.autonomous, "goals", None), "regions", ()))


def build(config: Config, directory: Path | None = None) -> RunParts:
    """Put a run together; nothing is executed yet.

    Args:
        config: its choices.
        directory: where the lessons of a person are, if there are any; None for where the run is written.

    Raises:
        ValueError: a part refuses its option, or a file does not fit the robot.
        FileNotFoundError: there is no such file.
    """
    task = task_of(config)
    parts = _Parts(config, task)
    benchmark, notes, benchmark_crc32 = benchmark_of(task, config.benchmark)
    demonstrations: Sequence[Demonstration] = []
    teacher, demonstrations_crc32 = None, None
    if parts.used & {"teacher", "teachers"} and "demonstrations" in parts.used:
        demonstrations, about_them, demonstrations_crc32 = demonstrations_of(task, config.demonstrations)
        notes += about_them
    if "teacher" in parts.used:
        teacher = parts["teacher"](demonstrations, stream(config.seed, "teacher"))
    teachers = parts.asked(demonstrations) if "teachers" in parts.used else {}
    demonstrations = [*demonstrations, *_others(demonstrations, teachers)]
    learner = parts["algorithm"](task.environment, config.seed)
    words = {answer: config.inverse if answer == OWN else answer for answer in config.answered}
    if "inverse" in config.entry("algorithm").options and config.entry("inverse").learns_with is None:
        words = {answer: OWN if word == config.inverse else word for answer, word in words.items()}  # it learns with it
    inverses = {
        word: learner.inverse if word == OWN else parts.maker("inverse", word, learning=False)(learner.memory)
        for word in dict.fromkeys(words.values())
    }
    return RunParts(
        config=config,
        environment=task.environment,
        learner=learner,
        teacher=teacher,
        demonstrations=demonstrations,
        answers={answer: inverses[word] for answer, word in words.items()},
        benchmark=benchmark,
        data={"demonstrations_crc32": demonstrations_crc32, "benchmark_crc32": benchmark_crc32},
        model=parts["model"] if "model" in parts.used else None,
        trust=parts["trust"] if "model" in parts.used else None,
        notes=[*config.without_effect, *notes],
        record=task.picture,
        teachers=teachers,
        task=task,
    )


def _others(demonstrations: Sequence[Demonstration], teachers: Mapping[str, Demonstrator]) -> list[Demonstration]:
    """What teachers can show besides, each movement once."""
    known = {
        shown.trajectory.tobytes(): shown for each in teachers.values() for shown in getattr(each, "demonstrations", ())
    }
    played = {shown.trajectory.tobytes() for shown in demonstrations}
    return [shown for trajectory, shown in known.items() if trajectory not in played]


def task_of(config: Config) -> Task:
    """The environment of a run, with what belongs to it.

    Raises:
        ValueError: it cannot be made, or is not an environment.
    """
    made = config.entry("environment").bind(partial(getattr, config))
    task = checked("environment", config.environment, made)()
    return task if isinstance(task, Task) else Task(task)


class _Parts:
    """Makes the parts of one run by name, each once."""

    def __init__(self, config: Config, task: Task) -> None:
        self.used = config.used
        self._config, self._task = config, task
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        """A shared part, a choice of the catalogue as something to be called, or the value of an option."""
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    def asked(self, demonstrations: Sequence[Demonstration]) -> dict[str, Demonstrator]:
        """The teachers by name; an algorithm is told of the same ones."""
        made: dict[str, Demonstrator] = {}
        for word in self._config.teachers:
            rng = stream(self._config.seed, f"teacher {word}")
            made[word] = self.maker("teachers", word)(demonstrations, rng)
        self._made["teachers"] = made
        return made

    def maker(self, kind: str, word: str | None = None, *, learning: bool = True) -> Callable[..., Any]:
        """The choice of a kind, or another ``word`` of it, with its options. ``learning`` False: for evaluations, where
        the inverse may differ."""
        word = getattr(self._config, kind) if word is None else word
        entry = find(kind, word)
        if learning and entry.learns_with is not None:
            word, entry = entry.learns_with, CATALOGUE[kind][entry.learns_with]
        made = entry.bind(self.__getitem__)
        return made if word in CATALOGUE[kind] else checked(kind, word, made)

    def _make(self, name: str) -> Any:
        robot, algorithm = self._task.environment, self._config.entry("algorithm")
        if name in algorithm.uses.values() and algorithm.own.get(name) == getattr(self._config, name, None) is not None:
            return None  # the algorithm makes its own
        match name:
            case "policies" | "outcome_noise":
                return getattr(robot, name)
            case "correspondence":
                return correspondence_of(self._task)
            case "model":
                dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
                return SHARED[name].bind(self.__getitem__)(*dims, seed=self._config.seed)
            case "trust":
                return SHARED[name].bind(self.__getitem__)(noise=max(robot.outcome_noise, LEAST_NOISE))
        return self.maker(name) if name in CATALOGUE else getattr(self._config, name)
