"""Toy robots as tasks. Their goals and demonstrations are made here and are equal for every seed."""

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

SHOWN: Final = 127  # demonstrations, as many as each shipped demonstrator recorded
REACHING: Final = 20_000  # uniform movements that find the outcomes a toy can reach


def toy(make: Callable[[], Toy], side: float, *, taught: bool) -> Task:
    """A toy robot. Its goals lie on tiles of this ``side``, in the unit of T. If it is ``taught``, it has a teacher."""
    robot = make()
    shown = partial(toy_demonstrations, robot) if taught else None
    return Task(robot, partial(toy_benchmark, robot, side), shown, last_row if taught else None)


toss = partial(toy, toys.toss, 0.4, taught=True)
"""A ball thrown in the wind; the wind is the context."""
crawler = partial(toy, toys.crawler, 0.1, taught=False)
"""Four legs, whose phases are periodic parameters."""
two_elbows = partial(toy, toys.two_elbows, 0.1, taught=False)
"""An arm with two separate families of postures."""
spatial_arm = partial(toy, toys.spatial_arm, 25.0, taught=False)
"""An arm with six joints and three outcomes, in cm."""
puck = partial(toy, objects.puck, 0.1, taught=False)
"""A puck that has to be hit; the place of the puck is the context."""
fetch = partial(toy, objects.fetch, 0.1, taught=False)
"""A ball that has to be grasped."""


def toy_benchmark(robot: Toy, side: float) -> Benchmark:
    """One random goal in each tile that uniform movements reach in the middle of C; equal in every run."""
    rng = stream(0, "goals for a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    context = (robot.contexts.low + robot.contexts.high) / 2
    reached = robot.effect(np.tile(context, (REACHING, 1)), thetas)
    return Benchmark(type(robot).__name__, tile_goals(reached, robot.outcomes, side, rng), side)


def last_row(times: Array, trajectory: Array) -> Array:
    """The correspondence of a toy: each row of its demonstrations is theta itself."""
    return trajectory[-1]


def toy_demonstrations(robot: Toy) -> list[Demonstration]:
    """Uniform movements with different outcomes, in contexts all over C; equal in every run."""
    rng = stream(0, "demonstrations by a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((REACHING, robot.policies.dim))
    found = []
    for place in rng.integers(REACHING, size=SHOWN):
        context = robot.contexts.sample(rng)
        outcomes = robot.effect(np.tile(context, (REACHING, 1)), thetas)
        if robot.outcomes.contains(outcomes[place]):
            found.append(Demonstration(context, np.array([0.0, 1.0]), np.tile(thetas[place], (2, 1)), outcomes[place]))
    return found
