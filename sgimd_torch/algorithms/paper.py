"""The five learners of the paper, a few lines each: which strategy is in which slot?

Section 5.1 of Nguyen & Oudeyer (2014). Every part is a keyword, so an ablation changes one word:
    learner = sgim_d(environment, seed, correspondence=environment.primitive.correspondence, goals=UniformGoals)
A part is given as its constructor; `sgimd_torch.parts` says what each kind is given and must do.

Every algorithm takes a ``memory`` to start from, which it copies: of another run, of another version of the robot, or
of demonstrations, such as the memory of an ``observation`` learner that has watched them all.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sgimd_torch.algorithms import MakeInverse
from sgimd_torch.catalogue.options import hands_on
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Problem, Social
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.strategies import Babble, GoalBabbling, Imitate, Mimic, Remember, Rest

# Deviation: the paper infers by eq. (9) alone, which is `LocalInverse`. `LocalProcess` answers better.


def random_exploration(
    environment: Environment, seed: int, *, inverse: MakeInverse = LocalProcess, memory: Memory | None = None
) -> Learner:
    """Uniform movements: random exploration."""
    problem = Problem(environment, seed, memory, inverse=inverse)
    return Learner(problem, Babble(problem))


def observation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
) -> Learner:
    """Watches and remembers, never moves: learning by observation."""
    problem = Problem(environment, seed, memory, inverse=inverse)
    return Learner(problem, Rest(problem), social=Remember(problem), correspondence=correspondence)


def imitation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    epsilon: float = 0.05,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
) -> Learner:
    """Repeats the last demonstration with small variations until the next one.

    Args:
        environment: robot, which is not executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        epsilon: bound of the variation in each parameter, |theta_rand| < epsilon.
        inverse: inverse model.
        memory: exemplars to start from; None for none.
    """
    problem = Problem(environment, seed, memory, inverse=inverse)
    mimic = Mimic(problem, repeats=None, epsilon=epsilon)
    return Learner(problem, Rest(problem), social=mimic, correspondence=correspondence)


@hands_on(GoalBabbling, goals=InterestMap, search=NelderMead)
def sagg_riac(
    environment: Environment,
    seed: int,
    *,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """Goal babbling without a teacher: SAGG-RIAC.

    Args:
        environment: robot, which is not executed here.
        seed: number from which all random streams of the learner come.
        inverse: inverse model, where searches begin and by which the learner answers.
        memory: exemplars to start from; None for none.
        parts: parts and options of `GoalBabbling`.
    """
    problem = Problem(environment, seed, memory, inverse=inverse)
    return Learner(problem, GoalBabbling(problem, **parts))


@hands_on(GoalBabbling, goals=InterestMap, search=NelderMead)
def sgim_d(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: Callable[[Problem], Social] = Imitate,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """Goal babbling, interrupted by a short imitation whenever the teacher demonstrates: SGIM-D.

    Args:
        environment: robot, which is not executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        social: how it answers a demonstration.
        inverse: inverse model, where searches begin and by which the learner answers.
        memory: exemplars to start from; None for none.
        parts: parts and options of `GoalBabbling`.
    """
    problem = Problem(environment, seed, memory, inverse=inverse)
    problem.autonomous = GoalBabbling(problem, **parts)
    return Learner(problem, problem.autonomous, social=Social.of(social, problem), correspondence=correspondence)
