"""Planar arms as tasks. Benchmark goals and demonstrations do not depend on the seed of a run."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, tile_goals
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Array, Box, Demonstration, stream

SIDE: Final = 0.1  # m, side of a benchmark tile; the disc of radius 1 m that an arm reaches has 311 goals
N_DEMONSTRATIONS: Final = 127  # number of demonstrations, equal to that of the rod's demonstrators
SAMPLES: Final = 5  # number of samples in the trajectory of an arm's demonstration


def planar_arm(*, n_joints: int) -> Task:
    """An arm without noise; its outcome is the position of its end."""
    arm = PlanarArm(n_joints)
    return Task(arm, partial(arm_benchmark, arm), partial(arm_demonstrations, arm))


planar_arm_7 = partial(planar_arm, n_joints=7)
"""Planar arm with 7 joints, no noise."""
planar_arm_50 = partial(planar_arm, n_joints=50)
"""Planar arm with 50 joints, no noise."""


def arm_benchmark(arm: PlanarArm) -> Benchmark:
    """One random goal in each tile of T, if the arm can reach this goal; every run has the same goals."""
    box = arm.outcomes
    goals = tile_goals(np.tile(_grid(box, SIDE), (2, 1)), box, SIDE, stream(0, "goals for an arm"))
    return Benchmark(type(arm).__name__, goals[arm.reachable(goals)], SIDE)


def arm_demonstrations(arm: PlanarArm) -> list[Demonstration]:
    """Movements from rest to outcomes spread evenly over the reachable disc; all joints but the first bend equally."""
    shares = (
        np.arange(N_DEMONSTRATIONS) + 0.5
    ) / N_DEMONSTRATIONS  # shares of the disc's area, which make a sunflower spiral
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(N_DEMONSTRATIONS)
    ends = np.sqrt(shares)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return [_led_to(arm, end) for end in ends]


def _grid(box: Box, side: float) -> Array:
    """``(n, dim)`` centres of tiles."""
    middles = [np.arange(low + side / 2, high, side) for low, high in zip(box.low, box.high, strict=True)]
    return np.stack(np.meshgrid(*middles), axis=-1).reshape(-1, box.dim)


def _led_to(arm: PlanarArm, end: Array) -> Demonstration:
    context = np.empty(0)
    theta = arm.solve(context, end)
    times = np.linspace(0.0, 1.0, SAMPLES)
    outcome = arm.execute(context, theta, stream(0, "demonstrations by an arm"))
    return Demonstration(context, times, np.outer(times, arm.angles(theta)), outcome)
