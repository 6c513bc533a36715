"""Toy robots as tasks, each of which is hard to learn for a different reason; a movement takes microseconds.

Each robot is a `Toy`: boxes, and a function from context and theta to the outcome, to which Gaussian noise is added.
    toss: the wind is the context                    crawler: most parameters are phases, for which 0 equals 1
    two_elbows: two families of postures             spatial_arm: three outcome dimensions, in cm
    puck: a puck to hit; its place is the context    fetch: a ball to grasp and carry
    half_reached: half of T is out of reach          blind_toss: the toss, but the learner does not know the wind
    soft_arm: nine tendons, three outcome dimensions
    sgimd run --environment experiments.toys:toss    # in the root folder of the repository

The outcome of puck and fetch is the final place of an object. If a movement misses the object, the outcome does not
show how far the hand was from the object. So goal babbling learns nothing from most movements.

Benchmark goals and demonstrations do not depend on the seed of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.evaluation import Benchmark, tile_goals
from sgimd_torch.spaces import Array, Box, Demonstration, check_rng, stream
from sgimd_torch.tasks import Task
from sgimd_torch.tasks.robots import arm_benchmark

GRAVITY: Final = 9.81  # m/s^2
STROKES: Final = 10  # number of strokes in one movement of the crawler
SWING_STEPS: Final = 50  # number of steps of a swing at the puck; within a step the hand moves in a straight line
FRICTION: Final = 0.3  # coefficient of friction of the puck on the table
BOUNCE: Final = 0.5  # coefficient of restitution of hand and puck
N_DEMONSTRATIONS: Final = 127  # largest number of demonstrations, equal to that of the rod's demonstrators
N_REACHING: Final = 20_000  # number of uniform movements by which the reachable part of T is found
PLANE: Final = Box.cube(-1, 1, 2, names=("x", "y"), unit="m")


@dataclass(frozen=True, eq=False)
class Toy:
    """A robot whose noise-free outcome is a formula.

    Args:
        contexts, policies, outcomes: C, Pi and T.
        effect: function (contexts ``(..., context_dim)``, thetas ``(..., theta_dim)``) -> outcomes without noise.
        still: ``(theta_dim,)``, movement whose outcome in the middle of C is ``rest``.
        outcome_noise: standard deviation of the noise on each dimension of the outcome, in the unit of T.
    """

    contexts: Box
    policies: Box
    outcomes: Box
    effect: Callable[[Array, Array], Array]
    still: Array
    outcome_noise: float
    rest: Array = field(init=False)

    def __post_init__(self) -> None:
        rest = self.effect((self.contexts.low + self.contexts.high) / 2, self.still)
        object.__setattr__(self, "rest", self.outcomes.clip(rest))

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, uniform in C."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one movement; see `Environment`."""
        context, theta = check_movement(self, context, theta)
        check_rng(rng)
        return rng.normal(self.effect(context, theta), self.outcome_noise)


def toss(*, noise: float = 0.03) -> Task:
    """An arm throws a ball on a floor; the context is the wind (m/s^2) from the left.

    theta: direction, elevation, speed and height of release. A high and a flat throw can land in the same place, but
    the wind blows a high throw farther. Outcome: landing place, sideways and forwards (m).
    """
    ranges = Box(np.array([-np.pi / 3, np.pi / 18, 1.0, 0.5]), np.array([np.pi / 3, np.pi * 8 / 18, 6.0, 1.5]))

    def landing(context: Array, theta: Array) -> Array:
        direction, elevation, speed, height = np.moveaxis(ranges.low + theta * ranges.sides, -1, 0)
        upwards = speed * np.sin(elevation)
        duration = (upwards + np.sqrt(upwards**2 + 2 * GRAVITY * height)) / GRAVITY
        distance = speed * np.cos(elevation) * duration
        blown = context[..., 0] * duration**2 / 2
        return np.stack([distance * np.sin(direction) + blown, distance * np.cos(direction)], axis=-1)

    weak = np.array([0.5, 0.5, 0.0, 0.0])
    floor = Box(np.array([-5.0, 0.0]), np.array([5.0, 5.0]), ("sideways", "forwards"), "m")
    return toy_task(
        Toy(Box.cube(-1, 1, 1, names=("wind",), unit="m/s²"), Box.cube(0, 1, 4), floor, landing, weak, noise),
        0.4,
        taught=True,
    )


