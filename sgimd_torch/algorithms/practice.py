"""Practice, our own algorithm: one movement for each goal within reach, the answer of a local process plus noise.

Practice needs no unit and no knowledge of the robot. It learns next where the answer is wrong. Where most movements do
nothing, it first looks for movements with an effect, and then learns from those alone.
    learner = practice(environment, seed)
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final

from sgimd_torch.algorithms import sagg_riac, sgim_d
from sgimd_torch.catalogue.options import hands_on
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.explore.returning import Returning
from sgimd_torch.goals.within_reach import WithinReach
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.learner import Correspondence, Learner
from sgimd_torch.searches.perturb import Vary
from sgimd_torch.strategies import Imitate

PRACTICE: Final[dict[str, Any]] = {
    "goals": WithinReach,
    "search": Vary,
    "explore": Returning,
    "budget": 1,
    "global_range": (0.02, 0.3),
}
"""Parts and options of `GoalBabbling` that make it practice."""


@hands_on(sagg_riac, **PRACTICE, inverse=AmongEffects)
def practice(environment: Environment, seed: int, **parts: Any) -> Learner:
    """Practice: one movement for each goal within reach, by a local Gaussian process; no teacher."""
    return sagg_riac(environment, seed, **parts)


@hands_on(sgim_d, **PRACTICE, inverse=AmongEffects, social=partial(Imitate, repeats=1))
def practice_taught(environment: Environment, seed: int, *, correspondence: Correspondence, **parts: Any) -> Learner:
    """Practice, one movement for each goal within reach; executes each demonstration once, exactly.

    It learns most when all demonstrations come at the start."""
    return sgim_d(environment, seed, correspondence=correspondence, **parts)
