"""Learners that ask, a few lines each: SGIM-IM when, SGIM-ACTS whom, how and what for.

learner = sgim_acts(environment, seed, correspondence=..., teachers={"ann": ann, "ben": ben}, cost=3)
learner = sgim_im(environment, seed, correspondence=..., teachers={"ann": ann}, base=exploring)     # as in the papers
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sgimd_torch.algorithms import (
    PRACTICE,
    Correspondence,
    MakeInverse,
    MakeSocial,
    attempted,
    emulating,
    goal_babbling,
    start_memory,
)
from sgimd_torch.catalogue.options import hands_on
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.strategic import AUTONOMOUS, StrategicInterest
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.learner.asking import Asking, StrategicBabbling
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Box, stream
from sgimd_torch.strategies import GoalBabbling, Imitate
from sgimd_torch.teachers.answering import Demonstrator


class Base(NamedTuple):
    """What a learner that asks does on its own, as keywords of ``goal_babbling``; and by name, how it can answer a
    demonstration, imitation first."""

    parts: Mapping[str, Any]
    ways: Mapping[str, MakeSocial]


MakeBase = Callable[[Environment], Base]


@hands_on(Imitate, "repeats", "epsilon")
def repeating(babbling: GoalBabbling, outcomes: Box, rng: np.random.Generator, **variations: Any) -> Imitate:
    """Imitation alone: what comes of it is told to the goal model by whoever has asked."""
    return Imitate(babbling.policies, rng, **variations)


def practised(environment: Environment) -> Base:
    """As ``practice``: one movement at each goal, and what is shown is executed once, exactly. To emulate would be
    one movement at a goal, as always, so there is no other way to answer."""
    return Base(PRACTICE, {"imitate": partial(repeating, repeats=1, epsilon=0.0)})


@hands_on(repeating)
@hands_on(goal_babbling, "search", "explore", "budget", "global_range", "give_up", "tolerance")
def searched(environment: Environment, **parts: Any) -> Base:
    """As in the papers: a search at each goal, and short imitations with variations, or emulation."""
    variations = {name: parts.pop(name) for name in ("repeats", "epsilon") if name in parts}
    imitate = partial(repeating, **variations)
    return Base(parts, {"imitate": imitate, "emulate": partial(emulating, strategy=AUTONOMOUS)})


def imitating_only(base: MakeBase, environment: Environment) -> Base:
    """A base whose only answer to a demonstration is to imitate it."""
    parts, ways = base(environment)
    return Base(parts, {"imitate": ways["imitate"]})


def sgim_im(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    cost: float = 1.0,
    base: MakeBase = practised,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """SGIM-IM: it decides when to ask its one teacher, and imitates what it is shown.

    Args:
        environment, seed, correspondence, teachers, cost, base, inverse, memory, parts: as in `sgim_acts`.

    Raises:
        ValueError: not exactly one teacher.
    """
    if len(teachers) != 1:
        raise ValueError(f"sgim_im asks one teacher, got {len(teachers)}; is sgim_acts meant?")
    memory, base = start_memory(environment, memory), partial(imitating_only, base)
    return strategic(environment, seed, memory, correspondence, teachers, cost, base, inverse=inverse, **parts)


def sgim_acts(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    cost: float = 1.0,
    base: MakeBase = practised,
    inverse: MakeInverse = LocalProcess,
    memory: Memory | None = None,
    **parts: Any,
) -> Learner:
    """SGIM-ACTS: it decides when to ask, whom, what for, and how to answer what it is shown.

    Args:
        environment, seed, inverse, parts: as ``goal_babbling``; ``goals`` have to choose strategies, too.
        correspondence: (times, trajectory) -> theta_d, eq. (6).
        teachers: by name, the same that ``run`` is given.
        cost: of a demonstration, in attempts of its own.
        base: (environment) -> what it does on its own, and how it can answer: `practised`, or, as in the paper,
            `searched`.
        memory: to start from; None for an empty one.
    """
    memory = start_memory(environment, memory)
    return strategic(environment, seed, memory, correspondence, teachers, cost, base, inverse=inverse, **parts)


def strategic(
    environment: Environment,
    seed: int,
    memory: Memory,
    correspondence: Correspondence,
    teachers: Mapping[str, Demonstrator],
    cost: float,
    base: MakeBase,
    **parts: Any,
) -> Learner:
    """The same with this very ``memory``."""
    own, ways = base(environment)
    chosen = {**own, "goals": StrategicInterest, "judge": attempted, **parts}
    babbling = goal_babbling(environment, seed, memory, **chosen)
    asking = dict[str, Asking]()
    for teacher, demonstrator in teachers.items():
        for way, make in ways.items():
            name = f"{way} {teacher}"
            answer = make(babbling, environment.outcomes, stream(seed, name))
            asking[name] = Asking(teacher, answer, cost, getattr(demonstrator, "takes", 0))
    strategy = StrategicBabbling(babbling, environment.outcomes, asking)
    return Learner(
        memory, strategy, correspondence=correspondence, inverse=babbling.inverse, policies=environment.policies
    )
