"""Kinesthetic teaching without a robot: a compliant arm that follows a hand, and records how it was led.

Section 5.3 of Nguyen & Oudeyer (2014): demonstrator 3 led the arm by the hand. Here the arm is a MuJoCo model without
weight. It follows the point at which it is held, by damped least squares, never beyond its joints' ranges, speeds and
accelerations; where it is let go, it stays.
    leading = Leading.of(rod.hand_led); leading.grab("hand"); leading.record()
    for point in path: leading.drag(point); leading.step(0.02)
    leading.release(); recording = leading.stop()
Joints can be moved one by one, too: ``leading.set_joints(q)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.demonstrations.arm import Arm
from sgimd_torch.demonstrations.hand import FOLLOW, STEP, Hand
from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array, Box, check_point, read_only

SUPPLE: Final = 0.03  # s, in which a joint takes up a speed: a hand's trembling does not become the arm's
DAMPING: Final = 0.1  # of the least squares, relative to the arm's levers: near a stretched posture joints stay slow
BRAKES: Final = 0.88  # of the acceleration, to stop before a range ends: the last step may take 9/8 of it
CROSSING: Final = 1.0  # s, in which a joint of unknown speed crosses its range


class Leading:
    """An arm that a hand leads. It never jumps: ``step`` moves it by what fits into that time.

    ``data`` is the model in the posture of now, to be drawn; ``links`` are the bodies that can be grabbed, by name.

    Args:
        model: a ``mujoco.MjModel``; what is not led in it keeps its posture relative to the link that carries it.
        joints: names of the hinge and slide joints that are led, in the order of a recording's columns.
        hand: name of the body or site that ``grab()`` takes.
        ranges: ``(n_joints,)`` rad; None for those of the model.
        start: ``(n_joints,)`` rad, the posture at the beginning, see ``home``; None for the model's.
        speeds, accelerations: ``(n_joints,)`` rad/s, rad/s^2, above 0, never exceeded; None for a joint that crosses
            its range in a second, smoothly.

    Raises:
        ValueError: a name that the model does not have, a joint that is no hinge or slide, no range, a start outside
            the ranges, or a limit that is not above 0.
    """

    def __init__(
        self,
        model: Any,
        joints: Sequence[str],
        hand: str,
        *,
        ranges: Box | None = None,
        start: ArrayLike | None = None,
        speeds: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> None:
        self._arm = arm = Arm(model, joints, ranges)
        self.data, self.joints, self.ranges, self.links = arm.data, arm.joints, arm.ranges, arm.links
        n = len(self.joints)
        whole = self.ranges.sides / CROSSING
        self.speeds = _limits("speeds", 1.5 * whole if speeds is None else speeds, n)
        self.accelerations = _limits("accelerations", 6 * whole if accelerations is None else accelerations, n)
        posture = self.ranges.clip(arm.posture) if start is None else start
        self.start = read_only(self.ranges.check("start", check_point("start", posture, n), "are they in rad?"))
        self._hand = arm.place_of(hand)
        self._held: Hand | None = None
        self._goal: Array | None = None
        self._rows: list[tuple[Array, float]] | None = None
        self.home()

    @classmethod
    def of(cls, led: HandLed) -> Leading:
        """The arm that an environment gives as ``hand_led``."""
        limits = {"speeds": led.speeds, "accelerations": led.accelerations}
        return cls(led.model, led.joints, led.hand, ranges=led.ranges, start=led.start, **limits)

    @property
    def q(self) -> Array:
        """``(n_joints,)`` rad, where the joints are."""
        return self._q.copy()

    @property
    def point(self) -> Array:
        """``(3,)`` m, where the point is at which the arm is held; without a hand on it, its own hand."""
        return self._arm.where(*((self._held.body, self._held.place) if self._held else self._hand))

    @property
    def target(self) -> Array | None:
        """``(3,)`` m, where the hand wants the held point to be; None if nothing is held."""
        return self._held.target.copy() if self._held else None

    @property
    def gap(self) -> float:
        """m, how far the held point is from the way that the hand took during the last moments; 0 if nothing is held.

        What follows late has no gap. What is beyond the arm's reach, or faster than its joints are, has one.
        """
        return self._held.gap(self.point) if self._held else 0.0

    @property
    def held(self) -> bool:
        """Whether a hand holds the arm."""
        return self._held is not None

    @property
    def recording(self) -> bool:
        """Whether postures are being recorded."""
        return self._rows is not None

    def home(self) -> None:
        """Put the arm where its movements start, at once; it is let go.

        Raises:
            RuntimeError: a recording is under way, which must not jump.
        """
        if self.recording:
            raise RuntimeError("the arm cannot jump home during a recording; stop() it first, or set_joints(start)")
        self._q, self._speed, self._since = self.start.copy(), np.zeros(len(self.joints)), 0.0
        self._held = self._goal = None
        self._arm.pose(self._q)

    def grab(self, body: str | None = None, point: ArrayLike | None = None) -> None:
        """Take hold of the arm.

        Args:
            body: name of a body or site; None for the hand.
            point: ``(3,)`` m in the world, where it is touched; None for the origin of ``body``.

        Raises:
            ValueError: the model has no such body, or the joints do not move it alone, as the water or a line.
        """
        number, place = self._hand if body is None else self._arm.place_of(body)
        if point is not None:
            place = self._arm.place_at(number, check_point("point", point, 3, "in m"))
        self._held, self._goal = Hand(number, place, self._arm.where(number, place)), None

    def drag(self, target: ArrayLike) -> None:
        """Pull the held point towards ``target``, ``(3,)`` m, from the next step on.

        Raises:
            RuntimeError: nothing is held.
            ValueError: not one finite point.
        """
        if self._held is None:
            raise RuntimeError("drag() needs a hand on the arm; grab() it first")
        self._held.target = check_point("target", target, 3, "in m").copy()

    def release(self) -> None:
        """Let go: the arm comes to rest, within a tenth of a second or so, and stays there."""
        self._held = None

    def set_joints(self, q: ArrayLike) -> None:
        """Move all joints towards ``q``, ``(n_joints,)`` rad, from the next step on; a hand lets go.

        Raises:
            ValueError: not one posture within the ranges.
        """
        goal = check_point("q", q, len(self.joints), "one angle for each joint, in rad")
        self._goal = self.ranges.check("q", goal, "are they in rad?").copy()
        self.release()

    def step(self, dt: float) -> None:
        """Let ``dt`` (s) pass, in steps of ``STEP``; what is left of it counts for the next call.

        Raises:
            ValueError: ``dt`` is not a time of 0 s or more.
        """
        if not 0 <= dt < np.inf:
            raise ValueError(f"dt must be a time in s, 0 or more, got {dt}")
        self._since += dt
        while self._since >= STEP * (1 - 1e-9):
            self._since -= STEP
            self._advance()

    def record(self) -> None:
        """Begin a recording with the posture of now.

        Raises:
            RuntimeError: one is under way.
        """
        if self._rows is not None:
            raise RuntimeError("a recording is under way; stop() it first")
        self._rows = [(self.q, self.gap)]

    def stop(self) -> Recording:
        """End the recording and give it.

        Raises:
            RuntimeError: none is under way.
            ValueError: it holds one posture only, as no time has passed.
        """
        if self._rows is None:
            raise RuntimeError("nothing is being recorded; record() comes first")
        rows, self._rows = self._rows, None
        postures, gaps = zip(*rows, strict=True)
        times = np.arange(len(rows), dtype=np.float64) * STEP
        return Recording(times, np.stack(postures), np.array(gaps))

    def _advance(self) -> None:
        speed = self._within(self._wish())
        q = self.ranges.clip(self._q + speed * STEP)  # rounding
        self._speed, self._q = (q - self._q) / STEP, q
        self._arm.pose(self._q)
        if self._rows is not None:
            self._rows.append((self.q, self.gap))

    def _wish(self) -> Array:
        """``(n_joints,)`` rad/s, the speeds that would follow hand or joint goal."""
        if self._held is not None:
            return self._towards(self._held.follow(self.point), self._held.body)
        if self._goal is not None:
            return FOLLOW / 2 * (self._goal - self._q)
        return np.zeros(len(self.joints))

    def _towards(self, velocity: Array, body: int) -> Array:
        """``(n_joints,)`` rad/s that move the held point with this ``velocity`` ``(3,)`` m/s, by damped least squares.

        If that is too fast, all is slowed down, so that the direction stays. A joint that would leave its range stops
        in time, and the others do what it does not.
        """
        levers = self._arm.levers(body, self.point)
        damping = (DAMPING**2 * np.square(levers).sum() / 3 + 1e-12) * np.eye(3)

        def solve(columns: Array, velocity: Array) -> Array:
            return np.asarray(columns.T @ np.linalg.solve(columns @ columns.T + damping, velocity))

        velocity = velocity * self._slower(solve(levers, velocity))
        speed, free = np.zeros(len(self.joints)), np.ones(len(self.joints), dtype=bool)
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
        """The share of the wished speeds, 1 at most, at which no joint exceeds its own."""
        return min(1.0, float((self.speeds / np.maximum(np.abs(wish), 1e-12)).min()))

    def _within(self, wish: Array) -> Array:
        """The speeds of the next step: towards the wished ones, in their direction, within all limits."""
        change = (self._slower(wish) * wish - self._speed) * min(1.0, STEP / SUPPLE)
        most = self.accelerations * STEP
        low, high = self._brakes()
        return np.clip(np.clip(self._speed + np.clip(change, -most, most), -self.speeds, self.speeds), low, high)

    def _brakes(self) -> tuple[Array, Array]:
        """``(n_joints,)`` rad/s each, the speeds from which a joint still stops before its range ends."""
        brakes = BRAKES * self.accelerations

        def fastest(distance: Array) -> Array:
            return np.asarray(brakes * (np.sqrt(STEP**2 / 4 + 2 * np.maximum(distance, 0) / brakes) - STEP / 2))

        return -fastest(self._q - self.ranges.low), fastest(self.ranges.high - self._q)


def _limits(name: str, value: ArrayLike, n: int) -> Array:
    limits = check_point(name, value, n, "one for each joint")
    if not (limits > 0).all():
        raise ValueError(f"{name} must be above 0, got {limits}")
    return read_only(limits)
