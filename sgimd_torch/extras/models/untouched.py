"""Movements whose simulated way touches nothing: the others are known before a real robot executes them.

touches = partial(touched_by, twin, 3.0, 1.5, 0.02); policies = Untouched(policies.low, policies.high, touches=touches)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.spaces import Array, Box

TRIES: Final = 100  # number of random movements that are tried for one that touches nothing


@dataclass(frozen=True, eq=False)
class Untouched(Box):
    """Pi, whose random movements touch nothing, as far as ``TRIES`` find them."""

    touches: Callable[[Array], str] = field(kw_only=True)

    def sample(self, rng: np.random.Generator) -> Array:
        """``(dim,)``, uniform among the movements that touch nothing."""
        drawn = (super(Untouched, self).sample(rng) for _ in range(TRIES))
        return next(filter(self.allows, drawn), (self.low + self.high) / 2)

    def allows(self, point: Array) -> bool:
        """Whether a movement touches nothing."""
        return not self.touches(point)


def touched_by(twin: MujocoRobot, speed: float, speed_back: float, clearance: float, theta: Array) -> str:
    """What touches on the simulated way of a movement and back to rest, "" if nothing does; see `first_touch`.

    ``speed`` and ``speed_back`` (rad/s) limit the commands.
    """
    start = twin.start
    there = _limited(np.vstack([start, twin.commanded(theta)]), speed * twin.model.opt.timestep)
    return twin.touches(np.concatenate([there, _way(twin, speed_back, there[-1], start)]), clearance)


def way_to_start(twin: MujocoRobot, speed: float, clearance: float, joints: Array) -> Array:
    """Commands ``(n_steps, n_joints)`` from ``joints`` (rad) to the start: all joints at once, or one of them first
    where nothing touches that is not near already.

    Raises:
        SimulationError: something touches on each of these ways.
    """
    touched = ""
    for first in [np.ones(len(joints), bool), *np.eye(len(joints), dtype=bool)]:
        via = np.where(first, twin.start, joints)
        way = np.concatenate([_way(twin, speed, joints, via), _way(twin, speed, via, twin.start)])
        if not (found := twin.touches(way, clearance, joints)):
            return way
        touched = touched or found
    raise SimulationError(f"on the way to rest {touched} would touch; lead the arm elsewhere by hand; torque is off")


def _way(twin: MujocoRobot, speed: float, here: Array, there: Array) -> Array:
    """Commands ``(n_steps, n_joints)`` from ``here`` to ``there`` at ``speed`` (rad/s), one for each timestep."""
    most = speed * twin.model.opt.timestep
    n = int(np.abs(there - here).max() / most) + 2
    return _limited(np.vstack([here, np.tile(there, (n, 1))]), most)


def _limited(commands: Array, most: float) -> Array:
    """The commands, whose changes are limited to ``most`` from row to row."""
    for before, command in pairwise(commands):
        command[:] = np.clip(command, before - most, before + most)
    return commands
