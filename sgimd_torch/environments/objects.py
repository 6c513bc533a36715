"""Toy robots that act on an object: most movements do not touch it and have no effect.

The outcome is the final place of the object, not of the hand. If a movement misses the object, the outcome does
not show how far the hand was from the object. So goal babbling learns nothing from most movements.
    puck: a puck to hit; its place is the context        fetch: a ball to grasp and carry
    robot = puck(); outcome = robot.execute(robot.observe(rng), theta, rng)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.environments.toys import GRAVITY, Toy
from sgimd_torch.spaces import Array, Box

_STEPS: Final = 50  # number of steps of a swing; within a step the hand moves in a straight line
_FRICTION: Final = 0.3  # coefficient of friction of the puck on the table
_BOUNCE: Final = 0.5  # coefficient of restitution of hand and puck


def puck(*, noise: float = 0.005) -> Toy:
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
    times = np.linspace(0, 1, _STEPS + 1)
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
        speed = (1 + _BOUNCE) * ((before - after) * ahead).sum(axis=-1, keepdims=True) * _STEPS / duration
        return np.where(hit, _reflected(context + ahead * speed**2 / (2 * _FRICTION * GRAVITY), table), context)

    still = np.array([0.5, 1.0, 0.5, 1.0, 0.0])  # the arm points straight ahead, beside the puck
    return Toy(places, Box.cube(0, 1, 5), table, rest, still, noise)


def fetch(*, noise: float = 0.005) -> Toy:
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
    return Toy(Box.cube(0, 1, 0), Box.cube(0, 1, 8), floor, place, np.full(8, 0.5), noise)


def _at(path: Array, index: NDArray[np.intp]) -> Array:
    """``(..., 2)``, the point of each path ``(..., times, 2)`` at its own index ``(...)``."""
    found: Array = np.take_along_axis(path, index[..., None, None], axis=-2)[..., 0, :]
    return found


def _until(distance: float, before: Array, step: Array) -> Array:
    """``(..., 1)``, share of ``step`` after which a point that begins at ``before`` is ``distance`` from the origin."""
    a, b = ((each * step).sum(axis=-1, keepdims=True) for each in (step, before))
    c = (before * before).sum(axis=-1, keepdims=True) - distance**2
    return np.clip((-b - np.sqrt(np.maximum(b * b - a * c, 0))) / np.maximum(a, 1e-300), 0, 1)


def _reflected(places: Array, box: Box) -> Array:
    """``places`` folded into ``box``: the final places of an object that the walls reflect without loss."""
    laps = (places - box.low) / box.sides % 2
    return box.low + box.sides * (1 - np.abs(1 - laps))
