"""The five learners of the paper and practice, a few lines each: which strategy is in which slot?

Section 5.1 of Nguyen & Oudeyer (2014). Every part is a keyword, so an ablation changes one word:
    learner = sgim_d(environment, seed, correspondence=environment.primitive.correspondence, goals=UniformGoals)
Parts are passed as constructors, because they need boxes, the memory and random streams, which are made here.

Every builder takes a ``memory`` to start from, which it copies: of another run, of another version of the robot, or of
demonstrations, such as the memory of an ``observation`` learner that has watched them all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from sgimd_torch.catalogue import check_constructors
from sgimd_torch.catalogue.options import given, hands_on
from sgimd_torch.competence import AttemptCompetence, Competence, Performance, performance
from sgimd_torch.environments.protocol import Environment, check_rest
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.protocol import Goals
from sgimd_torch.goals.within_reach import WithinReach
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.searches.perturb import practise
from sgimd_torch.searches.returning import Returning
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.spaces import Array, Box, Estimate, Search, stream
from sgimd_torch.strategies import (
    Babble,
    Emulate,
    Explore,
    GoalBabbling,
    Imitate,
    Judge,
    Remember,
    Rest,
    SocialStrategy,
)

Correspondence = Callable[[Array, Array], Array]
MakeGoals = Callable[[Box, Box, np.random.Generator], Goals]
MakeInverse = Callable[[Memory], Callable[[Array, Array], Estimate]]
MakeSearch = Callable[[Box, np.random.Generator], Search]
MakeJudge = Callable[[Memory, Performance], Judge]
MakeExplore = Callable[[Box, Memory, Any, np.random.Generator], Explore | None]
MakeSocial = Callable[[GoalBabbling, Box, np.random.Generator], SocialStrategy]


def remembered(memory: Memory, measure: Performance) -> Judge:
    """The paper's reading of competence, eq. (2): the best that memory holds."""
    return Competence(memory, measure)


def attempted(memory: Memory, measure: Performance) -> Judge:
    """SAGG-RIAC's own reading: the best of this attempt."""
    return AttemptCompetence(measure)


def anywhere(policies: Box, memory: Memory, inverse: object, rng: np.random.Generator) -> None:
    """Global exploration of all of Pi, uniformly: what `GoalBabbling` does without an explorer."""


@hands_on(Imitate, "repeats", "epsilon")
def imitating(
    babbling: GoalBabbling, outcomes: Box, rng: np.random.Generator, *, strategy: str = "social", **variations: Any
) -> Imitate:
    """How SGIM-D answers a demonstration: a short imitation, then emulation of the goal."""
    return Imitate(babbling.policies, rng, babbling=babbling, outcomes=outcomes, strategy=strategy, **variations)


def emulating(babbling: GoalBabbling, outcomes: Box, rng: np.random.Generator, *, strategy: str = "social") -> Emulate:
    """A swap for ``imitating``: the teacher's goals without the teacher's movements."""
    return Emulate(babbling, outcomes, strategy=strategy)


@hands_on(GoalBabbling, "budget", "global_range", "give_up")
def goal_babbling(
    environment: Environment,
    seed: int,
    memory: Memory,
    *,
    goals: MakeGoals = InterestMap,
    inverse: MakeInverse = LocalProcess,
    search: MakeSearch = nelder_mead,
    explore: MakeExplore = anywhere,
    judge: MakeJudge = remembered,
    measure: Performance | None = None,
    tolerance: float | None = None,
    **pursuit: Any,
) -> GoalBabbling:
    """The paper's autonomous strategy, built from its parts.

    Args:
        environment: its boxes, rest and outcome noise are read; it is not executed.
        seed: of all streams of this learner.
        memory: of the learner.
        goals: (contexts, outcomes, rng) -> the goal model; it is given the ``memory`` as ``reached`` and
            ``effects`` of the inverse, if it has such keywords.
        inverse: (memory) -> the inverse model, where searches begin and by which the learner answers; it is given
            ``outcome_noise`` if it has such a keyword. Deviation: the paper infers by eq. (9) alone, which is
            `LocalInverse`; the answers of `LocalProcess` have to prove themselves.
        search: (policies, rng) -> the refinement of its estimate; it is given the ``inverse`` if it has such a keyword,
            and the ``width`` of the explorer if both have one.
        explore: (policies, memory, inverse, rng) -> how the global regime draws movements; None: uniformly from Pi.
        judge: (memory, measure) -> the competence that the goal model is told.
        measure: J; None for eq. (7), relative to the distance from rest.
        tolerance: distance (m) at which a goal counts as reached; None for the outcome noise, but at least .02 m.
        budget: the most movements for one goal. Deviation: the paper has no such number; with a complete simplex of 26
            movements a goal would take 60 or so, and a learner with the rod would come to a hundred goals in its life.
        global_range: least and greatest probability of the global exploration regime.
        give_up: below this competence a goal is given up when a movement does not raise it; -1 never gives up.

    Raises:
        ValueError: a number out of its range.
    """
    check_constructors(goals=goals, search=search, explore=explore, judge=judge)
    noise = max(environment.outcome_noise, 0.02)
    if measure is None:
        measure = partial(performance, rest=environment.rest, d_min=noise)
    made = answering(environment, memory, inverse)
    explorer = explore(environment.policies, memory, made, stream(seed, "look"))
    goals = given(goals, reached=memory, effects=getattr(made, "effects", lambda: None))
    width = getattr(explorer, "width", None)
    if width is not None:  # how far to look, which both of them go by
        search = given(search, width=width)
    return GoalBabbling(
        environment.policies,
        memory,
        goals(environment.contexts, environment.outcomes, stream(seed, "goals")),
        made,
        given(search, inverse=made)(environment.policies, stream(seed, "search")),
        Competence(memory, measure),
        judge(memory, measure),
        stream(seed, "regime"),
        tolerance=noise if tolerance is None else tolerance,
        explore=explorer,
        **pursuit,
    )


