"""Anchored predictions of the forward model, corrected by its errors at similar executed movements, the anchors.

Not in Nguyen & Oudeyer (2014). L is the mean of the networks. Near an anchor k the prediction is about
tau_k + L(theta) - L(theta_k): a Gaussian process fitted to the errors of L at the anchors is added to L(theta). Its
variance grows far from anchors. Networks are wrong where few movements were executed; without this variance a search
would end there.
    near = Anchored(model, policies, context, ...); thetas = near.best(starts, goals, steps=40, step=0.005)
"""

from __future__ import annotations

from typing import Final

import torch

from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.training import one_thread
from sgimd_torch.spaces import Array, Box

# All numbers are relative to Pi or to the spread of outcomes, so the unit of T does not matter.
_REACH: Final = 0.08  # length scale of the process, relative to the sides of Pi times the square root of theta_dim
# Weight of the variances that the model predicts, of noise and of disagreement between members. A network that has not
# learnt enough takes its own errors for noise: late in a run on the rod it predicts twice the true standard deviation,
# earlier even more. With weight 1 the anchors would hardly correct the network.
_SHARE: Final = 0.1
# Weight of the process's variance when it is added to the squared distance. The expected squared distance has weight 1,
# but the best of many candidates is often one whose prediction is too good.
_CAUTION: Final = 10.0
_LEAST_NOISE: Final = 0.003  # relative to the spread of outcomes; with less, equal anchors make a singular covariance


class Anchored:
    """Expected squared distances of n candidates from their goals, and gradient descent on these distances.

    Args:
        model: forward model, trained.
        policies: Pi; distances between movements are relative to its sides.
        context: ``(context_dim,)``, context of all candidates, or ``(n, context_dim)``, one for each candidate.
        contexts: ``(n, m, context_dim)``, contexts of the anchors.
        thetas: ``(n, m, theta_dim)``, m anchors for each candidate; with n = 1, all candidates share them.
        outcomes: ``(n, m, outcome_dim)``, outcomes of the anchors.
    """

    @one_thread()
    def __init__(
        self, model: ForwardModel, policies: Box, context: Array, contexts: Array, thetas: Array, outcomes: Array
    ) -> None:
        self.model, self.tensor = model, model.tensor
        self.low, self.high, self.sides = map(self.tensor, (policies.low, policies.high, policies.sides))
        self.context, anchors = self.tensor(context), self.tensor(thetas)
        self._scaled = anchors / self.sides
        self._squares = (self._scaled**2).sum(dim=-1)
        self._reach = _REACH * policies.dim**0.5
        spread = model.outcome_scale.square().mean().sqrt()
        with torch.no_grad():
            means, variances = model.landing(self.tensor(contexts), anchors)
            errors, noise = self.tensor(outcomes) - means.mean(dim=0), _SHARE * variances.mean(dim=(0, -1))
            # Far from all anchors, the assumed error is at least the error on held-out exemplars.
            prior_sd = (errors**2).mean(dim=(1, 2), keepdim=True).sqrt().clamp(min=model.missed * spread)
            covariance = prior_sd**2 * self._kernel(torch.cdist(self._scaled, self._scaled) ** 2)
            noise = noise + (_LEAST_NOISE * spread) ** 2
            self._precision = torch.cholesky_inverse(torch.linalg.cholesky(covariance + torch.diag_embed(noise)))
            self._prior_variance, self._weights = prior_sd[:, 0] ** 2, self._precision @ errors

    @one_thread()
    def predict(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Expected outcomes ``(n, outcome_dim)`` of ``theta`` ``(n, theta_dim)``, and their variances ``(n,)``: the
        weighted sum of noise, disagreement between members, and variance of the process."""
        means, variances = self.model.landing(self.context, theta)
        landing = means.mean(dim=0)
        known_variance = _SHARE * (variances.mean(dim=0) + means.var(dim=0, correction=0)).sum(dim=-1)
        scaled = theta / self.sides
        squares = (scaled**2).sum(dim=-1, keepdim=True) + self._squares - 2 * (self._scaled @ scaled[..., None])[..., 0]
        kernel = self._prior_variance * self._kernel(squares)  # (n, m)
        correction = (kernel[:, None] @ self._weights)[:, 0]
        explained = ((kernel[:, None] @ self._precision)[:, 0] * kernel).sum(dim=-1)
        variance = (self._prior_variance[:, 0] - explained).clamp(min=0)
        return landing + correction, known_variance + landing.shape[-1] * _CAUTION * variance

    def expected(self, theta: torch.Tensor, goals: torch.Tensor) -> torch.Tensor:
        """Squared distances ``(n,)`` of expected outcomes from ``goals``, plus the variances of the outcomes."""
        landing, variance = self.predict(theta)
        return ((landing - goals) ** 2).sum(dim=-1) + variance

    def descend(
        self, theta: torch.Tensor, goals: torch.Tensor, *, steps: int, step: float, radius: float | None = None
    ) -> torch.Tensor:
        """Candidates ``(n, theta_dim)`` after a descent by Adam.

        Args:
            theta: ``(n, theta_dim)`` candidates at the start.
            goals: ``(n, outcome_dim)``, or one goal for all candidates.
            steps: number of steps.
            step: approximate length of a step in each parameter, relative to the sides of Pi.
            radius: largest distance from the start (root mean square over the parameters, relative to the sides of Pi);
                None: no limit.
        """
        start = theta
        mean, square = torch.zeros_like(theta), torch.zeros_like(theta)
        for i in range(1, steps + 1):  # torch's own Adam would need a new object for every goal
            theta = theta.detach().requires_grad_(True)
            (gradient,) = torch.autograd.grad(self.expected(theta, goals).sum(), theta)
            gradient = gradient * self.sides
            mean, square = mean.lerp(gradient, 0.1), square.lerp(gradient**2, 0.001)
            change = (mean / (1 - 0.9**i)) / ((square / (1 - 0.999**i)).sqrt() + torch.finfo().tiny)
            theta = theta.detach() - step * self.sides * change
            if radius is not None:
                theta = within(start, theta, self.sides, radius)
            theta = theta.clamp(self.low, self.high)
        return theta.detach()

    @one_thread()
    def best(self, starts: Array, goals: Array, *, steps: int, step: float, radius: float | None = None) -> Array:
        """For each of the ``goals`` ``(n_goals, outcome_dim)`` the best theta ``(n_goals, theta_dim)`` of descents from
        its ``starts`` ``(n_goals, n_starts, theta_dim)``; options of `descend`."""
        n_goals, n_starts, theta_dim = starts.shape
        aims = self.tensor(goals.repeat(n_starts, axis=0))
        thetas = self.descend(self.tensor(starts.reshape(-1, theta_dim)), aims, steps=steps, step=step, radius=radius)
        with torch.no_grad():
            rows = self.expected(thetas, aims).reshape(n_goals, n_starts).argmin(dim=1)
        return thetas.reshape(starts.shape)[torch.arange(n_goals), rows].cpu().double().numpy()

    def _kernel(self, squared_distances: torch.Tensor) -> torch.Tensor:
        return (-squared_distances / (2 * self._reach**2)).exp()


def within(start: torch.Tensor, theta: torch.Tensor, sides: torch.Tensor, radius: float) -> torch.Tensor:
    """``theta``, moved into the trust region around ``start``; its ``radius`` is explained in `Anchored.descend`."""
    change, longest = (theta - start) / sides, radius * theta.shape[-1] ** 0.5
    return start + sides * change * (longest / change.norm(dim=-1, keepdim=True).clamp(min=longest))
