"""Movements whose simulated way touches nothing: the others are known before a real robot executes them.

touches = partial(touched_by, twin, 3.0, 1.5, 0.02); policies = Untouched(policies.low, policies.high, touches=touches)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

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
        return next((theta for theta in drawn if not self.touches(theta)), (self.low + self.high) / 2)


def touched_by(twin: MujocoRobot, speed: float, speed_back: float, clearance: float, theta: Array) -> str:
    """What touches on the simulated way of a movement and back to rest, "" if nothing does; see `first_touch`.

    ``speed`` and ``speed_back`` (rad/s) limit the commands.
    """
    start, timestep = twin.start, twin.model.opt.timestep
    there = _limited(np.vstack([start, twin.commanded(theta)]), speed * timestep)
    n = int(np.abs(there[-1] - start).max() / (speed_back * timestep)) + 2
    back = _limited(np.vstack([there[-1:], np.tile(start, (n, 1))]), speed_back * timestep)
    return twin.touches(np.concatenate([there, back]), clearance)


def _limited(commands: Array, most: float) -> Array:
    """The commands, whose changes are limited to ``most`` from row to row."""
    for before, command in pairwise(commands):
        command[:] = np.clip(command, before - most, before + most)
    return commands
