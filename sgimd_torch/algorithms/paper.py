"""The five learners of the paper, each built from an autonomous and a social strategy; two of them to the letter, too.

Section 5.1 of Nguyen & Oudeyer (2014). Every part is a keyword, so an ablation changes one argument:
    learner = sgim_d(environment, seed, correspondence=environment.primitive.correspondence, goals=UniformGoals)
A part is given as its constructor; `sgimd_torch.parts` describes each kind of part.

Every algorithm can start from a copy of a ``memory``: of another run, of another version of the robot, or of an
``observation`` learner that has watched all demonstrations.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import MakeInverse, MakeWatcher, learner_of, nobody
from sgimd_torch.calls import with_keywords_of
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import absolute_progress
from sgimd_torch.inverses.local import LocalInverse
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import MakeMemory, Memory
from sgimd_torch.parts import Problem, Social
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.strategies import Babble, GoalBabbling, Imitate, Mimic, Remember, Rest

# Deviation: the paper infers by eq. (9) alone, which is `LocalInverse`; the default `LocalProcess` has smaller errors.

LETTER: Final[dict[str, Any]] = {
    "goals": partial(InterestMap, max_aspect=1e9, progress=absolute_progress),  # eq. (3)
    "search": partial(NelderMead, noise=0.0, complete=True, xatol=1e-4, fatol=1e-4),
    # A demonstration, every 30 movements, ends a goal of SGIM-D before this budget does. Deviation: the paper gives no
    # budget of SAGG-RIAC, but shows goals all over a T that is mostly out of reach (fig. 8f), so there is one.
    "budget": 60,
    "global_range": (0.0, 1.0),
    "give_up": -1.0,
}
"""Parts and options of `GoalBabbling` to the letter of the paper."""
VARIED: Final = partial(Imitate, exact_first=False)


def random_exploration(
    environment: Environment, seed: int, *, inverse: MakeInverse = LocalProcess, memory: Memory | MakeMemory = Memory
) -> Learner:
    """Uniform movements: random exploration."""

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        return Learner(problem, Babble(problem))

    return learner_of(begin, seed, memory)


def observation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
) -> Learner:
    """Learning by observation: remembers each demonstration and never moves."""

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        return Learner(problem, Rest(problem), social=Remember(problem), correspondence=correspondence)

    return learner_of(begin, seed, memory)


def imitation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    epsilon: float = 0.05,
    exact_first: bool = True,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
) -> Learner:
    """Repeats the last demonstration with small variations until the next one.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        epsilon: largest variation of each parameter, in the unit of the parameter.
        exact_first: true: the first movement is theta_d itself; false: all are varied, as in the paper.
        inverse: inverse model.
        memory: memory, or exemplars to start from.
    """

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        mimic = Mimic(problem, repeats=None, epsilon=epsilon, exact_first=exact_first)
        return Learner(problem, Rest(problem), social=mimic, correspondence=correspondence)

    return learner_of(begin, seed, memory)


@with_keywords_of(GoalBabbling, goals=InterestMap, search=NelderMead)
def sagg_riac(
    environment: Environment,
    seed: int,
    *,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
    prior: Memory | None = None,
    watch: MakeWatcher = nobody,
    **parts: Any,
) -> Learner:
    """SAGG-RIAC: goal babbling without a teacher, with our inverse model and exploration.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which all random streams of the learner come.
        inverse: inverse model; searches begin at its answer.
        memory: memory, or exemplars to start from.
        prior: exemplars of another robot, such as a simulator, which count as far as they hold; None: no exemplars.
        watch: watcher, which notices changes of the robot; `nobody` does in the paper.
        parts: parts and options of `GoalBabbling`.
    """

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        return Learner(problem, GoalBabbling(problem, **parts))

    return learner_of(begin, seed, memory, prior, watch)


@with_keywords_of(GoalBabbling, goals=InterestMap, search=NelderMead)
def sgim_d(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: Callable[[Problem], Social] = Imitate,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
    prior: Memory | None = None,
    watch: MakeWatcher = nobody,
    **parts: Any,
) -> Learner:
    """SGIM-D: the paper's algorithm with our inverse model and exploration; as printed: sgim-d-letter.

    Goal babbling, and after each demonstration a short imitation.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        social: social strategy, which uses the demonstrations.
        inverse: inverse model; searches begin at its answer.
        memory: memory, or exemplars to start from.
        prior: exemplars of another robot, such as a simulator, which count as far as they hold; None: no exemplars.
        watch: watcher, which notices changes of the robot; `nobody` does in the paper.
        parts: parts and options of `GoalBabbling`.
    """

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        problem.autonomous = GoalBabbling(problem, **parts)
        return Learner(problem, problem.autonomous, social=Social.of(social, problem), correspondence=correspondence)

    return learner_of(begin, seed, memory, prior, watch)


@with_keywords_of(sagg_riac, inverse=LocalInverse, **LETTER)
def sagg_riac_letter(environment: Environment, seed: int, **options: Any) -> Learner:
    """SAGG-RIAC to the letter: eqs. (3) and (9), 26 vertices, any probability of global exploration.

    Options as for `sagg_riac`.
    """
    return sagg_riac(environment, seed, **options)


@with_keywords_of(sgim_d, social=VARIED, inverse=LocalInverse, **LETTER)
def sgim_d_letter(environment: Environment, seed: int, *, correspondence: Correspondence, **options: Any) -> Learner:
    """SGIM-D to the letter: eqs. (3) and (9), 26 vertices, any probability of global exploration.

    Options as for `sgim_d`.
    """
    return sgim_d(environment, seed, correspondence=correspondence, **options)
