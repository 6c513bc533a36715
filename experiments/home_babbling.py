"""Goal babbling from a home posture, a rival: Rolf, Steil & Gienger (2010), "Goal babbling permits direct learning of
inverse kinematics", IEEE Transactions on Autonomous Mental Development 2(3).

It knows one movement at first, home, the middle of Pi. Goals lie on straight ways through T. For each it makes the
movement that its inverse estimate gives, and a variation that is affine in the goal and stays the same along a way. The
estimate learns from these movements alone, most from those that led towards the goal and far for their size: of the
many movements that reach a place they show one family.
    sgimd run --algorithm experiments.home_babbling:home_babbling
Deviation: the estimate is a local affine regression, not a global one; a posture is a movement here.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Problem, Strategy
from sgimd_torch.spaces import Array, Attempt, Move

HOMEWARD: Final = 0.1  # of ways begin with the movement home
NEAREST: Final = 20  # outcomes around a goal that the estimate is made from
RIDGE: Final = 0.1  # exemplars of mean weight at home that the estimate counts besides
ORIGIN: Final = "home-babbling"
TINY: Final = np.finfo(float).tiny


class HomeBabbling(Strategy):
    """A way of goals each attempt.

    Args:
        problem: what has to be learnt; its memory began empty.
        steps: movements on a way.
        sd: standard deviation of the variations, in sides of Pi.
    """

    draws_from = ORIGIN

    def __init__(self, problem: Problem, *, steps: int = 10, sd: float = 0.1) -> None:
        super().__init__(problem)
        self.policies, self.outcomes, self.memory = problem.policies, problem.outcomes, problem.memory
        self.steps, self.sd = steps, sd
        self.home = (self.policies.low + self.policies.high) / 2
        self._from: Array | None = None  # where the last way ended; None: at home
        self._weights: list[float] = []  # of each exemplar

    def attempt(self, context: Array) -> Attempt:
        """Home, now and then, and a way from there or from the last goal to a new one."""
        if self._from is None or self.rng.random() < HOMEWARD:
            self._from = self.outcomes.clip((yield Move(self.home, None, ORIGIN)))
            self._weights.append(1.0)
        end = self.outcomes.sample(self.rng)
        goals = np.linspace(self._from, end, self.steps + 1)[1:]
        self._from = end
        variation = self.rng.normal(0, self.sd, (1 + self.outcomes.dim, self.policies.dim))
        last: tuple[Array, Array, Array] | None = None
        for goal in goals:
            place = np.append(1.0, 2 * (goal - self.outcomes.low) / self.outcomes.sides - 1)
            varied = self._estimate(context, goal) + place @ variation * self.policies.sides
            theta = self.policies.clip(varied)
            outcome = yield Move(theta, goal, ORIGIN)
            now = goal / self.outcomes.sides, outcome / self.outcomes.sides, theta / self.policies.sides
            self._weights.append(_weight(*(new - old for new, old in zip(now, last, strict=True))) if last else 1.0)
            last = now

    def _estimate(self, context: Array, goal: Array) -> Array:
        """``(theta_dim,)`` for a goal: an affine regression of theta on the outcomes nearest to it, drawn home."""
        rows = self.memory.near_outcomes(context, goal, NEAREST)
        weights = np.array([self._weights[row] for row in rows])
        off = (self.memory.outcomes[rows] - goal) / self.outcomes.sides
        inputs = np.concatenate((np.ones((len(rows), 1)), off), axis=1)
        weighted = weights[:, None] * inputs
        squares = weighted.T @ inputs + RIDGE * weights.mean() * np.eye(inputs.shape[1])
        slopes = np.linalg.solve(squares, weighted.T @ (self.memory.thetas[rows] - self.home))
        return np.asarray(self.home + slopes[0])


def _weight(goal: Array, outcome: Array, theta: Array) -> float:
    """Of a movement, by the steps of goal, outcome and theta that led to it: how straight to the goal times how far for
    its size."""
    length, size = np.linalg.norm(outcome), np.linalg.norm(theta)
    straight = goal @ outcome / max(np.linalg.norm(goal) * length, TINY)
    return float((1 + straight) / 2 * length / max(size, TINY))


def home_babbling(environment: Environment, seed: int, *, steps: int = 10, sd: float = 0.1) -> Learner:
    """Goal babbling from home; the learner answers by `LocalProcess`, as others do.

    Args:
        environment: robot, which is not executed here.
        seed: number from which the random stream of the learner comes.
        steps: movements on a way.
        sd: standard deviation of the variations, in sides of Pi.

    Raises:
        ValueError: an environment with contexts, between which a way cannot go.
    """
    if environment.contexts.dim:
        raise ValueError(f"home babbling knows one context only, got contexts of dim {environment.contexts.dim}")
    problem = Problem(environment, seed, inverse=LocalProcess)
    return Learner(problem, HomeBabbling(problem, steps=steps, sd=sd))
