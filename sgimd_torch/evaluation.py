"""Evaluation: how near does the robot come to goals spread over all that can be reached?

Section 5.2 and eq. (10) of Nguyen & Oudeyer (2014). Looking changes nothing: an evaluation executes without learning or
remembering, with random streams of its own.
    benchmark = load_benchmark(); evaluation = evaluate(inverse, environment, benchmark.goals, seed, movements)
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgimd_torch.demonstrations import UNREADABLE
from sgimd_torch.environment import Environment, execute_many
from sgimd_torch.spaces import Array, Box, Estimate, check_vector, stream

VERSION = 1
SHIPPED = Path(__file__).with_name("data") / "benchmark.npz"


@dataclass(frozen=True, eq=False)
class Benchmark:
    """Goals to be judged by: ``environment`` names the class they were made for, ``goals`` is ``(n, outcome_dim)`` m,
    ``side`` (m) the side of the tiles that they were drawn from."""

    environment: str
    goals: Array
    side: float

    def check(self, environment: Environment) -> None:
        """Refuse an environment that these goals were not made for.

        Raises:
            ValueError: another class, or other outcome dimensions.
        """
        found = type(environment).__name__
        if found != self.environment or environment.outcomes.dim != self.goals.shape[1]:
            raise ValueError(
                f"the benchmark was made for {self.environment} with {self.goals.shape[1]} outcome dimensions, got "
                f"{found} with {environment.outcomes.dim}; make one with scripts/make_benchmark.py"
            )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What ``evaluate`` saw. ``errors`` ``(n,)`` m, one for each goal; ``thetas`` ``(n, theta_dim)`` what was executed;
    ``outcomes`` ``(n, outcome_dim)`` where it landed; ``scatter`` ``(n,)`` m, mean distance of the repeated landing
    points of each theta to their own mean, NaN without repeats."""

    errors: Array
    thetas: Array
    outcomes: Array
    scatter: Array

    @property
    def mean_error(self) -> float:
        """Eq. (10), m."""
        return float(self.errors.mean())

    @property
    def noise_floor(self) -> float:
        """The part of the error that noise alone makes, m: what is left of ``mean_error`` is bias."""
        return float(self.scatter.mean())


def evaluate(
    inverse: Callable[[Array, Array], Estimate],
    environment: Environment,
    goals: Array,
    seed: int,
    movements: int,
    *,
    context: Array | None = None,
    repeats: int = 10,
) -> Evaluation:
    """Invert every goal, execute what comes out once, and ``repeats`` times more to measure the noise.

    Args:
        inverse: (context, goal) -> estimate; its memory must not be empty.
        environment: executed, all goals side by side if it can.
        goals: ``(n, outcome_dim)`` m.
        seed, movements: name the random streams, so that each evaluation of a run has its own.
        context: ``(context_dim,)`` in which to execute; None for the middle of C.
        repeats: 0 leaves the noise out.

    Raises:
        ValueError: no goals, of another dimension, or not finite.
        RuntimeError: the memory behind ``inverse`` is empty.
    """
    goals = check_vector("goals", goals, environment.outcomes.dim)
    if goals.ndim != 2 or len(goals) == 0:
        raise ValueError(f"goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    if context is None:
        context = (environment.contexts.low + environment.contexts.high) / 2
    thetas = np.stack([inverse(context, goal).theta for goal in goals])
    copies = np.tile(thetas, (1 + repeats, 1))  # all goals once, then all again: row k is judged, whatever repeats
    rngs = [stream(seed, f"evaluation {movements}", row) for row in range(len(copies))]
    landed = execute_many(environment, np.tile(context, (len(copies), 1)), copies, rngs)
    landed = landed.reshape(1 + repeats, *goals.shape)
    outcomes, again = landed[0], landed[1:]
    scatter = np.full(len(goals), np.nan)
    if repeats:
        scatter = np.linalg.norm(again - again.mean(axis=0), axis=2).mean(axis=0)
    return Evaluation(np.linalg.norm(outcomes - goals, axis=1), thetas, outcomes, scatter)


def tile_goals(outcomes: Array, box: Box, side: float, rng: np.random.Generator, *, at_least: int = 2) -> Array:
    """One random goal in each tile of the apparent reachable space.

    Args:
        outcomes: ``(n, outcome_dim)`` m, pooled over runs; those outside ``box`` are left out.
        box: T.
        side: of a tile (m).
        rng: draws the goals.
        at_least: outcomes that make a tile reachable.

    Returns:
        ``(n_tiles, outcome_dim)`` m, in the order of the tiles.
    """
    inside = outcomes[box.contains(outcomes)]
    tiles, counts = np.unique(np.floor((inside - box.low) / side), axis=0, return_counts=True)
    tiles = tiles[counts >= at_least]
    return box.clip(box.low + (tiles + rng.random(tiles.shape)) * side)


def save_benchmark(path: str | os.PathLike[str], benchmark: Benchmark) -> None:
    """Write an ``.npz`` without pickle; the file appears whole or not at all."""
    path = Path(path)
    partial = path.with_name(path.name + ".part")
    with partial.open("wb") as file:
        np.savez(
            file,
            allow_pickle=False,
            version=np.array(VERSION),
            environment=np.array(benchmark.environment),
            goals=benchmark.goals,
            side=np.array(benchmark.side),
        )
    partial.replace(path)


def load_benchmark(path: str | os.PathLike[str] = SHIPPED) -> Benchmark:
    """Read a benchmark; the shipped one for ``FishingRod`` unless told otherwise.

    Raises:
        ValueError: not such a file, truncated, of another version, without goals, or with numbers that are not finite.
        FileNotFoundError: there is no file.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            version, name, side = archive["version"], str(archive["environment"]), float(archive["side"])
            goals = archive["goals"]
    except FileNotFoundError:
        raise
    except UNREADABLE as error:
        raise ValueError(f"{path} is no benchmark ({error}); was it written by scripts/make_benchmark.py?") from error
    if version.shape != () or version != VERSION:
        raise ValueError(f"{path} has version {version}, this library reads {VERSION}")
    if goals.ndim != 2 or len(goals) == 0:
        raise ValueError(f"{path}: goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    if not 0 < side < np.inf:
        raise ValueError(f"{path}: the side of the tiles must be positive, got {side}")
    return Benchmark(name, check_vector(f"{path}: goals", goals, goals.shape[1]), side)
