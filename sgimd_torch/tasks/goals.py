"""Goals of evaluation for a robot that brings none: within reach if that is known, or else all over T."""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment, FromFiles, beside_execute
from sgimd_torch.evaluation import Benchmark, grid_over, rows_in_tiles, tile_side

MAX_GOALS: Final = 500  # largest number of goals all over T
FEWEST: Final = 500  # least number of known outcomes in T that show what is within reach


def goals_for(environment: Environment) -> tuple[Benchmark, str]:
    """Goals within reach, or else all over T, and where they are, for the user."""
    goals = goals_within_reach(environment)
    if goals is not None:
        return goals, f"{len(goals.goals)} points, one in each tile of T that random postures reach"
    goals = goals_all_over(environment)
    where = f"{len(goals.goals)} points all over T, reachable or not"
    return goals, f"{where}; for reachable goals, make a file with sgimd benchmark and use it as --benchmark"


def goals_within_reach(environment: Environment) -> Benchmark | None:
    """One outcome in each tile of T with two outcomes that are known to be within reach; None if too few are known.

    So goals lie within reach even if that is a line or a surface, where a random point of a tile would not.
    """
    if not isinstance(environment, FromFiles) or not beside_execute(environment, "within_reach"):
        return None
    box, outcomes = environment.outcomes, environment.within_reach()
    outcomes = outcomes[box.contains(outcomes)]
    if len(outcomes) < FEWEST:
        return None
    side = tile_side(outcomes, box)
    return Benchmark(type(environment).__name__, outcomes[rows_in_tiles(outcomes, box, side)], side)


def goals_all_over(environment: Environment) -> Benchmark:
    """At most ``MAX_GOALS`` goals all over T: a grid in one or two dimensions, Sobol points in more."""
    box = environment.outcomes
    per_side = int(MAX_GOALS ** (1 / box.dim))
    if box.dim <= 2:
        goals = grid_over(box, [per_side] * box.dim)
    else:
        from scipy.stats import qmc  # slower to import than this whole library

        goals = box.low + qmc.Sobol(box.dim, scramble=False).random_base2(int(np.log2(MAX_GOALS)))[1:] * box.sides
    return Benchmark(type(environment).__name__, goals, float(box.sides.max()) / per_side)