def random_exploration(
    environment: Environment, seed: int, *, inverse: MakeInverse = LocalProcess, memory: Memory | None = None
) -> Learner:
    """Random: uniform movements."""
    memory = start_memory(environment, memory)
    return Learner(
        memory, Babble(environment.policies, stream(seed, "babble")), inverse=answering(environment, memory, inverse)
    )


def observation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
) -> Learner:
    """Observation: watches and remembers, never moves."""
    memory = start_memory(environment, memory)
    return Learner(
        memory,
        Rest(),
        social=Remember(memory),
        correspondence=correspondence,
        inverse=answering(environment, memory, inverse),
        policies=environment.policies,
    )


@hands_on(Imitate, "epsilon")
def imitation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **variations: Any,
) -> Learner:
    """Imitation: repeats the last demonstration with small variations until the next one."""
    memory = start_memory(environment, memory)
    return Learner(
        memory,
        Rest(),
        social=Imitate(environment.policies, stream(seed, "imitate"), repeats=None, **variations),
        correspondence=correspondence,
        inverse=answering(environment, memory, inverse),
        policies=environment.policies,
    )


@hands_on(goal_babbling)
def sagg_riac(environment: Environment, seed: int, *, memory: Memory | None = None, **parts: Any) -> Learner:
    """SAGG-RIAC: active goal babbling, without a teacher."""
    memory = start_memory(environment, memory)
    babbling = goal_babbling(environment, seed, memory, **parts)
    return Learner(memory, babbling, inverse=babbling.inverse)


@hands_on(goal_babbling)
def sgim_d(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: MakeSocial = imitating,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """SGIM-D: SAGG-RIAC, interrupted by a short imitation whenever the teacher demonstrates.

    Args:
        environment, seed, parts: as ``goal_babbling``.
        correspondence: (times, trajectory) -> theta_d, eq. (6).
        social: (goal babbling, T, rng) -> the answer to a demonstration.
        memory: to start from; None for an empty one.
    """
    memory = start_memory(environment, memory)
    babbling = goal_babbling(environment, seed, memory, **parts)
    check_constructors(social=social)
    answer = social(babbling, environment.outcomes, stream(seed, "imitate"))
    return Learner(
        memory,
        babbling,
        social=answer,
        correspondence=correspondence,
        inverse=babbling.inverse,
        policies=environment.policies,
    )


PRACTICE: Final[dict[str, Any]] = {
    "goals": WithinReach,
    "inverse": AmongEffects,
    "search": practise,
    "explore": Returning,
    "budget": 1,
    "global_range": (0.02, 0.3),
}
"""What makes a learner practise, in keywords of ``goal_babbling``."""


@hands_on(sagg_riac, **PRACTICE)
def practice(environment: Environment, seed: int, **parts: Any) -> Learner:
    """Practice, which is ours: goals within reach, and at each one movement, the answer of a local process plus noise.

    It has no teacher, and nothing in it knows a unit or a robot. What the answer gets wrong is what it learns next.
    Where most movements do nothing, it first looks for some that have an effect, and learns from those alone.
    """
    return sagg_riac(environment, seed, **parts)


@hands_on(sgim_d, **PRACTICE, social=partial(imitating, repeats=1))
def practice_taught(environment: Environment, seed: int, *, correspondence: Correspondence, **parts: Any) -> Learner:
    """The same with a teacher: what is shown is executed once, exactly. Best when all is shown at the start."""
    return sgim_d(environment, seed, correspondence=correspondence, **parts)


def answering(environment: Environment, memory: Memory, inverse: MakeInverse) -> Callable[[Array, Array], Estimate]:
    """The inverse model of a learner, with what it names of its robot."""
    check_constructors(inverse=inverse)
    made: Callable[[Array, Array], Estimate]
    made = given(inverse, outcome_noise=environment.outcome_noise, policies=environment.policies)(memory)
    return made


def start_memory(environment: Environment, start: Memory | None) -> Memory:
    """The memory of a new learner: empty, or a copy of ``start``.

    Raises:
        ValueError: ``rest`` outside T, or exemplars that this robot cannot have: other dimensions, thetas outside Pi.
    """
    check_rest(environment)
    dims = environment.contexts.dim, environment.policies.dim, environment.outcomes.dim
    if start is None:
        return Memory(*dims)
    found = start.context_dim, start.theta_dim, start.outcome_dim
    if found != dims:
        raise ValueError(f"a memory to start from must have dims {dims} of context, theta, outcome, got {found}")
    environment.policies.check("thetas of a memory to start from", start.thetas, "of another robot?")
    return start.copy()