def crawler(*, noise: float = 0.02) -> Task:
    """A robot crawls ten strokes; in each stroke each of its four legs pushes once.

    theta: phase of each leg in a stroke, where 0 equals 1, and amplitude of the swing. Phase lags between successive
    legs drive the robot forwards; phase differences between left and right legs turn the robot. Outcome: place of the
    robot (m) after ten strokes.
    """
    side = np.array([1.0, 0.5, -0.5, -1.0])

    def place(context: Array, theta: Array) -> Array:
        phases, swing = 2 * np.pi * theta[..., :4], theta[..., 4:]
        step = 0.1 * swing * np.sin(np.diff(phases, axis=-1)).mean(axis=-1, keepdims=True)
        turn = 0.6 * swing * (side * np.cos(phases)).mean(axis=-1, keepdims=True)
        heading = np.arange(1, 1 + STROKES) * turn  # (..., strokes)
        return np.stack([(step * np.cos(heading)).sum(axis=-1), (step * np.sin(heading)).sum(axis=-1)], axis=-1)

    return toy_task(Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 5), PLANE, place, np.zeros(5), noise), 0.1)


def two_elbows(*, noise: float = 0.01) -> Task:
    """A planar arm of three links whose elbow bends to either side by 30 degrees or more: two families of postures.

    theta: shoulder, elbow and wrist; below .5 the elbow bends to the right, above .5 to the left. Each family reaches
    nearly every place, but the mean of two postures from both families lands elsewhere. Outcome: the hand's place (m).
    """
    lengths = np.array([0.5, 0.4, 0.1])

    def hand(context: Array, theta: Array) -> Array:
        bend = 2 * theta[..., 1] - 1  # -1 to 1
        way = np.where(bend < 0, -1.0, 1.0)
        elbow = way * np.pi * (30 + 120 * np.abs(bend)) / 180
        angles = np.stack([np.pi * (theta[..., 0] - 0.5), elbow, np.pi / 2 * (theta[..., 2] - 0.5)], axis=-1)
        directions = np.cumsum(angles, axis=-1)
        return np.stack([np.cos(directions) @ lengths, np.sin(directions) @ lengths], axis=-1)

    folded = np.array([0.5, 1.0, 0.5])
    return toy_task(Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 3), PLANE, hand, folded, noise), 0.1)


def spatial_arm(*, noise: float = 1.0) -> Task:
    """An arm that turns about the vertical and bends in five joints, with links of 20 cm.

    theta: the turn, within +-150 degrees, and five bends, within +-60 degrees. Outcome: the hand's x, y, height (cm).
    """

    def hand(context: Array, theta: Array) -> Array:
        turn = np.pi * 5 / 6 * (2 * theta[..., 0] - 1)
        heights = np.cumsum(np.pi / 3 * (2 * theta[..., 1:] - 1), axis=-1)
        reach = 20.0 * np.cos(heights).sum(axis=-1)
        up = 20.0 * np.sin(heights).sum(axis=-1)
        return np.stack([reach * np.cos(turn), reach * np.sin(turn), up], axis=-1)

    middle = np.full(6, 0.5)
    space = Box.cube(-100, 100, 3, names=("x", "y", "height"), unit="cm")
    return toy_task(Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 6), space, hand, middle, noise), 25.0)


def soft_arm(*, noise: float = 0.005) -> Task:
    """A soft arm of three segments, each bent and shortened by three tendons; each segment bends to an arc of a circle.

    theta: pull of each of the nine tendons. Outcome: x, y, height of the tip (m); the arm hangs from 0 and is 1 m long.
    """
    around = 2 * np.pi * np.arange(3) / 3

    def tip(context: Array, theta: Array) -> Array:
        pulls = theta.reshape(*theta.shape[:-1], 3, 3)
        lengths = (1 - 0.2 * pulls.mean(axis=-1)) / 3
        bends = np.stack([pulls @ np.cos(around), pulls @ np.sin(around)], axis=-1)  # rad, about two axes
        place, frame = np.zeros((*theta.shape[:-1], 3)), np.broadcast_to(np.eye(3), (*theta.shape[:-1], 3, 3))
        for k in range(3):
            ways, angle = bends[..., k, :], np.linalg.norm(bends[..., k, :], axis=-1, keepdims=True) + 1e-9
            aside, length = ways / angle, lengths[..., k, None]
            chord = np.concatenate([aside * (1 - np.cos(angle)), -np.sin(angle)], axis=-1) * length / angle
            place = place + (frame @ chord[..., None])[..., 0]
            axis = np.concatenate([-aside[..., 1:], aside[..., :1], np.zeros_like(angle)], axis=-1)
            cross = np.cross(np.eye(3), axis[..., None, :])
            turn = np.eye(3) - np.sin(angle)[..., None] * cross + (1 - np.cos(angle))[..., None] * (cross @ cross)
            frame = frame @ turn
        return place

    space = Box(np.array([-0.8, -0.8, -1.0]), np.array([0.8, 0.8, 0.2]), ("x", "y", "height"), "m")
    return toy_task(Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 9), space, tip, np.zeros(9), noise), 0.1)


