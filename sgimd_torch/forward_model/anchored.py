"""Anchored predictions: those of the forward model, corrected by its errors at executed movements nearby, the anchors.

Not in Nguyen & Oudeyer (2014). With one anchor k it is tau_k + L(theta) - L(theta_k). With many it is a Gaussian
process of the network's errors at the anchors, whose variance grows away from them: a network is wrong where little was
executed, and a search through it finds just those places.
    near = Anchored(model, context, thetas, outcomes); theta = near.descend(candidates, goals, policies)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import torch

from sgimd_torch.forward_model.diagnostics import TRUSTED_UP_TO
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.spaces import Array, Box

_JITTER = 1e-6  # m^2, keeps coincident anchors from making the covariance singular


@dataclass(frozen=True)
class Trust:
    """How far to trust the model.

    Args:
        reach: length scale in policy space of what an anchor tells; None for .08 sqrt(theta_dim).
        noise: largest standard deviation (m) of the outcomes of one movement; see ``Environment.outcome_noise``.
        share: how much of the model's predicted variances counts, of noise and of disagreement. A network that has not
            learnt enough takes its own errors for noise (twice the true deviation late in a run on the fishing rod, and
            more early), so that the anchors would not correct it. 1 is for outcomes that are as noisy as it says.
        doubt: standard deviation (m) of the network's error where no anchor is near; its error at the anchors counts
            instead if that is larger.
        caution: weight of the anchored prediction's variance against the squared distance. 1 would be the expectation,
            but the minimum over many candidates selects those whose error makes them look good.
        error: ``ForwardModel.relative_error`` above which the model is not used.
        anchors: False predicts by the network alone, for comparison.

    Raises:
        ValueError: a number out of its range.
    """

    reach: float | None = None
    noise: float = 0.04
    share: float = 0.1
    doubt: float = 0.06
    caution: float = 10.0
    error: float = TRUSTED_UP_TO
    anchors: bool = True

    def __post_init__(self) -> None:
        for name in ("reach", "noise", "doubt", "error"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share must lie in [0, 1], got {self.share}")
        if not 0 <= self.caution < float("inf"):
            raise ValueError(f"caution must be finite and at least 0, got {self.caution}")


TRUST: Final = Trust()
"""For the fishing rod."""


class Anchored:
    """For n candidates: the expected squared distance of each to a goal, and its descent.

    Args:
        model: predicts.
        context: ``(context_dim,)`` in which the candidates will be executed.
        contexts: ``(n, m, context_dim)`` in which the anchors were executed.
        thetas: ``(n, m, theta_dim)`` of the m anchors of each candidate; n may be 1, the same for all.
        outcomes: ``(n, m, outcome_dim)`` m, where the anchors landed.
        trust: how far to trust the model.
    """

    def __init__(
        self, model: ForwardModel, context: Array, contexts: Array, thetas: Array, outcomes: Array, trust: Trust
    ) -> None:
        self.model, self.trust = model, trust
        self.context, self.thetas = self.tensor(context), self.tensor(thetas)
        self._squares = (self.thetas**2).sum(dim=-1)
        self.reach = 0.08 * thetas.shape[-1] ** 0.5 if trust.reach is None else trust.reach
        with torch.no_grad():
            means, variances = model.landing(self.tensor(contexts), self.thetas)
            missed, noise = self.tensor(outcomes) - means.mean(dim=0), trust.share * variances.mean(dim=(0, -1))
            doubt = (missed**2).mean(dim=(1, 2), keepdim=True).sqrt().clamp(min=trust.doubt)
            covariance = doubt**2 * self._kernel(torch.cdist(self.thetas, self.thetas) ** 2)
            noise = noise.clamp(max=trust.noise**2) + _JITTER
            self._inverse = torch.cholesky_inverse(torch.linalg.cholesky(covariance + torch.diag_embed(noise)))
            self._doubt, self._weights = doubt[:, 0] ** 2, self._inverse @ missed

    def tensor(self, values: Array) -> torch.Tensor:
        """``values`` in the precision of the model, and where it is."""
        return torch.tensor(values, dtype=torch.float32, device=self.model.input_mean.device)

    def predict(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Where ``theta`` ``(n, theta_dim)`` should land, ``(n, outcome_dim)`` m, and the spread ``(n,)`` m^2 about it:
        noise, disagreement of the members, and doubt weighted with ``caution``."""
        means, variances = self.model.landing(self.context, theta)
        landing = means.mean(dim=0)
        spread = self.trust.share * (variances.mean(dim=0) + means.var(dim=0, correction=0)).sum(dim=-1)
        if not self.trust.anchors:
            return landing, spread
        squares = (theta**2).sum(dim=-1, keepdim=True) + self._squares - 2 * (self.thetas @ theta[..., None])[..., 0]
        kernel = self._doubt * self._kernel(squares)  # (n, m)
        correction = (kernel[:, None] @ self._weights)[:, 0]
        explained = ((kernel[:, None] @ self._inverse)[:, 0] * kernel).sum(dim=-1)
        doubt = (self._doubt[:, 0] - explained).clamp(min=0)
        return landing + correction, spread + landing.shape[-1] * self.trust.caution * doubt

    def expected(self, theta: torch.Tensor, goals: torch.Tensor) -> torch.Tensor:
        """``(n,)`` m^2: squared distance to ``goals`` plus the spread, so that reliable movements win."""
        landing, spread = self.predict(theta)
        return ((landing - goals) ** 2).sum(dim=-1) + spread

    def descend(
        self,
        theta: torch.Tensor,
        goals: torch.Tensor,
        policies: Box,
        *,
        steps: int,
        step: float,
        radius: float | None = None,
    ) -> torch.Tensor:
        """``(n, theta_dim)``: ``theta`` after ``steps`` of Adam, each of about ``step`` sides of ``policies``.

        Args:
            radius: the farthest that it goes from ``theta``, root mean square over the parameters, in sides.
        """
        low, high, sides = (self.tensor(values) for values in (policies.low, policies.high, policies.sides))
        start = theta
        mean, square = torch.zeros_like(theta), torch.zeros_like(theta)
        for i in range(1, steps + 1):  # torch's own Adam would have to be made for every goal
            theta = theta.detach().requires_grad_(True)
            (gradient,) = torch.autograd.grad(self.expected(theta, goals).sum(), theta)
            gradient = gradient * sides
            mean, square = mean.lerp(gradient, 0.1), square.lerp(gradient**2, 0.001)
            change = (mean / (1 - 0.9**i)) / ((square / (1 - 0.999**i)).sqrt() + 1e-12)
            theta = theta.detach() - step * sides * change
            if radius is not None:
                theta = self.within(start, theta, sides, radius)
            theta = theta.clamp(low, high)
        return theta.detach()

    @staticmethod
    def within(start: torch.Tensor, theta: torch.Tensor, sides: torch.Tensor, radius: float) -> torch.Tensor:
        """The points nearest to ``theta`` in the trust region of ``start``: ``radius`` sides, root mean square."""
        change, longest = (theta - start) / sides, radius * theta.shape[-1] ** 0.5
        return start + sides * change * (longest / change.norm(dim=-1, keepdim=True).clamp(min=longest))

    def _kernel(self, squared_distances: torch.Tensor) -> torch.Tensor:
        return (-squared_distances / (2 * self.reach**2)).exp()
