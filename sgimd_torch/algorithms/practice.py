"""Practice, our own algorithm: one movement for each goal within reach, the answer of a local process plus noise.

No option depends on the units or on the robot. A movement that misses its goal corrects the inverse model there. Some
goals are pursued in a family of movements around the middle of Pi (`TwoFamilies`). If most movements have no effect,
practice first looks for movements with an effect, and then learns from these alone.
    learner = practice(environment, seed)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import MakeInverse
from sgimd_torch.algorithms.families import TwoFamilies
from sgimd_torch.changes import noticing_changes
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.within_reach import WithinReach
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.signature import with_keywords_of
from sgimd_torch.parts import Problem, Social
from sgimd_torch.searches.explore import Returning, Widening
from sgimd_torch.searches.perturb import Vary
from sgimd_torch.spaces import stream
from sgimd_torch.strategies import GoalBabbling, Imitate

PRACTICE: Final[dict[str, Any]] = {
    "goals": WithinReach,
    "search": Vary,
    "explore": Returning,
    "budget": 1,
    "global_range": (0.02, 0.3),
}
"""Parts and options of `GoalBabbling` that make it the wide family of practice."""
ONCE: Final = partial(Imitate, repeats=1)


@with_keywords_of(GoalBabbling, **PRACTICE)
def practice(
    environment: Environment,
    seed: int,
    *,
    inverse: MakeInverse = AmongEffects,
    memory: Memory | None = None,
    prior: Memory | None = None,
    **parts: Any,
) -> Learner:
    """Practice: one movement for each goal within reach, by a local Gaussian process; no teacher.

    Options hold for both families of movements, but ``explore`` for the wide one alone.
    """

    def begin(seed: int, memory: Memory | None) -> Learner:
        families = _families(environment, seed, memory, inverse, parts)
        return Learner(families.problem, families)

    return noticing_changes(begin, seed, memory, prior)


@with_keywords_of(GoalBabbling, **PRACTICE)
def practice_taught(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    social: Callable[[Problem], Social] = ONCE,
    inverse: MakeInverse = AmongEffects,
    memory: Memory | None = None,
    prior: Memory | None = None,
    **parts: Any,
) -> Learner:
    """Practice, one movement for each goal within reach; executes each demonstration once, exactly.

    It learns most when all demonstrations come at the start. Options as for `practice`.
    """

    def begin(seed: int, memory: Memory | None) -> Learner:
        families = _families(environment, seed, memory, inverse, parts)
        problem = families.problem
        problem.autonomous = families.wide  # its goal model is told of demonstrated goals
        return Learner(problem, families, social=Social.of(social, problem), correspondence=correspondence)

    return noticing_changes(begin, seed, memory, prior)


def _families(
    environment: Environment, seed: int, memory: Memory | None, inverse: MakeInverse, parts: dict[str, Any]
) -> TwoFamilies:
    """Goal babbling in two families; they share no random stream and no width of exploration.

    A forward model learns from all movements, so the narrow family does without.
    """
    problem = Problem(environment, seed, memory, inverse=inverse)
    wide = GoalBabbling(problem, **parts)
    if problem.trained:
        inverse, parts = AmongEffects, {**parts, "search": Vary}
    narrow_problem = Problem(environment, int(stream(seed, "narrow family").integers(2**63)), inverse=inverse)
    narrow = GoalBabbling(narrow_problem, **{**parts, "explore": Widening})
    problem.remarks += [remark for remark in narrow_problem.remarks if remark not in problem.remarks]
    return TwoFamilies(wide, narrow)