def puck(*, noise: float = 0.005) -> Task:
    """An arm hits a puck, which slides until friction stops it; walls reflect the puck. Context: the puck's place (m).

    theta: turn and reach of the arm at the start of its swing, turn and reach at the end, and speed of the swing. When
    the hand touches the puck, the arm stops and the puck slides away from the hand. If the hand already touches the
    puck at the start of the swing, the puck does not move. Outcome: the final place of the puck (m).
    """
    ranges = Box(np.array([-np.pi * 5 / 12, 0.3]), np.array([np.pi * 5 / 12, 0.9]))  # rad and m
    apart = 0.1  # distance (m) between the middles of hand and puck when they touch
    shortest, longest = 0.5, 1.5  # shortest and longest duration of a swing (s)
    table = Box(np.array([0.0, -0.8]), np.array([1.2, 0.8]), ("x", "y"), "m")
    places = Box(np.array([0.35, 0.2]), np.array([0.65, 0.5]), ("puck x", "puck y"), "m")
    times = np.linspace(0, 1, SWING_STEPS + 1)
    course = (3 * times**2 - 2 * times**3)[:, None]  # share of the swing done; the speed at both ends is 0

    def rest(context: Array, theta: Array) -> Array:
        start, end = (ranges.low + theta[..., None, k : k + 2] * ranges.sides for k in (0, 2))
        turn, reach = np.moveaxis(start + course * (end - start), -1, 0)
        hand = reach[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        away = context[..., None, :] - hand  # (..., times, 2)
        near = np.linalg.norm(away, axis=-1) < apart
        first = near.argmax(axis=-1)
        hit = (first > 0)[..., None]
        before, after = (_at(away, np.maximum(first, 1) - k) for k in (1, 0))
        touch = before + _until(apart, before, after - before) * (after - before)
        ahead = touch / apart  # unit vector
        duration = longest + theta[..., 4:] * (shortest - longest)
        speed = (1 + BOUNCE) * ((before - after) * ahead).sum(axis=-1, keepdims=True) * SWING_STEPS / duration
        return np.where(hit, _reflected(context + ahead * speed**2 / (2 * FRICTION * GRAVITY), table), context)

    still = np.array([0.5, 1.0, 0.5, 1.0, 0.0])  # the arm points straight ahead, beside the puck
    return toy_task(Toy(places, Box.cube(0, 1, 5), table, rest, still, noise), 0.1)


def fetch(*, noise: float = 0.005) -> Task:
    """An arm closes its hand in one posture, opens it in another, and carries a ball within .15 m of the closing hand.

    theta: angles of the four joints where the hand closes, then where it opens. Outcome: final place of the ball (m).
    """
    ball = np.array([0.45, 0.45])

    def hand(joints: Array) -> Array:
        directions = np.cumsum(np.pi * 4 / 3 * (joints - 0.5), axis=-1)  # (..., 4) each joint within +-120 degrees
        return np.stack([np.cos(directions).mean(axis=-1), np.sin(directions).mean(axis=-1)], axis=-1)

    def place(context: Array, theta: Array) -> Array:
        closes, opens = hand(theta[..., :4]), hand(theta[..., 4:])
        grasped = np.linalg.norm(closes - ball, axis=-1, keepdims=True) < 0.15
        return np.where(grasped, opens, ball)

    floor = Box.cube(-1, 1, 2, names=("x", "y"), unit="m")
    return toy_task(Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 8), floor, place, np.full(8, 0.5), noise), 0.1)


