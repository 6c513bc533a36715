"""Evaluation: how near does the robot come to goals spread over all that can be reached?

Section 5.2 and eq. (10) of Nguyen & Oudeyer (2014). An evaluation changes nothing: it executes without learning or
remembering, with random streams of its own.
    benchmark = load_benchmark(); evaluation = evaluate(inverse, environment, benchmark.goals, seed, movements)
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgimd_torch.environments.protocol import Environment, execute_many
from sgimd_torch.files import read_npz, write_npz
from sgimd_torch.spaces import Array, Box, Estimate, check_count, check_vector, first_entry, stream

VERSION = 1
SHIPPED = Path(__file__).with_name("data") / "benchmark.npz"


@dataclass(frozen=True, eq=False)
class Benchmark:
    """The goals that learners are judged by. ``environment`` is the class that they were made for; ``goals`` is
    ``(n, outcome_dim)`` m; ``side`` (m) is that of the tiles that they were drawn from."""

    environment: str
    goals: Array
    side: float

    def check(self, environment: Environment) -> None:
        """Refuse an environment that these goals were not made for.

        Raises:
            ValueError: another class, other outcome dimensions, or goals outside its T.
        """
        found = type(environment).__name__
        if found != self.environment or environment.outcomes.dim != self.goals.shape[1]:
            raise ValueError(
                f"the benchmark was made for {self.environment} with {self.goals.shape[1]} outcome dimensions, got "
                f"{found} with {environment.outcomes.dim}; make one with scripts/make_benchmark.py"
            )
        space = environment.outcomes
        if not space.contains(self.goals).all():
            entry = first_entry(self.goals, ~((self.goals >= space.low) & (self.goals <= space.high)))  # NaN too
            raise ValueError(
                f"goals of the benchmark must lie in the task space {space.low.tolist()} to {space.high.tolist()} m, "
                f"but {entry}; were they in cm?"
            )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What ``evaluate`` found. ``errors`` ``(n,)`` m, one for each goal; ``thetas`` ``(n, theta_dim)`` that were
    executed; ``outcomes`` ``(n, outcome_dim)`` where they landed; ``scatter`` ``(n,)`` m, the mean distance of the
    repeated landing points of each theta to their true mean (estimated, see ``evaluate``), NaN without repeats."""

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
        """The part of ``mean_error`` that noise alone makes, m; the rest is bias."""
        return float(self.scatter.mean())

    def met(self, near: float) -> int:
        """How many goals were missed by ``near`` (m) or less."""
        return int((self.errors <= near).sum())


