"""A look at a robot from a model file before its first movement: what would make learning hopeless, and what to do.

lines = look(robot, still, pairs); each line is a sentence for the user.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.environments.mujoco_model import UNITS, joint_of, pulled
from sgimd_torch.environments.mujoco_posture import movable, touching
from sgimd_torch.spaces import Array, Box

NEARLY: Final = 1e-3  # share of a side of Pi by which two nearly equal thetas differ
MISSED: Final = 0.05  # rad or m, distance between a joint and its last command that counts
OFTEN: Final = 0.2  # share of movements with such a distance from which on it is told
SUNK: Final = 0.02  # m or rad; a place that moves farther while the robot holds still is told
APART: Final = 0.1  # share of T's longest side; nearly equal thetas with outcomes farther apart are told
_HOPELESS: Final = 0.1  # share of such pairs that is told
_PARTS: Final = 4  # number of parts of each side of T whose visits are counted


@dataclass(frozen=True, eq=False)
class Seen:
    """What the look is at.

    Args:
        model: model of the robot.
        actuators: actuators of the commands.
        positions: whether commands are positions of joints.
        bodies: bodies that the commands move.
        still: data at the end of a movement that holds the start.
        sunk: distance (m or rad) of the measured places from the start to that end.
        ends: ``(n, nq)`` positions at the ends of random movements.
        commands: ``(n, n_commands)`` last commands of these movements.
        outcomes: ``(n, 2, outcome_dim)`` outcomes of random movements, each with those of a nearly equal theta.
        space: T.
    """

    model: mujoco.MjModel
    actuators: Sequence[int]
    positions: bool
    bodies: Sequence[int]
    still: mujoco.MjData
    sunk: float
    ends: Array
    commands: Array
    outcomes: Array
    space: Box


def look(seen: Seen) -> list[str]:
    """Sentences on what a user should know before the first movement."""
    if not len(seen.ends):
        return [*_parts(seen), "every random movement diverges: a shorter timestep, or softer actuators, in the model"]
    return [*_parts(seen), *_held(seen), *(_missed(seen) if seen.positions else []), *_reached(seen)]


def _parts(seen: Seen) -> list[str]:
    model = seen.model
    acted = {joint_of(model, k) for k in range(model.nu)}
    passive = [model.joint(k).name for k in movable(model) if k not in acted]
    lines = [f"without an actuator, so they move freely: {_listed(passive)}"] if passive else []
    if held := [model.body(body).name for _, body in pulled(model)]:
        lines.append(
            f"mocap bodies hold {_listed(held)} where it begins; --environment.servos made moves the joints instead"
        )
    return lines


def _held(seen: Seen) -> list[str]:
    pairs, lines = touching(seen.model, seen.still, seen.bodies), list[str]()
    if pairs:
        names = [" and ".join(seen.model.body(k).name for k in pair) for pair in sorted(pairs)]
        lines.append(f"holding still, the robot touches itself: {_listed(names)}; give another --environment.keyframe")
    if seen.sunk > SUNK:
        advice = "" if seen.positions else "; its commands are forces: --environment.servos made holds it"
        lines.append(f"while it holds still, the measured place moves by {seen.space.amount(seen.sunk, '.2g')}{advice}")
    return lines


def _missed(seen: Seen) -> list[str]:
    joints = [joint_of(seen.model, k) for k in seen.actuators]
    misses = np.abs(seen.ends[:, seen.model.jnt_qposadr[joints]] - seen.commands)
    medians, worst = np.median(misses, axis=0), misses.max(axis=0)
    told = [k for k in np.argsort(-medians) if (misses[:, k] > MISSED).mean() > OFTEN][:3]
    names = [
        f"{seen.model.joint(joints[k]).name} by {medians[k]:.2g} {UNITS[int(seen.model.jnt_type[joints[k]])]} (median), "
        f"{worst[k]:.2g} (most)"
        for k in told
    ]
    advice = "a contact, a limit of force, or too little time: see its ranges, or lengthen --environment.settle"
    return [f"joints miss their last commands: {'; '.join(names)}: {advice}"] if told else []


def _reached(seen: Seen) -> list[str]:
    space, n = seen.space, len(seen.outcomes)
    far = np.linalg.norm(np.diff(seen.outcomes, axis=1)[:, 0], axis=1) > APART * space.sides.max()
    cells = np.floor((seen.outcomes[:, 0] - space.low) / space.sides * _PARTS)
    inside = cells[((cells >= 0) & (cells < _PARTS)).all(axis=1)]
    visits = np.sort(np.unique(inside, axis=0, return_counts=True)[1])[::-1]
    half = int(np.searchsorted(np.cumsum(visits), len(inside) / 2)) + 1 if len(inside) else 0
    lines = [
        f"{n} random movements reach {len(visits)} of {_PARTS**space.dim} equal parts of T; half of them end in {half}"
    ]
    if far.mean() >= _HOPELESS:
        lines.append(
            f"{100 * far.mean():.0f} % of nearly equal movements end far apart, so nothing can be learnt of them: move "
            "fewer --environment.joints, longer --environment.durations, or out of reach of what the robot hits"
        )
    return lines


def _listed(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + f" and {len(names) - most} more" * (len(names) > most)
