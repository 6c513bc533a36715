"""Learners that ask for demonstrations, a few lines each: SGIM-IM decides when, SGIM-ACTS also whom, how and what for.

learner = sgim_acts(environment, seed, correspondence=..., teachers={"ann": ann, "ben": ben}, cost=3)
learner = sgim_im(environment, seed, correspondence=..., teachers={"ann": ann}, **SEARCHING)     # as in the papers
learner = sgim_im(environment, seed, correspondence=..., teachers={"ann": ann}, goals=EntropyGoals)
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import MakeInverse
from sgimd_torch.algorithms.practice import PRACTICE
from sgimd_torch.asking.entropy import EntropyGoals
from sgimd_torch.asking.interest import AUTONOMOUS, StrategicInterest
from sgimd_torch.asking.strategy import Asking, StrategicBabbling
from sgimd_torch.catalogue.options import hands_on
from sgimd_torch.competence import AttemptCompetence
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.explore.anywhere import Anywhere
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.learner.requests import Demonstrator
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Problem
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.strategies import Emulate, GoalBabbling, Mimic

STRATEGIC: Final[dict[str, Any]] = {**PRACTICE, "goals": StrategicInterest, "judge": AttemptCompetence}
SEARCHING: Final[dict[str, Any]] = {
    "search": NelderMead,
    "explore": Anywhere,
    "budget": 15,
    "global_range": (0.05, 0.95),
    "repeats": 10,
    "epsilon": 0.05,
}
"""Options that make it search at each goal, imitate with variations, and emulate, as in the papers."""


@hands_on(GoalBabbling, **STRATEGIC)
def _asking(
    environment: Environment,
    seed: int,
    imitates_only: bool,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    cost: float = 1.0,
    repeats: int = 1,
    epsilon: float = 0.0,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """A learner that asks. Alone it practises, and executes a demonstration once; `SEARCHING` makes it search.

    Args:
        cost: price of a demonstration, in attempts of its own.
        repeats: movements for one demonstration.
        epsilon: bound of the variation in each parameter, |theta_rand| < epsilon.
        inverse: inverse model, where searches begin and by which the learner answers.
        memory: exemplars to start from; None for none.
    """
    problem = Problem(environment, seed, memory, inverse=inverse)
    problem.autonomous = babbling = GoalBabbling(problem, **parts)
    emulates = babbling.budget > 1 and not imitates_only  # one movement at a goal is what it does alone
    asking = dict[str, Asking]()
    for teacher, demonstrator in teachers.items():
        name = f"imitate {teacher}"
        mimic = Mimic(problem, repeats=repeats, epsilon=epsilon, draws_from=name)
        asking[name] = Asking(teacher, mimic, cost, demonstrator.takes)
        if emulates:
            emulate = Emulate(problem, strategy=AUTONOMOUS)
            asking[f"emulate {teacher}"] = Asking(teacher, emulate, cost, demonstrator.takes)
    return Learner(problem, StrategicBabbling(problem, babbling, asking), correspondence=correspondence)


@hands_on(_asking)
def sgim_acts(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    **options: Any,
) -> Learner:
    """SGIM-ACTS: practice; chooses when, whom and what to ask, and how to use the demonstration.

    Args:
        environment: robot, which is not executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        teachers: teachers by name, those that ``run`` is given.
        options: ``cost``, ``repeats``, ``epsilon``, ``inverse``, ``memory``, and those of `GoalBabbling`, whose goal
            model has to choose strategies, too.
    """
    return _asking(environment, seed, False, correspondence=correspondence, teachers=teachers, **options)


@hands_on(_asking)
def sgim_im(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    **options: Any,
) -> Learner:
    """SGIM-IM: practice; chooses when to ask its one teacher.

    Args:
        environment: robot, which is not executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        teachers: its one teacher, by name.
        options: options of `sgim_acts`.

    Raises:
        ValueError: not exactly one teacher.
    """
    if len(teachers) != 1:
        raise ValueError(f"sgim_im asks one teacher, got {len(teachers)}; is sgim_acts meant?")
    return _asking(environment, seed, True, correspondence=correspondence, teachers=teachers, **options)


sgim_acts_search = partial(sgim_acts, **SEARCHING)
"""SGIM-ACTS with a search at each goal, as in its paper."""
sgim_im_search = partial(sgim_im, **SEARCHING)
"""SGIM-IM with a search at each goal, as in its paper."""
sgim_eer = partial(sgim_im, goals=EntropyGoals)
"""SGIM-IM that asks when a demonstration reduces entropy more."""
