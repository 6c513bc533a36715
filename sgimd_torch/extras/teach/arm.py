"""An arm that a hand leads: inverse kinematics within the ranges, speeds and accelerations of the joints.

    arm = Arm(led); grip = arm.grip("hand"); grip.target = np.array([0.3, 0.4, 0.5]); arm.advance(grip)
In each step, mink solves a quadratic program: the joint speeds that best move the held point to the hand.
"""

from __future__ import annotations

import copy
from typing import Final

import mink
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.extras.models.places import joints_above
from sgimd_torch.extras.teach.led import HandLed
from sgimd_torch.spaces import Array, Box, check_point, read_only

STEP: Final = 0.01  # s, time from one posture of the arm to the next
FOLLOW: Final = 15.0  # 1/s, rate at which the held point follows the hand; 5 / FOLLOW s after a jump it is nearly there
DAMPING: Final = 0.1  # damping of the inverse, relative to the Jacobian; it slows joints near a stretched posture
BRAKES: Final = 0.95  # share of the accelerations that brakes a joint before the end of its range; some is left over
TOLERANCE: Final = 1e-9  # rad, largest violation of a limit in one step that the solver accepts
TURN_OR_SLIDE: Final = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


class Grip(mink.Task):
    """A point of a link that a hand holds and pulls to ``target``, ``(3,)`` m.

    A browser sends the position of the hand about 20 times a second, so the target jumps. The held point follows
    ``_wanted`` (m), which approaches the target in a critically damped motion with the velocity ``_pull`` (m/s).

    Args:
        configuration: the arm.
        body: number of the link.
        offset: ``(3,)`` m, position of the point in the frame of the link.
    """

    def __init__(self, configuration: mink.Configuration, body: int, offset: Array) -> None:
        super().__init__(cost=np.ones(3), gain=FOLLOW * STEP)
        self._configuration, self._body, self._offset = configuration, body, offset
        self.target = self._wanted = self.position
        self._pull = np.zeros(3)

    @property
    def position(self) -> Array:
        """``(3,)`` m, present position of the held point in the world."""
        data = self._configuration.data
        return np.asarray(data.xpos[self._body] + data.xmat[self._body].reshape(3, 3) @ self._offset)

    def pull(self) -> None:
        """Let one ``STEP`` pass for the hand."""
        self._pull = self._pull + STEP * FOLLOW**2 * (self.target - self._wanted - 2 / FOLLOW * self._pull)
        self._wanted = self._wanted + STEP * self._pull

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """``(3,)`` m, which gives the held point the velocity ``_pull + FOLLOW * (_wanted - position)``."""
        return self.position - self._wanted - self._pull / FOLLOW

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """``(3, nv)`` m/rad, derivative of the position by the joints."""
        jacobian = np.zeros((3, configuration.nv))
        mujoco.mj_jac(configuration.model, configuration.data, jacobian, None, self.position, self._body)
        return jacobian


