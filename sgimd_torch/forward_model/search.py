"""A search through the forward model: by its gradient, which movement should land nearer to the goal, and reliably?

Not in Nguyen & Oudeyer (2014); a swap for the simplex of section 4.4.2, which needs no model.
    search = gradient_search(policies, rng, model=model); movements = search(estimate, goal); theta = next(movements)
Until the model is good enough for ``trust``, the search is the simplex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import Final

import numpy as np
import torch

from sgimd_torch.forward_model.anchored import TRUST, Anchored, Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.spaces import Array, Box, Estimate, Search

Propose = Callable[[Anchored, torch.Tensor, torch.Tensor, float], torch.Tensor]
"""(anchored, starts ``(n, theta_dim)``, goal ``(1, outcome_dim)``, radius) -> proposals within the radius of
their starts, see ``Anchored.descend``; the one that should be best is taken."""

_CANDIDATES: Final = 5  # remembered movements to start from
_RADIUS: Final = 0.15  # of the trust region at first
_RADII: Final = (0.02, 0.3)  # sides, root mean square: smaller is less than the noise, larger leaves the neighbourhood


def descend(
    anchored: Anchored,
    starts: torch.Tensor,
    goal: torch.Tensor,
    radius: float,
    *,
    steps: int = 5,
    step: float = 0.03,
) -> torch.Tensor:
    """Descent of the gradient of the expected squared distance, noise included."""
    return anchored.descend(starts, goal, steps=steps, step=step, radius=radius)


def gauss_newton(
    anchored: Anchored,
    starts: torch.Tensor,
    goal: torch.Tensor,
    radius: float,
    *,
    steps: int = 3,
    damping: float = 1e-3,
) -> torch.Tensor:
    """Repeatedly the smallest change that meets the goal to first order.

    It only uses the predicted landing point, not its spread. ``damping`` is relative to the mean square of what a side
    of Pi changes.
    """
    theta, n = starts, goal.shape[-1]
    for _ in range(steps):
        theta = theta.detach().requires_grad_(True)
        landing, _ = anchored.predict(theta)
        rows = [torch.autograd.grad(part.sum(), theta, retain_graph=True)[0] for part in landing.unbind(dim=1)]
        jacobian = torch.stack(rows, dim=1) * anchored.sides  # (n, outcome_dim, theta_dim)
        squares = jacobian @ jacobian.mT
        sizes = squares.diagonal(dim1=1, dim2=2).mean(dim=1) + torch.finfo().tiny
        damped = squares + damping * sizes[:, None, None] * torch.eye(n, device=theta.device)
        change = jacobian.mT @ torch.linalg.solve(damped, (goal - landing.detach())[..., None])
        theta = anchored.within(starts, theta.detach() + anchored.sides * change[..., 0], anchored.sides, radius)
        theta = theta.clamp(anchored.low, anchored.high)
    return theta.detach()


def gradient_search(
    policies: Box,
    rng: np.random.Generator,
    *,
    model: ForwardModel,
    propose: Propose = descend,
    noise: float = 0.05,
    residual: bool = True,
    trust: Trust = TRUST,
    inverse: object = None,
) -> Search:
    """Every movement is planned through the model, from theta_g and the movements that landed nearest; it never ends.

    Predictions are anchored at the neighbours of the estimate, all proposals in one batch. Each outcome becomes an
    anchor, too, so that the model's error here corrects the next prediction. Proposals stay in a trust region, which
    grows when the outcome changes as predicted, and shrinks when it does not.

    Args:
        policies: Pi; nothing outside is proposed.
        rng: draws the noise.
        model: predicts; the caller's loop refreshes it.
        propose: from starting points to proposals: ``descend`` or ``gauss_newton``.
        noise: as in ``nelder_mead``: without it the memory soon holds too few different movements.
        residual: False leaves the outcomes of this search out of the anchors, for comparison.
        trust: how far to trust the model.
        inverse: of the learner; if it knows whether the model can be ``trusted``, as `ProvedModel` does, it decides.

    Raises:
        ValueError: ``noise`` out of its range, or a model of other dimensions.
    """
    model.check_fits("policies", theta_dim=policies.dim)
    if not 0 <= noise <= 0.5:
        raise ValueError(f"noise must lie in [0, 0.5], got {noise}; it is a fraction of the sides of Pi")
    simplex = nelder_mead(policies, rng)

    def search(start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        if not getattr(inverse, "trusted", model.relative_error <= trust.error):
            yield from simplex(start, goal)
            return
        radius = _RADIUS
        thetas, outcomes, n_anchors = start.thetas, start.outcomes, len(start.thetas)
        first = policies.check("theta of the estimate", start.theta)[None]
        while True:
            nearest = np.linalg.norm(outcomes - goal, axis=1).argsort(kind="stable")[:_CANDIDATES]
            anchored = _anchored(model, policies, start.context, thetas[:n_anchors], outcomes[:n_anchors], trust)
            starts = anchored.tensor(np.vstack([first, thetas[nearest]]))
            theta = _best(anchored, propose, starts, goal, radius)
            theta = policies.clip(rng.normal(theta, noise * policies.sides)) if noise else policies.clip(theta)
            with torch.no_grad():
                predicted = anchored.predict(anchored.tensor(theta[None]))[0][0].cpu().double().numpy()
            outcome = yield theta
            misfit, change = math.dist(predicted, outcome), math.dist(predicted, outcomes[nearest[0]])
            if misfit < 0.5 * change:
                radius = min(radius * 1.5, _RADII[1])
            elif misfit > change:
                radius = max(radius / 2, _RADII[0])
            thetas, outcomes, first = np.vstack([thetas, theta]), np.vstack([outcomes, outcome]), first[:0]
            n_anchors += residual

    return search


def _anchored(
    model: ForwardModel, policies: Box, context: Array, thetas: Array, outcomes: Array, trust: Trust
) -> Anchored:
    """Predictions with the same anchors for all candidates, as if all were from this ``context``."""
    contexts = np.broadcast_to(context, (1, len(thetas), len(context)))
    return Anchored(model, policies, context, contexts, thetas[None], outcomes[None], trust)


def _best(
    anchored: Anchored,
    propose: Propose,
    starts: torch.Tensor,
    goal: Array,
    radius: float,
) -> Array:
    aim = anchored.tensor(goal[None])
    proposals = propose(anchored, starts, aim, radius)
    with torch.no_grad():
        return proposals[anchored.expected(proposals, aim).argmin()].cpu().double().numpy()
