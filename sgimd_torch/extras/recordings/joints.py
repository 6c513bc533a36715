"""Units of joints as a user writes them, such as "deg,gripper=0:100", and what they are in rad.

for joint, unit in units_of(("elbow", "gripper"), units_from("deg,gripper=0:100")).items(): ...
scale, shift = in_rad("gripper", "0:100", (0.0, 1.2))       # rad = scale * value + shift
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from math import pi
from typing import Final

_RANGE: Final = re.compile(r"(-?\d+\.?\d*):(-?\d+\.?\d*)", re.ASCII)


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
