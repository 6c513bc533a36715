"""Two rivals: goal babbling from a home posture, and MAP-Elites that begins in the middle of Pi.

Goal babbling: Rolf, Steil & Gienger (2010), "Goal babbling permits direct learning of inverse kinematics", IEEE
Transactions on Autonomous Mental Development 2(3).

At first the learner knows one movement, home, which is the middle of Pi. Goals lie on straight paths through T. For
each goal the learner makes the movement that its estimate gives, plus a variation. The variation is an affine function
of the goal, drawn once for each path. The estimate learns from these movements alone. A movement gets a larger weight
if its outcome moved towards the goal, and farther relative to the change of theta. So the estimate learns one of the
many families of movements that reach a place.
    sgimd run --algorithm experiments.rivals:home_babbling
Deviation: the estimate is a local affine regression, not a global one. Theta takes the place of the posture.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.extras.rivals import quality_diversity
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Problem, Strategy
from sgimd_torch.spaces import Array, Attempt, Move

HOMEWARD: Final = 0.1  # share of paths that begin with the movement home
NEAREST: Final = 20  # number of nearest outcomes around a goal in the local regression
RIDGE: Final = 0.1  # weight of home in the local regression, relative to the mean weight of an exemplar
ORIGIN: Final = "home-babbling"
TINY: Final = np.finfo(float).tiny


class HomeBabbling(Strategy):
    """A strategy that follows one path of goals in each attempt.

    Args:
        problem: learning problem; its memory is empty at the start.
        steps: number of movements on a path.
        sd: standard deviation of the variations, relative to the sides of Pi.
    """

    draws_from = ORIGIN

    def __init__(self, problem: Problem, *, steps: int = 10, sd: float = 0.1) -> None:
        super().__init__(problem)
        self.policies, self.outcomes, self.memory = problem.policies, problem.outcomes, problem.memory
        self.steps, self.sd = steps, sd
        self.home = (self.policies.low + self.policies.high) / 2
        self._from: Array | None = None  # last goal; None: the next path begins at home
        self._weights: list[float] = []  # weight of each exemplar

    def attempt(self, context: Array) -> Attempt:
        """Follow a path to a new goal; it begins at the last goal, and now and then at home."""
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
        """``(theta_dim,)`` for a goal: affine regression of theta on outcomes near it, with a ridge towards home."""
        rows = self.memory.near_outcomes(context, goal, NEAREST)
        weights = np.array([self._weights[row] for row in rows])
        off = (self.memory.outcomes[rows] - goal) / self.outcomes.sides
        inputs = np.concatenate((np.ones((len(rows), 1)), off), axis=1)
        weighted = weights[:, None] * inputs
        squares = weighted.T @ inputs + RIDGE * weights.mean() * np.eye(inputs.shape[1])
        slopes = np.linalg.solve(squares, weighted.T @ (self.memory.thetas[rows] - self.home))
        return np.asarray(self.home + slopes[0])


def _weight(goal: Array, outcome: Array, theta: Array) -> float:
    """Weight of a movement: how well its outcome moved in the goal's direction, times distance, divided by size.

    Args:
        goal: change of the goal since the movement before, relative to the sides of T.
        outcome: change of the outcome since the movement before, relative to the sides of T.
        theta: change of theta since the movement before, relative to the sides of Pi.
    """
    length, size = np.linalg.norm(outcome), np.linalg.norm(theta)
    straight = goal @ outcome / max(np.linalg.norm(goal) * length, TINY)
    return float((1 + straight) / 2 * length / max(size, TINY))


def home_babbling(environment: Environment, seed: int, *, steps: int = 10, sd: float = 0.1) -> Learner:
    """Goal babbling from home. In evaluations `LocalProcess` answers, as for the other learners.

    Args:
        environment: robot and world; its ``execute`` is not called.
        seed: seed of the learner's random stream.
        steps: number of movements on a path.
        sd: standard deviation of the variations, relative to the sides of Pi.

    Raises:
        ValueError: the environment has contexts; a path of goals would lead through several contexts.
    """
    if environment.contexts.dim:
        raise ValueError(f"home babbling knows one context only, got contexts of dim {environment.contexts.dim}")
    problem = Problem(environment, seed, inverse=LocalProcess)
    return Learner(problem, HomeBabbling(problem, steps=steps, sd=sd))


def map_elites_middle(environment: Environment, seed: int) -> Learner:
    """MAP-Elites that begins around the middle of Pi, with wider variations, and with cells of twice the side."""

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[GaussianEmitter]:
        dim = environment.policies.dim
        bounds = {"lower_bounds": np.zeros(dim), "upper_bounds": np.ones(dim)}
        first = rng.normal(0.5, 0.1, (100, dim)).clip(0, 1)
        drawn = int(rng.integers(2**32))
        return [GaussianEmitter(archive, sigma=0.1, initial_solutions=first, batch_size=10, seed=drawn, **bounds)]

    return quality_diversity.quality_diversity(
        environment, seed, "map-elites", emitters, {}, correspondence=None, cells=10
    )
