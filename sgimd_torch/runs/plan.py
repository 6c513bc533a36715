"""What a run is built from: its robot and its demonstrations, made from its settings when they are needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from sgimd_torch.calls import call_checked
from sgimd_torch.options.config import Config
from sgimd_torch.runs.hooks import Hook
from sgimd_torch.spaces import Demonstration
from sgimd_torch.tasks import Task


@dataclass
class Plan:
    """What a run is built from: its settings, and its robot and demonstrations, which are made when they are needed.

    Attributes:
        record: record of the run, if it is on disk.
        notes: messages for the user.
        data: checksums of the files that were read.
    """

    config: Config
    record: Path | None = None
    notes: list[str] = field(default_factory=list)
    data: dict[str, str | None] = field(default_factory=lambda: {"demonstrations_crc32": None})

    @cached_property
    def hooks(self) -> list[Hook]:
        """The hooks of all rooms."""
        return [Hook.of(self.config.constructor(name)) for name in self.config.chosen if name.startswith("hook ")]

    @cached_property
    def task(self) -> Task:
        """The environment, with its goals and demonstrations. ValueError: it cannot be built, or is none."""
        made = call_checked(f"environment {self.config['environment']}", self.config.constructor("environment"))
        task = made if isinstance(made, Task) else Task(made)
        for hook in self.hooks:
            task = replace(task, environment=hook.wrapped(task.environment))
        return task

    @cached_property
    def demonstrations(self) -> Sequence[Demonstration]:
        """Demonstrations of the teachers."""
        from sgimd_torch.tasks.taught import demonstrations_of  # not for learners alone

        read, notes, self.data["demonstrations_crc32"] = demonstrations_of(self.task, self.config.demonstrations)
        self.notes += notes
        return read


def task_of(config: Config) -> Task:
    """The environment of a run, with its goals and demonstrations; see `Plan.task`."""
    return Plan(config).task
