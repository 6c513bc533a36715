"""Robots made at random, on which no default was chosen: how well learners do on them, beside random movements.

    experiments/compare.py robots                                            the lives of the page ANY_ROBOT
    experiments/compare.py robots --seeds 0-35 --only practice random --results development    other robots

Nine families: planar and spatial chains, poses (which fill a thin part of their box), smooth and rugged maps, throws,
maps that do nothing in half of Pi, contexts, periodic parameters. Units go from mm to km. Noise is absent, even,
grows with the movement, or is one gross error in 33 movements.

Numbers 0 to 199 are for development; others below 720, and 1200 to 1259, were seen before the defaults were what they
are.
Each error is the mean distance between goals and what the answers do without noise, over the spread of the
goals. `process` answers for random movements; for the standard baseline, the better of it and the nearest exemplar.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from lives import Life
from sgimd_torch.algorithms.paper import random_exploration, sagg_riac
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Inverse
from sgimd_torch.searches.perturb import Perturb
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, Box

FAMILIES: Final = ("chain", "spatial", "pose", "smooth", "rugged", "throw", "idle", "context", "phases")
NOISES: Final = ("none", "even", "speed", "gross")
COUNTS: Final = (50, 100, 250, 500, 1000)  # movements at which a learner is evaluated
ROBOTS: Final = range(800, 860)  # robots of the page ANY_ROBOT, named before the first of them was run
TABLE: Final = "robots.csv"
RANDOM: Final = "random"  # reference: random movements
BASELINE: Final = "uniform-nearest"  # reference: the standard baseline
LEARNERS: Final[Mapping[str, Callable[[RandomRobot, int], Learner]]] = {
    "practice": practice,
    "practice-interest": partial(practice, goals=InterestMap),
    "sagg-riac": sagg_riac,
    BASELINE: partial(sagg_riac, goals=UniformGoals, inverse=NearestNeighbour, search=Perturb, budget=1),
    RANDOM: random_exploration,
}
# Seeds of each learner on each robot: five, so that harm can be judged by robot, twice as many for random movements,
# so that two equal learners can be compared, and one for the others.
SEEDS: Final = {**dict.fromkeys(LEARNERS, range(280, 281)), "practice": range(280, 285), RANDOM: range(280, 290)}


def kind(number: int) -> tuple[str, str, np.random.Generator]:
    """Family and noise of the robot with this number, and the random stream that makes the rest of it."""
    rng = np.random.default_rng([number, 2026])
    return FAMILIES[number % len(FAMILIES)], NOISES[int(rng.integers(len(NOISES)))], rng


class RandomRobot:
    """Robot with this ``number``; ``effect`` is the outcome without noise, ``goals`` are goals that it can reach."""

    def __init__(self, number: int) -> None:
        self.family, self.noise, rng = kind(number)
        dim = int(rng.integers(3, 31))
        self._lengths, self._limits = rng.dirichlet(np.ones(dim) * 4), rng.uniform(0.4, 2.2, dim)
        self._axes = rng.normal(size=(dim, 3))
        outcome_dims = {"chain": 2, "spatial": 3, "pose": int(rng.integers(4, 7))}
        self._outcome_dim = outcome_dims.get(self.family, int(rng.integers(1, 4)))
        context_dim = int(rng.integers(1, 3)) if self.family == "context" else 0
        inputs = dim * (2 if self.family == "phases" else 1) + context_dim
        scales = rng.normal(size=(inputs, 40)) * rng.lognormal(0, 0.6, (inputs, 1))
        self._first = scales * rng.uniform(0.8, 2.5) / np.sqrt(inputs)
        self._phase = rng.uniform(-np.pi, np.pi, 40)
        self._second = rng.normal(size=(40, 40)) * 1.6 / np.sqrt(40)
        self._last = rng.normal(size=(40, max(self._outcome_dim, 6))) / np.sqrt(40)
        self._gate = rng.normal(size=dim)
        self.contexts, self.policies, self._unit = Box.cube(-1, 1, context_dim), Box.cube(0, 1, dim), 1.0
        thetas = rng.uniform(size=(6000, dim))
        half = len(thetas) // 2  # the other half varies a few postures, as uniform movements leave out what is rare
        centres = thetas[rng.integers(half, size=half) // 200 * 200]
        thetas[half:] = np.clip(centres + rng.normal(0, 0.12, (half, dim)), 0, 1)
        contexts = rng.uniform(-1, 1, (6000, context_dim))
        effects = np.array([self.effect(c, t) for c, t in zip(contexts, thetas, strict=True)])
        self._unit = float(10.0 ** rng.integers(-3, 4) / effects.std(axis=0).mean())
        effects *= self._unit
        low, high = effects.min(axis=0), effects.max(axis=0)
        margin = (high - low) * rng.uniform(0, 0.4)
        self.outcomes, self.rest = Box(low - margin, high + margin), effects.mean(axis=0)
        sd = effects.std(axis=0).mean()
        self.outcome_noise = 0.0 if self.noise == "none" else float(rng.choice([0.005, 0.02, 0.05]) * sd)
        tiles = np.floor((effects - low) / (high - low) * {1: 60, 2: 10, 3: 5}.get(self._outcome_dim, 3))
        order = rng.permutation(len(tiles))
        _, first = np.unique(tiles[order], axis=0, return_index=True)
        chosen = order[rng.permutation(first)[:100]]
        self.goals, self.goal_contexts = effects[chosen], contexts[chosen]

    def effect(self, context: ArrayLike, theta: ArrayLike) -> Array:
        """Outcome ``(outcome_dim,)`` of a movement, without noise."""
        x = 2 * np.asarray(theta, dtype=np.float64) - 1
        if self.family == "chain":
            angles = np.cumsum(x * self._limits)
            outcome = np.array([self._lengths @ np.cos(angles), self._lengths @ np.sin(angles)])
        elif self.family in ("spatial", "pose"):
            outcome = self._pose(x)[: self._outcome_dim]
        else:
            turns = np.pi * (x + 1)
            inputs = np.concatenate((np.cos(turns), np.sin(turns))) if self.family == "phases" else x
            hidden = np.sin(np.concatenate((inputs, np.asarray(context))) @ self._first + self._phase)
            if self.family == "rugged":
                hidden = np.tanh(hidden @ self._second)
            outcome = (hidden @ self._last)[: self._outcome_dim]
            push = float(x @ self._gate / np.linalg.norm(self._gate))
            if self.family == "throw":
                outcome = outcome * (1 + abs(push)) ** 2
            if self.family == "idle":
                outcome = outcome * max(0.0, math.tanh(3 * push))
        scaled: Array = outcome * self._unit
        return scaled

    def _pose(self, x: Array) -> Array:
        """Position and orientation of the end of a chain in space."""
        turn, place = np.eye(3), np.zeros(3)
        for angle, axis, length in zip(x * self._limits, self._axes, self._lengths, strict=True):
            k = axis / np.linalg.norm(axis)
            cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
            turn = turn @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
            place = place + turn @ np.array([length, 0, 0])
        return np.concatenate((place, turn[:, 0] * 0.5))

    def observe(self, rng: np.random.Generator) -> Array:
        """A context, uniform in C."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """Outcome of a movement, with noise."""
        outcome, sd = self.effect(context, theta), self.outcome_noise
        if self.noise == "speed":
            sd *= 2 * float(np.abs(2 * np.asarray(theta) - 1).mean())
        if self.noise == "gross" and rng.random() < 0.03:
            sd *= 20
        return outcome + (rng.normal(0, sd, self._outcome_dim) if sd else 0.0)

    def error(self, inverse: Inverse, effect: Callable[[Array, Array], Array] | None = None) -> float:
        """Mean distance between goals and the effects of the answers, relative to the spread of the goals.

        ``effect`` (context, theta) -> outcome: that of a robot which has changed; None: its own.
        """
        asked, effect = list(zip(self.goal_contexts, self.goals, strict=True)), effect or self.effect
        missed = [np.linalg.norm(effect(c, inverse(c, g).theta) - g) for c, g in asked]
        return float(np.mean(missed) / np.linalg.norm(self.goals - self.goals.mean(axis=0), axis=1).mean())


def life(number: int, name: str, seed: int) -> dict[int, tuple[float, int]]:
    """Errors of the learner with this ``name`` on the robot with this ``number``, and the changes that it noticed."""
    robot = RandomRobot(number)
    learner = LEARNERS[name](robot, seed)
    answers: list[Inverse] = [learner.inverse]
    if name in (RANDOM, BASELINE):
        answers = [LocalProcess(learner.problem), *answers][: 1 + (name == BASELINE)]
    errors = {}
    for episode in run(learner, robot, seed, movements=COUNTS[-1]):
        if (movements := episode.index + 1) in COUNTS:
            errors[movements] = min(map(robot.error, answers)), len(learner.changes)
    return errors


def lives(robots: Iterable[int] | None, only: Collection[str], out: Path) -> list[Life]:
    """The lives on robots with these numbers, None for those of the page, of these learners or of all."""
    keys = product(ROBOTS if robots is None else robots, only)
    return [Life(TABLE, (number, name, seed), COUNTS[-1], out) for number, name in keys for seed in SEEDS[name]]
