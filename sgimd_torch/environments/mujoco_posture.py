"""The posture in which the movements of a robot begin: within all ranges, and without contacts of the robot with itself.

qpos = nearest_posture(model, qpos, joints, pairs) is found once; a run keeps it.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np
from scipy.optimize import minimize

from sgimd_torch.environments.mujoco_model import UNITS
from sgimd_torch.spaces import Array, stream

NEAR: Final = 0.004  # m, distance of two geoms that counts as a contact while a posture is looked for
_WEIGHTS: Final = (1e3, 1e5, 1e7)  # 1/m^2, growing weight of contacts against the way (rad or m) to a posture
_RESTARTS: Final = 8  # number of random postures from which the posture is looked for, too


def movable(model: mujoco.MjModel) -> list[int]:
    """Joints that turn or slide."""
    return [k for k in range(model.njnt) if int(model.jnt_type[k]) in UNITS]


def outside_ranges(model: mujoco.MjModel, qpos: Array) -> list[int]:
    """Joints whose position lies outside their range."""
    within = _clipped(model, qpos)
    return [k for k in movable(model) if abs(within[a := model.jnt_qposadr[k]] - qpos[a]) > 1e-6]


def touching(model: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[int]) -> set[tuple[int, int]]:
    """Pairs of ``bodies`` that touch each other in the state of ``data``, the lower number first."""
    pairs = (sorted(int(model.geom_bodyid[geom]) for geom in contact.geom) for contact in _contacts(data))
    return {(one, other) for one, other in pairs if {one, other} <= {*bodies}}


def nearest_posture(model: mujoco.MjModel, qpos: Array, joints: Sequence[int], bodies: Sequence[int]) -> Array:
    """``(nq,)``, the nearest positions within all ranges in which ``bodies`` do not touch each other.

    If every posture that is tried has contacts, it is one with few of them.

    Args:
        model: model of the robot.
        qpos: positions from which to start.
        joints: joints that may move to end a contact.
        bodies: bodies of the robot.
    """
    wide = copy.copy(model)  # sees contacts before they begin
    wide.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
    wide.opt.o_margin = NEAR
    data, exact, home = mujoco.MjData(wide), mujoco.MjData(model), _clipped(model, qpos)
    angles, dofs = model.jnt_qposadr[[*joints]], model.jnt_dofadr[[*joints]]

    def cost(q: Array, weight: float) -> tuple[float, Array]:
        data.qpos[:] = home
        data.qpos[angles] = q
        mujoco.mj_kinematics(wide, data)
        mujoco.mj_comPos(wide, data)
        mujoco.mj_collision(wide, data)
        value, slope = float(np.square(q - home[angles]).sum()), 2 * (q - home[angles])
        for contact in _contacts(data, NEAR):
            ends = [int(wide.geom_bodyid[geom]) for geom in contact.geom]
            if {*ends} <= {*bodies}:
                jacobians = np.zeros((2, 3, wide.nv))
                for jacobian, body in zip(jacobians, ends, strict=True):
                    mujoco.mj_jac(wide, data, jacobian, None, contact.pos, body)
                depth, away = NEAR - contact.dist, contact.frame[:3] @ (jacobians[1] - jacobians[0])
                value += weight * depth**2
                slope -= 2 * weight * depth * away[dofs]
        return value, slope

    def judged(q: Array) -> tuple[int, float]:
        exact.qpos[:] = home
        exact.qpos[angles] = q
        mujoco.mj_forward(model, exact)
        return len(touching(model, exact, bodies)), float(np.linalg.norm(q - home[angles]))

    limited = model.jnt_limited[[*joints]].astype(bool)
    low, high = np.where(limited, model.jnt_range[[*joints]].T, [[-np.inf], [np.inf]])
    best = home[angles]
    for k in range(_RESTARTS + 1 if judged(best)[0] else 0):
        shares, q = stream(0, "posture", k).random(len(angles)), home[angles]
        if k:  # from the home posture first, then from between it and random ones
            least, most = np.where(limited, [low, high], [q - 1, q + 1])
            q = q + k / _RESTARTS * (least + shares * (most - least) - q)
        for weight in _WEIGHTS:
            q = minimize(cost, q, (weight,), "L-BFGS-B", jac=True, bounds=[*zip(low, high, strict=True)]).x
        best = min(best, q, key=judged)
    home[angles] = best
    return home


def _clipped(model: mujoco.MjModel, qpos: Array) -> Array:
    within = np.array(qpos)
    for k in movable(model):
        if model.jnt_limited[k]:
            within[model.jnt_qposadr[k]] = np.clip(within[model.jnt_qposadr[k]], *model.jnt_range[k])
    return within


def _contacts(data: mujoco.MjData, near: float = 0.0) -> list[mujoco.MjContact]:
    return [contact for contact in data.contact if contact.dist < near and min(contact.geom) >= 0]
