"""Evaluation: the mean error of an inverse model at goals that are spread over the reachable space.

Section 5.2 and eq. (10) of Nguyen & Oudeyer (2014). An evaluation does not change the learner: nothing is learnt from
its movements, and it has random streams of its own.
    benchmark = load_benchmark(); evaluation = evaluate(inverse, environment, benchmark.goals, seed, step)
"""

from __future__ import annotations

import math
import os
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.environments.protocol import Environment, execute_many, moves_in_batches, observed, tried
from sgimd_torch.files import read_npz, write_npz
from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat
from sgimd_torch.parts import Inverse
from sgimd_torch.spaces import Array, Box, Estimate, Failure, check_count, check_vector, first_entry, stream

SHIPPED = Path(__file__).with_name("data") / "benchmark.npz"
TILES: Final = 358  # number of goals in the paper's benchmark
TOGETHER: Final = 128  # number of movements that an evaluation executes at once; Ctrl-C works between them
RECENT: Final = 50  # number of latest goals, or movements, over which the results at the learner's own goals are taken
NEAREST: Final = 10  # number of outcomes near a goal that say whether it lies beyond all
ONE_SIDE: Final = 0.7  # share of their mean distance that their mean has, if they lie on one side
FAR: Final = 0.03  # share of the diagonal of all outcomes
SIDES: Final = np.linspace(0.025, 0.1, 301)  # sides of a tile to try, relative to T's: 1600 to 100 tiles in the plane


