"""Arms, a swimmer and toys as tasks. Benchmark goals and demonstrations do not depend on the seed of a run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.environments import objects, toys
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.toys import Toy
from sgimd_torch.evaluation import SHIPPED as SHIPPED_BENCHMARK
from sgimd_torch.evaluation import Benchmark, tile_goals
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Array, Box, Demonstration, stream

DATA: Final = SHIPPED_BENCHMARK.parent
SIDE: Final = 0.1  # m, side of a benchmark tile; the disc of radius 1 m that an arm reaches has 311 goals
SHOWN: Final = 127  # number of demonstrations, equal to that of the rod's demonstrators
REACHING: Final = 20_000  # number of uniform movements by which the reachable part of T is found
SAMPLES: Final = 5  # number of samples in the trajectory of an arm's demonstration


def planar_arm(*, n_joints: int) -> Task:
    """An arm without noise; its outcome is the position of its end."""
    arm = PlanarArm(n_joints)
    return Task(arm, partial(arm_benchmark, arm), partial(arm_demonstrations, arm))


planar_arm_7 = partial(planar_arm, n_joints=7)
"""Planar arm with 7 joints, no noise."""
planar_arm_50 = partial(planar_arm, n_joints=50)
"""Planar arm with 50 joints, no noise."""


def swimmer() -> Task:
    """gymnasium's Swimmer-v5: three links and two motors; a demonstration is a sequence of torques."""
    from sgimd_torch.environments.swimmer import Swimmer  # gymnasium is loaded only when it is needed

    return Task(Swimmer(), DATA / "swimmer_benchmark.npz", DATA / "swimmer_demonstrations.npz")


def half_reached() -> Task:
    """Planar arm with 7 joints that reaches less than half of T."""
    arm = PlanarArm(7, noise=0.02, outcomes=Box(np.array([-1.0, -1.0]), np.array([3.0, 1.0]), ("x", "y"), "m"))
    return Task(arm, partial(arm_benchmark, arm))


def arm_benchmark(arm: PlanarArm) -> Benchmark:
    """One random goal in each tile of T, if the arm can reach this goal; every run has the same goals."""
    box = arm.outcomes
    goals = tile_goals(np.tile(_grid(box, SIDE), (2, 1)), box, SIDE, stream(0, "goals for an arm"))
    return Benchmark(type(arm).__name__, goals[arm.reachable(goals)], SIDE)


def arm_demonstrations(arm: PlanarArm) -> list[Demonstration]:
    """Movements from rest to outcomes spread evenly over the reachable disc; all joints but the first bend equally."""
    shares = (np.arange(SHOWN) + 0.5) / SHOWN  # shares of the disc's area, which make a sunflower spiral
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(SHOWN)
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


def toy(make: Callable[[], Toy], side: float, *, taught: bool) -> Task:
    """Task of a toy robot, with one goal in each tile, ``side`` wide (unit of T), and a teacher if it is ``taught``."""
    robot = make()
    shown = partial(toy_demonstrations, robot) if taught else None
    return Task(robot, partial(toy_benchmark, robot, side), shown, last_row if taught else None)


toss = partial(toy, toys.toss, 0.4, taught=True)
"""Ball that the robot throws in the wind; the wind is the context."""
crawler = partial(toy, toys.crawler, 0.1, taught=False)
"""Crawler with four legs; the phases of its legs are periodic parameters."""
two_elbows = partial(toy, toys.two_elbows, 0.1, taught=False)
"""Arm that reaches each place by two separate families of postures."""
spatial_arm = partial(toy, toys.spatial_arm, 25.0, taught=False)
"""Arm with six joints in space; its outcome is a position of three dimensions, in cm."""
puck = partial(toy, objects.puck, 0.1, taught=False)
"""Puck that the robot has to hit; the place of the puck is the context."""
fetch = partial(toy, objects.fetch, 0.1, taught=False)
"""Ball that the robot has to grasp."""


def toy_benchmark(robot: Toy, side: float) -> Benchmark:
    """One random goal in each tile that uniform movements reach in the middle context; all runs have the same goals."""
    rng = stream(0, "goals for a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    context = (robot.contexts.low + robot.contexts.high) / 2
    reached = robot.effect(np.tile(context, (REACHING, 1)), thetas)
    return Benchmark(type(robot).__name__, tile_goals(reached, robot.outcomes, side, rng), side)


def last_row(times: Array, trajectory: Array) -> Array:
    """The correspondence of a toy: each sample of its recordings is theta itself."""
    return trajectory[-1]


def toy_demonstrations(robot: Toy) -> list[Demonstration]:
    """Uniform movements with outcomes in T, in contexts all over C; every run has the same demonstrations."""
    rng = stream(0, "demonstrations by a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    found = []
    for place in rng.integers(REACHING, size=SHOWN):
        context = robot.contexts.sample(rng)
        outcomes = robot.effect(np.tile(context, (REACHING, 1)), thetas)
        if robot.outcomes.contains(outcomes[place]):
            found.append(Demonstration(context, np.array([0.0, 1.0]), np.tile(thetas[place], (2, 1)), outcomes[place]))
    return found
