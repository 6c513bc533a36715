"""Robots that a person can lead by the hand: a MuJoCo model, the led joints of the model, and their limits.

    led = hand_led_of(task); led.joints
The arm, the rod and robots from model files are known here. A robot of your own needs an attribute ``hand_led``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from sgimd_torch.environments.fishing_rod import JOINT_RANGES, JOINTS, FishingRod
from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.spaces import Array, Box
from sgimd_torch.tasks import Task
from sgimd_torch.tasks.taught import correspondence_of


def on_the_plane(points: Array) -> Array:
    """Positions ``(n, 3)`` m of points of T whose first two dimensions are x and y; z is 0."""
    return np.pad(points[:, :2], ((0, 0), (0, 3 - min(2, points.shape[1]))))


@dataclass(frozen=True, eq=False)
class HandLed:
    """A robot that a person can lead by the hand; `Arm` checks it.

    Args:
        model: MuJoCo model of the robot and its objects.
        joints: names of the joints that a policy moves, in the order of a recording's columns.
        hand: name of the body or site by which a person usually leads the robot.
        ranges: ``(n_joints,)`` ranges (rad; m for a slide joint); None for the ranges in the model.
        start: ``(n_joints,)`` posture in which every movement starts; None for the initial posture of the model.
        speeds: ``(n_joints,)`` rad/s, largest speeds of the robot's own movements, which limit the led movements, too.
            None for 1.5 times the range per s, the largest speed of a smooth movement of 1 s over the range.
        accelerations: ``(n_joints,)`` rad/s^2, largest accelerations of the robot's own movements; None for 6 times the
            range per s^2.
        positions: ``(nq,)`` positions of all joints at the start of movements, except for the led ones; None for the
            initial positions of the model.
        hidden: names of bodies that are not drawn.
        located: function from points of T ``(n, outcome_dim)`` to positions in the world ``(n, 3)`` m.
    """

    model: mujoco.MjModel
    joints: tuple[str, ...]
    hand: str
    ranges: Box | None = None
    start: Array | None = None
    speeds: Array | None = None
    accelerations: Array | None = None
    positions: Array | None = None
    hidden: tuple[str, ...] = ()
    located: Callable[[Array], Array] = on_the_plane


def hand_led_of(task: Task) -> HandLed:
    """Model, led joints and limits of the robot of a task.

    Raises:
        ValueError: the robot cannot be led, or it has no correspondence to translate recordings.
    """
    robot = task.environment
    own = getattr(robot, "hand_led", None)
    if isinstance(own, HandLed):
        led = own
    elif isinstance(robot, FishingRod):
        led = rod_led(robot)
    elif isinstance(robot, PlanarArm):
        led = arm_led(robot)
    elif isinstance(robot, MujocoRobot) and isinstance(robot.primitive, GaussianPrimitive) and robot.joints:
        start = robot.start_in((robot.contexts.low + robot.contexts.high) / 2)  # as in a lesson
        measured = robot.located(robot.rest[None], start).shape[1] > 0  # else T is of joints
        led = HandLed(
            *(robot.model, robot.joints, robot.hand, robot.primitive.joints, robot.start),
            *robot.primitive.fastest(),
            positions=robot.positions(start),
            located=(lambda points: robot.located(points, start)[:, 0]) if measured else on_the_plane,
        )
    else:
        raise ValueError(
            f"{type(robot).__name__} cannot be led by the hand: it does not say which joints of which model a hand "
            "moves; give it an attribute hand_led, a HandLed(model, joints, hand) of sgimd_torch.extras.teach.led"
        )
    correspondence_of(task)
    return led


def rod_led(rod: FishingRod) -> HandLed:
    """The fishing rod, led by its tip, no faster than its motor primitive moves it."""
    middle = (JOINT_RANGES.low + JOINT_RANGES.high) / 2
    names = [rod.model.body(k).name for k in range(rod.model.nbody)]
    line = tuple(name for name in names if name.startswith(("line", "float")))
    return HandLed(rod.model, JOINTS, "tip", JOINT_RANGES, middle, *rod.primitive.fastest(), hidden=line)


def arm_led(arm: PlanarArm) -> HandLed:
    """A planar arm, led by its end, no faster than in a smooth movement of 1 s."""
    n, limits = arm.policies.dim, arm.angles(np.ones(arm.policies.dim))
    names = tuple(f"joint_{k}" for k in range(n))
    fastest = 1.5 * limits, 6 * limits  # largest speed and acceleration of 3 t^2 - 2 t^3
    return HandLed(planar_model(n, 1 / n), names, "end", Box(-limits, limits), np.zeros(n), *fastest)


def planar_model(n_links: int, length: float) -> mujoco.MjModel:
    """An arm in the plane z = 0 with a hinge before each link of a ``length`` (m); at zero angles it lies along +x."""
    inner = f'<site name="end" pos="{length} 0 0"/>'
    for k in reversed(range(n_links)):
        inner = f"""<body name="link_{k}" pos="{length if k else 0} 0 0"><joint name="joint_{k}" axis="0 0 1"/>
            <geom type="capsule" fromto="0 0 0 {length} 0 0" size="{0.02 * n_links * length}"/>{inner}</body>"""
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