@dataclass(frozen=True, eq=False)
class Benchmark:
    """The goals of an evaluation.

    Args:
        environment: name of the class of the environment that the goals were made for.
        goals: ``(n, outcome_dim)``, in the unit of T.
        side: side of the tiles in which the goals were drawn, in the unit of T.
    """

    environment: str
    goals: Array
    side: float

    def check(self, environment: Environment) -> None:
        """Refuse an environment that these goals were not made for.

        Raises:
            ValueError: its class or its outcome dimensions differ, or goals lie outside its T.
        """
        name = type(environment).__name__
        if name != self.environment or environment.outcomes.dim != self.goals.shape[1]:
            raise ValueError(
                f"the benchmark was made for the class {self.environment} ({self.goals.shape[1]} outcome dimensions), "
                f"got {name} ({environment.outcomes.dim}); sgimd benchmark makes another one"
            )
        space = environment.outcomes
        if not space.contains(self.goals).all():
            entry = first_entry(self.goals, ~((self.goals >= space.low) & (self.goals <= space.high)))  # NaN too
            raise ValueError(
                f"goals of the benchmark must lie in the task space {space.low.tolist()} to {space.high.tolist()}, "
                f"but {entry}; were they made for another T, or not in {space.unit or 'its unit'}?"
            )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The result of ``evaluate``, a row for each goal.

    Args:
        errors: ``(n,)``, distance of the outcome from the goal; of ``rest`` from the goal if the movement failed.
        thetas: ``(n, theta_dim)``, executed movements.
        outcomes: ``(n, outcome_dim)``; NaN if the movement failed.
        scatter: ``(n,)``, estimated mean distance of the repeated outcomes at a goal from their true mean; NaN if there
            are no repeats.
        contexts: ``(n, context_dim)``, contexts of the movements.
        failed: ``(n,)``, whether the movement failed.
        expected: ``(n,)``, errors that the inverse model expected; NaN if it does not say how sure it is.
    """

    errors: Array
    thetas: Array
    outcomes: Array
    scatter: Array
    contexts: Array
    failed: NDArray[np.bool_]
    expected: Array

    @property
    def mean_error(self) -> float:
        """Mean error, eq. (10), in the unit of T."""
        return float(self.errors.mean())

    @property
    def noise_floor(self) -> float:
        """The part of ``mean_error`` that noise alone makes; the remaining part is bias."""
        known = self.scatter[np.isfinite(self.scatter)]
        return float(known.mean()) if len(known) else float("nan")

    @property
    def without_noise(self) -> Evaluation:
        """This evaluation without ``scatter``."""
        return replace(self, scatter=np.full_like(self.scatter, np.nan))

    def met(self, near: float) -> int:
        """The number of goals with an error of ``near`` or less."""
        return int((self.errors <= near).sum())


def beyond(outcomes: Array, goals: Array) -> NDArray[np.bool_]:
    """``(n,)``, whether each of the ``goals`` ``(n, dim)`` lies beyond all ``outcomes`` ``(m, dim)``.

    Then the outcomes near it lie on one side of it, and none is nearer than 3 % of their diagonal.
    """
    if len(outcomes) < NEAREST:
        return np.zeros(len(goals), bool)
    ways = outcomes[Flat(Growing(outcomes.shape[1], outcomes)).nearest(goals, NEAREST)] - goals[:, None]
    distances, far = np.linalg.norm(ways, axis=2), FAR * np.linalg.norm(np.ptp(outcomes, axis=0))
    one_side = np.linalg.norm(ways.mean(axis=1), axis=1) > ONE_SIDE * distances.mean(axis=1)
    return np.asarray(one_side & (distances[:, 0] > far))


@dataclass
class OwnGoals:
    """How nearly a learner met the goals that it chose. A run without evaluations has no other measure of learning.

    A goal counts once, by the nearest outcome of its movements: of those that follow each other, or that only movements
    of other robots separate.

    Args:
        at_once: number of robots that move at once.

    Attributes:
        begun: number of the first movement at each goal, in order.
        missed: distance from each goal to its nearest outcome, in the unit of T.
    """

    at_once: int = 1
    begun: list[int] = field(default_factory=list)
    missed: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._seen: dict[bytes, tuple[int, int]] = {}  # for each goal its number, and the number of its last movement

    def add(self, index: int, goal: Array, outcome: Array) -> None:
        """Count the movement with the number ``index``, which had an outcome."""
        key = goal.tobytes()
        number, last = self._seen.get(key, (0, -self.at_once - 1))
        if index - last > self.at_once:
            number = len(self.begun)
            self.begun.append(index)
            self.missed.append(np.inf)
        self._seen[key] = number, index
        self.missed[number] = min(self.missed[number], math.dist(outcome, goal))

    def recent_misses(self, movements: int) -> Array:
        """``(n,)``, distances missed at the last 50 goals begun in this number of ``movements``, or fewer."""
        until = bisect_left(self.begun, movements)
        return np.array(self.missed[max(0, until - RECENT) : until])


def contexts_of_goals(environment: Environment, n: int) -> Array:
    """``(n, context_dim)``, an observed context for each goal, equal in all evaluations, so comparisons are paired."""
    if environment.contexts.dim == 0:
        return np.zeros((n, 0))
    return np.stack([_context_of_goal(environment, goal) for goal in range(n)])


def _context_of_goal(environment: Environment, goal: int) -> Array:
    return observed(environment, stream(0, "contexts of evaluation", goal))


def evaluate(
    inverse: Inverse,
    environment: Environment,
    goals: Array,
    seed: int,
    step: int,
    *,
    context: ArrayLike | None = None,
    repeats: int = 2,
    between: Callable[[], object] = bool,
) -> Evaluation:
    """Execute the answer to every goal once, and ``repeats`` times more to measure the noise.

    Two inverse models evaluated with equal ``seed`` and ``step`` get equal noise, goal by goal. The order of movements
    is random, so that the noise of a robot with memory shows. Each context is observed again before its movement; if it
    has changed, as a state of the robot does, the goal is answered anew.

    Args:
        inverse: inverse model, whose ``answer_many`` is called; its memory must not be empty.
        environment: environment of the movements; a `BatchEnvironment` executes them together.
        goals: ``(n, outcome_dim)``, in the unit of T.
        seed: number from which the random streams come.
        step: number that distinguishes the evaluations of a run, such as the number of movements so far.
        context: ``(context_dim,)`` for all goals, or ``(n, context_dim)``; None for `contexts_of_goals`.
        repeats: number k of repetitions of each movement, 2 or more; 0 to leave the noise unmeasured. The measured
            scatter is multiplied by sqrt(k / (k - 1)), because outcomes lie nearer to their own mean than to the true
            mean; for Gaussian noise the result does not depend on k.
        between: function to call before each movement, or before each 128 if the environment executes them together;
            its `KeyboardInterrupt` ends the evaluation.

    Raises:
        ValueError: there are no goals, goals have another dimension or are not finite, or a number is out of its range.
        RuntimeError: the memory of ``inverse`` is empty.
    """
    goals = check_vector("goals", goals, environment.outcomes.dim)
    if goals.ndim != 2 or len(goals) == 0:
        raise ValueError(f"goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    check_count("step", step, 0)
    if check_count("repeats", repeats, 0) == 1:
        raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
    if context is None:
        contexts = contexts_of_goals(environment, len(goals))
    else:
        given = environment.contexts.check("context", context)
        contexts = np.broadcast_to(given, (len(goals), environment.contexts.dim))
    answers, n = [*inverse.answer_many(contexts, goals)] * (1 + repeats), len(goals)
    thetas, contexts = np.stack([answer.theta for answer in answers]), np.tile(contexts, (1 + repeats, 1))

    def look(row: int) -> bool:
        """Answer anew if the context of a movement has changed; False: the robot cannot see it."""
        if context is not None or not environment.contexts.dim or moves_in_batches(environment):
            return True
        seen = tried("context", environment.contexts.dim, _context_of_goal, environment, row % n)
        if isinstance(seen, Failure):
            return False
        if not np.array_equal(seen, contexts[row]):
            answers[row] = inverse(seen, goals[row % n])
            contexts[row], thetas[row] = seen, answers[row].theta
        return True

    rng = stream(seed, f"order of evaluation {step}")
    # Repeats come last, so that errors do not depend on their number.
    order = np.concatenate([k * n + rng.permutation(n) for k in range(1 + repeats)])
    landed = _landed(environment, contexts, thetas, seed, f"evaluation {step}", order, look, between)
    landed = landed.reshape(1 + repeats, *goals.shape)
    outcomes, again = landed[0], landed[1:]
    failed = np.isnan(outcomes).any(axis=1)
    scatter = np.full(len(goals), np.nan)
    if repeats:
        bessel = np.sqrt(repeats / (repeats - 1))
        again = environment.outcomes.unwrapped(again, landed[0])
        scatter = bessel * np.linalg.norm(again - again.mean(axis=0), axis=2).mean(axis=0)
    reached = np.where(np.isnan(outcomes), environment.rest, outcomes)
    errors, expected = environment.outcomes.distance(reached, goals), expected_errors(answers[:n], goals)
    return Evaluation(errors, thetas[:n], outcomes, scatter, contexts[:n], failed, expected)


def expected_errors(answers: Sequence[Estimate], goals: Array) -> Array:
    """Expected errors ``(n,)`` of answers to ``goals`` ``(n, outcome_dim)``; NaN: not known."""
    return np.array([answer.expected_error(goal) for answer, goal in zip(answers, goals, strict=True)])


def _landed(
    environment: Environment,
    contexts: Array,
    thetas: Array,
    seed: int,
    name: str,
    order: NDArray[np.int_],
    look: Callable[[int], bool],
    between: Callable[[], object],
) -> Array:
    """Outcomes ``(n, outcome_dim)``, NaN for a failed movement; movement i has stream i of this ``name``.

    Before a movement, ``look`` may change its context and theta, or say that there is none.
    """
    landed = np.full((len(thetas), environment.outcomes.dim), np.nan)
    together = TOGETHER if moves_in_batches(environment) else 1
    waiting = [order[start : start + together].tolist() for start in range(0, len(order), together)][::-1]
    while waiting:
        between()
        # No theta outside Pi may go to a robot.
        rows = [row for row in waiting.pop() if look(row) and environment.policies.contains(thetas[row])]
        rngs = [stream(seed, name, row) for row in rows]
        outcomes = execute_many(environment, contexts[rows], thetas[rows], rngs)
        if len(rows) > 1 and all(isinstance(outcome, Failure) for outcome in outcomes):
            waiting += [[row] for row in rows]  # perhaps one of them failed: they move again, one by one
            continue
        for row, outcome in zip(rows, outcomes, strict=True):
            landed[row] = np.nan if isinstance(outcome, Failure) else outcome
    return landed


def grid_over(box: Box, counts: Sequence[int] | Array) -> Array:
    """``(n, dim)`` centres of equal cells of a box, so many in each dimension."""
    centres = [low + (np.arange(n) + 0.5) / n * side for low, side, n in zip(box.low, box.sides, counts, strict=True)]
    return np.stack(np.meshgrid(*centres), axis=-1).reshape(-1, box.dim)


def tile_goals(outcomes: Array, box: Box, side: float, rng: np.random.Generator) -> Array:
    """One random goal in each tile of T with two outcomes or more.

    Args:
        outcomes: ``(n, outcome_dim)``, outcomes of several runs; outcomes outside ``box`` do not count.
        box: T.
        side: side of a tile, in the unit of T.
        rng: random stream of the goals.

    Returns:
        ``(n_tiles, outcome_dim)``, in the order of the tiles.
    """
    tiles = _tiles(outcomes[rows_in_tiles(outcomes, box, side)], box, side)
    return box.clip(box.low + (tiles + rng.random(tiles.shape)) * side)


def tile_sides(outcomes: Array, box: Box) -> Array:
    """``(n,)``, sides of tiles to choose from, increasing.

    In the plane they are a fortieth to a tenth of T's side. In other dimensions they are chosen so that T has as many
    tiles as in the plane. If outcomes span less than a tenth of a side of T, their span replaces that side.
    """
    inside = outcomes[box.contains(outcomes)]
    reached = np.ptp(inside, axis=0) if len(inside) else box.sides
    lengths = np.where((reached > 0) & (reached < box.sides / 10), reached, box.sides)
    return np.asarray(np.prod(lengths) ** (1 / box.dim) * SIDES ** (2 / box.dim))


def tile_side(outcomes: Array, box: Box, tiles: int = TILES) -> float:
    """The one of `tile_sides` with which about ``tiles`` tiles have two outcomes or more; see `tile_goals`."""
    inside = outcomes[box.contains(outcomes)]
    return float(min(tile_sides(outcomes, box), key=lambda side: abs(len(rows_in_tiles(inside, box, side)) - tiles)))


def rows_in_tiles(outcomes: Array, box: Box, side: float) -> NDArray[np.intp]:
    """Row of the first outcome in each tile of T that has two or more, in the order of the tiles; see `tile_goals`."""
    rows = np.flatnonzero(box.contains(outcomes))
    tiles = _tiles(outcomes[rows], box, side)
    per_side = np.floor(box.sides / side) + 1
    if np.log2(per_side).sum() < 53:  # one number for each tile, because numbers are quicker to sort than rows
        tiles = tiles @ np.append(np.cumprod(per_side[:0:-1])[::-1], 1.0)
    _, first, counts = np.unique(tiles, return_index=True, return_counts=True, axis=0 if tiles.ndim > 1 else None)
    return np.asarray(rows[first[counts > 1]])


def _tiles(outcomes: Array, box: Box, side: float) -> Array:
    """``(n, dim)``, tile of each outcome, numbered in each dimension from T's lower corner."""
    return np.floor((outcomes - box.low) / side)


