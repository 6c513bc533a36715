"""The fishing rod as a task, with the shipped benchmark and demonstrations."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations import SHIPPED as SHIPPED_DEMONSTRATIONS
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import SHIPPED as SHIPPED_BENCHMARK
from sgimd_torch.options.signature import with_keywords_of
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Box, Demonstration

LARGEST: Final = 1e6  # m, largest half side of T


@with_keywords_of(FishingRod, "noise", "max_wind", "line")
def fishing_rod(*, task_space: float = 1.0, threads: int = 1, **physics: Any) -> Task:
    """Arm with a fishing rod, in MuJoCo: the paper's task.

    Demonstrations and benchmark goals are those of the paper's rod without wind, whatever the options are. For a rod
    with contexts, demonstrations and goals belong to the context 0.

    Args:
        task_space: half side (m) of T, a square; 100 in the paper's large-space experiment.
        threads: number of threads of an evaluation; results do not depend on this number.

    Raises:
        ValueError: a number is out of its range.
    """
    if not 0 < task_space <= LARGEST:
        raise ValueError(
            f"task_space must be above 0 and at most {LARGEST:g}, got {task_space}; it is a length in metres"
        )
    space = Box.cube(-task_space, task_space, 2, names=("x", "y"), unit="m")
    rod = FishingRod(outcomes=space, threads=threads, **physics)
    return Task(
        rod,
        SHIPPED_BENCHMARK,
        partial(_in_context_zero, rod.contexts.dim) if rod.contexts.dim else SHIPPED_DEMONSTRATIONS,
        rod.primitive.correspondence,
    )


def _in_context_zero(context_dim: int) -> list[Demonstration]:
    """The shipped demonstrations, as demonstrations in the context 0 of a rod with contexts."""
    return [replace(shown, context=np.zeros(context_dim)) for shown in load_demonstrations()]
