"""How well a robot can repeat a demonstration: the misfit of eq. (6), and the limits that the demonstration exceeds.

The equation is that of Nguyen & Oudeyer (2014).    misfit_of(rod, theta_d, shown); beyond_limits(rod, shown)
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.environments.protocol import Environment, primitive_of
from sgimd_torch.spaces import Array, Demonstration


def misfit_of(environment: Environment, theta: Array, shown: Demonstration) -> float:
    """Distance d of eq. (6): root mean square of played minus recorded angles (rad) or commands, over times and joints.

    Args:
        environment: robot that plays theta; the misfit is NaN if the robot has no primitive.
        theta: ``(theta_dim,)`` policy that the correspondence gives for the recording.
        shown: demonstration with the recording.
    """
    played = primitive_of(environment).at(theta, shown.times - shown.times[0])
    if played is None or played.shape != shown.trajectory.shape:
        return float("nan")
    return float(np.sqrt(np.mean((played - shown.trajectory) ** 2)))


def beyond_limits(environment: Environment, shown: Demonstration) -> list[str]:
    """Sentences, one for each limit of the robot that a recording exceeds."""
    remarks, primitive = list[str](), primitive_of(environment)
    box = primitive.ranges
    if box is not None and shown.trajectory.ndim == 2 and shown.trajectory.shape[1] == box.dim:
        outside = (shown.trajectory < box.low) | (shown.trajectory > box.high)
        for joint in np.flatnonzero(outside.any(axis=0)):
            sample = int(outside[:, joint].argmax())
            name = box.names[joint] if box.names else f"joint {joint}"
            found = f"{name} is {shown.trajectory[sample, joint]:.3g} at sample {sample}"
            remarks.append(f"{found}, outside its range [{box.low[joint]:g}, {box.high[joint]:g}]")
    shortest, longest = primitive.durations
    lasts = float(shown.times[-1] - shown.times[0])
    if not shortest * (1 - 1e-9) <= lasts <= longest * (1 + 1e-9):
        remarks.append(f"too {'fast' if lasts < shortest else 'long'}: movements last {shortest:g} to {longest:g} s")
    if shown.outcome.shape == (environment.outcomes.dim,) and not environment.outcomes.contains(shown.outcome):
        remarks.append("its outcome is outside T: a learner imitates it, but never takes it as a goal")
    return remarks