def save_benchmark(path: str | os.PathLike[str], benchmark: Benchmark) -> None:
    """Write a file for ``load_benchmark``, whole or not at all.

    Raises:
        ValueError: ``load_benchmark`` would refuse the benchmark.
        OSError: ``path`` is a directory, or cannot be written.
    """
    name, goals, side = np.array(benchmark.environment), np.asarray(benchmark.goals), np.array(benchmark.side)
    right = _checked(str(path), name, goals, side)
    write_npz(path, {"environment": name, "goals": right.goals, "side": side})


def load_benchmark(path: str | os.PathLike[str] = SHIPPED) -> Benchmark:
    """Read a benchmark; by default the shipped one of ``FishingRod``.

    Raises:
        ValueError: the file is no benchmark, is damaged, has no goals, or has numbers that are not finite.
        OSError: there is no file, or ``path`` is a directory.
    """
    arrays = read_npz(path, "benchmark", "sgimd benchmark", ("environment", "goals", "side"))
    return _checked(str(path), *arrays)


def _checked(source: str, name: np.ndarray, goals: np.ndarray, side: np.ndarray) -> Benchmark:
    if name.shape != () or name.dtype.kind != "U" or not str(name).isidentifier():
        raise ValueError(f"{source}: environment must be the name of a class, got {name.dtype} {name.shape}")
    if goals.ndim != 2 or goals.size == 0:
        raise ValueError(f"{source}: goals must have shape (n, outcome_dim) with n > 0, got {goals.shape}")
    if side.shape != () or side.dtype.kind not in "iuf" or not 0 < side < np.inf:
        raise ValueError(f"{source}: the side of the tiles must be a positive number, got {str(side)[:40]}")
    return Benchmark(str(name), check_vector(f"{source}: goals", goals, goals.shape[1]), float(side))
