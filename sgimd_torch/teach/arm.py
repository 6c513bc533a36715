"""Kinematics of an arm in MuJoCo: the positions of its points, and their Jacobians.

arm = Arm(led); arm.pose(q); arm.where(*arm.place_of("hand")); arm.levers(body, point)
"""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box, check_point, read_only
from sgimd_torch.teach.led import HandLed

TURN_OR_SLIDE: Final = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
CROSSING: Final = 1.0  # s, assumed time in which a joint crosses its range, if the robot gives no largest speeds


class Arm:
    """The led joints of a model; all other joints keep their positions.

    Args:
        led: the robot.

    Attributes:
        data: MuJoCo's data of the present posture, for drawing.
        links: names of the bodies that only led joints move, from the base outwards.
        ranges: ``(n_joints,)`` box of the postures (rad; m for a slide joint).
        start: ``(n_joints,)`` posture in which movements start.
        speeds, accelerations: ``(n_joints,)`` limits (rad/s and rad/s^2).

    Raises:
        ValueError: a name that the model does not have, a joint that is no hinge or slide, a joint without a range, a
            start outside the ranges, or a limit that is not above 0.
    """

    def __init__(self, led: HandLed) -> None:
        self._model, self.data = led.model, mujoco.MjData(led.model)
        if led.positions is not None:
            self.data.qpos = led.positions
        self._numbers = [self._number(mujoco.mjtObj.mjOBJ_JOINT, name, "joint") for name in led.joints]
        for name, number in zip(led.joints, self._numbers, strict=True):
            if int(self._model.jnt_type[number]) not in TURN_OR_SLIDE:
                raise ValueError(f"joint {name} is neither a hinge nor a slide; only these can be led")
            if led.ranges is None and not self._model.jnt_limited[number]:
                raise ValueError(f"joint {name} has no range in the model; give ranges")
        self._angles, self._speeds = self._model.jnt_qposadr[self._numbers], self._model.jnt_dofadr[self._numbers]
        self.ranges = Box(*self._model.jnt_range[self._numbers].T) if led.ranges is None else led.ranges
        n, pace = len(led.joints), self.ranges.sides / CROSSING
        if self.ranges.dim != n:
            raise ValueError(f"needs a range for each of {n} joints, got {self.ranges.dim}")
        self.speeds = _limits("speeds", 1.5 * pace if led.speeds is None else led.speeds, n)
        self.accelerations = _limits("accelerations", 6 * pace if led.accelerations is None else led.accelerations, n)
        start = self.ranges.clip(self.data.qpos[self._angles]) if led.start is None else led.start
        self.start = read_only(self.ranges.check("start", check_point("start", start, n), "are they in rad?"))
        names = {k: self._model.body(k).name for k in range(self._model.nbody)}
        self.links = tuple(name for k, name in names.items() if name and not self._trouble(k))

    def pose(self, q: Array) -> None:
        """Take the posture ``q``, ``(n_joints,)`` rad."""
        self.data.qpos[self._angles] = q
        mujoco.mj_kinematics(self._model, self.data)
        mujoco.mj_comPos(self._model, self.data)  # mj_jac needs its result

    def place_of(self, name: str) -> tuple[int, Array]:
        """Number of the link that has this body or site, and the origin of the body or site in the link's frame (m).

        Raises:
            ValueError: the model has no such body or site, no joint moves it, or joints that are not led move it.
        """
        body, place = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, name), np.zeros(3)
        if body < 0:
            site = self._number(mujoco.mjtObj.mjOBJ_SITE, name, "body or site")
            body, place = int(self._model.site_bodyid[site]), self._model.site_pos[site].copy()
        trouble = self._trouble(body)
        if trouble:
            raise ValueError(f"{name} cannot be grabbed: {trouble}; links to grab are {', '.join(self.links)}")
        return body, place

    def where(self, body: int, place: Array) -> Array:
        """World position ``(3,)`` m of the point that has the position ``place`` ``(3,)`` m in the frame of a link."""
        return np.asarray(self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ place)

    def place_at(self, body: int, point: Array) -> Array:
        """Position ``(3,)`` m of a world ``point`` ``(3,)`` m in the frame of a link; the inverse of ``where``."""
        return np.asarray(self.data.xmat[body].reshape(3, 3).T @ (point - self.data.xpos[body]))

    def levers(self, body: int, point: Array) -> Array:
        """Jacobian ``(3, n_joints)`` m/rad of a point that is fixed to a link and is now at ``point`` in the world."""
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jac(self._model, self.data, jacobian, None, point, body)
        return jacobian[:, self._speeds]

    def _trouble(self, body: int) -> str:
        """Reason why a body is not a link of the arm, "" if it is a link."""
        moved_by, above = set[int](), body
        while above:
            first = int(self._model.body_jntadr[above])
            moved_by |= set(range(first, first + int(self._model.body_jntnum[above])))
            above = int(self._model.body_parentid[above])
        if not moved_by:
            return "no joint moves it"
        return "" if moved_by <= set(self._numbers) else "joints not led move it, too"

    def _number(self, kind: mujoco.mjtObj, name: str, called: str) -> int:
        number = mujoco.mj_name2id(self._model, kind, name)
        if number < 0:
            raise ValueError(f"the model has no {called} {name!r}; is it spelt as in the model?")
        return int(number)


def _limits(name: str, value: ArrayLike, n: int) -> Array:
    limits = check_point(name, value, n, "one for each joint")
    if not (limits > 0).all():
        raise ValueError(f"{name} must be above 0, got {limits}")
    return read_only(limits)
