"""Lessons given by hand: what a recording of a led arm teaches, and what of it the robot cannot do again.

Section 4.1 of Nguyen & Oudeyer (2014): a led trajectory becomes theta_d by the correspondence, eqs. (5) and (6); the
robot executes it, and where it lands is the lesson's outcome.
    lesson = lesson_by_hand(recording, rod, rod.primitive.correspondence, rod.hand_led, stream(seed, "lessons", 0))
    save_demonstrations("mine.npz", [lesson.demonstration])
The file says all that the learner is shown: loaded again, it has the same theta_d, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import Environment, HandLed
from sgimd_torch.spaces import Array, Box, Demonstration, read_only

RATE: Final = 50.0  # Hz, of the shipped demonstrations and of motor primitives
LAG: Final = 0.03  # m: warn when the arm lags the hand by more
FASTER: Final = 1.02  # warn when a joint would be so many times faster than in the robot's own movements
MOVES: Final = 0.02  # rad/s: an arm that never was faster did not move
STILL: Final = 0.05  # of the largest speed: all joints slower than this is a pause
AWAY: Final = 0.05  # rad: warn when it starts farther than this from where movements start


@dataclass(frozen=True, eq=False)
class LedMovement:
    """What a hand did with an arm, before anybody knows where the movement lands.

    ``times`` ``(n_times,)`` s, increasing from 0; ``joints`` ``(n_times, n_joints)`` rad; ``gaps`` ``(n_times,)`` m,
    how far the led point stayed from the way that the hand wanted it to go, 0 where nothing was held.
    """

    times: Array
    joints: Array
    gaps: Array

    @property
    def duration(self) -> float:
        """s."""
        return float(self.times[-1])

    def moving(self) -> LedMovement:
        """The same without the stillness before and after it, its times from 0.

        Raises:
            ValueError: it never moved.
        """
        speeds = np.abs(np.diff(self.joints, axis=0)).max(axis=1) / np.diff(self.times)
        if not speeds.max() > MOVES:
            raise ValueError("you did not move the arm")
        moved = np.flatnonzero(speeds > STILL * speeds.max())
        kept = slice(moved[0], moved[-1] + 2)
        return LedMovement(self.times[kept] - self.times[moved[0]], self.joints[kept], self.gaps[kept])


@dataclass(frozen=True, eq=False)
class HandLesson:
    """A lesson as a learner is shown it, and how well the robot can follow it.

    Args:
        demonstration: the trajectory, and the outcome of ``theta_d`` executed once.
        theta_d: ``(theta_dim,)`` in Pi, what the trajectory corresponds to.
        misfit: rad, see `misfit_of`.
        remarks: what could not be followed, a sentence each; none if all could.
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
    *,
    context: ArrayLike | None = None,
) -> HandLesson:
    """The lesson that a recording gives; ``theta_d`` is executed once.

    A recording may last longer than the robot's movements; it is then played in the longest of them, and the lesson
    says so.

    Args:
        recording: of the joints of ``led``.
        environment, correspondence: as of the run that is taught.
        led: what was led.
        rng: of the noise of that one movement, such as ``stream(seed, "lessons", number)``.
        context: ``(context_dim,)`` in which it is executed; None for the middle of C.

    Raises:
        ValueError: the correspondence refuses the recording.
        SimulationError: theta_d has no outcome.
    """
    middle = (environment.contexts.low + environment.contexts.high) / 2
    context = environment.contexts.check("context", middle if context is None else context)
    _, longest = durations_of(environment)
    slower = recording.duration > longest
    times = recording.times / recording.duration * longest if slower else recording.times  # ends exactly at longest
    even, joints = resampled(times, recording.joints)
    theta_d = environment.policies.check("theta_d", correspondence(even, joints))
    shown = Demonstration(context, even, joints, environment.execute(context, theta_d.copy(), rng))
    remarks = (*_as_led(recording, times, led), *beyond_limits(environment, shown))
    return HandLesson(shown, read_only(theta_d), misfit_of(environment, theta_d, shown), remarks)


