"""Quality diversity: learners of another school, which fill an archive of outcomes with movements that reach them.

MAP-Elites (Mouret & Clune 2015), its line operator (Vassiliades & Mouret 2018), CMA-ME (Fontaine et al. 2020) and
CMA-MAE (Fontaine & Nikolaidis 2023), by the package ``ribs``. They, too, end with a movement for every outcome that
they found, but without goals: they vary movements that led somewhere new.
    learner = map_elites(environment, seed)        learner = cma_mae(environment, seed, correspondence=translate)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from sgimd_torch.algorithms import MakeInverse
from sgimd_torch.catalogue.options import hands_on
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Problem
from sgimd_torch.rivals.explorer import QualityDiversity, Shown
from sgimd_torch.spaces import check_count
from sgimd_torch.strategies import Mimic

try:
    from ribs.archives import GridArchive
    from ribs.emitters import EmitterBase, EvolutionStrategyEmitter, GaussianEmitter, IsoLineEmitter
    from ribs.schedulers import Scheduler
except ImportError as error:
    raise ImportError(f"quality diversity needs ribs: pip install 'sgimd-torch[rivals]' ({error})") from error

_DEFAULT_CELLS = 400  # 20 x 20, of .1 m in the fishing task, like the tiles of its benchmark
_MAX_CELLS = 1_000_000  # ribs keeps an array of all of them
_LEAST_OBJECTIVE = -0.35  # of CMA-MAE's cells at the start: below the effort of the corners of Pi, .25
_SHARED = ("cells", "correspondence", "imitations", "epsilon", "inverse", "memory")
MakeEmitters = Callable[[GridArchive, np.random.Generator], Sequence[EmitterBase]]


def quality_diversity(
    environment: Environment,
    seed: int,
    origin: str,
    emitters: MakeEmitters,
    annealed: dict[str, Any] | None = None,
    *,
    cells: int | None = None,
    correspondence: Correspondence | None = None,
    imitations: int = 10,
    epsilon: float = 0.05,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
) -> Learner:
    """What all of them share.

    Args:
        environment: its boxes are read; it is not executed.
        seed: of this learner's stream.
        origin: name of that stream, and of the movements in the log.
        emitters: (archive, rng) -> what proposes movements.
        annealed: keywords of the archive of CMA-MAE.
        cells: for each dimension of T; None for about 400 in all.
        correspondence: eq. (6): what is demonstrated is imitated as by SGIM-D, and enters the archive; None learns
            alone.
        imitations: movements that are spent on imitating a demonstration.
        epsilon: bound of the variation in each parameter of theta when imitating.
        inverse: (memory) -> the inverse model by which it answers.
        memory: to start from: its exemplars enter the archive, and take the place of first movements.

    Raises:
        ValueError: a number out of its range, or an environment with contexts.
    """
    if environment.contexts.dim:
        raise ValueError(f"quality diversity knows one context only, got contexts of dim {environment.contexts.dim}")
    problem = Problem(environment, seed, memory, inverse=inverse)
    outcomes, rng = environment.outcomes, problem.stream(origin)
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
    scheduler = Scheduler(archive, emitters(archive, rng))
    explorer = QualityDiversity(problem, scheduler, origin)
    if correspondence is None:
        return Learner(problem, explorer)
    shown = Shown(problem, explorer, Mimic(problem, repeats=imitations, epsilon=epsilon))
    return Learner(problem, explorer, social=shown, correspondence=correspondence)


@hands_on(quality_diversity, *_SHARED)
def map_elites(
    environment: Environment,
    seed: int,
    *,
    first: int = 100,
    sd: float = 0.05,
    batch: int = 10,
    **options: Any,
) -> Learner:
    """MAP-Elites: Gaussian variations of elites, which are drawn evenly from the cells of T that were reached.

    Args:
        environment: its boxes are read; it is not executed.
        seed: of this learner's stream.
        first: number of uniform movements at the start.
        sd: standard deviation of the variations, in sides of Pi, as in `perturb`; what leaves Pi is clipped.
        batch: movements between two looks at the archive.
        options: see `quality_diversity`.

    Raises:
        ValueError: a number out of its range, or an environment with contexts, which an archive over T does not know.
    """
    _check_sd(sd)
    sizes = check_count("first", first, 1), check_count("batch", batch, 1)

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[EmitterBase]:
        return [GaussianEmitter(archive, sigma=sd, **_begun(environment, rng, *sizes))]

    return quality_diversity(environment, seed, "map-elites", emitters, **options)


@hands_on(quality_diversity, *_SHARED)
def isoline(
    environment: Environment,
    seed: int,
    *,
    first: int = 100,
    sd: float = 0.02,
    line: float = 0.2,
    batch: int = 10,
    **options: Any,
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

    return quality_diversity(environment, seed, "isoline", emitters, **options)


@hands_on(quality_diversity, *_SHARED)
def cma_me(
    environment: Environment,
    seed: int,
    *,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    **options: Any,
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
    return quality_diversity(environment, seed, "cma-me", team, **options)


@hands_on(quality_diversity, *_SHARED)
def cma_mae(
    environment: Environment,
    seed: int,
    *,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    learning_rate: float = 0.01,
    **options: Any,
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
    return quality_diversity(environment, seed, "cma-mae", team, annealed, **options)


_ALONE: Final[dict[str, Any]] = {"correspondence": None, "imitations": 0, "epsilon": 0.0}
map_elites_alone = partial(map_elites, **_ALONE)
"""MAP-Elites: fills an archive of outcomes by variations of its elites."""
isoline_alone = partial(isoline, **_ALONE)
"""MAP-Elites along lines between elites."""
cma_me_alone = partial(cma_me, **_ALONE)
"""CMA-ME: fills an archive by evolution strategies."""
cma_mae_alone = partial(cma_mae, **_ALONE)
"""CMA-MAE: CMA-ME with thresholds that rise slowly."""


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


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**32))
