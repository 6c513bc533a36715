"""Robots made at random, on which no default was chosen: how well learners do on them, beside random movements.

    experiments/random_robots.py                                        the lives of the page ANY_ROBOT
    experiments/random_robots.py --robots 0 36 --results development    others, in a table of your own
    experiments/random_robots.py --repeated                             five lives on each robot: a fair measure of harm

Nine families: planar and spatial chains, poses (which fill a thin part of their box), smooth and rugged maps, throws,
maps that do nothing in half of Pi, contexts, periodic parameters. Units go from mm to km. Noise is absent, even,
grows with the movement, or is one gross error in 33 movements.

Numbers 0 to 199 are for development; 200 to 319 were seen before practice was what it is now. Each error is the mean
distance between goals and what the answers do without noise. For the references the better of `process` and the nearest
exemplar answers.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from lives import make_lives, parser
from sgimd_torch.algorithms.paper import random_exploration, sagg_riac
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Inverse
from sgimd_torch.runs.signals import command
from sgimd_torch.searches.explore import Returning
from sgimd_torch.searches.perturb import Perturb
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, Box

FAMILIES: Final = ("chain", "spatial", "pose", "smooth", "rugged", "throw", "idle", "context", "phases")
NOISES: Final = ("none", "even", "speed", "gross")
COUNTS: Final = (50, 100, 250, 500, 1000)  # movements at which a learner is evaluated
UNSEEN: Final = range(320, 380)  # robots of the page ANY_ROBOT, named before the first of them was run
TABLE: Final = "random.csv"
REPEATED: Final = range(460, 490)  # robots that are learnt once by each of the `SEEDS`, named before the first was run
SEEDS: Final = range(265, 270)
REPEATED_TABLE: Final = "repeated.csv"
RANDOM: Final = "random"  # reference: random movements
BASELINE: Final = "uniform-nearest"  # reference: the standard baseline
LEARNERS: Final[Mapping[str, Callable[[RandomRobot, int], Learner]]] = {
    "practice": practice,
    "practice-middle": partial(practice, explore=partial(Returning, uniform=0.0)),
    "practice-interest": partial(practice, goals=InterestMap),
    "sagg-riac": sagg_riac,
    BASELINE: partial(sagg_riac, goals=UniformGoals, inverse=NearestNeighbour, search=Perturb, budget=1),
    RANDOM: random_exploration,
}


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

    def error(self, inverse: Inverse) -> float:
        """Mean distance between goals and the effects of the answers, relative to the spread of the goals."""
        asked = list(zip(self.goal_contexts, self.goals, strict=True))
        missed = [np.linalg.norm(self.effect(c, inverse(c, g).theta) - g) for c, g in asked]
        return float(np.mean(missed) / np.linalg.norm(self.goals - self.goals.mean(axis=0), axis=1).mean())


def life(number: int, name: str) -> dict[int, tuple[float, int]]:
    """Errors of the learner with this ``name`` on the robot with this ``number``, and the changes that it noticed."""
    robot = RandomRobot(number)
    learner = LEARNERS[name](robot, number)
    references: list[Inverse] = [LocalProcess(learner.problem), NearestNeighbour(learner.problem)]
    answers = references if name in (RANDOM, BASELINE) else [learner.inverse]
    return {at: (error, len(learner.changes)) for at, error in errors(robot, learner, number, answers)}


def repeated_life(number: int, name: str, seed: int) -> dict[int, tuple[float]]:
    """Errors of a life with this ``seed``, answered by `process`."""
    robot = RandomRobot(number)
    learner = LEARNERS[name](robot, seed)
    answer = LocalProcess(learner.problem) if name == RANDOM else learner.inverse
    return {at: (error,) for at, error in errors(robot, learner, seed, [answer])}


def errors(robot: RandomRobot, learner: Learner, seed: int, answers: Sequence[Inverse]) -> Iterator[tuple[int, float]]:
    """The numbers of movements at which a learner is evaluated, and the least error of the ``answers``."""
    for episode in run(learner, robot, seed, movements=COUNTS[-1]):
        if (movements := episode.index + 1) in COUNTS:
            yield movements, min(map(robot.error, answers))


def make(
    results: Path, processes: int, numbers: Iterable[int] = UNSEEN, learners: Collection[str] = tuple(LEARNERS)
) -> None:
    """Make the lives that the table in ``results`` lacks."""
    lives = {(number, name): COUNTS[-1] for number in numbers for name in learners}
    make_lives(results, TABLE, life, lives, processes)


def make_repeated(results: Path, processes: int) -> None:
    """Make the lives of each of the `SEEDS` that the table in ``results`` lacks."""
    lives = dict.fromkeys(product(REPEATED, ("practice", RANDOM), SEEDS), COUNTS[-1])
    make_lives(results, REPEATED_TABLE, repeated_life, lives, processes)


def main(argv: Sequence[str] | None = None) -> int:
    options = parser(__doc__)
    numbers = "first number of a robot, and the number after the last (default: those of the page)"
    options.add_argument("--robots", nargs=2, type=int, default=[UNSEEN.start, UNSEEN.stop], help=numbers)
    options.add_argument("--learners", nargs="+", default=[*LEARNERS], choices=LEARNERS, help="learners (default: all)")
    options.add_argument("--repeated", action="store_true", help="practice and random movements, five lives a robot")
    chosen = options.parse_args(argv)
    if chosen.repeated:
        make_repeated(chosen.results, chosen.processes)
        return 0
    make(chosen.results, chosen.processes, range(*chosen.robots), chosen.learners)
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