def resampled(times: Array, joints: Array) -> tuple[Array, Array]:
    """The same movement at equal steps, at least ``RATE`` of them a second."""
    even = np.linspace(0.0, times[-1], max(2, int(np.ceil(times[-1] * RATE - 1e-9)) + 1))
    return even, np.stack([np.interp(even, times, column) for column in joints.T], axis=1)


def misfit_of(environment: Environment, theta: Array, shown: Demonstration) -> float:
    """d of eq. (6): the root mean square (rad), over time and joints, of what the robot plays minus what was shown.

    Args:
        environment: has a ``primitive`` or a ``controller``; NaN for one that cannot tell what it plays.
        theta: ``(theta_dim,)``, what the recording was translated to.
        shown: the recording.
    """
    player = _player_of(environment)
    played = None if player is None else player.at(theta, shown.times - shown.times[0])
    if played is None or played.shape != shown.trajectory.shape:
        return float("nan")
    return float(np.sqrt(np.mean((played - shown.trajectory) ** 2)))


def ranges_of(environment: Environment) -> Box | None:
    """The ranges of the joints or commands that recordings are of; None for a robot that does not tell."""
    player = _player_of(environment)
    return getattr(player, "joints", getattr(player, "commands", None))


def beyond_limits(environment: Environment, shown: Demonstration) -> list[str]:
    """What of a recording lies outside the limits of the robot, as far as it tells them."""
    remarks, box = [], ranges_of(environment)
    if box is not None and shown.trajectory.ndim == 2 and shown.trajectory.shape[1] == box.dim:
        outside = (shown.trajectory < box.low) | (shown.trajectory > box.high)
        for joint in np.flatnonzero(outside.any(axis=0)):
            sample = int(outside[:, joint].argmax())
            found = f"joint {joint} is {shown.trajectory[sample, joint]:.3g} at sample {sample}"
            remarks.append(f"{found}, its range [{box.low[joint]:g}, {box.high[joint]:g}]")
    shortest, longest = durations_of(environment)
    lasts = float(shown.times[-1] - shown.times[0])
    if not shortest * (1 - 1e-9) <= lasts <= longest * (1 + 1e-9):
        remarks.append(f"too {'fast' if lasts < shortest else 'long'}: movements last {shortest:g} to {longest:g} s")
    if shown.outcome.shape == (environment.outcomes.dim,) and not environment.outcomes.contains(shown.outcome):
        remarks.append("its outcome is outside T: it is imitated, but never a goal")
    return remarks


def _player_of(environment: Environment) -> Any:
    """What turns theta into joint angles or commands: ``primitive`` or ``controller`` of a robot that has one."""
    player = getattr(environment, "primitive", None) or getattr(environment, "controller", None)
    return player if hasattr(player, "at") else None


def durations_of(environment: Environment) -> tuple[float, float]:
    """s, how long the robot's movements last, at least and at most."""
    player = _player_of(environment)
    shortest, *_, longest = getattr(player, "durations", (0.0, getattr(player, "duration", np.inf)))
    return shortest, longest


def _as_led(recording: LedMovement, times: Array, led: HandLed) -> list[str]:
    """What of a recording, played at ``times``, the robot cannot do as the hand led it."""
    remarks = []
    if recording.duration > times[-1]:
        faster = recording.duration / times[-1]
        remarks.append(f"it is played {faster:.3g} times faster: movements last {times[-1]:g} s at most")
    if recording.gaps.max() > LAG:
        far = f"up to {recording.gaps.max():.2g} m"
        remarks.append(f"the arm stayed {far} behind the hand, which went too far or too fast for it")
    speeds = np.abs(np.diff(recording.joints, axis=0) / np.diff(times)[:, None]).max(axis=0)
    for name, speed, most in zip(led.joints, speeds, speeds if led.speeds is None else led.speeds, strict=True):
        if speed > most * FASTER:
            remarks.append(f"{name} would turn at {speed:.2g} rad/s, its movements at {most:.2g} rad/s at most")
    away = 0.0 if led.start is None else float(np.abs(recording.joints[0] - led.start).max())
    if away > AWAY:
        remarks.append(f"it starts {away:.2g} rad from where movements start, so the robot begins with a jerk")
    return remarks
