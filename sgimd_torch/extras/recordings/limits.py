"""Limits of a robot that a recording exceeds, and joints whose readings are not plausible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.fit import slow_clock
from sgimd_torch.environments.protocol import Environment, primitive_of
from sgimd_torch.spaces import Demonstration

MOVES: Final = 0.1  # rad, way of a joint that moves
STUCK: Final = 1e-6  # rad, way of a joint that never moves
TURN: Final = 2 * np.pi  # rad
NEARLY: Final = 0.5  # rad, difference from a turn of a jump that counts as a turn


def implausible(demonstration: Demonstration, joints: Sequence[str]) -> list[str]:
    """Sentences, one for each of the ``joints`` (rad) that never moves while others do, or jumps by a turn."""
    trajectory, remarks = demonstration.trajectory, list[str]()
    ways, jumps = np.ptp(trajectory, axis=0), np.abs(np.diff(trajectory, axis=0)).max(axis=0)
    for joint, way, jump in zip(joints, ways.tolist(), jumps.tolist(), strict=True):
        if way <= STUCK and ways.max() > MOVES:
            remarks.append(f"{joint} never moves while others do: was its encoder read?")
        if abs(jump - TURN) < NEARLY:
            remarks.append(f"{joint} jumps by a turn: --unwrap {joint} joins it")
    return remarks


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
