"""The fishing rod as a task; in a file of its own, so that runs of other robots do not load it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sgimd_torch.calls import with_keywords_of
from sgimd_torch.demonstrations import SHIPPED as SHIPPED_DEMONSTRATIONS
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import SHIPPED as SHIPPED_BENCHMARK
from sgimd_torch.spaces import Box, Demonstration
from sgimd_torch.tasks import Task


@with_keywords_of(FishingRod, "noise", "max_wind")
def fishing_rod(*, task_space: float = 1.0, threads: int = 1, **physics: Any) -> Task:
    """Arm with a fishing rod, in MuJoCo: the paper's task.

    Demonstrations and benchmark goals are those of the paper's rod without wind, in the context 0 of a rod in the wind.

    Args:
        task_space: half side (m) of T, a square; 100 in the paper's large-space experiment.
        threads: number of threads of an evaluation; results do not depend on this number.

    Raises:
        ValueError: a number is out of its range.
    """
    if not task_space > 0:
        raise ValueError(f"task_space must be above 0, got {task_space}; it is a length in metres")
    space = Box.cube(-task_space, task_space, 2, names=("x", "y"), unit="m")
    rod = FishingRod(outcomes=space, threads=threads, **physics)

    def without_wind() -> list[Demonstration]:
        return [replace(demonstration, context=np.zeros(rod.contexts.dim)) for demonstration in load_demonstrations()]

    demonstrations = without_wind if rod.contexts.dim else SHIPPED_DEMONSTRATIONS
    return Task(rod, SHIPPED_BENCHMARK, demonstrations, rod.primitive.correspondence)
