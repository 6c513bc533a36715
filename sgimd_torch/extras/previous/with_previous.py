"""A robot with memory: the theta of the movement before is part of the context.

For robots whose outcomes depend on the movement before, such as a soft finger with hysteresis. The learner then sees
what the robot remembers. The option of ``sgimd run`` is ``--context previous``.
    finger = with_previous(Finger()); learner = practice(finger, seed)
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import Environment, check_movement
from sgimd_torch.spaces import Array, Box

# Optional members that stay as they are.
_KEPT: Final = ("primitive", "files", "remarks", "found_options", "within_reach")


class WithPrevious:
    """Robot whose context is the theta of the movement before, then the robot's own context.

    If a movement is to be made after another theta than that of the last movement, ``execute`` first makes a movement
    with that theta. So a movement costs two if an attempt keeps its context, after a failure, and at the start of a
    program, when the context is the middle of Pi.

    Args:
        robot: robot with memory.
    """

    at_once = 1  # of several robots, each has a movement before of its own
    asks_context = "the theta of the movement before"  # without it an answer means nothing

    def __init__(self, robot: Environment) -> None:
        self.robot = robot
        self.policies, self.outcomes = robot.policies, robot.outcomes
        self.rest, self.outcome_noise = robot.rest, robot.outcome_noise
        boxes = (("theta", robot.policies), ("context", robot.contexts))
        names = [name for kind, box in boxes for name in box.names or [f"{kind} {k}" for k in range(box.dim)]]
        names[: robot.policies.dim] = [f"previous {name}" for name in names[: robot.policies.dim]]
        low, high = (np.concatenate([getattr(box, corner) for _, box in boxes]) for corner in ("low", "high"))
        self.contexts = Box(low, high, tuple(names))
        self._last: Array | None = None  # theta of the last movement; None: unknown
        for name in _KEPT:
            if hasattr(robot, name):
                setattr(self, name, getattr(robot, name))
        if (trace := getattr(robot, "trace", None)) is not None:
            self.trace = partial(self._after, trace)

    def observe(self, rng: np.random.Generator) -> Array:
        """Context: theta of the last movement, the middle of Pi if it is unknown, then what the robot observes."""
        middle = (self.policies.low + self.policies.high) / 2
        return np.concatenate((middle if self._last is None else self._last, self.robot.observe(rng)))

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """Outcome of a movement after the movement in ``context``; see `Environment`."""
        outcome: Array = self._after(self.robot.execute, context, theta, rng)
        return outcome

    def _after(self, move: Callable[..., Any], context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Any:
        """Result of the method ``move`` after the movement in ``context``."""
        context, theta = check_movement(self, context, theta)
        before, own = np.split(context, [self.policies.dim])
        if self._last is None or not np.array_equal(before, self._last):
            self.robot.execute(own.copy(), before.copy(), deepcopy(rng))  # the noise of theta stays what it was
        self._last = None  # if it fails
        result = move(own, theta.copy(), rng)
        self._last = theta.copy()
        return result


def with_previous(robot: Environment) -> WithPrevious:
    """The robot with the theta of the movement before as context; its class has the name of the robot's class, so
    that benchmark goals made for the robot fit."""
    made: WithPrevious = type(type(robot).__name__, (WithPrevious,), {})(robot)
    return made
