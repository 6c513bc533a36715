"""Planar arms as tasks. Benchmark goals and demonstrations do not depend on the seed of a run."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, grid_over, tile_goals
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.tasks import Task

SIDE: Final = 0.1  # m, side of a benchmark tile; the disc of radius 1 m that an arm reaches has 311 goals
N_DEMONSTRATIONS: Final = 127  # number of an arm's demonstrations, equal to that of the rod's demonstrators
N_SAMPLES: Final = 5  # number of samples in the trajectory of an arm's demonstration


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
    centres = grid_over(box, np.rint(box.sides / SIDE).astype(int))
    goals = tile_goals(np.tile(centres, (2, 1)), box, SIDE, stream(0, "goals for an arm"))
    return Benchmark(type(arm).__name__, goals[arm.reachable(goals)], SIDE)


def arm_demonstrations(arm: PlanarArm) -> list[Demonstration]:
    """Movements from rest to outcomes spread evenly over the reachable disc; all joints but the first bend equally."""
    shares = (np.arange(N_DEMONSTRATIONS) + 0.5) / N_DEMONSTRATIONS  # of the disc's area; they make a sunflower spiral
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(N_DEMONSTRATIONS)
    no_context, times, demonstrations = np.empty(0), np.linspace(0.0, 1.0, N_SAMPLES), []
    for end in np.sqrt(shares)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1):
        theta = arm.solve(no_context, end)
        outcome = arm.execute(no_context, theta, stream(0, "demonstrations by an arm"))
        demonstrations.append(Demonstration(no_context, times, np.outer(times, arm.angles(theta)), outcome))
    return demonstrations
