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

from collections import deque
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.environments.protocol import HandLed
from sgimd_torch.spaces import Array, Box, check_point, read_only

STEP = 0.01  # s, from one posture to the next; a recording has them all
FOLLOW = 15.0  # 1/s, how quickly the led point follows the hand: nearly all of a jump within 5 / FOLLOW
SUPPLE = 0.03  # s, in which a joint takes up a speed: a hand's trembling does not become the arm's
DAMPING = 0.1  # of the least squares, relative to the arm's levers: near a stretched posture joints stay slow
BRAKES = 0.88  # of the acceleration, to stop before a range ends: the last step takes up to 9/8 of what is planned
REACH = 0.4  # s: how long ago a hand may have been where the led point is now
CROSSING = 1.0  # s, in which a joint of unknown speed crosses its range

_TURNS_OR_SLIDES: Final = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


class _Hold:
    """A hand on the arm: ``place`` (3,) m on a ``body``, in its frame, and ``target`` (3,) m where the hand wants it.

    The hand jumps, as a browser tells of it about 20 times a second. What the arm is asked to follow, ``_wanted`` (m),
    goes after it in a critically damped motion of velocity ``_pull`` (m/s).
    """

    def __init__(self, body: int, place: Array, target: Array) -> None:
        self.body, self.place, self.target = body, place, target
        self._wanted, self._pull = target, np.zeros(3)
        self._lately = deque([target], maxlen=round(REACH / STEP))  # targets

    def follow(self, point: Array) -> Array:
        """``(3,)`` m/s, the velocity that the held ``point`` should have in the next step."""
        self._pull = self._pull + STEP * FOLLOW**2 * (self.target - self._wanted - 2 / FOLLOW * self._pull)
        self._wanted = self._wanted + STEP * self._pull
        self._lately.append(self.target)
        velocity: Array = self._pull + FOLLOW * (self._wanted - point)
        return velocity

    def gap(self, point: Array) -> float:
        """m, from the held ``point`` to the nearest target of the last moments."""
        return min(float(np.linalg.norm(each - point)) for each in self._lately)


