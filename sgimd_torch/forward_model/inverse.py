"""Inverse model by the forward model: gradient descent on the expected squared distance from the goal.

Not in Nguyen & Oudeyer (2014), whose inverse model, eqs. (8) and (9), uses remembered outcomes only. The descent starts
at remembered movements. The expected distance includes the predicted noise, so reliable movements are preferred.
    inverse = ModelInverse(problem); inverse(context, goal).theta
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch

from sgimd_torch.calls import with_keywords_of
from sgimd_torch.forward_model.anchored import Anchored
from sgimd_torch.forward_model.shared import ModelBased
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Estimate

_NEAREST: Final = 10  # number of remembered movements, nearest to the goal, at which a descent starts
_ANCHORS: Final = 40  # number of anchors of a candidate: its neighbours in policy space
_STEPS: Final = 40  # number of steps of a descent; many small steps end nearer to the start than few large steps
_STEP: Final = 0.005  # size of a step, relative to the sides of Pi
_GOALS_PER_BATCH: Final = 64  # number of goals that are computed together, in about 50 MB


class ModelInverse(ModelBased):
    """Best result of gradient descents through the forward model.

    The descents start at the estimate of `LocallyLinear` and at the nearest remembered movements. Until the model is
    trusted, the answer is that of `LocallyLinear`. Answers never train the model, so that an evaluation changes
    nothing; the loop that adds to the memory calls ``model.refresh(memory)``.

    Args:
        problem: problem to learn.
    """

    @with_keywords_of(ModelBased)
    def __init__(self, problem: Problem, **options: Any) -> None:
        super().__init__(problem, **options)
        self.start = LocallyLinear(problem)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The theta with the least expected distance, and the exemplars of the estimate of `LocallyLinear`."""
        self.model.guides |= self.trusted
        return self.answer_many(context[None], goal[None])[0]

    def answer_many(self, contexts: Array, goals: Array) -> list[Estimate]:
        """Estimates for ``goals`` ``(n, outcome_dim)``; if all have one context, many times faster than one by one."""
        estimates = self.start.answer_many(contexts, goals)
        if not self.trusted:
            return estimates
        descended: list[Estimate] = []
        size = _GOALS_PER_BATCH if (contexts == contexts[0]).all() else 1
        for first in range(0, len(goals), size):
            batch = slice(first, first + size)
            descended += self._descend(contexts[first], goals[batch], estimates[batch])
        return descended

    def predict_many(self, contexts: Array, thetas: Array) -> Array:
        """Expected outcomes ``(n, outcome_dim)`` by the model, corrected at similar movements.

        Args:
            contexts: ``(n, context_dim)``.
            thetas: ``(n, theta_dim)``.

        Raises:
            RuntimeError: the memory is empty.
        """
        anchored = self._anchored(contexts, thetas)
        with torch.no_grad():
            return anchored.predict(anchored.tensor(thetas))[0].cpu().double().numpy()

    def _descend(self, context: Array, goals: Array, estimates: list[Estimate]) -> list[Estimate]:
        memory, policies = self.problem.memory, self.problem.policies
        starts = [
            np.vstack([estimate.theta, memory.thetas[memory.near_outcomes(context, goal, _NEAREST)]])
            for goal, estimate in zip(goals, estimates, strict=True)
        ]
        n_starts = min(map(len, starts))
        candidates = policies.clip(np.stack([thetas[:n_starts] for thetas in starts]))  # (n_goals, n_starts, theta_dim)
        movements = candidates.reshape(-1, policies.dim)
        anchored = self._anchored(np.broadcast_to(context, (len(movements), len(context))), movements)
        thetas = policies.clip(anchored.best(candidates, goals, steps=_STEPS, step=_STEP))
        return [estimate._replace(theta=theta) for estimate, theta in zip(estimates, thetas, strict=True)]

    def _anchored(self, contexts: Array, thetas: Array) -> Anchored:
        """Predictions for ``thetas`` ``(n, theta_dim)`` in ``contexts`` ``(n, context_dim)``, each with its own
        anchors."""
        memory = self.problem.memory
        neighbours = [memory.near_policies(*movement, _ANCHORS) for movement in zip(contexts, thetas, strict=True)]
        rows = np.stack([nearest[: min(map(len, neighbours))] for nearest in neighbours])
        anchors = memory.contexts[rows], memory.thetas[rows], memory.outcomes[rows]
        return Anchored(self.model, self.problem.policies, contexts, *anchors)


class ModelAlone(ModelInverse):
    """Locally linear model while learning; untested forward model in evaluations (extra forward).

    Args:
        problem: problem to learn.
    """

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The estimate of `LocallyLinear`."""
        return self.start(context, goal)
