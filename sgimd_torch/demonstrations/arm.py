"""The geometry of an arm in MuJoCo: where its points are, and how its joints move them. No forces, no time.

arm = Arm(model, joints, ranges); arm.pose(q); arm.where(*arm.place_of("hand")); arm.levers(body, point)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.spaces import Array, Box

_TURNS_OR_SLIDES: Final = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


class Arm:
    """Some joints of a model; all else keeps its posture relative to the body that carries it.

    Args:
        model: of the arm and its world.
        joints: names of its hinge and slide joints, in the order of a posture.
        ranges: ``(n_joints,)`` rad, or m of a slide joint; None for those of the model.

    Raises:
        ValueError: a joint that the model does not have, that is no hinge or slide, or that has no range.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[str], ranges: Box | None = None) -> None:
        self.model, self.joints = model, tuple(joints)
        self.data = mujoco.MjData(model)
        self._numbers = [_number(model, mujoco.mjtObj.mjOBJ_JOINT, name, "joint") for name in self.joints]
        for name, number in zip(self.joints, self._numbers, strict=True):
            if int(model.jnt_type[number]) not in _TURNS_OR_SLIDES:
                raise ValueError(f"joint {name} is neither a hinge nor a slide; only these can be led")
            if ranges is None and not model.jnt_limited[number]:
                raise ValueError(f"joint {name} has no range in the model; give ranges")
        self._angles, self._speeds = model.jnt_qposadr[self._numbers], model.jnt_dofadr[self._numbers]
        self.ranges = Box(*model.jnt_range[self._numbers].T) if ranges is None else ranges
        if self.ranges.dim != len(self.joints):
            raise ValueError(f"needs a range for each of {len(self.joints)} joints, got {self.ranges.dim}")

    @property
    def posture(self) -> Array:
        """``(n_joints,)`` rad, as it was posed; at first the model's own."""
        return np.array(self.data.qpos[self._angles], dtype=np.float64)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the bodies that these joints move and no other ones, from the base on."""
        return tuple(self.model.body(body).name for body in range(self.model.nbody) if not self._trouble(body))

    def pose(self, q: Array) -> None:
        """Take the posture ``q``, ``(n_joints,)`` rad."""
        self.data.qpos[self._angles] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)  # mj_jac needs it

    def place_of(self, name: str) -> tuple[int, Array]:
        """The number of a link, and a place on it, ``(3,)`` m in its own frame: the origin of a body or a site.

        Raises:
            ValueError: the model has no such body or site, or it is not one that the joints move alone.
        """
        body, place = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name), np.zeros(3)
        if body < 0:
            site = _number(self.model, mujoco.mjtObj.mjOBJ_SITE, name, "body or site")
            body, place = int(self.model.site_bodyid[site]), self.model.site_pos[site].copy()
        trouble = self._trouble(body)
        if trouble:
            raise ValueError(f"{name} cannot be grabbed, {trouble}; links that can are {', '.join(self.links)}")
        return body, place

    def where(self, body: int, place: Array) -> Array:
        """``(3,)`` m in the world, of a place on a link."""
        return np.asarray(self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ place)

    def place_at(self, body: int, point: Array) -> Array:
        """``(3,)`` m in the frame of a link, of a ``point`` of the world; the inverse of ``where``."""
        return np.asarray(self.data.xmat[body].reshape(3, 3).T @ (point - self.data.xpos[body]))

    def levers(self, body: int, point: Array) -> Array:
        """``(3, n_joints)`` m/rad, how a ``point`` of the world that a link carries moves with each joint."""
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, jacobian, None, point, body)
        return jacobian[:, self._speeds]

    def _trouble(self, body: int) -> str:
        """Why a body is no link of the arm; "" if it is one."""
        moved_by, above = set[int](), body
        while above:
            first = int(self.model.body_jntadr[above])
            moved_by |= set(range(first, first + int(self.model.body_jntnum[above])))
            above = int(self.model.body_parentid[above])
        if not moved_by:
            return "no joint moves it"
        return "" if moved_by <= set(self._numbers) else "other joints move it, too"


def _number(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, called: str) -> int:
    number = mujoco.mj_name2id(model, kind, name)
    if number < 0:
        raise ValueError(f"the model has no {called} {name!r}; is it spelt as in the model?")
    return int(number)
