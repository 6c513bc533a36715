"""A search by the gradient of the forward model, towards reliable movements that land nearer to the goal.

Not in Nguyen & Oudeyer (2014); an alternative to the simplex of section 4.4.2, which needs no model.
    search = GradientSearch(problem); movements = search(estimate, goal); theta = next(movements)
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Final

import numpy as np
import torch

from sgimd_torch.forward_model.anchored import Anchored
from sgimd_torch.forward_model.shared import model_of, uses_model
from sgimd_torch.parts import Problem, Search
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.spaces import Array, Estimate

_CANDIDATES: Final = 5  # number of remembered movements to start from
_STEPS: Final = 5  # number of steps of a descent
_STEP: Final = 0.03  # size of a step, relative to the sides of Pi
_RADIUS: Final = 0.15  # first radius of the trust region, relative to the sides of Pi (root mean square)
_LEAST_RADIUS: Final = 0.02  # smaller steps are lost in the noise
_GREATEST_RADIUS: Final = 0.3  # larger steps leave the anchors


class GradientSearch(Search):
    """Gradient descent through the forward model; until the model is trusted, Nelder-Mead simplex (extra forward).

    Each movement is the best result of descents from theta_g and from the movements that landed nearest. The anchors of
    predictions are the exemplars of the estimate and the movements of the search, so the model's errors near the goal
    correct the next prediction. A descent stays in a trust region, which grows after a good prediction and shrinks
    after a bad one. The search never ends.

    Args:
        problem: problem to learn.
        noise: standard deviation of the noise of every movement, as a fraction of each parameter's range in Pi; without
            noise the memory soon holds too few different movements.

    Raises:
        ValueError: ``noise`` is not in [0, 0.5].
    """

    def __init__(self, problem: Problem, *, noise: float = 0.05) -> None:
        super().__init__(problem)
        if not 0 <= noise <= 0.5:
            raise ValueError(f"noise must lie in [0, 0.5], got {noise}; it is a fraction of the sides of Pi")
        self.model, self.noise, self._simplex = model_of(problem), noise, NelderMead(problem)

    @property
    def by_model(self) -> bool:
        """Whether the next search is by the model; false: the model is not trusted."""
        return uses_model(self.problem.inverse, self.model)

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements near ``start``; each depends on the outcomes of earlier ones."""
        if not self.by_model:
            yield from self._simplex(start, goal)
            return
        self.model.guides, policies = True, self.problem.policies
        first = policies.check("theta of the estimate", start.theta)[None]
        radius, thetas, outcomes = _RADIUS, start.thetas, start.outcomes
        while True:
            nearest = np.linalg.norm(outcomes - goal, axis=1).argsort(kind="stable")[:_CANDIDATES]
            contexts = np.broadcast_to(start.context, (1, len(thetas), len(start.context)))
            # All candidates share these anchors, which count as if executed in the context of the goal.
            anchored = Anchored(self.model, policies, start.context, contexts, thetas[None], outcomes[None])
            starts = np.vstack([first, thetas[nearest]])[None]
            theta = anchored.best(starts, goal[None], steps=_STEPS, step=_STEP, radius=radius)[0]
            theta = policies.clip(self.rng.normal(theta, self.noise * policies.sides) if self.noise else theta)
            with torch.no_grad():
                predicted = anchored.predict(anchored.tensor(theta[None]))[0][0].cpu().double().numpy()
            outcome = yield theta
            misfit, change = math.dist(predicted, outcome), math.dist(predicted, outcomes[nearest[0]])
            if misfit < 0.5 * change:
                radius = min(radius * 1.5, _GREATEST_RADIUS)
            elif misfit > change:
                radius = max(radius / 2, _LEAST_RADIUS)
            thetas, outcomes, first = np.vstack([thetas, theta]), np.vstack([outcomes, outcome]), first[:0]
