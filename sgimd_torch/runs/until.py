"""``sgimd run --until``: a run ends early, once its learner expects small errors.

The learner looks ahead now and then; looking executes nothing, and has random streams of its own.
    expected = expected_error(learner.inverse, benchmark.goals, stream(seed, "until", movements))
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.evaluation import expected_errors, tile_goals, tile_side
from sgimd_torch.parts import Inverse
from sgimd_torch.record import Record
from sgimd_torch.runs.build import RunParts
from sgimd_torch.spaces import Array, stream

EVERY: Final = 50  # number of movements from look to look, until it is a tenth of all movements


def ends_now(parts: RunParts, record: Record, movements: int) -> bool:
    """Whether the learner expects no larger error than --until says; it looks now and then. The record keeps it."""
    config, learner = parts.config, parts.learner
    if record.about["met"] is not None:
        return True
    moments = range(0, movements + 1, EVERY * max(1, movements // (10 * EVERY)))[1:]
    if not (config.due(movements, moments) and len(learner.memory)):
        return False
    known = parts.task.benchmark is not None or config.benchmark is not None
    goals = parts.benchmark.goals if known else None
    expected = expected_error(learner.inverse, goals, stream(config.seed, "until", movements))
    assert config.until is not None
    if expected <= config.until:  # not if it is NaN
        record.settle(met=[movements, expected])
        return True
    return False


def expected_error(inverse: Inverse, goals: Array | None, rng: np.random.Generator) -> float:
    """Mean error that an inverse model expects at ``goals``, each in a remembered context.

    Args:
        inverse: inverse model, whose ``answer_many`` is called; its memory must not be empty.
        goals: ``(n, outcome_dim)``, in the unit of T; None: one in each tile of T with two remembered outcomes or more.
        rng: random stream of contexts and goals.

    Returns:
        Mean error, in the unit of T; NaN: there are no goals, or the inverse model does not say how sure it is.
    """
    memory, box = inverse.problem.memory, inverse.problem.outcomes
    if goals is None:
        goals = tile_goals(memory.outcomes, box, tile_side(memory.outcomes, box), rng)
    contexts = memory.contexts[rng.integers(len(memory), size=len(goals))]
    return float(expected_errors(inverse.answer_many(contexts, goals), goals).mean()) if len(goals) else float("nan")
