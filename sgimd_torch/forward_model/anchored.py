"""Anchored predictions: those of the forward model, corrected by its errors at executed movements nearby, the anchors.

Not in Nguyen & Oudeyer (2014). With one anchor k it is tau_k + L(theta) - L(theta_k). With many it is a Gaussian
process of the network's errors at the anchors, whose variance grows away from them: a network is wrong where little was
executed, and a search through it finds just those places.
    near = Anchored(model, policies, context, ...); theta = near.descend(candidates, goals, steps=40, step=0.005)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import torch

from sgimd_torch.forward_model.diagnostics import TRUSTED_UP_TO
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.spaces import Array, Box

_REACH: Final = 0.08  # of an anchor, in sides of Pi, times the square root of the number of parameters
_LEAST_NOISE: Final = 0.003  # in spreads of the outcomes; less makes the covariance of coincident anchors singular


@dataclass(frozen=True)
class Trust:
    """How far to trust the model.

    All are numbers without a unit: lengths come from the data, so metres, millimetres or newtons make no difference.

    Args:
        reach: length scale in policy space of what an anchor tells, in sides of Pi; None for .08 sqrt(theta_dim).
        share: how much of the model's predicted variances counts, of noise and of disagreement. A network that has not
            learnt enough takes its own errors for noise (twice the true deviation late in a run on the fishing rod, and
            more early), so that the anchors would not correct it. 1 is for outcomes that are as noisy as it says.
        caution: weight of the anchored prediction's variance against the squared distance. 1 would be the expectation,
            but the minimum over many candidates selects those whose error makes them look good.
        error: ``ForwardModel.relative_error`` above which the model is not used.
        anchors: False predicts by the network alone, for comparison.

    Raises:
        ValueError: a number out of its range.
    """

    reach: float | None = None
    share: float = 0.1
    caution: float = 10.0
    error: float = TRUSTED_UP_TO
    anchors: bool = True

    def __post_init__(self) -> None:
        for name in ("reach", "error"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share must lie in [0, 1], got {self.share}")
        if not 0 <= self.caution < float("inf"):
            raise ValueError(f"caution must be finite and at least 0, got {self.caution}")


TRUST: Final = Trust()


class Anchored:
    """For n candidates: the expected squared distance of each to a goal, and its descent.

    Args:
        model: predicts.
        policies: Pi, whose sides measure distances between movements.
        context: ``(context_dim,)`` in which the candidates will be executed, or ``(n, context_dim)``, each in its own.
        contexts: ``(n, m, context_dim)`` in which the anchors were executed.
        thetas: ``(n, m, theta_dim)`` of the m anchors of each candidate; n may be 1, the same for all.
        outcomes: ``(n, m, outcome_dim)`` where the anchors landed.
        trust: how far to trust the model.
    """

    def __init__(
        self,
        model: ForwardModel,
        policies: Box,
        context: Array,
        contexts: Array,
        thetas: Array,
        outcomes: Array,
        trust: Trust,
    ) -> None:
        self.model, self.trust = model, trust
        self.low, self.high, self.sides = map(self.tensor, (policies.low, policies.high, policies.sides))
        self.context, thetas_there = self.tensor(context), self.tensor(thetas)
        self._placed = thetas_there / self.sides
        self._squares = (self._placed**2).sum(dim=-1)
        self.reach = _REACH * policies.dim**0.5 if trust.reach is None else trust.reach
        spread = model.outcome_scale.square().mean().sqrt()
        with torch.no_grad():
            means, variances = model.landing(self.tensor(contexts), thetas_there)
            missed, noise = self.tensor(outcomes) - means.mean(dim=0), trust.share * variances.mean(dim=(0, -1))
            # Where no anchor is near it errs as it does on what it was never trained on, or more.
            doubt = (missed**2).mean(dim=(1, 2), keepdim=True).sqrt().clamp(min=model.missed * spread)
            covariance = doubt**2 * self._kernel(torch.cdist(self._placed, self._placed) ** 2)
            noise = noise + (_LEAST_NOISE * spread) ** 2
            self._inverse = torch.cholesky_inverse(torch.linalg.cholesky(covariance + torch.diag_embed(noise)))
            self._doubt, self._weights = doubt[:, 0] ** 2, self._inverse @ missed

    def tensor(self, values: Array) -> torch.Tensor:
        """``values`` in the precision of the model, and where it is."""
        return torch.tensor(values, dtype=torch.float32, device=self.model.input_mean.device)

    def predict(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Where ``theta`` ``(n, theta_dim)`` should land, ``(n, outcome_dim)``, and the variance ``(n,)`` about it:
        noise, disagreement of the members, and doubt weighted with ``caution``."""
        means, variances = self.model.landing(self.context, theta)
        landing = means.mean(dim=0)
        spread = self.trust.share * (variances.mean(dim=0) + means.var(dim=0, correction=0)).sum(dim=-1)
        if not self.trust.anchors:
            return landing, spread
        placed = theta / self.sides
        squares = (placed**2).sum(dim=-1, keepdim=True) + self._squares - 2 * (self._placed @ placed[..., None])[..., 0]
        kernel = self._doubt * self._kernel(squares)  # (n, m)
        correction = (kernel[:, None] @ self._weights)[:, 0]
        explained = ((kernel[:, None] @ self._inverse)[:, 0] * kernel).sum(dim=-1)
        doubt = (self._doubt[:, 0] - explained).clamp(min=0)
        return landing + correction, spread + landing.shape[-1] * self.trust.caution * doubt

    def expected(self, theta: torch.Tensor, goals: torch.Tensor) -> torch.Tensor:
        """``(n,)`` squared distance to ``goals`` plus the spread, so that reliable movements win."""
        landing, spread = self.predict(theta)
        return ((landing - goals) ** 2).sum(dim=-1) + spread

    def descend(
        self,
        theta: torch.Tensor,
        goals: torch.Tensor,
        *,
        steps: int,
        step: float,
        radius: float | None = None,
    ) -> torch.Tensor:
        """``(n, theta_dim)``: ``theta`` after ``steps`` of Adam, each of about ``step`` sides of Pi.

        Args:
            radius: the farthest that it goes from ``theta``, root mean square over the parameters, in sides.
        """
        start = theta
        mean, square = torch.zeros_like(theta), torch.zeros_like(theta)
        for i in range(1, steps + 1):  # torch's own Adam would have to be made for every goal
            theta = theta.detach().requires_grad_(True)
            (gradient,) = torch.autograd.grad(self.expected(theta, goals).sum(), theta)
            gradient = gradient * self.sides
            mean, square = mean.lerp(gradient, 0.1), square.lerp(gradient**2, 0.001)
            change = (mean / (1 - 0.9**i)) / ((square / (1 - 0.999**i)).sqrt() + torch.finfo().tiny)
            theta = theta.detach() - step * self.sides * change
            if radius is not None:
                theta = self.within(start, theta, self.sides, radius)
            theta = theta.clamp(self.low, self.high)
        return theta.detach()

    @staticmethod
    def within(start: torch.Tensor, theta: torch.Tensor, sides: torch.Tensor, radius: float) -> torch.Tensor:
        """The points nearest to ``theta`` in the trust region of ``start``: ``radius`` sides, root mean square."""
        change, longest = (theta - start) / sides, radius * theta.shape[-1] ** 0.5
        return start + sides * change * (longest / change.norm(dim=-1, keepdim=True).clamp(min=longest))

    def _kernel(self, squared_distances: torch.Tensor) -> torch.Tensor:
        return (-squared_distances / (2 * self.reach**2)).exp()
