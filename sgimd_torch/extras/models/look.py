"""A look at a robot from a model file before its first movement: what would make learning hopeless, and what to do.

lines = [*parts(model), *reached(pairs, space)]; each line is a sentence for the user.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.extras.models.places import UNITS, joints_above, movable, pulled
from sgimd_torch.spaces import Array, Box

NEARLY: Final = 1e-3  # share of a side of Pi by which two nearly equal thetas differ
MISSED: Final = 0.05  # rad or m, distance between a joint and its last command that counts
OFTEN: Final = 0.2  # share of movements with such a distance from which on it is told
SUNK: Final = 0.02  # m or rad; a place that moves farther while the robot holds still is told
FLAT: Final = 1e-6  # share of a side of T; a dimension in which outcomes differ by less never changes
APART: Final = 0.1  # share of T's longest side; nearly equal thetas with outcomes farther apart are told
_HOPELESS: Final = 0.1  # share of such pairs that is told
_PARTS: Final = 4  # number of parts of each side of T whose visits are counted


def parts(model: mujoco.MjModel, bodies: Sequence[int]) -> list[str]:
    """What no actuator moves, of ``bodies`` also their ball joints and a floating base."""
    mujoco.mj_forward(model, data := mujoco.MjData(model))
    acted = {*model.dof_jntid[data.moment_colind[data.actuator_moment != 0]]}  # by tendons, too
    able = {*movable(model), *(k for body in bodies for k in joints_above(model, body))}
    passive = [model.joint(k).name for k in sorted(able - acted)]
    held = [model.body(body).name for _, body in pulled(model)]
    lines = [f"without an actuator, so they move freely: {listed(passive)}"] if passive else []
    return [*lines, f"mocap bodies hold {listed(held)}; --environment.servos made frees them"] if held else lines


def missed(model: mujoco.MjModel, joints: Sequence[int], ends: Array, commands: Array) -> list[str]:
    """Joints that miss their last ``commands`` ``(n, n_joints)``; ``ends`` ``(n, nq)`` are positions after settling."""
    misses = np.abs(ends[:, model.jnt_qposadr[[*joints]]] - commands)
    medians, worst = np.median(misses, axis=0), misses.max(axis=0)
    told = [k for k in np.argsort(-medians) if (misses[:, k] > MISSED).mean() > OFTEN][:3]
    names = [
        f"{model.joint(joints[k]).name} by {medians[k]:.2g} {UNITS[int(model.jnt_type[joints[k]])]} (median), "
        f"{worst[k]:.2g} (most)"
        for k in told
    ]
    advice = "is it a contact, or too little force or time? See its range, or lengthen --environment.settle"
    return [f"settled, joints miss their commands: {'; '.join(names)}; {advice}"] if told else []


def reached(outcomes: Array, space: Box) -> list[str]:
    """How much of T movements reach, what never changes, and whether nearly equal movements end far apart.

    Args:
        outcomes: ``(n, 2, dim)``, outcomes of movements, and of others nearly equal to them.
        space: T.
    """
    flat = [space.axis(k) for k in np.flatnonzero(np.ptp(outcomes[:, 0], axis=0) < FLAT * space.sides).tolist()]
    far = np.linalg.norm(np.diff(outcomes, axis=1)[:, 0], axis=1) > APART * space.sides.max()
    cells = np.floor((outcomes[:, 0] - space.low) / space.sides * _PARTS)
    inside = cells[((cells >= 0) & (cells < _PARTS)).all(axis=1)]
    visits = np.sort(np.unique(inside, axis=0, return_counts=True)[1])[::-1]
    half = int((np.cumsum(visits) < len(inside) / 2).sum()) + 1
    line = f"{len(cells)} random movements reach {len(visits)} of {_PARTS**space.dim} equal parts of T; half end in"
    lines = [f"{line} {half}", *[f"{listed(flat)} never changes; leave it out, as in site:tip:xy"] * bool(flat)]
    return lines + [
        f"{100 * far.mean():.0f} % of nearly equal movements end far apart, so nothing can be learnt of them: move "
        "fewer --environment.joints, lengthen --environment.durations, or put away what the robot hits"
    ] * bool(far.mean() >= _HOPELESS)


def listed(names: Sequence[str], most: int = 6) -> str:
    """The first names, and how many more there are."""
    return ", ".join(names[:most]) + f" and {len(names) - most} more" * (len(names) > most)
