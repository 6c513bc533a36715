"""The arm on the page: viewers lead it, record that and play it back; what hangs on it, such as a line, swings.

arm = LedArm(led); arm.grab(viewer, "hand", point); arm.drag(viewer, point); arm.move(now, seconds); arm.hanging.data
"""

from __future__ import annotations

import copy
from typing import Final

import mujoco
import numpy as np

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import LedMovement
from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array

HEAVY: Final = 1e6  # kg m^2 at each led joint: what hangs does not move it
FASTEST: Final = 200.0  # rad/s: faster means that the swinging has diverged, and it begins again at rest
LONGEST: Final = 0.1  # s, that is simulated at once; a page that was away does not make up for it
SETTLES: Final = 200  # steps, in which what hangs comes nearly to rest
STILL: Final = 0.4  # s, how long the end of a movement is shown


class LedArm:
    """An arm that one viewer at a time holds. The others wait until they let go; all may do all else.

    Args:
        led: the robot.

    Attributes:
        leading: follows the hand.
        hanging: the model as it is to be drawn.
        recording: the last one; None if there is none.

    Raises:
        ValueError: see `Leading`.
    """

    def __init__(self, led: HandLed) -> None:
        self.leading = Leading(led)
        self.hanging = Hanging(led, self.leading.q)
        self.recording: LedMovement | None = None
        self._hand = led.hand
        self._holder, self._offset = -1, np.zeros(3)  # (3,) m from the mouse to the held point
        self._played: tuple[LedMovement, float] | None = None  # since when

    def grab(self, viewer: int, body: str, point: Array) -> None:
        """Take hold of a ``body`` where the mouse touches it, ``(3,)`` m, unless another viewer holds it.

        Raises:
            ValueError: it cannot be led.
        """
        if not self.leading.held:
            self._played, self._holder = None, viewer
            self.leading.grab(body, None if body == self._hand else point)
            self._offset = self.leading.point - point

    def drag(self, viewer: int, point: Array) -> None:
        """The mouse goes to ``point`` ``(3,)`` m."""
        if self.leading.held and viewer == self._holder:
            self.leading.drag(point + self._offset)

    def let_go(self, viewer: int) -> None:
        """This viewer does not hold it any more."""
        if viewer == self._holder:
            self.leading.release()

    def home(self) -> None:
        """Put it where movements start.

        Raises:
            RuntimeError: a recording is under way.
        """
        self._played = None
        self.leading.home()

    def record(self) -> None:
        """Begin a recording, or end the one under way.

        Raises:
            ValueError: it was too short; it is over all the same.
        """
        self._played = None
        if self.leading.recording:
            self.recording = self.leading.stop()
        else:
            self.leading.record()

    def play(self, recording: LedMovement, now: float) -> None:
        """Do ``recording`` again from ``now`` (s) on.

        Raises:
            ValueError: a recording is under way.
        """
        if self.leading.recording:
            raise ValueError("a recording is under way; stop it first")
        self.leading.release()
        self._played = recording, now

    def move(self, now: float, seconds: float) -> None:
        """Let ``seconds`` pass until ``now`` (s)."""
        self.leading.step(seconds)
        q = self.leading.q
        if self._played is not None:
            recording, begun = self._played
            q = np.array([np.interp(now - begun, recording.times, column) for column in recording.joints.T])
            if now - begun > recording.duration + STILL:
                self._played = None
        self.hanging.follow(q, seconds)


class Hanging:
    """The model with its led joints where they are put, and all others moving by themselves.

    Args:
        led: the robot; all its joints are hinges or slides.
        start: ``(n_joints,)`` where the led ones begin.
    """

    def __init__(self, led: HandLed, start: Array) -> None:
        self._model = model = copy.copy(led.model)
        joints = [model.joint(name).id for name in led.joints]
        self._led, self._speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        model.dof_armature[self._speeds] += HEAVY
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.data = mujoco.MjData(model)
        self._site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, led.hand)
        self._body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, led.hand)
        self._rest(start)

    @property
    def hand(self) -> Array:
        """``(3,)`` m, where the hand is."""
        return np.array(self.data.site_xpos[self._site] if self._body < 0 else self.data.xpos[self._body])

    def follow(self, q: Array, seconds: float) -> None:
        """The led joints go to ``q`` ``(n_joints,)`` evenly within ``seconds``; the others swing along."""
        n = max(1, round(min(seconds, LONGEST) / self._model.opt.timestep))
        begun = self.data.qpos[self._led]
        for k in range(n):
            self._step(begun + (q - begun) * (k + 1) / n)
        if not np.abs(self.data.qvel).max() < FASTEST:  # NaN too
            self._rest(q)
        mujoco.mj_kinematics(self._model, self.data)

    def _rest(self, q: Array) -> None:
        mujoco.mj_resetData(self._model, self.data)
        self.data.qpos[self._led] = q
        for _ in range(SETTLES):
            self._step(q)

    def _step(self, q: Array) -> None:
        """One step of time, after which the led joints are at ``q``: pushed there, so that the others feel it."""
        step = self._model.opt.timestep
        speed = (q - self.data.qpos[self._led]) / step
        self.data.qfrc_applied[self._speeds] = HEAVY * (speed - self.data.qvel[self._speeds]) / step
        mujoco.mj_step(self._model, self.data)
        self.data.qpos[self._led], self.data.qvel[self._speeds] = q, speed
