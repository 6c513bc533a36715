"""The option ``--at-once`` of a run."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import partial
from typing import TYPE_CHECKING, Any

from sgimd_torch.runs.hooks import Hook

if TYPE_CHECKING:
    from sgimd_torch.runs.plan import Plan
    from sgimd_torch.runs.run_parts import RunParts
    from sgimd_torch.session import Execute


class AtOnce(Hook):
    """Several robots.

    Args:
        at_once: number of robots that move at once; at first one, then one for each 30 movements before.
    """

    def __init__(self, *, at_once: int = 1) -> None:
        if at_once < 1:
            raise ValueError(f"at_once must be at least 1, got {at_once}")
        self.robots = at_once

    def given(self, plan: Plan) -> Mapping[str, Any]:
        """Nothing; it refuses more movements at once than the robot can make."""
        robot = plan.task.environment
        most = getattr(robot, "at_once", self.robots)  # of the driver of a single robot, for example
        if self.robots > most:
            raise ValueError(
                f"at_once must be at most {most}, the at_once of {type(robot).__name__}, got {self.robots}"
            )
        return {}

    def executing(self, parts: RunParts) -> AbstractContextManager[Execute] | None:
        """A process for each robot, unless the environment executes movements together."""
        from sgimd_torch.environments.protocol import moves_in_batches
        from sgimd_torch.runs.plan import task_of

        if self.robots == 1 or moves_in_batches(parts.environment):
            return None
        from sgimd_torch.extras.at_once.processes import in_processes

        return in_processes(partial(task_of, parts.config), parts.config.seed, self.robots)
