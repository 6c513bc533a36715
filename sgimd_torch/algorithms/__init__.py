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
from typing import Any, TypedDict, Unpack

import numpy as np

from sgimd_torch.competence import AttemptCompetence, Competence, Performance, performance
from sgimd_torch.environments.protocol import Environment, check_rest
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.protocol import Goals
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.searches.perturb import practise
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.searches.widening import Widening, Width
from sgimd_torch.spaces import Array, Box, Estimate, Search, stream
from sgimd_torch.strategies import Babble, Emulate, GoalBabbling, Imitate, Judge, Look, Remember, Rest, SocialStrategy

Correspondence = Callable[[Array, Array], Array]
MakeGoals = Callable[[Box, Box, np.random.Generator], Goals]
MakeInverse = Callable[[Memory], Callable[[Array, Array], Estimate]]
MakeSearch = Callable[[Box, np.random.Generator], Search]
MakeJudge = Callable[[Memory, Performance], Judge]
MakeLook = Callable[[Box, Memory, Any, np.random.Generator], Look]
MakeSocial = Callable[[GoalBabbling, Box, np.random.Generator], SocialStrategy]


class Parts(TypedDict, total=False):
    """The keywords of ``goal_babbling``, which explains them."""

    goals: MakeGoals
    inverse: MakeInverse | None
    search: MakeSearch
    judge: MakeJudge
    measure: Performance | None
    budget: int
    tolerance: float | None
    look: MakeLook | None
    global_range: tuple[float, float]
    give_up: float


def random_exploration(
    environment: Environment, seed: int, *, inverse: MakeInverse | None = None, memory: Memory | None = None
) -> Learner:
    """Random: uniform movements."""
    memory = start_memory(environment, memory)
    return Learner(
        memory, Babble(environment.policies, stream(seed, "babble")), inverse=answering(environment, memory, inverse)
    )


def sagg_riac(environment: Environment, seed: int, *, memory: Memory | None = None, **parts: Unpack[Parts]) -> Learner:
    """SAGG-RIAC: active goal babbling, without a teacher."""
    memory = start_memory(environment, memory)
    babbling = goal_babbling(environment, seed, memory, **parts)
    return Learner(memory, babbling, inverse=babbling.inverse)


def practice(environment: Environment, seed: int, *, memory: Memory | None = None, **parts: Unpack[Parts]) -> Learner:
    """Practice, which is ours: goals anywhere in T, and at each one movement, the answer of a local process plus noise.

    It has no teacher, and nothing in it knows a unit or a robot. What the answer gets wrong is what it learns next.
    T should not be much larger than what can be reached: its goals are drawn from all of it.
    """
    return sagg_riac(environment, seed, memory=memory, **practising(parts))


def practice_taught(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    memory: Memory | None = None,
    **parts: Unpack[Parts],
) -> Learner:
    """The same with a teacher: what is shown is executed once, exactly. Best when all is shown at the start."""
    return sgim_d(
        environment,
        seed,
        correspondence=correspondence,
        social=partial(imitating, repeats=1),
        memory=memory,
        **practising(parts),
    )


def practising(changed: Parts) -> Parts:
    """The parts of `practice`, some of them ``changed``."""
    width = Width()
    parts: Parts = {
        "goals": UniformGoals,
        "search": partial(practise, width=width),
        "budget": 1,
        "look": partial(Widening, width=width),
        "global_range": (0.02, 0.3),
    }
    parts.update(changed)
    return parts


def observation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    inverse: MakeInverse | None = None,
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


def imitation(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    epsilon: float = 0.05,
    inverse: MakeInverse | None = None,
    memory: Memory | None = None,
) -> Learner:
    """Imitation: repeats the last demonstration with small variations until the next one."""
    memory = start_memory(environment, memory)
    return Learner(
        memory,
        Rest(),
        social=Imitate(environment.policies, stream(seed, "imitate"), repeats=None, epsilon=epsilon),
        correspondence=correspondence,
        inverse=answering(environment, memory, inverse),
        policies=environment.policies,
    )


