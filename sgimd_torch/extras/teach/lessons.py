"""Lessons by hand: demonstrations made of recordings of a led arm, with remarks on what the robot cannot repeat.

Section 4.1 of Nguyen & Oudeyer (2014): the correspondence, eqs. (5) and (6), turns a led trajectory into theta_d; the
robot executes theta_d, and the outcome of this movement is the outcome of the lesson.
    lesson = lesson_by_hand(*moving(*leading.end_recording()), task, stream(seed, "lessons", 0))
    save_demonstrations("mine.npz", [lesson.demonstration])
The file has the whole recording, so a loaded lesson gives an equal theta_d, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.environments.protocol import execute_one, primitive_of
from sgimd_torch.extras.recordings.limits import beyond_limits
from sgimd_torch.extras.teach.led import HandLed, hand_led_of
from sgimd_torch.spaces import Array, Demonstration, read_only
from sgimd_torch.tasks import Task
from sgimd_torch.tasks.taught import correspondence_of

FASTER: Final = 1.02  # multiple of the robot's largest speed; a joint that was led faster gets a remark
AWAY: Final = 0.05  # rad; a recording that starts farther from the start of movements gets a remark


@dataclass(frozen=True, eq=False)
class HandLesson:
    """A lesson for the learner, with remarks on what the robot cannot repeat.

    Attributes:
        demonstration: the recording, with the outcome of one execution of ``theta_d``.
        theta_d: ``(theta_dim,)`` policy that the correspondence gives for the recording.
        misfit: distance (rad) from the recording to the movement that the robot plays, see `misfit_of`.
        remarks: sentences, one for each property of the recording that the robot cannot repeat.
    """

    demonstration: Demonstration
    theta_d: Array
    misfit: float
    remarks: tuple[str, ...]


def lesson_by_hand(times: Array, joints: Array, task: Task, rng: np.random.Generator) -> HandLesson:
    """Make a lesson of a recording; the robot executes ``theta_d`` once, in the middle of C.

    A recording longer than the robot's longest movement is played faster, and a remark says so.

    Args:
        times: ``(n_times,)`` s, increasing from 0.
        joints: ``(n_times, n_joints)`` rad, postures of the led arm.
        task: task of the learner, whose robot was led.
        rng: random stream of the motor noise, such as ``stream(seed, "lessons", number)``.

    Raises:
        ValueError: the robot cannot be led, or its correspondence refuses the recording.
        SimulationError: the execution of ``theta_d`` fails.
    """
    robot, led = task.environment, hand_led_of(task)
    longest = primitive_of(robot).durations[1]
    played = times / times[-1] * longest if times[-1] > longest else times  # the last time equals longest exactly
    theta_d = robot.policies.check("theta_d", correspondence_of(task)(played, joints))
    context = robot.contexts.low + robot.contexts.sides / 2
    demonstration = Demonstration(context, played, joints, execute_one(robot, context, theta_d, rng))
    remarks = (*_differences(times, played, joints, led), *beyond_limits(robot, demonstration))
    return HandLesson(demonstration, read_only(theta_d), misfit_of(robot, theta_d, demonstration), remarks)


def _differences(times: Array, played: Array, joints: Array, led: HandLed) -> list[str]:
    """A sentence for each way in which the robot's repetition at the times ``played`` must differ from a recording."""
    remarks = []
    if times[-1] > played[-1]:
        faster = times[-1] / played[-1]
        remarks.append(f"it is played {faster:.3g} times faster: movements last {played[-1]:g} s at most")
    speeds = np.abs(np.diff(joints, axis=0) / np.diff(played)[:, None]).max(axis=0)
    for name, speed, most in zip(led.joints, speeds, speeds if led.speeds is None else led.speeds, strict=True):
        if speed > most * FASTER:
            remarks.append(f"{name} would turn at {speed:.2g} rad/s, but movements reach {most:.2g} rad/s at most")
    away = 0.0 if led.start is None else float(np.abs(joints[0] - led.start).max())
    if away > AWAY:
        remarks.append(f"it starts {away:.2g} rad from where movements start, so the robot begins with a jerk")
    return remarks
