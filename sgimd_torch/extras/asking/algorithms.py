"""Learners that ask for demonstrations: SGIM-IM chooses when to ask, SGIM-ACTS also chooses teacher, goal and strategy.

learner = sgim_acts(environment, seed, correspondence=..., teachers={"ann": ann, "ben": ben}, cost=3)
learner = sgim_im(environment, seed, correspondence=..., teachers={"ann": ann}, **SEARCHING)     # options of the papers
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import MakeInverse, learner_of
from sgimd_torch.algorithms.practice import PRACTICE
from sgimd_torch.calls import with_keywords_of
from sgimd_torch.competence import AttemptCompetence
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.extras.asking.interest import AUTONOMOUS, StrategicInterest
from sgimd_torch.extras.asking.strategy import Asking, StrategicBabbling
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import MakeMemory, Memory
from sgimd_torch.parts import Demonstrator, Problem
from sgimd_torch.searches.explore import Anywhere
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.strategies import Emulate, GoalBabbling, Mimic

# `practice`, but goals by interest; competence is that of the attempt, not of the memory.
STRATEGIC: Final[dict[str, Any]] = {**PRACTICE, "goals": StrategicInterest, "judge": AttemptCompetence}
SEARCHING: Final[dict[str, Any]] = {
    "search": NelderMead,
    "explore": Anywhere,
    "budget": 15,
    "global_range": (0.05, 0.95),
    "repeats": 10,
    "epsilon": 0.05,
}
"""Options of the papers: a search at each goal, imitation with variations, emulation."""


@with_keywords_of(GoalBabbling, **STRATEGIC)
def sgim_acts(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    cost: float = 1.0,
    repeats: int = 1,
    epsilon: float = 0.0,
    emulates: bool = True,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | MakeMemory = Memory,
    **parts: Any,
) -> Learner:
    """SGIM-ACTS: practice that chooses when, whom and what to ask, and how to use the answer.

    By default it practises and executes each demonstration once.

    Args:
        environment: robot and world; nothing is executed here.
        seed: number from which all random streams of the learner come.
        correspondence: function from times and trajectory to theta_d, eq. (6).
        teachers: mapping from names to teachers, as for ``run``.
        cost: cost of a demonstration; an autonomous attempt costs 1.
        repeats: number of movements for one demonstration.
        epsilon: largest variation of each parameter, in the unit of the parameter.
        emulates: whether emulation is a choice beside imitation. It matters only with a budget above 1, because
            emulation by one movement would be an autonomous attempt.
        inverse: inverse model; searches begin at its answer.
        memory: memory, or exemplars to start from.
        parts: options of `GoalBabbling`; the goal model must be a `StrategicGoals`.
    """

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        problem.autonomous = babbling = GoalBabbling(problem, **parts)
        asking = dict[str, Asking]()
        for teacher, demonstrator in teachers.items():
            name = f"imitate {teacher}"
            mimic = Mimic(problem, repeats=repeats, epsilon=epsilon, draws_from=name)
            asking[name] = Asking(teacher, mimic, cost, demonstrator.takes)
            if emulates and babbling.budget > 1:
                emulate = Emulate(problem, strategy=AUTONOMOUS)
                asking[f"emulate {teacher}"] = Asking(teacher, emulate, cost, demonstrator.takes)
        return Learner(problem, StrategicBabbling(babbling, asking), correspondence=correspondence)

    return learner_of(begin, seed, memory)


sgim_im = partial(sgim_acts, emulates=False)
"""SGIM-IM: practice that chooses when to ask its teacher, and for which goal; only imitates."""
sgim_acts_search = partial(sgim_acts, **SEARCHING)
"""SGIM-ACTS, as published: a search at each goal instead of practice."""
sgim_im_search = partial(sgim_im, **SEARCHING)
"""SGIM-IM, as published: a search at each goal instead of practice."""