def evaluate(
    inverse: Callable[[Array, Array], Estimate],
    environment: Environment,
    goals: Array,
    seed: int,
    movements: int,
    *,
    context: Array | None = None,
    repeats: int = 3,
) -> Evaluation:
    """Invert every goal, execute the result once, and ``repeats`` times more to measure the noise.

    Two inverses that are evaluated with the same ``seed`` and ``movements`` get the same noise, goal by goal.

    Args:
        inverse: (context, goal) -> estimate; its memory must not be empty. If it has a method ``many``, (context,
            goals) -> estimates, that is used instead.
        environment: executed, all goals side by side if it can do that.
        goals: ``(n, outcome_dim)`` m.
        seed, movements: name the random streams, so that each evaluation of a run has its own.
        context: ``(context_dim,)`` in which to execute; None for the middle of C.
        repeats: k; 0 does not measure the noise; otherwise 2 or more, as one landing point does not scatter. Landing
            points lie nearer to their own mean than to the true one, so the scatter is multiplied by sqrt(k / (k - 1)):
            for Gaussian noise its mean is then the same for every k.

    Raises:
        ValueError: no goals, of another dimension, or not finite; repeats or movements out of range.
        RuntimeError: the memory behind ``inverse`` is empty.
    """
    goals = check_vector("goals", goals, environment.outcomes.dim)
    if goals.ndim != 2 or len(goals) == 0:
        raise ValueError(f"goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    check_count("movements", movements, 0)
    if check_count("repeats", repeats, 0) == 1:
        raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
    if context is None:
        context = (environment.contexts.low + environment.contexts.high) / 2
    many = getattr(inverse, "many", None)  # a forward model is ten times as fast in batches
    estimates = many(context, goals) if many is not None else [inverse(context, goal) for goal in goals]
    thetas = np.stack([estimate.theta for estimate in estimates])
    copies = np.tile(thetas, (1 + repeats, 1))  # all goals once, then again: the judged rows do not depend on repeats
    rngs = [stream(seed, f"evaluation {movements}", row) for row in range(len(copies))]
    landed = execute_many(environment, np.tile(context, (len(copies), 1)), copies, rngs)
    landed = landed.reshape(1 + repeats, *goals.shape)
    outcomes, again = landed[0], landed[1:]
    scatter = np.full(len(goals), np.nan)
    if repeats:
        bessel = np.sqrt(repeats / (repeats - 1))
        scatter = bessel * np.linalg.norm(again - again.mean(axis=0), axis=2).mean(axis=0)
    return Evaluation(np.linalg.norm(outcomes - goals, axis=1), thetas, outcomes, scatter)


def tile_goals(outcomes: Array, box: Box, side: float, rng: np.random.Generator, *, at_least: int = 2) -> Array:
    """One random goal in each tile of the apparent reachable space.

    Args:
        outcomes: ``(n, outcome_dim)`` m, of several runs together; those outside ``box`` do not count.
        box: T.
        side: of a tile (m).
        rng: draws the goals.
        at_least: outcomes on a tile for it to be reachable.

    Returns:
        ``(n_tiles, outcome_dim)`` m, in the order of the tiles.
    """
    inside = outcomes[box.contains(outcomes)]
    tiles, counts = np.unique(np.floor((inside - box.low) / side), axis=0, return_counts=True)
    tiles = tiles[counts >= at_least]
    return box.clip(box.low + (tiles + rng.random(tiles.shape)) * side)


def save_benchmark(path: str | os.PathLike[str], benchmark: Benchmark) -> None:
    """Write a file that ``load_benchmark`` reads; the file appears whole or not at all.

    Raises:
        ValueError: a benchmark that ``load_benchmark`` would refuse.
        OSError: ``path`` is a directory, or cannot be written.
    """
    name, goals, side = np.array(benchmark.environment), np.asarray(benchmark.goals), np.array(benchmark.side)
    right = _checked(str(path), name, goals, side)
    write_npz(path, {"version": np.array(VERSION), "environment": name, "goals": right.goals, "side": side})


def load_benchmark(path: str | os.PathLike[str] = SHIPPED) -> Benchmark:
    """Read a benchmark; by default the shipped one for ``FishingRod``.

    Raises:
        ValueError: not such a file, truncated, of another version, without goals, or with numbers that are not finite.
        OSError: there is no file, or it is a directory.
    """
    names = ("environment", "goals", "side")
    return _checked(str(path), *read_npz(path, "benchmark", "scripts/make_benchmark.py", VERSION, names))


def _checked(source: str, name: np.ndarray, goals: np.ndarray, side: np.ndarray) -> Benchmark:
    if name.shape != () or name.dtype.kind != "U" or not str(name).isidentifier():
        raise ValueError(f"{source}: environment must be the name of a class, got {name.dtype} {name.shape}")
    if goals.ndim != 2 or goals.size == 0:
        raise ValueError(f"{source}: goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    if side.shape != () or side.dtype.kind not in "iuf" or not 0 < side < np.inf:
        raise ValueError(f"{source}: the side of the tiles must be a positive number, got {str(side)[:40]}")
    return Benchmark(str(name), check_vector(f"{source}: goals", goals, goals.shape[1]), float(side))
