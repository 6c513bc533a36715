"""Inverse by the forward model: of all movements similar to the nearest ones, which should land nearest, and reliably?

Not in Nguyen & Oudeyer (2014), whose inverse model, eqs. (8) and (9), only knows outcomes. Here candidates descend the
expected squared distance to the goal, predicted noise included: of several movements to a goal a reliable one wins.
    inverse = ModelInverse(memory, model, environment.policies); inverse(context, goal).theta
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch

from sgimd_torch.forward_model.anchored import TRUST, Anchored, Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box, Estimate

_NEAREST: Final = 10  # remembered movements that landed nearest to the goal: candidates beside the first estimate
_ANCHORS: Final = 40  # neighbours in policy space that correct the predictions for a candidate
# Of the descent; a step in sides of Pi. Many small steps end nearer to the start than few large ones.
_STEPS, _STEP = 40, 0.005
_GOALS_PER_BATCH: Final = 64  # about 50 MB


class ModelInverse:
    """Descends from the estimate of `LocallyLinear` and from the nearest remembered movements to what ``model`` expects
    to be best.

    It never trains the model, so that an evaluation changes nothing: call ``model.refresh(memory)`` in the loop that
    adds to the memory. Until the model is good enough for ``trust`` it answers like `LocallyLinear`.

    Args:
        memory: gives candidates and anchors; only read.
        model: predicts.
        policies: Pi; nothing outside is proposed.
        trust: how far to trust the model.

    Raises:
        ValueError: a model of other dimensions.
    """

    learns_with = LocallyLinear  # the inverse of a learner whose evaluations are answered by this one

    def __init__(self, memory: Memory, model: ForwardModel, policies: Box, *, trust: Trust = TRUST) -> None:
        model.check_fits("memory", **{name: getattr(memory, name) for name in model.sizes})
        model.check_fits("policies", theta_dim=policies.dim)
        self.memory, self.model, self.policies, self.trust = memory, model, policies, trust
        self.start = LocallyLinear(memory)

    @property
    def trusted(self) -> bool:
        """Whether the model is good enough to be used."""
        return self.model.relative_error <= self.trust.error

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The candidate that should be best, with the neighbours that ``start`` gives.

        Raises:
            RuntimeError: the memory is empty.
        """
        return self.many(context, goal[None])[0]

    def many(self, context: Array, goals: Array) -> list[Estimate]:
        """An estimate for each of ``(n, outcome_dim)`` goals, several times faster than one by one.

        Raises:
            RuntimeError: the memory is empty.
        """
        estimates = [self.start(context, goal) for goal in goals]
        if not self.trusted:
            return estimates
        found: list[Estimate] = []
        for first in range(0, len(goals), _GOALS_PER_BATCH):
            some = slice(first, first + _GOALS_PER_BATCH)
            found += self._descended(context, goals[some], estimates[some])
        return found

    def predict(self, contexts: Array, thetas: Array) -> Array:
        """``(n, outcome_dim)`` what movements should lead to, judging by the model and by those most like each.

        Args:
            contexts: ``(n, context_dim)``.
            thetas: ``(n, theta_dim)``.

        Raises:
            RuntimeError: the memory is empty, or the model is not trained.
        """
        anchored = self._anchored(contexts, thetas)
        with torch.no_grad():
            return anchored.predict(anchored.tensor(thetas))[0].cpu().double().numpy()

    def _descended(self, context: Array, goals: Array, estimates: list[Estimate]) -> list[Estimate]:
        memory = self.memory
        starts = [
            np.vstack([estimate.theta, memory.thetas[memory.near_outcomes(context, goal, _NEAREST)]])
            for goal, estimate in zip(goals, estimates, strict=True)
        ]
        n_each = min(map(len, starts))
        candidates = self.policies.clip(np.vstack([thetas[:n_each] for thetas in starts]))
        anchored = self._anchored(np.broadcast_to(context, (len(candidates), len(context))), candidates)
        aims = anchored.tensor(goals.repeat(n_each, axis=0))
        theta = anchored.descend(anchored.tensor(candidates), aims, steps=_STEPS, step=_STEP)
        with torch.no_grad():
            best = anchored.expected(theta, aims).reshape(len(goals), n_each).argmin(dim=1)
        chosen = theta.reshape(len(goals), n_each, -1)[torch.arange(len(goals)), best].cpu().double().numpy()
        return [
            estimate._replace(theta=self.policies.clip(row)) for estimate, row in zip(estimates, chosen, strict=True)
        ]

    def _anchored(self, contexts: Array, thetas: Array) -> Anchored:
        """Predictions for ``(n, theta_dim)`` in ``(n, context_dim)``, each with anchors of its own."""
        memory = self.memory
        rows = [memory.near_policies(*each, _ANCHORS) for each in zip(contexts, thetas, strict=True)]
        near = np.stack([row[: min(map(len, rows))] for row in rows])
        there = memory.contexts[near], memory.thetas[near], memory.outcomes[near]
        return Anchored(self.model, self.policies, contexts, *there, self.trust)
