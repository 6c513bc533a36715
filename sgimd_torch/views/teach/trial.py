"""A trial: the learner does its best at a goal, and says what it expects; it learns nothing from it.

trial = try_goal(parts, context, goal, stream(seed, "trials", 0)); trial.missed, trial.expected
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Recorded
from sgimd_torch.runs.build import RunParts
from sgimd_torch.spaces import Array, Estimate

RIDGE: Final = 1e-3  # of the regression, relative to the variance of the movements


@dataclass(frozen=True, eq=False)
class Trial:
    """``goal``, where the movement ``theta`` was ``expected`` to end and its ``outcome``, each ``(outcome_dim,)``; and
    the movement itself, ``recorded``, None if the task has no picture."""

    goal: Array
    theta: Array
    expected: Array
    outcome: Array
    recorded: Recorded | None

    @property
    def missed(self) -> float:
        """The distance from the goal to the outcome, m."""
        return float(np.linalg.norm(self.outcome - self.goal))


def try_goal(parts: RunParts, context: Array, goal: Array, rng: np.random.Generator) -> Trial:
    """Execute once what the run's inverse model infers for ``goal`` ``(outcome_dim,)``.

    Raises:
        ValueError: nothing is remembered yet, or the goal is not one of T.
    """
    goal = parts.environment.outcomes.check("goal", goal, "a click beside the map?")
    if not len(parts.learner.memory):
        raise ValueError("it remembers no movement yet; let it move, or show it something first")
    estimate = parts.inverse(context, goal)
    model = parts.model if parts.model is not None and parts.model.trained else None
    expected = expectation(estimate) if model is None else model.predict(context, estimate.theta).mean
    if parts.record is None:
        outcome = parts.environment.execute(context.copy(), estimate.theta.copy(), rng)
        return Trial(goal, estimate.theta, expected, outcome, None)
    recorded = parts.record(context, estimate.theta, rng)
    return Trial(goal, estimate.theta, expected, np.asarray(recorded.outcome), recorded)


def expectation(estimate: Estimate) -> Array:
    """``(outcome_dim,)`` where a movement should end, by a regression over the exemplars that it is based on."""
    thetas, outcomes = estimate.thetas, estimate.outcomes
    deviations = thetas - thetas.mean(axis=0)
    products = deviations @ deviations.T  # fewer exemplars than parameters: the dual form
    variance = products.trace()
    if variance == 0:
        return np.asarray(outcomes.mean(axis=0))
    weights = np.linalg.solve(products + RIDGE * variance * np.eye(len(thetas)), outcomes - outcomes.mean(axis=0))
    return np.asarray(outcomes.mean(axis=0) + (estimate.theta - thetas.mean(axis=0)) @ deviations.T @ weights)
