"""The posture in which movements begin: within all ranges, and without contacts of the robot with itself.

qpos = nearest_posture(model, within_ranges(model, qpos), joints, bodies, set()) is found once; a run keeps it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import mujoco
import numpy as np
from scipy.optimize import minimize

from sgimd_torch.extras.models.places import movable
from sgimd_torch.spaces import Array

NEAR: Final = 0.004  # m, distance of two geoms that counts as a contact while a posture is looked for
SLACK: Final = 0.001  # m, by which what is near at the start may come nearer
_WEIGHTS: Final = (1e3, 1e5, 1e7)  # 1/m^2, growing weight of contacts against the way (rad or m) to a posture


def within_ranges(model: mujoco.MjModel, qpos: Array) -> Array:
    """``(nq,)``, the nearest positions within the ranges of all joints."""
    joints = [k for k in movable(model) if model.jnt_limited[k]]
    within, places = np.array(qpos), model.jnt_qposadr[joints]
    within[places] = np.clip(within[places], *model.jnt_range[joints].T)
    return within


def touching(model: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[int]) -> set[tuple[int, int]]:
    """Pairs of ``bodies`` that touch each other in the state of ``data``, the lower number first."""
    pairs = (sorted(int(model.geom_bodyid[geom]) for geom in contact.geom) for contact in _contacts(data))
    return {(one, other) for one, other in pairs if {one, other} <= {*bodies}}


def nearest_posture(
    model: mujoco.MjModel, home: Array, joints: Sequence[int], bodies: Sequence[int], kept: set[tuple[int, int]]
) -> Array:
    """``(nq,)``, the positions nearest to ``home`` in which ``bodies`` do not touch each other; contacts may be left.

    ``home`` lies within all ranges; only ``joints`` move. The pairs ``kept``, the lower number first, may touch.
    """
    data, angles, dofs = mujoco.MjData(model), model.jnt_qposadr[[*joints]], model.jnt_dofadr[[*joints]]
    data.qpos[:], q = home, home[angles]

    def cost(q: Array, weight: float) -> tuple[float, Array]:
        data.qpos[angles] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        value, slope = float(np.square(q - home[angles]).sum()), 2 * (q - home[angles])
        for contact in _contacts(data, NEAR):
            ends = [int(model.geom_bodyid[geom]) for geom in contact.geom]
            if {*ends} <= {*bodies} and (min(ends), max(ends)) not in kept:
                jacobians = np.zeros((2, 3, model.nv))
                for jacobian, body in zip(jacobians, ends, strict=True):
                    mujoco.mj_jac(model, data, jacobian, None, contact.pos, body)
                depth, away = NEAR - contact.dist, contact.frame[:3] @ (jacobians[1] - jacobians[0])
                value += weight * depth**2
                slope -= 2 * weight * depth * away[dofs]
        return value, slope

    limited = model.jnt_limited[[*joints]].astype(bool)
    low, high = np.where(limited, model.jnt_range[[*joints]].T, [[-np.inf], [np.inf]])
    with _seeing(model, NEAR):  # contacts before they begin
        for weight in _WEIGHTS:
            q = minimize(cost, q, (weight,), "L-BFGS-B", jac=True, bounds=[*zip(low, high, strict=True)]).x
    data.qpos[angles] = q
    return np.array(data.qpos)


def gap(model: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[int], most: float) -> float:
    """Least distance (m) of ``bodies`` to each other and to anything in the state of ``data``; at most ``most``."""
    with _seeing(model, most):
        mujoco.mj_collision(model, data)
    near = [contact for contact in _contacts(data, most) if {*model.geom_bodyid[contact.geom]} & {*bodies}]
    return min((float(contact.dist) for contact in near), default=most)


def first_touch(
    model: mujoco.MjModel, states: Iterable[Array], bodies: Sequence[int], clearance: float, *, lying: bool = False
) -> str:
    """What touches first on a way of full physics ``states`` ``(n, n_state)``, such as "hand and table"; "" if nothing.

    ``bodies`` touch each other or their base at a distance of 0 m, and what stands still at ``clearance`` (m). What is
    so near at the start may stay so near; if the robot is ``lying``, it may touch what is within ``clearance`` at the
    start. Things that can move may be touched.
    """
    data, allowed = mujoco.MjData(model), dict[tuple[int, ...], float]()
    base = {int(model.body_parentid[body]) for body in bodies} - {0}
    with _seeing(model, clearance):
        for row, state in enumerate(states):
            mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for contact in data.contact:
                pair = tuple(contact.geom.tolist())
                ends = {int(model.geom_bodyid[geom]) for geom in pair}
                others = ends - {*bodies}
                if min(pair) < 0 or others == ends or any(model.body_weldid[other] for other in others):
                    continue
                own = others <= base
                if row == 0 and contact.dist < (0 if own and not lying else clearance):
                    nearer = -np.inf if own or lying else contact.dist - SLACK
                    allowed[pair] = min(allowed.get(pair, np.inf), nearer)
                if contact.dist < allowed.get(pair, 0 if own else clearance):
                    return " and ".join(model.geom(k).name or model.body(model.geom_bodyid[k]).name for k in pair)
    return ""


@contextmanager
def _seeing(model: mujoco.MjModel, near: float) -> Iterator[None]:
    """A block in which geoms of ``model`` see each other at a distance of ``near`` m; a copy of a model is slow."""
    flags, margin = model.opt.enableflags, model.opt.o_margin
    model.opt.enableflags, model.opt.o_margin = flags | int(mujoco.mjtEnableBit.mjENBL_OVERRIDE), near
    try:
        yield
    finally:
        model.opt.enableflags, model.opt.o_margin = flags, margin


def _contacts(data: mujoco.MjData, near: float = 0.0) -> list[mujoco.MjContact]:
    return [contact for contact in data.contact if contact.dist < near and min(contact.geom) >= 0]