class _AccelerationLimit(mink.Limit):
    """Limits (rad/s^2) of the changes of ``speeds``, ``(n_joints,)`` rad/s; mink itself limits ranges and speeds."""

    def __init__(self, joints: Array, limits: Array) -> None:
        self._rows, self._limits = np.concatenate([joints, -joints]), limits
        self.speeds = np.zeros(len(limits))

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Least and greatest changes (rad) of the joints in the time ``dt`` (s)."""
        change = self._limits * dt
        return mink.Constraint(self._rows, dt * np.concatenate([change + self.speeds, change - self.speeds]))


class Arm:
    """The led joints of a model; all other joints keep their positions.

    Args:
        led: the robot.

    Attributes:
        links: names of the bodies that only led joints move, from the base outwards.
        ranges: ``(n_joints,)`` box of the postures (rad; m for a slide joint).
        start: ``(n_joints,)`` posture in which movements start.
        speeds, accelerations: ``(n_joints,)`` limits (rad/s and rad/s^2).

    Raises:
        ValueError: a name that the model does not have, a joint that is no hinge or slide, a joint without a range, a
            start outside the ranges, or a limit that is not above 0.
    """

    def __init__(self, led: HandLed) -> None:
        self._model = model = copy.copy(led.model)
        self._joints = [self._number(mujoco.mjtObj.mjOBJ_JOINT, name, "joint") for name in led.joints]
        for name, joint in zip(led.joints, self._joints, strict=True):
            if mujoco.mjtJoint(model.jnt_type[joint]) not in TURN_OR_SLIDE:
                raise ValueError(f"joint {name} is neither a hinge nor a slide; only these can be led")
            if led.ranges is None and not model.jnt_limited[joint]:
                raise ValueError(f"joint {name} has no range in the model; give ranges")
        self._angles, self._dofs = model.jnt_qposadr[self._joints], model.jnt_dofadr[self._joints]
        self.ranges = Box(*model.jnt_range[self._joints].T) if led.ranges is None else led.ranges
        n = len(led.joints)
        if self.ranges.dim != n:
            raise ValueError(f"needs a range for each of {n} joints, got {self.ranges.dim}")
        self.speeds = _limits("speeds", 1.5 * self.ranges.sides if led.speeds is None else led.speeds, n)
        self.accelerations = _limits(
            "accelerations", 6 * self.ranges.sides if led.accelerations is None else led.accelerations, n
        )
        positions = model.qpos0 if led.positions is None else led.positions
        start = self.ranges.clip(positions[self._angles]) if led.start is None else led.start
        self.start = read_only(self.ranges.check("start", check_point("start", start, n), "are they in rad?"))
        names = {body: model.body(body).name for body in range(model.nbody)}
        self.links = tuple(name for body, name in names.items() if name and not self._trouble(body))

        model.jnt_limited[:] = False
        model.jnt_limited[self._joints] = True
        model.jnt_range[self._joints] = np.stack([self.ranges.low, self.ranges.high], axis=1)
        self._configuration = mink.Configuration(model, positions)
        self._acceleration_limit = _AccelerationLimit(np.eye(model.nv)[self._dofs], self.accelerations)
        # In a step a joint covers at most this share of the way to the end of its range, so it can brake in time.
        share = BRAKES * STEP * float((self.accelerations / self.speeds).min())
        self._limits = [
            mink.ConfigurationLimit(model, gain=min(1.0, share)),
            mink.VelocityLimit(model, dict(zip(led.joints, self.speeds, strict=True))),
            self._acceleration_limit,
        ]
        self.pose(self.start)

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of the present posture, for drawing."""
        return self._configuration.data

    @property
    def q(self) -> Array:
        """``(n_joints,)`` rad, the present posture."""
        return np.array(self.data.qpos[self._angles])

    def pose(self, q: Array) -> None:
        """Stand still in the posture ``q``, ``(n_joints,)`` rad."""
        self._acceleration_limit.speeds = np.zeros(len(q))
        self._move_to(q)

    def advance(self, grip: Grip | None) -> None:
        """Let one ``STEP`` pass; without a ``grip`` the joints come to rest."""
        damping = 1.0
        if grip is not None:
            grip.pull()
            damping = DAMPING**2 / 3 * np.square(grip.compute_jacobian(self._configuration)).sum() + 1e-12
        speeds = mink.solve_ik(
            self._configuration,
            [] if grip is None else [grip],
            STEP,
            "daqp",
            damping=damping,
            limits=self._limits,
            primal_tol=TOLERANCE,
        )
        before = self.q
        self._move_to(self.ranges.clip(before + STEP * speeds[self._dofs]))  # the clip removes rounding errors
        self._acceleration_limit.speeds = (self.q - before) / STEP

    def _move_to(self, q: Array) -> None:
        self.data.qpos[self._angles] = q
        self._configuration.update()

    def grip(self, name: str, point: ArrayLike | None = None) -> Grip:
        """A hand on a body or site; it holds the ``point`` ``(3,)`` m of the world, None for the origin of the body.

        Raises:
            ValueError: the model has no such body or site, no joint moves it, or joints that are not led move it.
        """
        body, offset = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, name), np.zeros(3)
        if body < 0:
            site = self._number(mujoco.mjtObj.mjOBJ_SITE, name, "body or site")
            body, offset = int(self._model.site_bodyid[site]), self._model.site_pos[site].copy()
        trouble = self._trouble(body)
        if trouble:
            raise ValueError(f"{name} cannot be grabbed: {trouble}; links to grab are {', '.join(self.links)}")
        if point is not None:
            away = check_point("point", point, 3, "in m") - self.data.xpos[body]
            offset = self.data.xmat[body].reshape(3, 3).T @ away
        return Grip(self._configuration, body, offset)

    def _trouble(self, body: int) -> str:
        """Reason why a body is not a link of the arm, "" if it is a link."""
        moved_by = set(joints_above(self._model, body))
        if not moved_by:
            return "no joint moves it"
        return "" if moved_by <= set(self._joints) else "joints not led move it, too"

    def _number(self, kind: mujoco.mjtObj, name: str, noun: str) -> int:
        number = mujoco.mj_name2id(self._model, kind, name)
        if number < 0:
            raise ValueError(f"the model has no {noun} {name!r}; is it spelt as in the model?")
        return int(number)


def _limits(name: str, value: ArrayLike, n: int) -> Array:
    limits = check_point(name, value, n, "one for each joint")
    if not (limits > 0).all():
        raise ValueError(f"{name} must be above 0, got {limits}")
    return read_only(limits)
