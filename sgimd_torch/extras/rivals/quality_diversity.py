"""Quality diversity: learners that fill an archive over T with movements for its cells.

MAP-Elites (Mouret & Clune 2015), its line operator (Vassiliades & Mouret 2018), CMA-ME (Fontaine et al. 2020) and
CMA-MAE (Fontaine & Nikolaidis 2023), by the package ``ribs``. Like goal babbling, these learners find a movement for
each part of T that they reach. But they have no goals: they vary movements that had new outcomes.
    learner = map_elites_alone(environment, seed)        learner = cma_mae(environment, seed, correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from sgimd_torch.algorithms import MakeInverse, learner_of
from sgimd_torch.calls import with_keywords_of
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import MakeMemory, Memory
from sgimd_torch.parts import Problem, Social, Strategy
from sgimd_torch.spaces import Array, Attempt, Demonstration, Move, check_count
from sgimd_torch.strategies import Mimic, recording_outcomes

try:
    from ribs.archives import GridArchive
    from ribs.emitters import EmitterBase, EvolutionStrategyEmitter, GaussianEmitter, IsoLineEmitter
    from ribs.schedulers import Scheduler
except ImportError as error:
    raise ImportError(f"quality diversity needs ribs: pip install 'sgimd-torch[rivals]' ({error})") from error

_DEFAULT_CELLS: Final = (
    400  # number of cells: 20 x 20 cells of .1 m in the fishing task, like the tiles of its benchmark
)
_MAX_CELLS: Final = 1_000_000  # largest number of cells; ribs keeps an array of all cells
_LEAST_OBJECTIVE: Final = -0.35  # first threshold of CMA-MAE's cells: below the objective of the corners of Pi, -.25
MakeEmitters = Callable[[GridArchive, np.random.Generator], Sequence[EmitterBase]]


def quality_diversity(
    environment: Environment,
    seed: int,
    origin: str,
    emitters: MakeEmitters,
    annealed: dict[str, Any],
    *,
    correspondence: Correspondence | None,
    cells: int | None = None,
    imitations: int = 10,
    epsilon: float = 0.05,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
) -> Learner:
    """A learner by quality diversity; the algorithms below choose its emitters.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which the random stream of the learner comes.
        origin: name of the random stream, and origin of the movements in the record.
        emitters: function (archive, rng) -> emitters, which propose movements.
        annealed: keywords of CMA-MAE's archive; empty for other algorithms.
        cells: number of cells in each dimension of T; None: about 400 cells in all.
        correspondence: function from times and trajectory to theta_d, eq. (6); None: the learner has no teacher.
        imitations: number of movements that imitate a demonstration.
        epsilon: largest variation of each parameter in an imitation, in the unit of the parameter.
        inverse: constructor of the inverse model.
        memory: memory, or exemplars to start from, which enter the archive.

    Raises:
        ValueError: a number is out of its range, or the environment has contexts.
    """
    if environment.contexts.dim:
        raise ValueError(f"quality diversity knows one context only, got contexts of dim {environment.contexts.dim}")
    outcomes = environment.outcomes
    cells = max(2, round(_DEFAULT_CELLS ** (1 / outcomes.dim))) if cells is None else check_count("cells", cells, 1)
    if cells**outcomes.dim > _MAX_CELLS:
        raise ValueError(f"cells must be {_MAX_CELLS} in all at most, got {cells} in {outcomes.dim} dimensions")

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        rng = problem.stream(origin)
        archive = GridArchive(
            solution_dim=environment.policies.dim,
            dims=[cells] * outcomes.dim,
            ranges=list(zip(outcomes.low, outcomes.high, strict=True)),
            seed=_seed(rng),
            **annealed,
        )
        scheduler = Scheduler(archive, emitters(archive, rng))
        explorer = QualityDiversity(problem, scheduler, origin)
        if correspondence is None:
            return Learner(problem, explorer)
        social = ImitateIntoArchive(problem, explorer, Mimic(problem, repeats=imitations, epsilon=epsilon))
        return Learner(problem, explorer, social=social, correspondence=correspondence)

    return learner_of(begin, seed, memory)


@with_keywords_of(quality_diversity)
def map_elites(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence | None,
    first: int = 100,
    sd: float = 0.05,
    line: float = 0.0,
    batch: int = 10,
    **options: Any,
) -> Learner:
    """MAP-Elites with a teacher: Gaussian variations of elites; all reached cells of T are equally likely.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which the random stream of the learner comes.
        correspondence: function from times and trajectory to theta_d, eq. (6); None: the learner has no teacher.
        first: number of uniform movements at the start.
        sd: standard deviation of the variations, as a fraction of each parameter's range in Pi.
        line: standard deviation of a step towards another elite, relative to the distance between the two elites; 0: no
            such steps.
        batch: number of movements between two updates of the archive.
        options: options of `quality_diversity`.

    Raises:
        ValueError: a number is out of its range, or the environment has contexts, which an archive over T cannot hold.
    """
    _check_sd(sd)
    if not 0 <= line < np.inf:
        raise ValueError(f"line must be finite and >= 0, got {line}; it is relative to the distance of two elites")
    check_count("first", first, 1), check_count("batch", batch, 1)
    dim = environment.policies.dim

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[EmitterBase]:
        shared: dict[str, Any] = {
            "initial_solutions": rng.uniform(size=(first, dim)),
            "batch_size": batch,
            "lower_bounds": np.zeros(dim),
            "upper_bounds": np.ones(dim),
            "seed": _seed(rng),
        }
        if line:
            return [IsoLineEmitter(archive, iso_sigma=sd, line_sigma=line, **shared)]
        return [GaussianEmitter(archive, sigma=sd, **shared)]

    return quality_diversity(
        environment, seed, "isoline" if line else "map-elites", emitters, {}, correspondence=correspondence, **options
    )


isoline = partial(map_elites, sd=0.02, line=0.2)
"""MAP-Elites along lines, with a teacher: an elite, a step towards another elite, and a little noise."""


@with_keywords_of(quality_diversity)
def cma_me(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence | None,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    **options: Any,
) -> Learner:
    """CMA-ME with a teacher: CMA-ES towards new cells of the archive; restarts from an elite when it finds none.

    Args:
        environment, seed, correspondence, options: arguments of `map_elites`.
        emitters: number of improvement emitters, which start at the centre of Pi. Deviation: Fontaine et al. have 15,
            but in a run on the rod each of the 15 would get only about 25 generations.
        sd: standard deviation at the start and after a restart, as a fraction of each parameter's range in Pi.
            Deviation: pyribs' examples start wider, but in many dimensions a wide start leads into the corners of Pi.
        batch: number of movements in a generation of each emitter, at least 2; None: 4 + 3 ln(theta_dim).

    Raises:
        ValueError: see `map_elites`.
    """
    team = _team(environment, emitters, sd, batch, ranker="2imp")
    return quality_diversity(environment, seed, "cma-me", team, {}, correspondence=correspondence, **options)


@with_keywords_of(quality_diversity)
def cma_mae(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence | None,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    learning_rate: float = 0.01,
    **options: Any,
) -> Learner:
    """CMA-MAE with a teacher: CMA-ME with thresholds that rise slowly, so that more movements are improvements.

    Args:
        environment, seed, correspondence, emitters, sd, batch, options: arguments of `cma_me`.
        learning_rate: step of a cell's threshold towards the objective of a new movement, in (0, 1].

    Raises:
        ValueError: see `map_elites`.
    """
    if not 0 < learning_rate <= 1:
        raise ValueError(f"learning_rate must lie in (0, 1], got {learning_rate}; 1 is CMA-ME's archive")
    team = _team(environment, emitters, sd, batch, ranker="imp", selection_rule="mu", restart_rule="basic")
    annealed = {"learning_rate": learning_rate, "threshold_min": _LEAST_OBJECTIVE}
    return quality_diversity(environment, seed, "cma-mae", team, annealed, correspondence=correspondence, **options)


_ALONE: Final[dict[str, Any]] = {"correspondence": None, "imitations": 0, "epsilon": 0.0}
map_elites_alone = partial(map_elites, **_ALONE)
"""MAP-Elites: fills an archive of outcomes by variations of its elites."""
isoline_alone = partial(isoline, **_ALONE)
"""MAP-Elites along lines between its elites."""
cma_me_alone = partial(cma_me, **_ALONE)
"""CMA-ME: fills an archive by evolution strategies."""
cma_mae_alone = partial(cma_mae, **_ALONE)
"""CMA-MAE: CMA-ME with thresholds that rise slowly."""


def _check_sd(sd: float) -> None:
    if not 0 < sd < np.inf:
        raise ValueError(f"sd must be positive and finite, got {sd}; without noise nothing new is tried")


def _team(environment: Environment, emitters: int, sd: float, batch: int | None, **rules: Any) -> MakeEmitters:
    """Function that makes evolution strategies, which all start at the centre of Pi."""
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


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**32))


class QualityDiversity(Strategy):
    """Movements that a scheduler proposes in batches; after each batch, the scheduler is told the outcomes.

    A cell keeps the movement with the largest objective, its elite. The objective is minus the mean square distance of
    a movement from the middle of Pi, relative to the sides of Pi. An outcome outside T counts in the nearest border
    cell of T. If T is far larger than the reachable part, most outcomes fall into a few cells, so there are few elites.

    Each attempt is one movement. If an attempt is interrupted before its outcome, the next attempt repeats it. Several
    robots at once may repeat the first movement of a batch near its end, because the next batch is not known yet.

    Args:
        problem: problem to learn; exemplars of its memory are in the archive from the start.
        scheduler: scheduler of ribs, with an archive over T; its movements are relative to the sides of Pi. Deviation:
            a movement outside Pi is clipped for execution, but the scheduler is told the objective of the proposed
            movement. CMA-ES would draw such a movement again, and in many dimensions these draws may never end.
        origin: origin of the movements, for the record.
    """

    def __init__(self, problem: Problem, scheduler: Scheduler, origin: str) -> None:
        super().__init__(problem)
        self.policies, self.archive = problem.policies, scheduler.archive
        self._scheduler, self._origin = scheduler, origin
        self._under_way: list[int] = []  # rows of the batch that are being executed
        if len(problem.memory):
            self.add(problem.memory.thetas, problem.memory.outcomes)
        self._ask()

    def attempt(self, context: Array) -> Attempt:
        """The next movement of the batch."""
        batch, outcomes = self._batch, self._outcomes
        waiting = [row for row in range(len(batch)) if row not in self._under_way and row not in outcomes]
        row = waiting[0] if waiting else 0
        self._under_way.append(row)
        try:
            theta = self.policies.low + self.policies.sides * batch[row]
            outcomes[row] = yield Move(self.policies.clip(theta), None, self._origin)
        finally:  # interruption included
            self._under_way.remove(row)
        if batch is self._batch and len(outcomes) == len(batch):
            results = np.stack([outcomes[row] for row in range(len(batch))])
            self._scheduler.tell(objectives_of(batch), results)
            self._ask()

    def add(self, thetas: Array, outcomes: Array) -> None:
        """Add other movements, ``thetas`` ``(n, theta_dim)`` in Pi with their outcomes, to the archive."""
        batch = (thetas - self.policies.low) / self.policies.sides
        self.archive.add(batch, objectives_of(batch), outcomes)

    def _ask(self) -> None:
        self._batch: Array = self._scheduler.ask()  # (n, theta_dim)
        self._outcomes: dict[int, Array] = {}  # by row of the batch


class ImitateIntoArchive(Social):
    """Imitate a demonstration as in SGIM-D; the executed movements enter the archive, so that they are varied later."""

    def __init__(self, problem: Problem, explorer: QualityDiversity, mimic: Mimic) -> None:
        super().__init__(problem)
        self.explorer, self.mimic = explorer, mimic

    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """The movements of the imitation."""
        executed: list[tuple[Array, Array]] = []
        try:
            yield from recording_outcomes(self.mimic.attempt(context, theta_d, demonstration), executed)
        finally:  # interruption by the next demonstration included
            if executed:
                thetas, outcomes = zip(*executed, strict=True)
                self.explorer.add(np.stack(thetas), np.stack(outcomes))


def objectives_of(batch: Array) -> Array:
    """Objectives: minus the mean square distance of each movement from the middle of Pi, relative to its sides."""
    objectives: Array = -np.square(batch - 0.5).mean(axis=1)
    return objectives
