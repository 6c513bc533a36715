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

from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.environments.protocol import Environment, HandLed
from sgimd_torch.spaces import Array, Demonstration, read_only

BEYOND: Final = 0.03  # m: what a hand asked for and did not get is told from here on
FASTER: Final = 1.02  # so is a joint that would be so many times faster than the robot's movements
AWAY: Final = 0.05  # rad: so is a start that is this far from where movements start


@dataclass(frozen=True, eq=False)
class HandLesson:
    """A lesson as a learner is shown it, and how well the robot can follow it.

    Args:
        demonstration: the trajectory, and the outcome of ``theta_d`` executed once.
        theta_d: ``(theta_dim,)`` in Pi, what the trajectory corresponds to.
        played: ``(n_times, n_joints)`` rad, what the robot plays in its place; None if it cannot tell.
        remarks: what could not be followed, a sentence each; none if all could.
    """

    demonstration: Demonstration
    theta_d: Array
    played: Array | None
    remarks: tuple[str, ...]

    @property
    def misfits(self) -> Array:
        """``(n_joints,)`` rad, root mean squares over time of what is played minus what was led; NaN if unknown."""
        led = self.demonstration.trajectory
        if self.played is None:
            return np.full(led.shape[1], np.nan)
        return np.asarray(np.sqrt(np.mean((self.played - led) ** 2, axis=0)))

    @property
    def misfit(self) -> float:
        """rad, d of eq. (6): the root mean square of ``misfits``."""
        return float(np.sqrt(np.mean(self.misfits**2)))


def lesson_by_hand(
    recording: Recording,
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
    player = player_of(environment)
    longest = max(getattr(player, "durations", (getattr(player, "duration", np.inf),)))
    paced = recording.within(longest).resampled()
    theta_d = environment.policies.check("theta_d", correspondence(paced.times, paced.joints))
    outcome = environment.execute(context, theta_d.copy(), rng)
    shown = Demonstration(context, paced.times, paced.joints, outcome)
    remarks = (*_as_led(recording, led, longest), *beyond_limits(environment, shown))
    return HandLesson(shown, read_only(theta_d), played(environment, theta_d, shown), remarks)


def player_of(environment: Environment) -> Any:
    """What turns theta into joint angles or commands: ``primitive`` or ``controller`` of a robot that has one."""
    player = getattr(environment, "primitive", None) or getattr(environment, "controller", None)
    return player if hasattr(player, "at") else None


def played(environment: Environment, theta: Array, shown: Demonstration) -> Array | None:
    """``(n_times, n_joints)`` that the robot plays in the place of a recording; None for one that cannot tell."""
    player = player_of(environment)
    if player is None:
        return None
    found: Array = player.at(theta, np.asarray(shown.times - shown.times[0]))
    return found if found.shape == shown.trajectory.shape else None


def beyond_limits(environment: Environment, shown: Demonstration) -> list[str]:
    """What of a recording lies outside the limits of the robot, as far as it tells them."""
    remarks, player = [], player_of(environment)
    box = getattr(player, "joints", getattr(player, "commands", None))
    if box is not None and shown.trajectory.ndim == 2 and shown.trajectory.shape[1] == box.dim:
        outside = (shown.trajectory < box.low) | (shown.trajectory > box.high)
        for joint in np.flatnonzero(outside.any(axis=0)):
            sample = int(outside[:, joint].argmax())
            remarks.append(
                f"joint {joint} is {shown.trajectory[sample, joint]:.3g} at sample {sample}, its range "
                f"[{box.low[joint]:g}, {box.high[joint]:g}]"
            )
    shortest, longest = getattr(player, "durations", (0.0, getattr(player, "duration", np.inf)))
    lasts = float(shown.times[-1] - shown.times[0])
    if not shortest * (1 - 1e-9) <= lasts <= longest * (1 + 1e-9):
        remarks.append(f"too {'fast' if lasts < shortest else 'long'}: movements last {shortest:g} to {longest:g} s")
    if shown.outcome.shape == (environment.outcomes.dim,) and not environment.outcomes.contains(shown.outcome):
        remarks.append("its outcome is outside T: it is imitated, but never a goal")
    return remarks


def _as_led(recording: Recording, led: HandLed, longest: float) -> list[str]:
    """What of a recording the robot cannot do as the hand led it."""
    remarks = []
    if recording.duration > longest:
        faster = recording.duration / longest
        remarks.append(f"it is played {faster:.3g} times faster: movements last {longest:g} s at most")
    if recording.gaps is not None and recording.gaps.max() > BEYOND:
        far = f"up to {recording.gaps.max():.2g} m"
        remarks.append(f"the arm stayed {far} behind the hand, which went too far or too fast for it")
    speeds = recording.within(longest).speeds
    for name, speed, most in zip(led.joints, speeds, speeds if led.speeds is None else led.speeds, strict=True):
        if speed > most * FASTER:
            remarks.append(f"{name} would turn at {speed:.2g} rad/s, its movements at {most:.2g} rad/s at most")
    away = 0.0 if led.start is None else float(np.abs(recording.joints[0] - led.start).max())
    if away > AWAY:
        remarks.append(f"it starts {away:.2g} rad from where movements start, so the robot begins with a jerk")
    return remarks
