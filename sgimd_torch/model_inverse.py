"""Inverse by the forward model: of all movements like those that came near, which should land nearest, and reliably?

Not in Nguyen & Oudeyer (2014), whose inverse model, eqs. (8) and (9), looks at outcomes alone. Here candidates descend
the expected squared distance to the goal, the predicted noise included: among redundant movements the reliable win.
    inverse = ModelInverse(memory, model, environment.policies); inverse(context, goal).theta
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch

from sgimd_torch.forward_model import ForwardModel
from sgimd_torch.inverse_model import LocallyLinear
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box, Estimate, check_count

_JITTER = 1e-6  # m^2, keeps coincident anchors from making the covariance singular


class ModelInverse:
    """Descends from ``start``'s estimate and the movements that came nearest to what ``model`` expects to be best.

    A network alone is wrong where little was executed, and a search finds just those places. So each candidate is
    anchored at its neighbours in policy space: a Gaussian process of what the network missed there corrects the
    prediction, and its variance, large away from all anchors, is what keeps the candidate near them.

    It reads the model and trains it never, so that looking changes nothing: call ``model.refresh(memory)`` in the loop
    that adds to the memory. Until the model is trained it answers as ``start`` does.

    Args:
        memory: read for candidates and anchors.
        model: predicts.
        policies: Pi; nothing outside is proposed.
        start: another inverse model, whose estimate is one of the candidates; None for :class:`LocallyLinear`.
        k: candidates besides, the remembered movements that landed nearest the goal.
        anchors: neighbours of each candidate.
        reach: distance in policy space over which an anchor tells something; None for .08 sqrt(theta_dim).
        noise: standard deviation (m) of an outcome executed again, at most: a network that knows little yet calls its
            own errors noise, and would not let the anchors correct it. See ``Environment.outcome_noise``.
        doubt: standard deviation (m) of the network's error where no anchor is near; where it misses the anchors by
            more, that counts.
        caution: weight of the anchored prediction's variance against the squared distance; 1 would be its expectation,
            but the minimum over many candidates picks out those whose error flatters them.
        steps, step: of Adam, in sides of ``policies``. Many small steps end nearer the start than few large ones.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        memory: Memory,
        model: ForwardModel,
        policies: Box,
        *,
        start: Callable[[Array, Array], Estimate] | None = None,
        k: int = 20,
        anchors: int = 40,
        reach: float | None = None,
        noise: float = 0.04,
        doubt: float = 0.06,
        caution: float = 10.0,
        steps: int = 25,
        step: float = 0.01,
    ) -> None:
        check_count("k", k, 1)
        check_count("anchors", anchors, 1)
        check_count("steps", steps, 0)
        reach = 0.08 * float(np.sqrt(policies.dim)) if reach is None else reach
        for name, value in {"reach": reach, "noise": noise, "doubt": doubt, "step": step}.items():
            if not 0 < value < np.inf:
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not 0 <= caution < np.inf:
            raise ValueError(f"caution must be finite and at least 0, got {caution}")
        self.memory, self.model, self.policies = memory, model, policies
        self.start = LocallyLinear(memory) if start is None else start
        self.k, self.anchors, self.reach, self.doubt = k, anchors, reach, doubt
        self.noise = noise
        self.caution, self.steps, self.step = caution, steps, step

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The candidate that should do best, with the neighbours that ``start`` gives.

        Raises:
            RuntimeError: the memory is empty.
        """
        estimate = self.start(context, goal)
        if not self.model.trained:
            return estimate
        rows = self.memory.near_outcomes(context, goal, self.k)
        candidates = self.policies.clip(np.vstack([estimate.theta, self.memory.thetas[rows]]))
        anchored = self._anchored(context, candidates)
        device = self.model.input_mean.device
        low, high, sides, aim = (
            torch.tensor(values, dtype=torch.float32, device=device)
            for values in (self.policies.low, self.policies.high, self.policies.sides, goal)
        )
        theta = torch.tensor(candidates, dtype=torch.float32, device=device)
        mean, square = torch.zeros_like(theta), torch.zeros_like(theta)
        for i in range(1, self.steps + 1):  # Adam, in sides of the box; torch's would have to be built for every goal
            theta.requires_grad_(True)
            (gradient,) = torch.autograd.grad(self._expected(anchored, theta, aim).sum(), theta)
            theta = theta.detach()
            gradient = gradient * sides
            mean, square = mean.lerp(gradient, 0.1), square.lerp(gradient**2, 0.001)
            change = (mean / (1 - 0.9**i)) / ((square / (1 - 0.999**i)).sqrt() + 1e-12)
            theta = (theta - self.step * sides * change).clamp(low, high)
        with torch.no_grad():
            best = int(self._expected(anchored, theta, aim).argmin())
        return estimate._replace(theta=self.policies.clip(theta[best].cpu().double().numpy()))

    def _anchored(self, context: Array, candidates: Array) -> _Anchored:
        """For every candidate the process of what the network misses, given its neighbours."""
        rows = [self.memory.near_policies(context, theta, self.anchors) for theta in candidates]
        nearest = np.stack([row[: min(map(len, rows))] for row in rows])
        device = self.model.input_mean.device
        here, contexts, thetas, outcomes = (
            torch.tensor(values, dtype=torch.float32, device=device)
            for values in (
                context,
                *(part[nearest] for part in (self.memory.contexts, self.memory.thetas, self.memory.outcomes)),
            )
        )
        with torch.no_grad():
            means, variances = self.model(contexts, thetas)
            missed, noise = outcomes - means.mean(dim=0), variances.mean(dim=(0, -1))
            doubt = (missed**2).mean(dim=(1, 2), keepdim=True).sqrt().clamp(min=self.doubt)
            noise = noise.clamp(max=self.noise**2)  # an ignorant network calls everything noise
            covariance = doubt**2 * self._kernel(torch.cdist(thetas, thetas) ** 2)
            factor = torch.linalg.cholesky(covariance + torch.diag_embed(noise + _JITTER))
            return _Anchored(here, thetas, doubt[:, 0] ** 2, factor, torch.cholesky_solve(missed, factor))

    def _expected(self, anchored: _Anchored, theta: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
        """``(n,)`` m^2: squared distance to be expected of each candidate, doubt counted with ``caution``."""
        means, variances = self.model(anchored.context, theta)
        kernel = anchored.doubt * self._kernel(((theta[:, None] - anchored.thetas) ** 2).sum(dim=-1))
        landing = means.mean(dim=0) + (kernel[..., None] * anchored.weights).sum(dim=1)
        explained = (kernel * torch.cholesky_solve(kernel[..., None], anchored.factor)[..., 0]).sum(dim=-1)
        doubt = (anchored.doubt[:, 0] - explained).clamp(min=0)
        noise = variances.mean(dim=0).sum(dim=-1) + means.var(dim=0, correction=0).sum(dim=-1)
        return ((landing - goal) ** 2).sum(dim=-1) + noise + len(goal) * self.caution * doubt

    def _kernel(self, squared_distances: torch.Tensor) -> torch.Tensor:
        return (-squared_distances / (2 * self.reach**2)).exp()


class _Anchored(NamedTuple):
    """``context`` ``(context_dim,)``; for each of n candidates: ``thetas`` ``(n, anchors, theta_dim)`` of its anchors,
    variance in ``doubt`` ``(n, 1)`` (m^2) far from them, Cholesky ``factor`` of their covariance, and ``weights``
    ``(n, anchors, outcome_dim)`` of what was missed."""

    context: torch.Tensor
    thetas: torch.Tensor
    doubt: torch.Tensor
    factor: torch.Tensor
    weights: torch.Tensor
