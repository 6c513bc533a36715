"""Quality diversity: learners of another school, which fill an archive of outcomes with movements that reach them.

MAP-Elites (Mouret & Clune 2015) and CMA-ME (Fontaine et al. 2020), by the package ``ribs``. They, too, end with a
movement for every outcome that they found, but without goals: they vary movements that led somewhere new.
    learner = map_elites(environment, seed)        learner = cma_me(environment, seed)
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from sgimd_torch.algorithms import start_memory
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Attempt, Box, Move, check_count, stream

try:
    from ribs.archives import GridArchive
    from ribs.emitters import EmitterBase, EvolutionStrategyEmitter, GaussianEmitter
except ImportError as error:
    raise ImportError(f"quality diversity needs ribs: pip install 'sgimd-torch[rivals]' ({error})") from error

_DEFAULT_CELLS = 400  # 20 x 20, of .1 m in the fishing task, like the tiles of its benchmark
_MAX_CELLS = 1_000_000  # ribs keeps an array of all of them


def map_elites(
    environment: Environment,
    seed: int,
    *,
    first: int = 100,
    sd: float = 0.05,
    batch: int = 10,
    cells: int | None = None,
    memory: Memory | None = None,
) -> Learner:
    """MAP-Elites: Gaussian variations of elites, which are drawn evenly from the cells of T that were reached.

    Args:
        environment: its boxes are read; it is not executed.
        seed: of this learner's stream.
        first: number of uniform movements at the start.
        sd: standard deviation of the variations, in sides of Pi, as in `perturb`; what leaves Pi is clipped.
        batch: movements between two looks at the archive.
        cells: for each dimension of T; None for about 400 in all.
        memory: to start from; its exemplars enter the archive, and take the place of the ``first`` movements.

    Raises:
        ValueError: a number out of its range, or an environment with contexts, which an archive over T does not know.
    """
    if not 0 < sd < np.inf:
        raise ValueError(f"sd must be positive and finite, got {sd}; without noise nothing new is tried")
    first, batch = check_count("first", first, 1), check_count("batch", batch, 1)
    rng = stream(seed, "map-elites")
    memory = start_memory(environment, memory)
    archive = _archive(environment, rng, cells, memory)
    emitter = GaussianEmitter(
        archive,
        sigma=sd,
        initial_solutions=rng.uniform(size=(first, environment.policies.dim)),
        batch_size=batch,
        seed=_seed(rng),
    )
    return Learner(memory, QualityDiversity(environment.policies, archive, [emitter], "map-elites"))


def cma_me(
    environment: Environment,
    seed: int,
    *,
    emitters: int = 5,
    sd: float = 0.1,
    batch: int | None = None,
    cells: int | None = None,
    memory: Memory | None = None,
) -> Learner:
    """CMA-ME: CMA-ES that climbs towards new cells of the archive, and restarts from an elite when it finds none.

    Args:
        environment, seed, cells, memory: as in `map_elites`.
        emitters: number of emitters of the improvement type, which take turns; all start at the centre of Pi.
            Deviation: Fontaine et al. have 15, of which each would get some 25 generations in a run on the rod.
        sd: standard deviation of the first generation and after a restart, in sides of Pi; what leaves Pi is clipped.
            Deviation: pyribs' examples start wider, but from the middle of a box of many dimensions that leads into its
            corners.
        batch: movements of a generation, at least 2; None for 4 + 3 ln(theta_dim).

    Raises:
        ValueError: as in `map_elites`.
    """
    if not 0 < sd < np.inf:
        raise ValueError(f"sd must be positive and finite, got {sd}; without noise nothing new is tried")
    if batch is not None:
        check_count("batch", batch, 2)
    rng = stream(seed, "cma-me")
    memory = start_memory(environment, memory)
    archive = _archive(environment, rng, cells, memory)
    centre = np.full(environment.policies.dim, 0.5)
    team = [
        EvolutionStrategyEmitter(archive, x0=centre, sigma0=sd, ranker="2imp", batch_size=batch, seed=_seed(rng))
        for _ in range(check_count("emitters", emitters, 1))
    ]
    return Learner(memory, QualityDiversity(environment.policies, archive, team, "cma-me"))


class QualityDiversity:
    """The movements of emitters, batch after batch; the archive is told of a batch when all of it was executed.

    The objective, which decides between elites of one cell, is little effort: minus the mean square of a movement's
    distance from the middle of Pi, in sides. Outcomes outside T count for the nearest cell of its border. In a T far
    larger than what can be reached nearly all outcomes share a few cells, and few elites are left to vary.

    Each attempt is one movement; if it is interrupted before its outcome is told, it is proposed again.

    Args:
        policies: Pi.
        archive: over T, of movements in sides of Pi.
        emitters: propose one batch each, in turns. Deviation: what lies outside Pi is clipped here. CMA-ES itself would
            draw again, and never end once its mean lies in a corner of many dimensions.
        origin: of the movements, for the log.
    """

    def __init__(self, policies: Box, archive: GridArchive, emitters: Sequence[EmitterBase], origin: str) -> None:
        self.policies = policies
        self.archive = archive
        self._emitters = itertools.cycle(emitters)
        self._origin = origin
        self._ask()

    def attempt(self, context: Array) -> Attempt:
        """The next movement of the batch."""
        theta = self.policies.low + self.policies.sides * self._batch[len(self._outcomes)]
        outcome = yield Move(self.policies.clip(theta), None, self._origin)
        self._outcomes.append(outcome)
        if len(self._outcomes) == len(self._batch):
            self._tell()
            self._ask()

    def _ask(self) -> None:
        self._emitter = next(self._emitters)
        self._batch: Array = np.clip(self._emitter.ask(), 0, 1)  # (n, theta_dim)
        self._outcomes: list[Array] = []

    def _tell(self) -> None:
        objectives, outcomes = _objectives(self._batch), np.stack(self._outcomes)
        added = self.archive.add(self._batch, objectives, outcomes)
        self._emitter.tell(self._batch, objectives, outcomes, added)


def _objectives(thetas: Array) -> Array:
    """``(n,)`` of thetas in sides of Pi."""
    return -np.square(thetas - 0.5).mean(axis=1)


def _archive(environment: Environment, rng: np.random.Generator, cells: int | None, memory: Memory) -> GridArchive:
    if environment.contexts.dim:
        raise ValueError(f"quality diversity knows one context only, got contexts of dim {environment.contexts.dim}")
    outcomes = environment.outcomes
    cells = max(2, round(_DEFAULT_CELLS ** (1 / outcomes.dim))) if cells is None else check_count("cells", cells, 1)
    if cells**outcomes.dim > _MAX_CELLS:
        raise ValueError(f"cells must be {_MAX_CELLS} in all at most, got {cells} in {outcomes.dim} dimensions")
    ranges = list(zip(outcomes.low, outcomes.high, strict=True))
    archive = GridArchive(
        solution_dim=environment.policies.dim, dims=[cells] * outcomes.dim, ranges=ranges, seed=_seed(rng)
    )
    if len(memory):
        thetas = (memory.thetas - environment.policies.low) / environment.policies.sides
        archive.add(thetas, _objectives(thetas), memory.outcomes)
    return archive


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**32))
