"""Where learners live: the fishing rod of the paper and planar arms, with goals to be judged by and somebody who shows.

Benchmark and demonstrations of the rod are shipped files. Those of an arm, whose geometry is known exactly, are made
here, the same for every seed.    arm = PlanarArm(ARMS["planar-arm-7"]); arm_benchmark(arm); arm_demonstrations(arm)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, tile_goals
from sgimd_torch.spaces import Array, Demonstration, stream

ROD: Final = "fishing-rod"
ARMS: Final = {"planar-arm-7": 7, "planar-arm-50": 50}  # how many joints
ENVIRONMENTS: Final = (ROD, *ARMS)
SIDE: Final = 0.1  # m, of a benchmark tile; it leaves 311 goals in the disc of radius 1 m that these arms reach
SHOWN: Final = 127  # demonstrations, as many as each shipped demonstrator recorded
SAMPLES: Final = 5  # of each of them


def arm_benchmark(arm: PlanarArm) -> Benchmark:
    """One random goal in each tile of T, without those that the arm cannot reach; always the same ones."""
    box = arm.outcomes
    middles = [np.arange(low + SIDE / 2, high, SIDE) for low, high in zip(box.low, box.high, strict=True)]
    tiles = np.stack(np.meshgrid(*middles), axis=-1).reshape(-1, box.dim)
    goals = tile_goals(tiles, box, SIDE, stream(0, "goals for an arm"), at_least=1)
    return Benchmark(type(arm).__name__, goals[arm.reachable(goals)], SIDE)


def arm_demonstrations(arm: PlanarArm) -> list[Demonstration]:
    """An arm without context, led from its rest to structured postures, all bends equal, whose ends spread evenly."""
    shares = (np.arange(SHOWN) + 0.5) / SHOWN  # of the area within reach: a sunflower's spiral
    radii = np.sqrt(arm.min_radius**2 + shares * (arm.length**2 - arm.min_radius**2))
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(SHOWN)
    ends = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return [_led_to(arm, end) for end in ends]


def _led_to(arm: PlanarArm, end: Array) -> Demonstration:
    context = np.empty(0)
    theta = arm.solve(context, end)
    times = np.linspace(0.0, 1.0, SAMPLES)
    outcome = arm.execute(context, theta, stream(0, "demonstrations by an arm"))
    return Demonstration(context, times, np.outer(times, arm.angles(theta)), outcome)