def imitating(
    babbling: GoalBabbling,
    outcomes: Box,
    rng: np.random.Generator,
    *,
    repeats: int = 10,
    epsilon: float = 0.05,
    strategy: str = "social",
) -> Imitate:
    """How SGIM-D answers a demonstration: a short imitation, then emulation of the goal."""
    return Imitate(
        babbling.policies,
        rng,
        repeats=repeats,
        epsilon=epsilon,
        babbling=babbling,
        outcomes=outcomes,
        strategy=strategy,
    )


def emulating(babbling: GoalBabbling, outcomes: Box, rng: np.random.Generator, *, strategy: str = "social") -> Emulate:
    """A swap for ``imitating``: the teacher's goals without the teacher's movements."""
    return Emulate(babbling, outcomes, strategy=strategy)


def sgim_d(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: MakeSocial = imitating,
    memory: Memory | None = None,
    **parts: Unpack[Parts],
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
    answer = social(babbling, environment.outcomes, stream(seed, "imitate"))
    return Learner(
        memory,
        babbling,
        social=answer,
        correspondence=correspondence,
        inverse=babbling.inverse,
        policies=environment.policies,
    )


def remembered(memory: Memory, measure: Performance) -> Judge:
    """The paper's reading of competence, eq. (2): the best that memory holds."""
    return Competence(memory, measure)


def attempted(memory: Memory, measure: Performance) -> Judge:
    """SAGG-RIAC's own reading: the best of this attempt."""
    return AttemptCompetence(measure)


def goal_babbling(
    environment: Environment,
    seed: int,
    memory: Memory,
    *,
    goals: MakeGoals = InterestMap,
    inverse: MakeInverse | None = None,
    search: MakeSearch = nelder_mead,
    judge: MakeJudge = remembered,
    measure: Performance | None = None,
    budget: int = 15,
    tolerance: float | None = None,
    look: MakeLook | None = None,
    global_range: tuple[float, float] = (0.05, 0.95),
    give_up: float = -0.5,
) -> GoalBabbling:
    """The paper's autonomous strategy, built from its parts.

    Args:
        environment: its boxes, rest and outcome noise are read; it is not executed.
        seed: of all streams of this learner.
        memory: of the learner.
        goals: (contexts, outcomes, rng) -> the goal model.
        inverse: (memory) -> the inverse model, where searches begin and by which the learner answers; None for a
            `LocalProcess`, whose answers have to prove themselves. Deviation: the paper infers by eq. (9) alone, which
            is `LocalInverse`.
        search: (policies, rng) -> the refinement of its estimate.
        judge: (memory, measure) -> the competence that the goal model is told.
        measure: J; None for eq. (7), relative to the distance from rest.
        budget: the most movements for one goal. Deviation: the paper has no such number; with a complete simplex of 26
            movements a goal would take 60 or so, and a learner with the rod would come to a hundred goals in its life.
        tolerance: distance (m) at which a goal counts as reached; None for the outcome noise, but at least .02 m.
        look: (policies, memory, inverse, rng) -> how the global regime draws movements; None: uniformly from Pi.
        global_range: least and greatest probability of the global exploration regime.
        give_up: below this competence a goal is given up when a movement does not raise it; -1 never gives up.

    Raises:
        ValueError: a number out of its range.
    """
    noise = max(environment.outcome_noise, 0.02)
    if measure is None:
        measure = partial(performance, rest=environment.rest, d_min=noise)
    made = answering(environment, memory, inverse)
    return GoalBabbling(
        environment.policies,
        memory,
        goals(environment.contexts, environment.outcomes, stream(seed, "goals")),
        made,
        search(environment.policies, stream(seed, "search")),
        Competence(memory, measure),
        judge(memory, measure),
        stream(seed, "regime"),
        budget=budget,
        tolerance=noise if tolerance is None else tolerance,
        look=None if look is None else look(environment.policies, memory, made, stream(seed, "look")),
        global_range=global_range,
        give_up=give_up,
    )


def answering(
    environment: Environment, memory: Memory, inverse: MakeInverse | None
) -> Callable[[Array, Array], Estimate]:
    """The inverse model of a learner; without a choice one whose answers have to prove themselves."""
    return LocalProcess(memory, noise=environment.outcome_noise) if inverse is None else inverse(memory)


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
