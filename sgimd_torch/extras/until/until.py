"""``sgimd run --until`` ends a run early, once its learner expects, and makes, small errors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from sgimd_torch.evaluation import evaluate, expected_errors, tile_goals, tile_side
from sgimd_torch.parts import Inverse
from sgimd_torch.runs.hooks import Listener
from sgimd_torch.runs.messages import say
from sgimd_torch.spaces import Array, stream

if TYPE_CHECKING:
    from sgimd_torch.runs.run import RunLoop

TRIED: Final = 20  # number of goals at which an expected error is tried before --until ends a run
LOOK_EVERY: Final = 50  # number of movements between two looks at the expected error, until it is a tenth of all


class Ending(Listener):
    """Ends a run once its learner expects, and makes, no larger mean error than ``until``; it looks now and then.

    An inverse model does not know what it cannot see, such as the memory of a robot. So the answers to a few random
    goals are executed before the run ends; nothing is learnt from them. The error that is told is the one that they
    made, plus its standard error, or the expected one if that is larger.
    """

    def __init__(self, loop: RunLoop, until: float) -> None:
        self._loop, self._until = loop, until

    def ends(self) -> str:
        """Why the run ends now; "": it goes on."""
        loop, parts = self._loop, self._loop.parts
        movements, learner, seed = loop.movements, parts.learner, parts.config.seed
        moments = range(0, movements + 1, LOOK_EVERY * max(1, movements // (10 * LOOK_EVERY)))[1:]
        if not (parts.due(movements, moments) and len(learner.memory)):
            return ""
        with loop.seconds.of("evaluation"):
            known, rng = parts.task.benchmark or parts.config.benchmark, stream(seed, "until", movements)
            goals = parts.benchmark.goals if known else goals_reached(learner.inverse, rng)
            expected = expected_error(learner.inverse, goals, rng)
            if not expected <= self._until:  # or it is NaN
                return ""
            tried, between = rng.permutation(goals)[:TRIED], loop.evaluations.between
            made = evaluate(learner.inverse, parts.environment, tried, seed, movements, repeats=0, between=between)
        likely = made.mean_error + float(made.errors.std()) / math.sqrt(len(tried))
        amount = parts.environment.outcomes.amount
        if likely <= self._until:
            return f"it expected {amount(max(expected, likely), '.4f')}"
        missed = f"{len(tried)} answers missed by {amount(made.mean_error, '.4f')}"
        say(f"after {movements} movements {amount(expected, '.4f')} was expected, but {missed}: the run goes on")
        return ""


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
