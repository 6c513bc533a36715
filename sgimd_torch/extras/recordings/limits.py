"""Limits of a robot that a recording exceeds."""

from __future__ import annotations

import numpy as np

from sgimd_torch.demonstrations.fit import slow_clock
from sgimd_torch.environments.protocol import Environment, primitive_of
from sgimd_torch.spaces import Demonstration


def beyond_limits(environment: Environment, demonstration: Demonstration) -> list[str]:
    """Sentences, one for each limit of the robot that a recording exceeds."""
    remarks, primitive = list[str](), primitive_of(environment)
    box, trajectory, outcome = primitive.ranges, demonstration.trajectory, demonstration.outcome
    if box is not None and trajectory.shape[1:] == (box.dim,):
        outside = (trajectory < box.low) | (trajectory > box.high)
        for joint in np.flatnonzero(outside.any(axis=0)):
            sample = int(outside[:, joint].argmax())
            name = box.names[joint] if box.names else f"joint {joint}"
            angle = f"{name} is {trajectory[sample, joint]:.3g} at sample {sample}"
            remarks.append(f"{angle}, outside its range [{box.low[joint]:g}, {box.high[joint]:g}]")
    remarks += slow_clock(demonstration)
    shortest, longest = primitive.durations
    lasts = float(demonstration.times[-1] - demonstration.times[0])
    if not shortest * (1 - 1e-9) <= lasts <= longest * (1 + 1e-9):
        remarks.append(f"too {'fast' if lasts < shortest else 'long'}: movements last {shortest:g} to {longest:g} s")
    if outcome.shape == (environment.outcomes.dim,) and not environment.outcomes.contains(outcome):
        remarks.append("its outcome is outside T: a learner imitates it, but never takes it as a goal")
    return remarks
