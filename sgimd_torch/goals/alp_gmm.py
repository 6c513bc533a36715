"""ALP-GMM: goals from Gaussians of high absolute learning progress, a rival of the interest map without regions.

Portelas, Colas, Hofmann & Oudeyer, Teacher algorithms for curriculum learning of deep RL in continuously parameterized
environments (CoRL 2019). Progress at a goal is |competence - competence at the nearest earlier goal|. A mixture of
Gaussians over (context, goal, progress) is fitted from time to time, and shows where progress is high. Needs
scikit-learn.    goals = AlpGmm(contexts, outcomes, rng)
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.protocol import check_attempt, check_in
from sgimd_torch.spaces import Array, Box, check_count

try:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture
except ImportError as error:
    raise ImportError(f"ALP-GMM needs scikit-learn: pip install 'sgimd-torch[rivals]' ({error})") from error

_DRAWS = 20  # from a Gaussian; the first that lies in T is the goal


class AlpGmm:
    """Goals from a mixture of Gaussians over (context, goal, absolute learning progress).

    Without contexts a Gaussian is chosen in proportion to its mean progress, and a goal is drawn from it. In a context
    it is chosen in proportion to its mean progress times its density there, and the goal is drawn from the Gaussian
    given this context. Distances are measured in sides of C x T.

    Args:
        contexts: C; ``dim`` 0 when there is only one context.
        outcomes: T. A goal drawn outside is drawn again, and clipped if 20 draws lie outside.
        rng: the only source of draws; ``add`` draws nothing.
        refit: goals between two fits; before the first fit, goals are uniform. Deviation: the publication waits for 250
            goals, half of what a run on the rod has.
        memory: how many of the last goals are fitted. The nearest earlier goal is looked for among all goals.
        components: the largest number of Gaussians. Akaike's criterion chooses a number from 2 to this.
        uniform: probability of a goal anywhere in T.

    Raises:
        ValueError: a number out of its range.
    """

    def __init__(
        self,
        contexts: Box,
        outcomes: Box,
        rng: np.random.Generator,
        *,
        refit: int = 50,
        memory: int = 250,
        components: int = 10,
        uniform: float = 0.2,
    ) -> None:
        self.components = check_count("components", components, 2)
        self.refit = check_count("refit", refit, 1)
        self.memory = check_count("memory", memory, 2)
        if min(refit, memory) < components:
            raise ValueError(f"refit and memory must be at least components={components}, got {refit} and {memory}")
        if not 0 <= uniform <= 1:
            raise ValueError(f"uniform must be a probability, got {uniform}")
        self.contexts, self.outcomes, self.uniform = contexts, outcomes, uniform
        self._rng = rng
        self._low = np.concatenate((contexts.low, outcomes.low))
        self._sides = np.concatenate((contexts.sides, outcomes.sides))
        self._points = np.empty((0, len(self._low)))  # in sides of C x T
        self._competences = np.empty(0)
        self._progress = np.empty(0)
        self._fitted = 0  # goals known at the last fit
        self._mixture: GaussianMixture | None = None

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` in T; fits the mixture first when that is due.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context = check_in(self.contexts, "context", context)
        if len(self._points) >= self._fitted + self.refit:
            self._mixture, self._fitted = self._fit(), len(self._points)
        if self._mixture is None or self._rng.random() < self.uniform:
            return self.outcomes.sample(self._rng)
        return self._draw(self._mixture, (context - self.contexts.low) / self.contexts.sides)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Competence was measured at a goal: how far is it from that at the nearest earlier goal, the latest of equals?

        Raises:
            ValueError: see `Goals.add`.
        """
        point = (check_attempt(self.contexts, self.outcomes, context, goal, competence, gain) - self._low) / self._sides
        progress = 0.0
        if len(self._points):
            apart = np.square(self._points - point).sum(axis=1)
            progress = abs(competence - self._competences[::-1][apart[::-1].argmin()])
        self._points = np.vstack((self._points, point))
        self._competences = np.append(self._competences, competence)
        self._progress = np.append(self._progress, progress)

    def _fit(self) -> GaussianMixture:
        """The best mixture of 2, 3 ... Gaussians over the last goals, by Akaike's criterion."""
        rows = np.column_stack((self._points, self._progress))[-self.memory :]
        seed = int(self._rng.integers(2**32))
        with warnings.catch_warnings():
            # Akaike's criterion may also judge a mixture of goals that coincide, or one that has not quite converged.
            warnings.simplefilter("ignore", ConvergenceWarning)
            numbers = range(2, self.components + 1)
            mixtures = [GaussianMixture(number, random_state=seed).fit(rows) for number in numbers]
        return min(mixtures, key=lambda mixture: mixture.aic(rows))

    def _draw(self, mixture: GaussianMixture, context: Array) -> Array:
        """A goal from one of the Gaussians, given the context in sides of C."""
        c, g = slice(self.contexts.dim), slice(self.contexts.dim, -1)
        means, covariances = mixture.means_, mixture.covariances_
        away = context - means[:, c]  # (components, context_dim)
        scaled = np.linalg.solve(covariances[:, c, c], away[:, :, None])[:, :, 0]
        densities = -0.5 * ((away * scaled).sum(axis=1) + np.linalg.slogdet(covariances[:, c, c])[1])  # logarithms
        weights = np.maximum(means[:, -1], 0.0) * np.exp(densities - densities.max())
        if not weights.any():  # no progress anywhere
            return self.outcomes.sample(self._rng)
        k = self._rng.choice(len(weights), p=weights / weights.sum())
        gain = np.linalg.solve(covariances[k, c, c], covariances[k, c, g]).T  # (outcome_dim, context_dim)
        mean = means[k, g] + gain @ away[k]
        spread = np.linalg.cholesky(covariances[k, g, g] - gain @ covariances[k, c, g])
        draws = mean + self._rng.standard_normal((_DRAWS, self.outcomes.dim)) @ spread.T
        goals = self.outcomes.low + self.outcomes.sides * draws
        return self.outcomes.clip(goals[self.outcomes.contains(goals).argmax()])
