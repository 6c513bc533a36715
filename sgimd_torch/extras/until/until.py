"""``sgimd run --until`` ends a run early, once its learner expects, and makes, small errors.

if ends_now(parts, record, movements, between): ...
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from sgimd_torch.evaluation import evaluate, expected_errors, tile_goals, tile_side
from sgimd_torch.options.build import RunParts
from sgimd_torch.parts import Inverse
from sgimd_torch.record import Record
from sgimd_torch.runs.signals import say
from sgimd_torch.spaces import Array, stream

TRIED: Final = 20  # number of goals at which an expected error is tried before --until ends a run
LOOK_EVERY: Final = 50  # number of movements between two looks at the expected error, until it is a tenth of all


def ends_now(parts: RunParts, record: Record, movements: int, between: Callable[[], object]) -> bool:
    """Whether the learner expects, and makes, no larger error than --until says; it looks now and then.

    An inverse model does not know what it cannot see, such as the memory of a robot. So the answers to a few random
    goals are executed before the run ends; nothing is learnt from them. The record keeps the error that they made, plus
    its standard error, or the expected one if that is larger.
    """
    config, learner = parts.config, parts.learner
    if record.about["ended_early"] is not None:
        return True
    moments = range(0, movements + 1, LOOK_EVERY * max(1, movements // (10 * LOOK_EVERY)))[1:]
    if not (config.due(movements, moments) and len(learner.memory)):
        return False
    known, rng = parts.task.benchmark or config.benchmark, stream(config.seed, "until", movements)
    goals = parts.benchmark.goals if known else goals_reached(learner.inverse, rng)
    expected = expected_error(learner.inverse, goals, rng)
    assert config.until is not None
    if not expected <= config.until:  # or it is NaN
        return False
    tried = rng.permutation(goals)[:TRIED]
    evaluation = evaluate(learner.inverse, parts.environment, tried, config.seed, movements, repeats=0, between=between)
    likely = evaluation.mean_error + float(evaluation.errors.std()) / math.sqrt(len(tried))
    if likely > config.until:
        amount = parts.environment.outcomes.amount
        missed = f"{len(tried)} answers missed by {amount(evaluation.mean_error, '.4f')}"
        say(f"after {movements} movements {amount(expected, '.4f')} was expected, but {missed}: the run goes on")
        return False
    record.about["ended_early"] = [movements, max(expected, likely)]
    return True


def goals_reached(inverse: Inverse, rng: np.random.Generator) -> Array:
    """``(n, outcome_dim)``, a goal in each tile of T with two remembered outcomes or more."""
    outcomes, box = inverse.problem.memory.outcomes, inverse.problem.outcomes
    return tile_goals(outcomes, box, tile_side(outcomes, box), rng)


def expected_error(inverse: Inverse, goals: Array, rng: np.random.Generator) -> float:
    """Mean error that an inverse model expects at ``goals``, each in a remembered context.

    Args:
        inverse: inverse model, whose ``answer_many`` is called; its memory must not be empty.
        goals: ``(n, outcome_dim)``, in the unit of T.
        rng: random stream of the contexts.

    Returns:
        Mean error, in the unit of T; NaN: there are no goals, or the inverse model does not say how sure it is.
    """
    memory = inverse.problem.memory
    contexts = memory.contexts[rng.integers(len(memory), size=len(goals))]
    return float(expected_errors(inverse.answer_many(contexts, goals), goals).mean()) if len(goals) else float("nan")
