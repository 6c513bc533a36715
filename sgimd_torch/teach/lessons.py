"""Lessons by hand: what a recording of a led arm teaches, and what the robot cannot repeat of it.

Section 4.1 of Nguyen & Oudeyer (2014): the correspondence, eqs. (5) and (6), turns a led trajectory into theta_d; the
robot executes theta_d, and where it lands is the outcome of the lesson.
    lesson = lesson_by_hand(recording, rod, rod.primitive.correspondence, led, stream(seed, "lessons", 0))
    save_demonstrations("mine.npz", [lesson.demonstration])
The file holds everything that the learner is shown: a loaded lesson has an equal theta_d, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.fit import beyond_limits, misfit_of
from sgimd_torch.environments.protocol import Environment, primitive_of
from sgimd_torch.spaces import Array, Demonstration, read_only
from sgimd_torch.teach.led import HandLed

RATE: Final = 50.0  # Hz, of the shipped demonstrations and of motor primitives
FASTER: Final = 1.02  # times the speed of the robot's own movements: a faster joint is remarked
MOVES: Final = 0.02  # rad/s: an arm that was never faster did not move
STILL: Final = 0.05  # share of the largest speed: the arm pauses while all joints are slower
AWAY: Final = 0.05  # rad from where movements start: a start farther away is remarked


@dataclass(frozen=True, eq=False)
class LedMovement:
    """How a hand led an arm; where the movement lands is not known yet.

    Attributes:
        times: ``(n_times,)`` s, increasing from 0.
        joints: ``(n_times, n_joints)`` rad.
    """

    times: Array
    joints: Array

    @property
    def duration(self) -> float:
        """Length in s."""
        return float(self.times[-1])

    def moving(self) -> LedMovement:
        """The movement without the pauses before and after it; its times start at 0.

        Raises:
            ValueError: the arm never moved.
        """
        speeds = np.abs(np.diff(self.joints, axis=0)).max(axis=1) / np.diff(self.times)
        if not speeds.max() > MOVES:
            raise ValueError("you did not move the arm")
        moved = np.flatnonzero(speeds > STILL * speeds.max())
        kept = slice(moved[0], moved[-1] + 2)
        return LedMovement(self.times[kept] - self.times[moved[0]], self.joints[kept])


@dataclass(frozen=True, eq=False)
class HandLesson:
    """A lesson for the learner, and how well the robot can follow it.

    Attributes:
        demonstration: the recording, with the outcome of ``theta_d`` executed once.
        theta_d: ``(theta_dim,)`` in Pi that the recording was translated to.
        misfit: distance between recording and movement (rad), see `misfit_of`.
        remarks: a sentence for each thing that the robot cannot follow.
    """

    demonstration: Demonstration
    theta_d: Array
    misfit: float
    remarks: tuple[str, ...]


def lesson_by_hand(
    recording: LedMovement,
    environment: Environment,
    correspondence: Callable[[Array, Array], Array],
    led: HandLed,
    rng: np.random.Generator,
) -> HandLesson:
    """Make a lesson of a recording; the robot executes ``theta_d`` once, in the middle of C.

    A recording longer than the robot's longest movement is played faster, and a remark says so.

    Args:
        recording: movement of the joints of ``led``.
        environment: robot that is taught.
        correspondence: (times, trajectory) -> theta_d.
        led: arm that the hand led.
        rng: noise of the one movement, such as ``stream(seed, "lessons", number)``.

    Raises:
        ValueError: the correspondence refuses the recording.
        SimulationError: theta_d has no outcome.
    """
    context = environment.contexts.low + environment.contexts.sides / 2
    longest = primitive_of(environment).durations[1]
    slower = recording.duration > longest
    times = recording.times / recording.duration * longest if slower else recording.times  # ends exactly at longest
    even, joints = resampled(times, recording.joints)
    theta_d = environment.policies.check("theta_d", correspondence(even, joints))
    shown = Demonstration(context, even, joints, environment.execute(context, theta_d.copy(), rng))
    remarks = (*_unlike_led(recording, times, led), *beyond_limits(environment, shown))
    return HandLesson(shown, read_only(theta_d), misfit_of(environment, theta_d, shown), remarks)


def resampled(times: Array, joints: Array) -> tuple[Array, Array]:
    """The trajectory at equal steps, at least ``RATE`` a second, both ends kept."""
    even = np.linspace(0.0, times[-1], max(2, int(np.ceil(times[-1] * RATE - 1e-9)) + 1))
    return even, np.stack([np.interp(even, times, column) for column in joints.T], axis=1)


def _unlike_led(recording: LedMovement, times: Array, led: HandLed) -> list[str]:
    """A sentence for each difference between a recording, played at ``times``, and how the hand led the arm."""
    remarks = []
    if recording.duration > times[-1]:
        faster = recording.duration / times[-1]
        remarks.append(f"it is played {faster:.3g} times faster: movements last {times[-1]:g} s at most")
    speeds = np.abs(np.diff(recording.joints, axis=0) / np.diff(times)[:, None]).max(axis=0)
    for name, speed, most in zip(led.joints, speeds, speeds if led.speeds is None else led.speeds, strict=True):
        if speed > most * FASTER:
            remarks.append(f"{name} would turn at {speed:.2g} rad/s, its movements at {most:.2g} rad/s at most")
    away = 0.0 if led.start is None else float(np.abs(recording.joints[0] - led.start).max())
    if away > AWAY:
        remarks.append(f"it starts {away:.2g} rad from where movements start, so the robot begins with a jerk")
    return remarks
