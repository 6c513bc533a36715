"""Kinesthetic teaching without a robot: a compliant arm follows a hand, and its movement is recorded.

Section 5.3 of Nguyen & Oudeyer (2014): demonstrator 3 led the arm by the hand. Here the arm is a kinematic model in
MuJoCo. The held point follows the hand by damped least squares, within the ranges, speeds and accelerations of the
joints. A released arm stays where it is.
    leading = Leading(hand_led_of(task)); leading.grab("hand"); leading.begin_recording()
    for point in path: leading.drag(point); leading.step(0.02)
    leading.release(); times, joints = leading.end_recording()
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, check_point
from sgimd_torch.teach.arm import Arm
from sgimd_torch.teach.led import HandLed

STEP: Final = 0.01  # time (s) from one posture of the arm to the next
FOLLOW: Final = 15.0  # 1/s, rate at which the held point follows the hand; 5 / FOLLOW s after a jump it is nearly there
SUPPLE: Final = 0.03  # s, time constant of the joint speeds, which keeps the tremor of the hand from the arm
DAMPING: Final = 0.1  # damping of the least squares, relative to the Jacobian; it slows joints near a stretched posture
BRAKES: Final = 0.88  # planned deceleration, as a share of the largest; the last time step may need 9/8 of the plan


class _Hand:
    """A hand that holds the point ``place`` ``(3,)`` m in the frame of a ``body``, and pulls it to ``target`` (m).

    A browser sends the position of the hand about 20 times a second, so the target jumps. The arm follows the point
    ``_wanted`` (m), which approaches the target in a critically damped motion with the velocity ``_pull`` (m/s).
    """

    def __init__(self, body: int, place: Array, target: Array) -> None:
        self.body, self.place, self.target = body, place, target
        self._wanted, self._pull = target, np.zeros(3)

    def follow(self, point: Array) -> Array:
        """``(3,)`` m/s, the desired velocity of the held ``point`` in the next step."""
        self._pull = self._pull + STEP * FOLLOW**2 * (self.target - self._wanted - 2 / FOLLOW * self._pull)
        self._wanted = self._wanted + STEP * self._pull
        return np.asarray(self._pull + FOLLOW * (self._wanted - point))


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
        self.arm = Arm(led)
        self._hand = self.arm.place_of(led.hand)
        self._held: _Hand | None = None
        self._postures: list[Array] | None = None
        self.home()

    @property
    def q(self) -> Array:
        """``(n_joints,)`` rad, the posture."""
        return self._q.copy()

    @property
    def point(self) -> Array:
        """``(3,)`` m, the held point, or the robot's own hand if nothing is held."""
        return self.arm.where(*((self._held.body, self._held.place) if self._held else self._hand))

    @property
    def hand(self) -> Array:
        """``(3,)`` m, the robot's own hand."""
        return self.arm.where(*self._hand)

    @property
    def held(self) -> bool:
        """Whether a hand holds the arm."""
        return self._held is not None

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
        self._q, self._speed, self._since = self.arm.start.copy(), np.zeros(len(self.arm.start)), 0.0
        self._held = None
        self.arm.pose(self._q)

    def grab(self, body: str | None = None, point: ArrayLike | None = None) -> None:
        """Take hold of the arm.

        Args:
            body: name of a body or site; None for the robot's own hand.
            point: ``(3,)`` m, touched point in the world; None for the origin of ``body``.

        Raises:
            ValueError: the model has no such body, the led joints do not move it, or other joints move it, too.
        """
        number, place = self._hand if body is None else self.arm.place_of(body)
        if point is not None:
            place = self.arm.place_at(number, check_point("point", point, 3, "in m"))
        self._held = _Hand(number, place, self.arm.where(number, place))

    def drag(self, target: ArrayLike) -> None:
        """Pull the held point towards ``target``, ``(3,)`` m, from the next step on.

        Raises:
            RuntimeError: nothing is held.
            ValueError: ``target`` is not one finite point.
        """
        if self._held is None:
            raise RuntimeError("drag() needs a hand on the arm; call grab() first")
        self._held.target = check_point("target", target, 3, "in m").copy()

    def release(self) -> None:
        """Release the arm, which comes to rest within about 0.1 s and stays there."""
        self._held = None

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
            self._advance()

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

    def _advance(self) -> None:
        held = self._held
        wish = np.zeros(len(self._q)) if held is None else self._towards(held.follow(self.point), held.body)
        speed = self._within(wish)
        q = self.arm.ranges.clip(self._q + speed * STEP)  # the clip removes rounding errors
        self._speed, self._q = (q - self._q) / STEP, q
        self.arm.pose(self._q)
        if self._postures is not None:
            self._postures.append(self.q)

    def _towards(self, velocity: Array, body: int) -> Array:
        """Joint speeds ``(n_joints,)`` rad/s that give the held point a ``velocity`` ``(3,)`` m/s.

        If a joint would be too fast, all joints slow down by one factor, which keeps the direction. A joint that would
        leave its range stops in time, and the other joints compensate.
        """
        levers = self.arm.levers(body, self.point)
        damping = (DAMPING**2 * np.square(levers).sum() / 3 + 1e-12) * np.eye(3)

        def solve(columns: Array, velocity: Array) -> Array:
            return np.asarray(columns.T @ np.linalg.solve(columns @ columns.T + damping, velocity))

        velocity = velocity * self._slower(solve(levers, velocity))
        speed, free = np.zeros(len(self._q)), np.ones(len(self._q), dtype=bool)
        low, high = self._brakes()
        while free.any():
            speed[free] = solve(levers[:, free], velocity - levers[:, ~free] @ speed[~free])
            beyond = free & ((speed < low) | (speed > high))
            if not beyond.any():
                break
            speed[beyond] = np.clip(speed, low, high)[beyond]
            free &= ~beyond
        return speed

    def _slower(self, wish: Array) -> float:
        """The largest factor, at most 1, that keeps ``wish`` (rad/s) within the speed limits of the joints."""
        return min(1.0, float((self.arm.speeds / np.maximum(np.abs(wish), 1e-12)).min()))

    def _within(self, wish: Array) -> Array:
        """Joint speeds ``(n_joints,)`` rad/s of the next step, which approach ``wish`` within all limits."""
        change = (self._slower(wish) * wish - self._speed) * min(1.0, STEP / SUPPLE)
        most, fastest = self.arm.accelerations * STEP, self.arm.speeds
        low, high = self._brakes()
        return np.clip(np.clip(self._speed + np.clip(change, -most, most), -fastest, fastest), low, high)

    def _brakes(self) -> tuple[Array, Array]:
        """Least and greatest speeds, ``(n_joints,)`` rad/s each, from which the joints still stop in their ranges."""
        brakes, ranges = BRAKES * self.arm.accelerations, self.arm.ranges

        def fastest(distance: Array) -> Array:
            return np.asarray(brakes * (np.sqrt(STEP**2 / 4 + 2 * np.maximum(distance, 0) / brakes) - STEP / 2))

        return -fastest(self._q - ranges.low), fastest(ranges.high - self._q)
