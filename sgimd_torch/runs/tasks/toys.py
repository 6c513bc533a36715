"""Toys as tasks. Benchmark goals and demonstrations do not depend on the seed of a run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.environments import objects, toys
from sgimd_torch.environments.toys import Toy
from sgimd_torch.evaluation import Benchmark, tile_goals
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Array, Demonstration, stream

SHOWN: Final = 127  # largest number of demonstrations, equal to that of the rod's demonstrators
REACHING: Final = 20_000  # number of uniform movements by which the reachable part of T is found


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
