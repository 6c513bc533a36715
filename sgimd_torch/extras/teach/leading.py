"""Kinesthetic teaching without a robot: a compliant arm follows a hand, and its movement is recorded.

Section 5.3 of Nguyen & Oudeyer (2014): demonstrator 3 led the arm by the hand. Here the arm is a kinematic model in
MuJoCo. The held point follows the hand within the ranges, speeds and accelerations of the joints. A released arm stays
where it is.
    leading = Leading(hand_led_of(task)); leading.grab("hand"); leading.begin_recording()
    for point in path: leading.drag(point); leading.step(0.02)
    leading.release(); times, joints = leading.end_recording()
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.extras.teach.arm import STEP, Arm, Grip
from sgimd_torch.extras.teach.led import HandLed
from sgimd_torch.spaces import Array, check_point


class Leading:
    """An arm that a hand leads, within the limits of its joints.

    Args:
        led: model, joints and limits of the robot.

    Attributes:
        arm: geometry and limits of the arm, in the present posture.

    Raises:
        ValueError: the robot does not fit its model, see `Arm`.
    """

    def __init__(self, led: HandLed) -> None:
        self.arm, self._hand = Arm(led), led.hand
        self._grip: Grip | None = None
        self._postures: list[Array] | None = None
        self._since = 0.0  # s, time since the last step of the arm
        self._own = self.arm.grip(led.hand)

    @property
    def q(self) -> Array:
        """``(n_joints,)`` rad, the posture."""
        return self.arm.q

    @property
    def point(self) -> Array:
        """``(3,)`` m, the held point, or the robot's own hand if nothing is held."""
        return (self._grip or self._own).position

    @property
    def hand(self) -> Array:
        """``(3,)`` m, the robot's own hand."""
        return self._own.position

    @property
    def held(self) -> bool:
        """Whether a hand holds the arm."""
        return self._grip is not None

    @property
    def recording(self) -> bool:
        """Whether postures are being recorded."""
        return self._postures is not None

    def home(self) -> None:
        """Release the arm, and put it at once into the posture in which its movements start.

        Raises:
            RuntimeError: a recording is under way; a jump would spoil it.
        """
        if self.recording:
            raise RuntimeError("the arm cannot jump home during a recording; end_recording() comes first")
        self._grip, self._since = None, 0.0
        self.arm.pose(self.arm.start)

    def grab(self, body: str | None = None, point: ArrayLike | None = None) -> None:
        """Take hold of the arm.

        Args:
            body: name of a body or site; None for the robot's own hand.
            point: ``(3,)`` m, touched point in the world; None for the origin of ``body``.

        Raises:
            ValueError: the model has no such body, the led joints do not move it, or other joints move it, too.
        """
        self._grip = self.arm.grip(self._hand if body is None else body, point)

    def drag(self, target: ArrayLike) -> None:
        """Pull the held point towards ``target``, ``(3,)`` m, from the next step on.

        Raises:
            RuntimeError: nothing is held.
            ValueError: ``target`` is not one finite point.
        """
        if self._grip is None:
            raise RuntimeError("drag() needs a hand on the arm; call grab() first")
        self._grip.target = check_point("target", target, 3, "in m").copy()

    def release(self) -> None:
        """Release the arm, which brakes as hard as it can and stays there."""
        self._grip = None

    def step(self, dt: float) -> None:
        """Let ``dt`` (s) pass, in steps of ``STEP``; a remainder of ``dt`` counts for the next call.

        Raises:
            ValueError: ``dt`` is negative or not finite.
        """
        if not 0 <= dt < np.inf:
            raise ValueError(f"dt must be a time in s, 0 or more, got {dt}")
        self._since += dt
        while self._since >= STEP * (1 - 1e-9):
            self._since -= STEP
            self.arm.advance(self._grip)
            if self._postures is not None:
                self._postures.append(self.q)

    def begin_recording(self) -> None:
        """Begin a recording with the present posture.

        Raises:
            RuntimeError: a recording is under way.
        """
        if self._postures is not None:
            raise RuntimeError("a recording is under way; end_recording() comes first")
        self._postures = [self.q]

    def end_recording(self) -> tuple[Array, Array]:
        """End the recording and return it: ``(n_times,)`` s from 0, and postures ``(n_times, n_joints)`` rad.

        Raises:
            RuntimeError: no recording is under way.
            ValueError: no time has passed since the recording began; the recording is lost.
        """
        if self._postures is None:
            raise RuntimeError("nothing is being recorded; begin_recording() comes first")
        postures, self._postures = self._postures, None
        if len(postures) < 2:
            raise ValueError("a recording needs 2 postures or more; was it too short?")
        return np.arange(len(postures), dtype=np.float64) * STEP, np.stack(postures)
