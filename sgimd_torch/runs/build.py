"""The composition root: makes the parts of a run from a ``Config``.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Final

from sgimd_torch.catalogue import SHARED, checked
from sgimd_torch.catalogue.options import given
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.learner import Learner
from sgimd_torch.runs.config import ALGORITHM, OWN, Config, Part, part_of
from sgimd_torch.runs.tasks import Task, benchmark_of, correspondence_of, demonstrations_of
from sgimd_torch.spaces import Array, Demonstration, Estimate, stream

if TYPE_CHECKING:
    from sgimd_torch.forward_model.anchored import Trust
    from sgimd_torch.forward_model.model import ForwardModel
    from sgimd_torch.teachers import Teacher
    from sgimd_torch.teachers.answering import Demonstrator


@dataclass(frozen=True, eq=False)
class RunParts:
    """What a run needs.

    ``config`` is what it was made from; ``environment`` is that of its ``task``. ``answers`` are the inverses to
    evaluate by, the run's own first; they read the learner's memory. ``model`` is refreshed after each movement; it and
    its ``trust`` are None for a run without a model. ``teacher`` demonstrates, ``teachers`` are asked for it. ``data``
    holds checksums of the files that were read, ``notes`` messages for the user.
    """

    config: Config
    task: Task
    environment: Environment
    learner: Learner
    teacher: Teacher | None
    teachers: Mapping[str, Demonstrator]
    answers: dict[str, Callable[[Array, Array], Estimate]]
    benchmark: Benchmark
    data: dict[str, str | None]
    model: ForwardModel | None
    trust: Trust | None
    notes: Sequence[str]


def build(config: Config) -> RunParts:
    """Put a run together; nothing is executed yet.

    Raises:
        ValueError: a part refuses its option, or a file does not fit the robot.
        FileNotFoundError: there is no such file.
    """
    task = task_of(config)
    make = _Maker(config, task)
    benchmark, notes, benchmark_crc32 = benchmark_of(task, config.benchmark)
    demonstrations: Sequence[Demonstration] = []
    demonstrations_crc32 = None
    if make.parts[ALGORITHM].teaching and _shown(config):
        demonstrations, about_them, demonstrations_crc32 = demonstrations_of(task, config.demonstrations)
        notes += about_them
    teacher: Teacher | None = None
    if "teacher" in make.parts:
        teacher = make("teacher")(demonstrations, stream(config.seed, "teacher"))
    teachers = {
        word: make.other("teachers", word)(demonstrations, stream(config.seed, f"teacher {word}"))
        for word in config.values.get("teachers", ())
    }
    learner = make(ALGORITHM, teachers=teachers)(task.environment, config.seed)
    return RunParts(
        config=config,
        task=task,
        environment=task.environment,
        learner=learner,
        teacher=teacher,
        teachers=teachers,
        answers=make.answers(learner),
        benchmark=benchmark,
        data={"demonstrations_crc32": demonstrations_crc32, "benchmark_crc32": benchmark_crc32},
        model=make.model if config.uses_model else None,
        trust=make.trust if config.uses_model else None,
        notes=notes,
    )


def task_of(config: Config) -> Task:
    """The environment of a run, with what belongs to it.

    Raises:
        ValueError: it cannot be made, or is not an environment.
    """
    found = _LOOKED_AT.pop(_place(config), None)
    if found is not None:
        return found
    part = part_of("environment", "environment", config["environment"])
    task = checked(part.kind, part.word, partial(part.make, **part.set_by(config.values)))()
    return task if isinstance(task, Task) else Task(task)


def has_demonstrations(config: Config) -> bool:
    """Whether its task comes with demonstrations. The next `task_of` gets the same task: some robots connect once."""
    task = _LOOKED_AT[_place(config)] = task_of(config)
    return task.demonstrations is not None


_LOOKED_AT: Final[dict[str, Task]] = {}


def _place(config: Config) -> str:
    return str([(name, value) for name, value in config.values.items() if name.partition(".")[0] == "environment"])


def _shown(config: Config) -> bool:
    """Whether its teachers need demonstrations, as a person does not."""
    return {config.values.get("teacher"), *config.values.get("teachers", ())} - {None} != {"by-hand"}


class _Maker:
    """Makes the parts of one run: each as something to be called, with its options and the parts that it leads to."""

    def __init__(self, config: Config, task: Task) -> None:
        self.parts = config.chosen
        self._config, self._task = config, task

    def __call__(self, name: str, **shared: Any) -> Callable[..., Any]:
        """The part of this name; ``shared`` is what it gets if it asks for it."""
        part = self.parts[name]
        values = part.set_by(self._config.values)
        made = partial(part.make, **values) if values else part.make
        for parameter in part.choices:
            child = self(part.full(parameter))
            if parameter == "inverse":
                child = getattr(self.parts[part.full(parameter)].make, "learns_with", child)
            made = partial(made, **{parameter: child})
        return self._given(part, made, **shared)

    def other(self, kind: str, word: str) -> Callable[..., Any]:
        """Another word of a kind, with its defaults."""
        part = part_of(kind, kind, word)
        return self._given(part, part.make)

    def answers(self, learner: Learner) -> dict[str, Callable[[Array, Array], Estimate]]:
        """The inverses to evaluate by; what the learner infers by answers as its own, but for one by a model."""
        own = self.parts.get("inverse")
        through_model = own is not None and hasattr(own.make, "learns_with")
        found = {OWN: self("inverse")(learner.memory) if through_model else learner.inverse}
        for word in self._config.answered[1:]:
            same = own is not None and word == own.word
            found[word] = found[OWN] if same else self.other("inverse", word)(learner.memory)
        return found

    @cached_property
    def model(self) -> Any:
        """The forward model of the run."""
        robot = self._task.environment
        dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
        return self("model")(*dims, seed=self._config.seed)

    @cached_property
    def trust(self) -> Any:
        """How far the run trusts its model."""
        return self("trust")()

    def _given(self, part: Part, make: Callable[..., Any], **things: Any) -> Callable[..., Any]:
        """With the things of the run that it names; one of a user's own is checked."""
        robot = self._task.environment
        things |= {name: getattr(self, name) for name in SHARED if name in part.takes}
        if part.kind == "inverse":
            things |= {"policies": robot.policies, "outcome_noise": robot.outcome_noise}
        if "correspondence" in part.takes:
            things["correspondence"] = correspondence_of(self._task)
        make = given(make, **things)
        return checked(part.kind, part.word, make) if ":" in part.word else make
