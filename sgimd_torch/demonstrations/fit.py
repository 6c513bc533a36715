"""How well a robot can repeat a demonstration: the misfit of eq. (6); times in another unit.

The equation is that of Nguyen & Oudeyer (2014).    misfit_of(rod, theta_d, demonstration)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment, primitive_of
from sgimd_torch.spaces import Array, Demonstration

LONG: Final = 60.0  # s, length from which on a recording with few samples may be in another unit


def misfit_of(environment: Environment, theta: Array, demonstration: Demonstration) -> float:
    """Distance d of eq. (6): root mean square of played minus recorded angles (rad) or commands, over times and joints.

    Args:
        environment: robot that plays theta; the misfit is NaN if the robot has no primitive.
        theta: ``(theta_dim,)`` policy that the correspondence gives for the recording.
        demonstration: recording of the joints.
    """
    times, trajectory = demonstration.times, demonstration.trajectory
    played = primitive_of(environment).at(theta, times - times[0])
    if played is None or played.shape != trajectory.shape:
        return float("nan")
    return float(np.sqrt(np.mean((played - trajectory) ** 2)))


def slow_clock(demonstration: Demonstration) -> list[str]:
    """A sentence if the times of a recording look like ms, us or ns: over a minute long, with 1 s between samples."""
    times = demonstration.times
    lasts, step = float(times[-1] - times[0]), float(np.median(np.diff(times)))
    if lasts < LONG or step < 1:
        return []
    unit = "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
    return [f"lasts {lasts:.2g} s, with {step:.2g} s between samples; are its times in {unit}?"]
