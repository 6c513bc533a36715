"""Recordings as a robot needs them: joints in rad, at another speed, without the pauses at their ends.

units = units_from("deg,gripper=0:100")         # as a user writes them; the name "" means all other joints
recordings = [paced(recording, 2.0) for recording in in_units(recordings, units, ranges)]
scale, shift = in_rad("gripper", "0:100", (0.0, 1.2))       # rad = scale * value + shift
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from math import pi
from typing import Any, Final

import numpy as np

from sgimd_torch.extras.recordings.columns import Recording
from sgimd_torch.spaces import Array, Box

MODES: Final = {"degrees": "deg", "range_0_100": "0:100", "range_m100_100": "-100:100"}  # by LeRobot's MotorNormMode
_RANGE: Final = re.compile(r"(-?\d+\.?\d*):(-?\d+\.?\d*)", re.ASCII)
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


def unwrapped(recordings: Sequence[Recording], names: Sequence[str]) -> list[Recording]:
    """The recordings (rad) with the jumps by a turn of the joints ``names`` taken away.

    Raises:
        ValueError: a name is no joint.
    """
    joints = next((recording.joints for recording in recordings if recording.demonstration), ())
    columns = [joints.index(joint) for joint in units_of(joints, dict.fromkeys(names, "rad"))]
    joined = list[Recording]()
    for recording in recordings:
        if shown := recording.demonstration:
            trajectory = shown.trajectory.copy()
            trajectory[:, columns] = np.unwrap(trajectory[:, columns], axis=0)
            recording = recording._replace(demonstration=replace(shown, trajectory=trajectory))
        joined.append(recording)
    return joined


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


def units_from(text: str) -> dict[str, str]:
    """Units by name of the joint, of a text such as "deg,gripper=0:100"; the name of a unit alone is ""."""
    parts = [part.rpartition("=") for part in text.split(",") if part.strip()]
    return {joint.strip(): unit.strip() for joint, _, unit in parts}


def units_of(joints: Sequence[str], units: Mapping[str, str]) -> dict[str, str]:
    """The unit of each joint that has one; ``units`` are as of ``units_from``, where gripper means gripper.pos, too.

    Raises:
        ValueError: a name is no joint.
    """
    unit_of = dict[str, str]()
    for key, unit in sorted(units.items()):  # "" first
        named = [joint for joint in joints if key in ("", joint, joint.partition(".")[0])]
        if joints and not named:
            near = " or ".join(get_close_matches(key, joints, 3, 0.0))
            raise ValueError(f"unit {key}={unit}: no joint is named {key}; did you mean {near}?")
        unit_of |= dict.fromkeys(named, unit)
    return unit_of


def motor_unit(buses: Sequence[Any], motor: str) -> str:
    """The unit that this motor of one of the ``buses`` of LeRobot reads, "" if it is unknown."""
    tables = [bus.motors for bus in buses if isinstance(getattr(bus, "motors", None), Mapping)]
    modes = [table[motor].norm_mode for table in tables if hasattr(table.get(motor), "norm_mode")]
    return MODES.get(modes[0].value, "") if modes else ""


def scales_of(joints: Sequence[str], units: str, ranges: Box, reads: Mapping[str, str]) -> tuple[Array, Array]:
    """``(n_joints,)`` scales and shifts that make rad of what joints read; see `in_rad`.

    Args:
        joints: names of the joints.
        units: units as a user writes them, one for each joint.
        ranges: ``(n_joints,)`` ranges of the joints (rad).
        reads: known units by motor, one for each joint, in their order; "" if a unit is not known.

    Raises:
        ValueError: a joint has no unit, or another one than its motor.
    """
    unit_of = units_of(joints, units_from(units))
    if lacking := [joint for joint in joints if joint not in unit_of]:
        raise ValueError(f"units has none for {', '.join(lacking)}; deg,gripper=0:100 is deg for all but gripper")
    for joint, (motor, unit) in zip(joints, reads.items(), strict=True):
        if unit_of[joint] in ("deg", "rad") and unit not in ("", unit_of[joint]):
            raise ValueError(f"{motor} reads {unit}, not {unit_of[joint]}: units {joint}={unit}")
    sides = zip(joints, ranges.low.tolist(), ranges.high.tolist(), strict=True)
    scales, shifts = np.array([in_rad(name, unit_of[name], (low, high)) for name, low, high in sides]).T
    return scales, shifts


def in_rad(joint: str, unit: str, side: tuple[float, float] | None) -> tuple[float, float]:
    """Scale and shift that make rad of a joint's values: rad = scale * value + shift.

    Args:
        joint: name of the joint, for messages.
        unit: "rad", "deg", or two values of the joint at the ends of its range, such as "0:100" or "90:-110".
        side: lowest and highest position (rad) of the joint; None if they are unknown.

    Raises:
        ValueError: the unit is unknown, or a range has no joint to map onto.
    """
    match = _RANGE.fullmatch(unit)
    first, last = map(float, match.groups()) if match else (0.0, 0.0)
    if first == last:
        if unit not in ("rad", "deg"):
            raise ValueError(f"the unit of {joint} must be rad, deg or a range such as -100:100, got {unit}")
        return (pi / 180 if unit == "deg" else 1.0), 0.0
    if side is None:
        raise ValueError(f"{joint}={unit} maps onto the range of a joint of a robot; name it by --environment")
    scale = (side[1] - side[0]) / (last - first)
    return scale, side[0] - scale * first