class Leading:
    """An arm that a hand leads. It never jumps: ``step`` moves it by what fits into that time.

    Args:
        model: of the arm; all else in it keeps its posture relative to the link that carries it.
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
        model: mujoco.MjModel,
        joints: Sequence[str],
        hand: str,
        *,
        ranges: Box | None = None,
        start: ArrayLike | None = None,
        speeds: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
    ) -> None:
        self.model, self.joints, self.hand = model, tuple(joints), hand
        self._numbers = [_number(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in self.joints]
        for name, number in zip(self.joints, self._numbers, strict=True):
            if int(model.jnt_type[number]) not in _TURNS_OR_SLIDES:
                raise ValueError(f"joint {name} is neither a hinge nor a slide; only these can be led")
        self._angles, self._speeds = model.jnt_qposadr[self._numbers], model.jnt_dofadr[self._numbers]
        self.ranges = self._ranges() if ranges is None else ranges
        n = len(self.joints)
        if self.ranges.dim != n:
            raise ValueError(f"needs a range for each of {n} joints, got {self.ranges.dim}")
        whole = self.ranges.sides / CROSSING
        self.speeds = _limits("speeds", 1.5 * whole if speeds is None else speeds, n)
        self.accelerations = _limits("accelerations", 6 * whole if accelerations is None else accelerations, n)
        self.data = mujoco.MjData(model)
        """The model in the posture of now; to be read, for drawing."""
        posture = self.ranges.clip(self.data.qpos[self._angles]) if start is None else start
        self.start = read_only(self.ranges.check("start", check_point("start", posture, n), "are they in rad?"))
        self._hand = self._place_of(hand)
        self._held: _Hold | None = None
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
        return self._in_world(*((self._held.body, self._held.place) if self._held else self._hand))

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
        self._pose()

    def grab(self, body: str | None = None, point: ArrayLike | None = None) -> None:
        """Take hold of the arm.

        Args:
            body: name of a body or site; None for the hand.
            point: ``(3,)`` m in the world, where it is touched; None for the origin of ``body``.

        Raises:
            ValueError: the model has no such body, or the joints do not move it alone, as the water or a line.
        """
        number, place = self._hand if body is None else self._place_of(body)
        if point is not None:
            away = check_point("point", point, 3, "in m") - self.data.xpos[number]
            place = self.data.xmat[number].reshape(3, 3).T @ away
        self._held, self._goal = _Hold(number, place, self._in_world(number, place)), None

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
        """Let go: the arm comes to rest as quickly as it can, and stays there. Nothing happens if nothing is held."""
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
        self._pose()
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

        A joint that would leave its range is fixed at its end, and the others do what it does not.
        """
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, jacobian, None, self.point, body)
        levers = jacobian[:, self._speeds]
        damping = DAMPING**2 * np.square(levers).sum() / 3 + 1e-12
        speed, free = np.zeros(len(self.joints)), np.ones(len(self.joints), dtype=bool)
        low, high = self._brakes()
        while free.any():
            rest = velocity - levers[:, ~free] @ speed[~free]
            moved = levers[:, free]
            speed[free] = moved.T @ np.linalg.solve(moved @ moved.T + damping * np.eye(3), rest)
            beyond = free & ((speed < low) | (speed > high))
            if not beyond.any():
                break
            speed[beyond] = np.clip(speed, low, high)[beyond]
            free &= ~beyond
        return speed

    def _within(self, wish: Array) -> Array:
        """The speeds of the next step: towards the wished ones, in their direction, within all limits."""
        slower = min(1.0, float((self.speeds / np.maximum(np.abs(wish), 1e-12)).min()))
        change = (slower * wish - self._speed) * min(1.0, STEP / SUPPLE)
        most = self.accelerations * STEP
        low, high = self._brakes()
        return np.clip(np.clip(self._speed + np.clip(change, -most, most), -self.speeds, self.speeds), low, high)

    def _brakes(self) -> tuple[Array, Array]:
        """``(n_joints,)`` rad/s each, the speeds from which a joint still stops before its range ends."""
        brakes = BRAKES * self.accelerations

        def fastest(distance: Array) -> Array:
            return np.asarray(brakes * (np.sqrt(STEP**2 / 4 + 2 * np.maximum(distance, 0) / brakes) - STEP / 2))

        return -fastest(self._q - self.ranges.low), fastest(self.ranges.high - self._q)

    def _in_world(self, body: int, place: Array) -> Array:
        return np.asarray(self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ place)

    def _pose(self) -> None:
        self.data.qpos[self._angles] = self._q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def _place_of(self, name: str) -> tuple[int, Array]:
        """A body that the led joints move, and a place on it ``(3,)`` m in its own frame; of a body or site."""
        body, place = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name), np.zeros(3)
        if body < 0:
            site = _number(self.model, mujoco.mjtObj.mjOBJ_SITE, name, "body or site")
            body, place = int(self.model.site_bodyid[site]), self.model.site_pos[site].copy()
        moved_by, above = set[int](), body
        while above:
            first = int(self.model.body_jntadr[above])
            moved_by |= set(range(first, first + int(self.model.body_jntnum[above])))
            above = int(self.model.body_parentid[above])
        if not moved_by or not moved_by <= set(self._numbers):
            why = "other joints move it, too" if moved_by else "no joint moves it"
            raise ValueError(f"{name} cannot be grabbed: {why}; grab a link of the arm, as {self.hand}")
        return body, place

    def _ranges(self) -> Box:
        for name, number in zip(self.joints, self._numbers, strict=True):
            if not self.model.jnt_limited[number]:
                raise ValueError(f"joint {name} has no range in the model; give ranges")
        return Box(*self.model.jnt_range[self._numbers].T)


def _number(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, called: str = "joint") -> int:
    number = mujoco.mj_name2id(model, kind, name)
    if number < 0:
        raise ValueError(f"the model has no {called} called {name!r}; is it spelt as in the model?")
    return int(number)


def _limits(name: str, value: ArrayLike, n: int) -> Array:
    limits = check_point(name, value, n, "one for each joint")
    if not (limits > 0).all():
        raise ValueError(f"{name} must be above 0, got {limits}")
    return read_only(limits)
