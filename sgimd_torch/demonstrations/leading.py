"""Kinesthetic teaching without a robot: a compliant arm that follows a hand, and records how it was led.

Section 5.3 of Nguyen & Oudeyer (2014): demonstrator 3 led the arm by the hand. Here the arm is a MuJoCo model without
weight. It follows the point at which it is held, by damped least squares, never beyond its joints' ranges, speeds and
accelerations; where it is let go, it stays.
    leading = Leading(rod.hand_led); leading.grab("hand"); leading.record()
    for point in path: leading.drag(point); leading.step(0.02)
    leading.release(); recording = leading.stop()
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.demonstrations.arm import Arm
from sgimd_torch.demonstrations.lessons import LedMovement
from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array, check_point, read_only

STEP: Final = 0.01  # s, from one posture of the arm to the next
FOLLOW: Final = 15.0  # 1/s, how quickly a held point follows: nearly all of a jump within 5 / FOLLOW
RECENT: Final = 0.4  # s: how long ago the hand may have been where the held point is now
SUPPLE: Final = 0.03  # s, in which a joint takes up a speed: a hand's trembling does not become the arm's
DAMPING: Final = 0.1  # of the least squares, relative to the arm's levers: near a stretched posture joints stay slow
BRAKES: Final = 0.88  # of the acceleration, to stop before a range ends: the last step may take 9/8 of it
CROSSING: Final = 1.0  # s, in which a joint of unknown speed crosses its range


class _Hand:
    """Holds a ``place`` ``(3,)`` m on a ``body``, in its frame, and wants it at ``target`` ``(3,)`` m in the world.

    A browser tells of a hand about 20 times a second, so it jumps. What the arm is asked to follow, ``_wanted`` (m),
    goes after the target in a critically damped motion of velocity ``_pull`` (m/s).
    """

    def __init__(self, body: int, place: Array, target: Array) -> None:
        self.body, self.place, self.target = body, place, target
        self._wanted, self._pull = target, np.zeros(3)
        self._lately = deque([target], maxlen=round(RECENT / STEP))  # targets

    def follow(self, point: Array) -> Array:
        """``(3,)`` m/s, the velocity that the held ``point`` should have in the next step."""
        self._pull = self._pull + STEP * FOLLOW**2 * (self.target - self._wanted - 2 / FOLLOW * self._pull)
        self._wanted = self._wanted + STEP * self._pull
        self._lately.append(self.target)
        velocity: Array = self._pull + FOLLOW * (self._wanted - point)
        return velocity

    def gap(self, point: Array) -> float:
        """m, from the held ``point`` to the nearest target of the last moments."""
        return float(np.linalg.norm(np.stack(self._lately) - point, axis=1).min())


class Leading:
    """An arm that a hand leads. It never jumps: ``step`` moves it by what fits into that time.

    ``data`` is the model in the posture of now, to be drawn; ``links`` are the bodies that can be grabbed, by name.

    Args:
        led: the arm, as an environment gives it as ``hand_led``; what is not led in its model keeps its posture
            relative to the link that carries it.

    Raises:
        ValueError: a name that the model does not have, a joint that is no hinge or slide, no range, a start outside
            the ranges, or a limit that is not above 0.
    """

    def __init__(self, led: HandLed) -> None:
        self._arm = arm = Arm(led.model, led.joints, led.ranges)
        self.data, self.ranges, self.links = arm.data, arm.ranges, arm.links
        whole = self.ranges.sides / CROSSING
        self.speeds = _limits("speeds", 1.5 * whole if led.speeds is None else led.speeds, len(whole))
        self.accelerations = _limits(
            "accelerations", 6 * whole if led.accelerations is None else led.accelerations, len(whole)
        )
        posture = self.ranges.clip(arm.posture) if led.start is None else led.start
        self.start = read_only(
            self.ranges.check("start", check_point("start", posture, len(whole)), "are they in rad?")
        )
        self._hand = arm.place_of(led.hand)
        self._held: _Hand | None = None
        self._rows: list[tuple[Array, float]] | None = None
        self.home()

    @property
    def q(self) -> Array:
        """``(n_joints,)`` rad, where the joints are."""
        return self._q.copy()

    @property
    def point(self) -> Array:
        """``(3,)`` m, where the point is at which the arm is held; without a hand on it, its own hand."""
        return self._arm.where(*((self._held.body, self._held.place) if self._held else self._hand))

    @property
    def hand(self) -> Array:
        """``(3,)`` m, where its own hand is."""
        return self._arm.where(*self._hand)

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
            raise RuntimeError("the arm cannot jump home during a recording; stop() it first")
        self._q, self._speed, self._since = self.start.copy(), np.zeros(len(self.start)), 0.0
        self._held = None
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
        self._held = _Hand(number, place, self._arm.where(number, place))

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

    def stop(self) -> LedMovement:
        """End the recording and give it.

        Raises:
            RuntimeError: none is under way.
            ValueError: it holds one posture only, as no time has passed; it is over all the same.
        """
        if self._rows is None:
            raise RuntimeError("nothing is being recorded; record() comes first")
        rows, self._rows = self._rows, None
        if len(rows) < 2:
            raise ValueError("a recording needs 2 postures or more; was it too short?")
        postures, gaps = zip(*rows, strict=True)
        times = np.arange(len(rows), dtype=np.float64) * STEP
        return LedMovement(times, np.stack(postures), np.array(gaps))

    def _advance(self) -> None:
        held = self._held
        wish = np.zeros(len(self.start)) if held is None else self._towards(held.follow(self.point), held.body)
        speed = self._within(wish)
        q = self.ranges.clip(self._q + speed * STEP)  # rounding
        self._speed, self._q = (q - self._q) / STEP, q
        self._arm.pose(self._q)
        if self._rows is not None:
            self._rows.append((self.q, self.gap))

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
        speed, free = np.zeros(len(self.start)), np.ones(len(self.start), dtype=bool)
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
