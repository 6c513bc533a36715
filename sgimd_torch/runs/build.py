"""The composition root: makes the parts of a run from a ``Config``, as the catalogue describes each choice.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, Final

from sgimd_torch.algorithms import Correspondence
from sgimd_torch.catalogue import CATALOGUE, SHARED, check, check_call
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.learner import Learner
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.tasks import Task, benchmark_of, correspondence_of, demonstrations_of
from sgimd_torch.spaces import Array, Demonstration, Estimate, stream
from sgimd_torch.teachers import Teacher

if TYPE_CHECKING:
    from sgimd_torch.forward_model.anchored import Trust
    from sgimd_torch.forward_model.model import ForwardModel

LEAST_NOISE: Final = 0.01  # m; predictions are not better than this, even if outcomes have no noise
_OF_THE_ROBOT: Final = {"policies", "outcome_noise", "correspondence"}


@dataclass(frozen=True, eq=False)
class RunParts:
    """What a run needs. ``correspondence`` translates a demonstrated trajectory to theta. ``inverse`` reads the
    learner's memory for evaluations; ``model`` is refreshed after each movement; it and its ``trust`` are None for a
    run without a model. ``teacher`` is None, and ``demonstrations`` are empty, for a learner that learns alone.
    ``residuals`` (rad) say how far each demonstration is from what the robot can play. ``data`` holds checksums of the
    files that were read, ``notes`` messages for the user."""

    environment: Environment
    correspondence: Correspondence | None
    learner: Learner
    teacher: Teacher | None
    demonstrations: Sequence[Demonstration]
    residuals: Sequence[float]
    inverse: Callable[[Array, Array], Estimate]
    benchmark: Benchmark
    data: dict[str, str | None]
    model: ForwardModel | None
    trust: Trust | None
    notes: Sequence[str] = ()


def build(config: Config) -> RunParts:
    """Put a run together; nothing is executed yet.

    Raises:
        ValueError: a part refuses its option, or a file does not fit the robot.
        FileNotFoundError: there is no such file.
    """
    task = task_of(config)
    parts = _Parts(config, task)
    benchmark, benchmark_crc32 = benchmark_of(task, config.benchmark)
    demonstrations: Sequence[Demonstration] = []
    residuals: list[float] = []
    teacher, demonstrations_crc32 = None, None
    if "teacher" in parts.used:
        demonstrations, residuals, demonstrations_crc32 = demonstrations_of(task, config.demonstrations)
        teacher = parts.maker("teacher")(demonstrations, stream(config.seed, "teacher"))
    learner = parts.maker("algorithm")(task.environment, config.seed)
    inverse = parts.maker("inverse", learning=False)(learner.memory)
    return RunParts(
        environment=task.environment,
        correspondence=parts["correspondence"] if "correspondence" in parts.used else None,
        learner=learner,
        teacher=teacher,
        demonstrations=demonstrations,
        residuals=residuals,
        inverse=inverse,
        benchmark=benchmark,
        data={"demonstrations_crc32": demonstrations_crc32, "benchmark_crc32": benchmark_crc32},
        model=parts["model"] if "model" in parts.used else None,
        trust=parts["trust"] if "model" in parts.used else None,
        notes=[*_goals_note(task, config, benchmark)],
    )


def task_of(config: Config) -> Task:
    """The environment of a run, with what belongs to it.

    Raises:
        ValueError: it cannot be made, or is not an environment.
    """
    entry = config.entry("environment")
    options = {name: getattr(config, option) for name, option in entry.uses.items()}
    make = partial(entry.load(), **entry.arguments(), **options)
    check_call("environment", config.environment, make, (), {})
    made = make()
    task = made if isinstance(made, Task) else Task(made)
    check("environment", config.environment, task.environment)
    return task


class _Parts:
    """Makes the parts of one run by name; shared parts are made once."""

    def __init__(self, config: Config, task: Task) -> None:
        self.config, self.used = config, config.used
        self._task = task
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        """A shared part, a choice of the catalogue as something to be called, or the value of an option."""
        if name in CATALOGUE:
            return self.maker(name)
        if name not in SHARED and name not in _OF_THE_ROBOT:
            return getattr(self.config, name)
        if name not in self._made:
            self._made[name] = self._shared(name)
        return self._made[name]

    def maker(self, kind: str, *, learning: bool = True) -> Callable[..., Any]:
        """The choice of a kind, with its options. ``learning`` False: for evaluations, where the inverse may differ."""
        word = getattr(self.config, kind)
        entry = self.config.entry(kind)
        if learning and entry.learns_with is not None:
            word, entry = entry.learns_with, CATALOGUE[kind][entry.learns_with]
        given = {name: self[option] for name, option in entry.uses.items()}
        options = {**entry.arguments(), **{name: value for name, value in given.items() if value is not None}}
        made = partial(entry.load(), **options) if options else entry.load()
        return made if word in CATALOGUE[kind] else _checked(kind, word, made)

    def _shared(self, name: str) -> Any:
        robot = self._task.environment
        if name in ("policies", "outcome_noise"):
            return getattr(robot, name)
        if name == "correspondence":
            return correspondence_of(self._task)
        entry = SHARED[name]
        options = {parameter: self[option] for parameter, option in entry.uses.items()}
        if name == "model":
            dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
            return entry.load()(*dims, seed=self.config.seed, **options)
        return entry.load()(noise=max(robot.outcome_noise, LEAST_NOISE), **options)


def _checked(kind: str, word: str, make: Callable[..., Any]) -> Callable[..., Any]:
    """``make``, with a check of what it gives: a part of the user's own may lack members."""

    @wraps(make)
    def made(*arguments: Any, **options: Any) -> Any:
        check_call(kind, word, make, arguments, options)
        part = make(*arguments, **options)
        check(kind, word, part)
        return part

    return made


def _goals_note(task: Task, config: Config, benchmark: Benchmark) -> list[str]:
    if task.benchmark is not None or config.benchmark is not None:
        return []
    name, n = type(task.environment).__name__, len(benchmark.goals)
    return [
        f"{name} has no benchmark goals: evaluations use {n} points all over T, also where it cannot reach; "
        "a file of goals (--benchmark) or a Task with a benchmark is more informative"
    ]
