"""Practice, our own algorithm: one movement for each goal within reach, the answer of a local process plus noise.

No option depends on the units or on the robot. A movement that misses its goal corrects the inverse model there. If
most movements have no effect, practice first looks for movements with an effect, and then learns from these alone.
    learner = practice(environment, seed)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import MakeInverse, MakeWatcher, learner_of, usual_watcher
from sgimd_torch.calls import with_keywords_of
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.within_reach import WithinReach
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import MakeMemory, Memory
from sgimd_torch.parts import Problem, Social
from sgimd_torch.searches.explore import Returning
from sgimd_torch.searches.vary import Vary
from sgimd_torch.strategies import GoalBabbling, Imitate

PRACTICE: Final[dict[str, Any]] = {
    "goals": WithinReach,
    "search": Vary,
    "explore": Returning,
    "budget": 1,
}
"""Parts and options of `GoalBabbling` that make it practice."""
ONCE: Final = partial(Imitate, repeats=1)


@with_keywords_of(GoalBabbling, **PRACTICE)
def practice(
    environment: Environment,
    seed: int,
    *,
    inverse: MakeInverse = AmongEffects,
    memory: Memory | MakeMemory = Memory,
    prior: Memory | None = None,
    watch: MakeWatcher = usual_watcher,
    **parts: Any,
) -> Learner:
    """Practice: one movement for each goal within reach, by a local Gaussian process; no teacher."""

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        return Learner(problem, GoalBabbling(problem, **parts))

    return learner_of(begin, seed, memory, prior, watch)


@with_keywords_of(GoalBabbling, **PRACTICE)
def practice_taught(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: Callable[[Problem], Social] = ONCE,
    inverse: MakeInverse = AmongEffects,
    memory: Memory | MakeMemory = Memory,
    prior: Memory | None = None,
    watch: MakeWatcher = usual_watcher,
    **parts: Any,
) -> Learner:
    """Practice, one movement for each goal within reach; executes each demonstration once, exactly.

    It learns most when all demonstrations come at the start. Options as for `practice`.
    """

    def begin(seed: int, memory: Memory | MakeMemory) -> Learner:
        problem = Problem(environment, seed, memory, inverse=inverse)
        problem.autonomous = GoalBabbling(problem, **parts)  # its goal model is told of demonstrated goals
        return Learner(problem, problem.autonomous, social=Social.of(social, problem), correspondence=correspondence)

    return learner_of(begin, seed, memory, prior, watch)
