"""Quality diversity: learners of another school, which fill an archive of outcomes with movements that reach them.

MAP-Elites (Mouret & Clune 2015), its line operator (Vassiliades & Mouret 2018), CMA-ME (Fontaine et al. 2020) and
CMA-MAE (Fontaine & Nikolaidis 2023), by the package ``ribs``. They, too, end with a movement for every outcome that
they found, but without goals: they vary movements that led somewhere new.
    learner = map_elites(environment, seed)        learner = cma_mae(environment, seed, correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypedDict, Unpack

import numpy as np

from sgimd_torch.algorithms import Correspondence
from sgimd_torch.environments.protocol import Environment, check_rest
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Attempt, Box, Demonstration, Move, check_count, stream
from sgimd_torch.strategies import Imitate

try:
    from ribs.archives import GridArchive
    from ribs.emitters import EmitterBase, EvolutionStrategyEmitter, GaussianEmitter, IsoLineEmitter
    from ribs.schedulers import Scheduler
except ImportError as error:
    raise ImportError(f"quality diversity needs ribs: pip install 'sgimd-torch[rivals]' ({error})") from error

_DEFAULT_CELLS = 400  # 20 x 20, of .1 m in the fishing task, like the tiles of its benchmark
_MAX_CELLS = 1_000_000  # ribs keeps an array of all of them
_LEAST_OBJECTIVE = -0.35  # of CMA-MAE's cells at the start: below the effort of the corners of Pi, .25
MakeEmitters = Callable[[GridArchive, np.random.Generator], Sequence[EmitterBase]]


class Options(TypedDict, total=False):
    """The keywords that all of them have.

    ``cells`` for each dimension of T, None for about 400 in all. ``again``: share of the movements that repeat elites,
    whose cell is then that of their mean outcome; 0 believes the first outcome, however lucky. ``correspondence``, eq.
    (6): what is demonstrated is imitated as by SGIM-D, ``imitations`` times with variations up to ``epsilon``, and
    enters the archive; None learns alone.
    """

    cells: int | None
    again: float
    correspondence: Correspondence | None
    imitations: int
    epsilon: float


def map_elites(
    environment: Environment,
    seed: int,
    *,
    first: int = 100,
    sd: float = 0.05,
    batch: int = 10,
    **options: Unpack[Options],
) -> Learner:
    """MAP-Elites: Gaussian variations of elites, which are drawn evenly from the cells of T that were reached.

    Args:
        environment: its boxes are read; it is not executed.
        seed: of this learner's stream.
        first: number of uniform movements at the start.
        sd: standard deviation of the variations, in sides of Pi, as in `perturb`; what leaves Pi is clipped.
        batch: movements between two looks at the archive.
        options: see `Options`.

    Raises:
        ValueError: a number out of its range, or an environment with contexts, which an archive over T does not know.
    """
    _check_sd(sd)
    sizes = check_count("first", first, 1), check_count("batch", batch, 1)

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[EmitterBase]:
        return [GaussianEmitter(archive, sigma=sd, **_begun(environment, rng, *sizes))]

    return _learner(environment, seed, "map-elites", emitters, **options)


def isoline(
    environment: Environment,
    seed: int,
    *,
    first: int = 100,
    sd: float = 0.02,
    line: float = 0.2,
    batch: int = 10,
    **options: Unpack[Options],
) -> Learner:
    """MAP-Elites with the line operator: an elite, a step along the line to another one, and a little noise.

    Args:
        environment, seed, first, batch, options: as in `map_elites`.
        sd: standard deviation of the noise, in sides of Pi.
        line: standard deviation of the step, in distances between the two elites.

    Raises:
        ValueError: as in `map_elites`.
    """
    _check_sd(sd)
    sizes = check_count("first", first, 1), check_count("batch", batch, 1)

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[EmitterBase]:
        return [IsoLineEmitter(archive, iso_sigma=sd, line_sigma=line, **_begun(environment, rng, *sizes))]

    return _learner(environment, seed, "isoline", emitters, **options)


def cma_me(
    environment: Environment,
    seed: int,
    *,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    **options: Unpack[Options],
) -> Learner:
    """CMA-ME: CMA-ES that climbs towards new cells of the archive, and restarts from an elite when it finds none.

    Args:
        environment, seed, options: as in `map_elites`.
        emitters: number of emitters of the improvement type; all start at the centre of Pi. Deviation: Fontaine et al.
            have 15, of which each would get some 25 generations in a run on the rod.
        sd: standard deviation of the first generation and after a restart, in sides of Pi; what leaves Pi is clipped.
            Deviation: pyribs' examples start wider, but from the middle of a box of many dimensions that leads into its
            corners.
        batch: movements of a generation of each emitter, at least 2; None for 4 + 3 ln(theta_dim).

    Raises:
        ValueError: as in `map_elites`.
    """
    team = _team(environment, emitters, sd, batch, ranker="2imp")
    return _learner(environment, seed, "cma-me", team, **options)


def cma_mae(
    environment: Environment,
    seed: int,
    *,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    learning_rate: float = 0.01,
    **options: Unpack[Options],
) -> Learner:
    """CMA-MAE: as CMA-ME, but what an elite has to beat rises slowly, so that a cell stays worth improving.

    Args:
        environment, seed, emitters, sd, batch, options: as in `cma_me`.
        learning_rate: how far a cell's threshold moves towards the objective of a movement that enters it, in (0, 1].

    Raises:
        ValueError: as in `map_elites`.
    """
    if not 0 < learning_rate <= 1:
        raise ValueError(f"learning_rate must lie in (0, 1], got {learning_rate}; 1 is CMA-ME's archive")
    team = _team(environment, emitters, sd, batch, ranker="imp", selection_rule="mu", restart_rule="basic")
    annealed = {"learning_rate": learning_rate, "threshold_min": _LEAST_OBJECTIVE}
    return _learner(environment, seed, "cma-mae", team, annealed, **options)


class QualityDiversity:
    """The movements of a scheduler, batch after batch; it is told of a batch when all of it was executed.

    The objective, which decides between elites of one cell, is little effort: minus the mean square of a movement's
    distance from the middle of Pi, in sides. Outcomes outside T count for the nearest cell of its border. In a T far
    larger than what can be reached nearly all outcomes share a few cells, and few elites are left to vary.

    Each attempt is one movement; if it is interrupted before its outcome is told, it is proposed again.

    Args:
        policies: Pi.
        scheduler: with its archive over T, of movements in sides of Pi. Deviation: what lies outside Pi is executed
            clipped, but told as it was proposed, and its effort counts. CMA-ES itself would draw again, and never end
            once its mean lies in a corner of many dimensions.
        origin: of the movements, for the log.
        again: share of the movements that repeat elites.
    """

    def __init__(self, policies: Box, scheduler: Scheduler, origin: str, again: float = 0.0) -> None:
        if not 0 <= again < 1:
            raise ValueError(f"again must lie in [0, 1), got {again}; it is a share of the movements")
        self.policies = policies
        self.archive = scheduler.archive
        self._scheduler = scheduler
        self._origin = origin
        self._again = again
        self._landed: dict[bytes, list[Array]] = {}  # outcomes of each movement, where elites are repeated
        self._ask()

    def attempt(self, context: Array) -> Attempt:
        """The next movement of the batch."""
        theta = self.policies.low + self.policies.sides * self._batch[len(self._outcomes)]
        outcome = yield Move(self.policies.clip(theta), None, self._origin)
        self._outcomes.append(outcome)
        if len(self._outcomes) == len(self._batch):
            self._tell()
            self._ask()

    def add(self, thetas: Array, outcomes: Array) -> None:
        """Movements ``(n, theta_dim)`` in Pi that were not its own, with their outcomes, for the archive."""
        batch = (thetas - self.policies.low) / self.policies.sides
        self._remember(batch, outcomes)
        self.archive.add(batch, _objectives(batch), outcomes)

    def _ask(self) -> None:
        new = self._scheduler.ask()
        n = 0 if self.archive.empty else round(len(new) * self._again / (1 - self._again))
        repeated = [self.archive.sample_elites(n)["solution"]] if n else []
        self._batch: Array = np.concatenate([new, *repeated])  # (n, theta_dim)
        self._new = len(new)
        self._outcomes: list[Array] = []

    def _tell(self) -> None:
        outcomes, new = np.stack(self._outcomes), slice(self._new)
        self._remember(self._batch, outcomes)
        self._scheduler.tell(_objectives(self._batch[new]), outcomes[new])
        if len(self._batch) > self._new:
            elites = self.archive.data("solution")
            means = np.stack([np.mean(self._landed[elite.tobytes()], axis=0) for elite in elites])
            self.archive.clear()
            self.archive.add(elites, _objectives(elites), means)

    def _remember(self, batch: Array, outcomes: Array) -> None:
        if self._again:
            for theta, outcome in zip(batch, outcomes, strict=True):
                self._landed.setdefault(theta.tobytes(), []).append(outcome)


class Shown:
    """Imitate what is demonstrated, as SGIM-D does; what was executed enters the archive, where it is varied."""

    def __init__(self, explorer: QualityDiversity, imitate: Imitate) -> None:
        self.explorer, self.imitate = explorer, imitate

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """The movements of the imitation."""
        thetas: list[Array] = []
        outcomes: list[Array] = []
        moves = self.imitate.attempt(context, theta_d, demonstration)
        move = next(moves, None)
        try:
            while move is not None:
                outcome = yield move
                thetas.append(move.theta)
                outcomes.append(outcome)
                try:
                    move = moves.send(outcome)
                except StopIteration:
                    return
        finally:  # also when the next demonstration interrupts
            if outcomes:
                self.explorer.add(np.stack(thetas), np.stack(outcomes))


def _objectives(batch: Array) -> Array:
    objectives: Array = -np.square(batch - 0.5).mean(axis=1)
    return objectives


def _check_sd(sd: float) -> None:
    if not 0 < sd < np.inf:
        raise ValueError(f"sd must be positive and finite, got {sd}; without noise nothing new is tried")


def _begun(environment: Environment, rng: np.random.Generator, first: int, batch: int) -> dict[str, Any]:
    """Keywords of an emitter that starts with ``first`` uniform movements."""
    dim = environment.policies.dim
    uniform = rng.uniform(size=(first, dim))
    return {
        "initial_solutions": uniform,
        "batch_size": batch,
        "lower_bounds": np.zeros(dim),
        "upper_bounds": np.ones(dim),
        "seed": _seed(rng),
    }


def _team(environment: Environment, emitters: int, sd: float, batch: int | None, **rules: Any) -> MakeEmitters:
    """Makes evolution strategies that all start at the centre of Pi."""
    _check_sd(sd)
    if batch is not None:
        check_count("batch", batch, 2)
    check_count("emitters", emitters, 1)
    centre = np.full(environment.policies.dim, 0.5)

    def make(archive: GridArchive, rng: np.random.Generator) -> list[EmitterBase]:
        return [
            EvolutionStrategyEmitter(archive, x0=centre, sigma0=sd, batch_size=batch, seed=_seed(rng), **rules)
            for _ in range(emitters)
        ]

    return make


def _learner(
    environment: Environment,
    seed: int,
    origin: str,
    emitters: MakeEmitters,
    annealed: dict[str, Any] | None = None,
    *,
    cells: int | None = None,
    again: float = 0.0,
    correspondence: Correspondence | None = None,
    imitations: int = 10,
    epsilon: float = 0.05,
) -> Learner:
    if environment.contexts.dim:
        raise ValueError(f"quality diversity knows one context only, got contexts of dim {environment.contexts.dim}")
    check_rest(environment)
    outcomes, rng = environment.outcomes, stream(seed, origin)
    cells = max(2, round(_DEFAULT_CELLS ** (1 / outcomes.dim))) if cells is None else check_count("cells", cells, 1)
    if cells**outcomes.dim > _MAX_CELLS:
        raise ValueError(f"cells must be {_MAX_CELLS} in all at most, got {cells} in {outcomes.dim} dimensions")
    archive = GridArchive(
        solution_dim=environment.policies.dim,
        dims=[cells] * outcomes.dim,
        ranges=list(zip(outcomes.low, outcomes.high, strict=True)),
        seed=_seed(rng),
        **(annealed or {}),
    )
    explorer = QualityDiversity(environment.policies, Scheduler(archive, emitters(archive, rng)), origin, again)
    memory = Memory(environment.contexts.dim, environment.policies.dim, environment.outcomes.dim)
    if correspondence is None:
        return Learner(memory, explorer)
    imitate = Imitate(environment.policies, stream(seed, "imitate"), repeats=imitations, epsilon=epsilon)
    return Learner(memory, explorer, social=Shown(explorer, imitate), correspondence=correspondence)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**32))
