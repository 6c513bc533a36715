"""Toy robots, each of which is hard to learn for a different reason; a movement takes microseconds.

Each is a ``Toy``: boxes, and a function from context and theta to the outcome, to which Gaussian noise is added.
    toss: the wind is the context                    crawler: most parameters are phases, for which 0 equals 1
    two_elbows: two families of postures             spatial_arm: three outcome dimensions, in cm
    robot = toss(); outcome = robot.execute(robot.observe(rng), theta, rng)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.spaces import Array, Box, check_rng

GRAVITY: Final = 9.81  # m/s^2
_STROKES: Final = 10  # number of strokes in one movement of the crawler
_PLANE: Final = Box.cube(-1, 1, 2, names=("x", "y"), unit="m")


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
        """``(outcome_dim,)``, the outcome of one movement.

        Raises:
            ValueError: ``context`` is not one point of C, or ``theta`` is not one point of Pi.
            TypeError: ``rng`` is not a Generator.
        """
        context, theta = check_movement(self, context, theta)
        check_rng(rng)
        return rng.normal(self.effect(context, theta), self.outcome_noise)


def toss(*, noise: float = 0.03) -> Toy:
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
    return Toy(Box.cube(-1, 1, 1, names=("wind",), unit="m/s²"), Box.cube(0, 1, 4), floor, landing, weak, noise)


def crawler(*, noise: float = 0.02) -> Toy:
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
        heading = np.arange(1, 1 + _STROKES) * turn  # (..., strokes)
        return np.stack([(step * np.cos(heading)).sum(axis=-1), (step * np.sin(heading)).sum(axis=-1)], axis=-1)

    return Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 5), _PLANE, place, np.zeros(5), noise)


def two_elbows(*, noise: float = 0.01) -> Toy:
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
    return Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 3), _PLANE, hand, folded, noise)


def spatial_arm(*, noise: float = 1.0) -> Toy:
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
    return Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 6), space, hand, middle, noise)
