"""Recordings as a robot needs them: joints in rad, at another speed, without the pauses at their ends.

recordings = [paced(recording, 2.0) for recording in in_units(recordings, {"": "deg", "gripper": "0:100"}, ranges)]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.columns import Recording
from sgimd_torch.spaces import Array, Box
from sgimd_torch.units import in_rad, units_of

_TURN: Final = 7.0  # rad, a little more than a turn; a joint that reads more may be in degrees
_MOVES: Final = 0.02  # rad/s; joints that were never faster count as unmoved
_STILL: Final = 0.05  # share of the largest speed of a recording; while all joints are slower, they pause
_FEWEST: Final = 4  # steps of a movement; with a jerk all other steps are slow, as if they were pauses


def in_units(
    recordings: Sequence[Recording], units: Mapping[str, str], ranges: Box | None = None, *, unclear: str = ""
) -> list[Recording]:
    """The recordings with joints in rad.

    Args:
        recordings: recordings with joints as they were recorded.
        units: "rad", "deg" or a range such as "0:100", by name of the joint; the name "" means all other joints. A
            range maps onto the range of the joint. Commands that are no angles are left alone by "rad".
        ranges: ``(n_joints,)`` ranges of the robot's joints; None if they are unknown.
        unclear: reason why the unit of every joint must be said; "" if there is none.

    Raises:
        ValueError: a name is no joint, a unit is unknown, a range has no robot to map onto, or the unit of a joint must
            be said, because units are ``unclear`` or because the joint reads more than a turn.
    """
    joints = next((recording.joints for recording in recordings if recording.demonstration), ())
    unit_of = units_of(joints, units)
    if ranges is not None and joints and ranges.dim != len(joints):
        raise ValueError(f"the robot has {ranges.dim} joints, the recordings have {len(joints)}: {', '.join(joints)}")
    scales, shifts = np.ones(len(joints)), np.zeros(len(joints))
    for k, joint in enumerate(joints):
        unit = unit_of.get(joint, "")
        if not unit and unclear:
            raise ValueError(f"{unclear}; say all units, for example --unit deg,{joints[-1].partition('.')[0]}=0:100")
        if not unit:
            most, name = max(
                (np.abs(r.demonstration.trajectory[:, k]).max(), r.name) for r in recordings if r.demonstration
            )
            if most > (_TURN if ranges is None else max(_TURN, ranges.high[k], -ranges.low[k])):
                raise ValueError(
                    f"{joint} reads up to {most:.4g} in {name}, more than a turn in rad; say its unit: "
                    f"--unit {joint}=deg, or rad, or a range such as -100:100"
                )
        else:
            side = None if ranges is None else (float(ranges.low[k]), float(ranges.high[k]))
            scales[k], shifts[k] = in_rad(joint, unit, side)
    return [
        recording._replace(
            demonstration=recording.demonstration
            and replace(recording.demonstration, trajectory=recording.demonstration.trajectory * scales + shifts)
        )
        for recording in recordings
    ]


def paced(recording: Recording, speed: float, *, trim: bool) -> Recording:
    """The recording played ``speed`` times as fast, and without the pauses at its ends if ``trim`` is true."""
    demonstration = recording.demonstration
    if demonstration is None:
        return recording
    times, joints = demonstration.times / speed, demonstration.trajectory
    try:
        times, joints = moving(times, joints) if trim else (times, joints)
    except ValueError as error:
        return recording._replace(demonstration=None, fault=str(error))
    return recording._replace(demonstration=replace(demonstration, times=times, trajectory=joints))


def moving(times: Array, joints: Array) -> tuple[Array, Array]:
    """The recording without the pauses before and after the movement; its times start at 0.

    Raises:
        ValueError: no joint moved, or a jerk makes the other steps look like pauses.
    """
    speeds = np.abs(np.diff(joints, axis=0)).max(axis=1) / np.diff(times)
    if not speeds.max() > _MOVES:
        raise ValueError("no joint moved")
    moved = np.flatnonzero(speeds > _STILL * speeds.max())
    if len(moved) < _FEWEST:
        raise ValueError(f"it moves in {len(moved)} of {len(speeds)} steps and else hardly; has it a jerk?")
    first, last = moved[0], moved[-1] + 1
    return times[first : last + 1] - times[first], joints[first : last + 1]
