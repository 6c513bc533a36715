"""What hangs on a led arm, such as a line and its float: it swings as the arm moves, by the physics of the model.

    hanging = Hanging(model, joints, hand, start); hanging.follow(q, seconds); hanging.data.xpos, hanging.hand
The led joints do what the hand makes them do; the others follow from the equations of motion with that given, damping
taken implicitly, as MuJoCo's own integrator does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np

from sgimd_torch.spaces import Array

FASTEST: Final = 200.0  # rad/s: faster means that the swinging has diverged, and it begins again at rest
RESTING: Final = 0.02  # rad/s: slower than this nobody sees it swing
LONGEST: Final = 0.1  # s, that is simulated at once; a page that was away does not make up for it


class Hanging:
    """The model with its led joints where they are put, and all others moving by themselves.

    Args:
        model: of the robot; all its joints are hinges or slides.
        joints: the led ones.
        hand: name of a body or site.
        start: ``(n_joints,)`` where they begin.
    """

    def __init__(self, model: Any, joints: Sequence[str], hand: str, start: Array) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        led = [model.joint(name).id for name in joints]
        self._led, self._led_speeds = model.jnt_qposadr[led], model.jnt_dofadr[led]
        free = [joint for joint in range(model.njnt) if joint not in led]
        self._free, self._free_speeds = model.jnt_qposadr[free], model.jnt_dofadr[free]
        self._site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, hand)
        self._body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, hand)
        self._step = float(model.opt.timestep)
        self._still = False
        self.rest(start)

    @property
    def hand(self) -> Array:
        """``(3,)`` m, where the hand is."""
        return np.array(self.data.site_xpos[self._site] if self._body < 0 else self.data.xpos[self._body])

    def rest(self, q: Array) -> None:
        """Put the led joints at ``q``, everything at rest; what hangs settles in the next moments."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._led] = q
        mujoco.mj_forward(self.model, self.data)
        self._q, self._speed = np.array(q), np.zeros(len(q))
        if self._free.size:
            for _ in range(200):
                self._swing(np.zeros(len(q)))

    def follow(self, q: Array, seconds: float) -> None:
        """The led joints go to ``q`` ``(n_joints,)`` evenly within ``seconds``; the others swing along."""
        n = max(1, round(min(seconds, LONGEST) / self._step))
        resting = np.abs(self.data.qvel).max() < RESTING and np.array_equal(q, self._q)
        if resting and self._still:
            return
        self._still = resting
        if not self._free.size:
            self._q = np.array(q)
            self.data.qpos[self._led] = q
            mujoco.mj_kinematics(self.model, self.data)
            return
        begun, moved = self._q, np.asarray(q) - self._q
        speed = moved / (n * self._step)
        for k in range(n):
            pull = (speed - self._speed) / self._step if k == 0 else np.zeros_like(speed)
            self._speed, self._q = speed, begun + moved * (k + 1) / n
            self._swing(pull)
        if not np.abs(self.data.qvel).max() < FASTEST:  # NaN too
            self.rest(q)

    def _swing(self, pull: Array) -> None:
        """One time step; ``pull`` ``(n_joints,)`` rad/s^2 is the acceleration of the led joints."""
        data, step, free, led = self.data, self._step, self._free_speeds, self._led_speeds
        data.qpos[self._led], data.qvel[led] = self._q, self._speed
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        mass = np.empty((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, data, mass)
        own = mass[np.ix_(free, free)]
        force = -data.qfrc_bias[free] - mass[np.ix_(free, led)] @ pull
        damped = own + step * np.diag(self.model.dof_damping[free])
        data.qvel[free] = np.linalg.solve(damped, own @ data.qvel[free] + step * force)
        data.qpos[self._free] += step * data.qvel[free]
        mujoco.mj_kinematics(self.model, data)
