"""The parts of a run, and when it is evaluated."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.options.config import OWN, Config
from sgimd_torch.parts import Demonstrator, Inverse, Teacher
from sgimd_torch.runs.hooks import Hook
from sgimd_torch.tasks import Task, benchmark_of


@dataclass(frozen=True, eq=False)
class RunParts:
    """Parts of a run.

    Attributes:
        config: settings of the run, with what its robot found by movements.
        task: robot with its goals and demonstrations.
        hooks: hooks of rooms.
        learner: learner, freshly built.
        teacher: teacher who demonstrates without being asked; None: no teacher.
        teachers: teachers who are asked, by name.
        prior: movements of another robot with which the learner begins; None: there are none.
        data: checksums of the files that were read.
        notes: messages for the user.
    """

    config: Config
    task: Task
    hooks: Sequence[Hook]
    learner: Learner
    teacher: Teacher | None
    teachers: Mapping[str, Demonstrator]
    prior: Memory | None
    data: dict[str, str | None]
    notes: list[str]

    @property
    def environment(self) -> Environment:
        """Robot of the task."""
        return self.task.environment

    @cached_property
    def benchmark(self) -> Benchmark:
        """Goals of evaluations; an answer needs none, and those of a model file take half a second.

        Raises:
            ValueError: the goals do not fit the environment, or the file is damaged.
            OSError: there is no such file.
        """
        benchmark, notes, self.data["benchmark_crc32"] = benchmark_of(self.task, self.config.benchmark)
        self.notes.extend(notes)
        return benchmark

    @property
    def robots(self) -> int:
        """Number of robots that move at once."""
        return max((hook.robots for hook in self.hooks), default=1)

    @property
    def inverses(self) -> dict[str, Inverse]:
        """Inverse models for evaluations, by name, the run's own first; after a change of the robot they are others."""
        learner, inverses = self.learner, {OWN: self.learner.inverse}
        for word in self.config.evaluated_by[1:]:
            make = partial(Inverse.of, load_word("inverse", word), learner.problem)
            learnt_with = self.config.values.get("inverse") == word
            inverses[word] = learner.inverse if learnt_with else learner.problem.shared(f"answer {word}", make)
        return inverses

    def due(self, movements: int, numbers: Iterable[int]) -> bool:
        """Whether one of ``numbers`` falls into the group of robots that ended after this number of ``movements``."""
        return any(0 <= movements - number < self.robots for number in numbers)

    def missing(self, made: Collection[int], requested: Iterable[int]) -> list[int]:
        """Those ``requested`` moments at which no evaluation was ``made``, in their order."""
        return [number for number in requested if not any(self.due(n, [number]) for n in made)]