def half_reached() -> Task:
    """Planar arm with 7 joints that reaches less than half of T."""
    arm = PlanarArm(7, noise=0.02, outcomes=Box(np.array([-1.0, -1.0]), np.array([3.0, 1.0]), ("x", "y"), "m"))
    return Task(arm, partial(arm_benchmark, arm))


class BlindToss:
    """The toss with a hidden wind: there is no context, and each movement draws a wind from the range of the toss."""

    def __init__(self, robot: Toy) -> None:
        self.robot = robot
        self.contexts = Box.cube(0, 1, 0)
        self.policies, self.outcomes, self.rest = robot.policies, robot.outcomes, robot.rest
        self.outcome_noise = robot.outcome_noise

    def observe(self, rng: np.random.Generator) -> Array:
        """The empty context, ``(0,)``."""
        return np.zeros(0)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """See `Toy.execute`."""
        return self.robot.execute(self.robot.observe(rng), theta, rng)


def blind_toss() -> Task:
    """The toss with a hidden wind, and with the goals of the toss; it shows what knowing the context is worth."""
    robot = toss().environment
    assert isinstance(robot, Toy)
    goals = partial(toy_benchmark, robot, 0.4)
    return Task(BlindToss(robot), lambda: replace(goals(), environment=BlindToss.__name__))


def toy_task(robot: Toy, side: float, *, taught: bool = False) -> Task:
    """Task of a toy, with one goal in each tile, ``side`` wide (unit of T), and a teacher if it is ``taught``."""
    demonstrations = partial(toy_demonstrations, robot) if taught else None
    return Task(robot, partial(toy_benchmark, robot, side), demonstrations, last_sample if taught else None)


def toy_benchmark(robot: Toy, side: float) -> Benchmark:
    """One random goal in each tile that uniform movements reach in the middle context; all runs have the same goals."""
    rng = stream(0, "goals for a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((N_REACHING, robot.policies.dim))
    context = (robot.contexts.low + robot.contexts.high) / 2
    reached = robot.effect(np.tile(context, (N_REACHING, 1)), thetas)
    return Benchmark(type(robot).__name__, tile_goals(reached, robot.outcomes, side, rng), side)


def last_sample(times: Array, trajectory: Array) -> Array:
    """The correspondence of a toy: each sample of its recordings is theta itself."""
    return trajectory[-1]


def toy_demonstrations(robot: Toy) -> list[Demonstration]:
    """Uniform movements with outcomes in T, in contexts all over C; every run has the same demonstrations."""
    rng = stream(0, "demonstrations by a toy")
    thetas = robot.policies.low + robot.policies.sides * rng.random((N_REACHING, robot.policies.dim))
    demonstrations = []
    for row in rng.integers(N_REACHING, size=N_DEMONSTRATIONS):
        context = robot.contexts.sample(rng)
        outcome = robot.effect(np.tile(context, (N_REACHING, 1)), thetas)[row]
        if robot.outcomes.contains(outcome):
            recording = np.array([0.0, 1.0]), np.tile(thetas[row], (2, 1))
            demonstrations.append(Demonstration(context, *recording, outcome))
    return demonstrations


def _at(path: Array, index: NDArray[np.intp]) -> Array:
    """``(..., 2)``, the point of each path ``(..., times, 2)`` at its own index ``(...)``."""
    points: Array = np.take_along_axis(path, index[..., None, None], axis=-2)[..., 0, :]
    return points


def _until(distance: float, before: Array, step: Array) -> Array:
    """``(..., 1)``, share of ``step`` after which a point that begins at ``before`` is ``distance`` from the origin."""
    a, b = ((vector * step).sum(axis=-1, keepdims=True) for vector in (step, before))
    c = (before * before).sum(axis=-1, keepdims=True) - distance**2
    return np.clip((-b - np.sqrt(np.maximum(b * b - a * c, 0))) / np.maximum(a, 1e-300), 0, 1)


def _reflected(places: Array, box: Box) -> Array:
    """``places`` folded into ``box``: the final places of an object that the walls reflect without loss."""
    laps = (places - box.low) / box.sides % 2
    return box.low + box.sides * (1 - np.abs(1 - laps))
