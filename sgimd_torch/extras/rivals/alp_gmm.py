"""ALP-GMM: goals from Gaussians of high absolute learning progress, a rival of the interest map without regions.

Portelas, Colas, Hofmann & Oudeyer, Teacher algorithms for curriculum learning of deep RL in continuously parameterized
environments (CoRL 2019). Progress at a goal is |competence - competence at the nearest earlier goal|. A mixture of
Gaussians over (context, goal, progress) is fitted every 50 goals, and shows where progress is high. This module needs
scikit-learn.    goals = AlpGmm(problem)
"""

from __future__ import annotations

import warnings
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.uniform import check_attempt, check_in
from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array, check_count

try:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture
except ImportError as error:
    raise ImportError(f"ALP-GMM needs scikit-learn: pip install 'sgimd-torch[rivals]' ({error})") from error

_DRAWS: Final = 20  # number of draws from a Gaussian; the first that lies in T is the goal
# Number of goals between two fits; before the first fit, goals are uniform. Deviation: 250 in the publication, which is
# half of the goals of a run on the rod.
_REFIT: Final = 50
_COMPONENTS: Final = 10  # largest number of Gaussians; Akaike's criterion chooses a number from 2 on


class AlpGmm(Goals):
    """Goals from Gaussians of high absolute learning progress.

    Without contexts a Gaussian is chosen in proportion to its mean progress, and a goal is drawn from it. With
    contexts, the mean progress is multiplied by the density at the context, and the goal is drawn from the Gaussian
    given this context. A goal outside T is drawn again, and clipped after 20 draws. All distances are relative to the
    sides of C x T.

    Args:
        problem: problem to learn.
        memory: number of last goals to which the mixture is fitted.
        uniform: probability of a goal that is uniform in T.

    Raises:
        ValueError: a number is out of its range.
    """

    def __init__(self, problem: Problem, *, memory: int = 250, uniform: float = 0.2) -> None:
        super().__init__(problem)
        self.memory = check_count("memory", memory, _COMPONENTS)
        if not 0 <= uniform <= 1:
            raise ValueError(f"uniform must be a probability, got {uniform}")
        self.uniform = uniform
        self.contexts, self.outcomes = contexts, outcomes = problem.contexts, problem.outcomes
        self._low = np.concatenate((contexts.low, outcomes.low))
        self._sides = np.concatenate((contexts.sides, outcomes.sides))
        self._points = np.empty((0, len(self._low)))  # relative to the sides of C x T
        self._competences = np.empty(0)
        self._progress = np.empty(0)
        self._fitted = 0  # number of goals at the last fit
        self._mixture: GaussianMixture | None = None

    def sample(self, context: ArrayLike) -> Array:
        """A goal ``(outcome_dim,)`` in T; the mixture is fitted first if a fit is due.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context = check_in(self.contexts, "context", context)
        if len(self._points) >= self._fitted + _REFIT:
            self._mixture, self._fitted = self._fit(), len(self._points)
        if self._mixture is None or self.rng.random() < self.uniform:
            return self.outcomes.sample(self.rng)
        return self._draw(self._mixture, (context - self.contexts.low) / self.contexts.sides)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Learn the competence at a goal, and its progress since the nearest earlier goal; of equally near goals the
        latest counts.

        Raises:
            ValueError: see `Goals.add`.
        """
        point = (check_attempt(self.problem, context, goal, competence, gain) - self._low) / self._sides
        progress = 0.0
        if len(self._points):
            apart = np.square(self._points - point).sum(axis=1)
            progress = abs(competence - self._competences[::-1][apart[::-1].argmin()])
        self._points = np.vstack((self._points, point))
        self._competences = np.append(self._competences, competence)
        self._progress = np.append(self._progress, progress)

    def _fit(self) -> GaussianMixture:
        """The best mixture of 2 to 10 Gaussians over the last goals, by Akaike's criterion."""
        rows = np.column_stack((self._points, self._progress))[-self.memory :]
        seed = int(self.rng.integers(2**32))
        with warnings.catch_warnings():
            # Akaike's criterion also compares mixtures that have not converged, for example because goals coincide.
            warnings.simplefilter("ignore", ConvergenceWarning)
            numbers = range(2, _COMPONENTS + 1)
            mixtures = [GaussianMixture(number, random_state=seed).fit(rows) for number in numbers]
        return min(mixtures, key=lambda mixture: mixture.aic(rows))

    def _draw(self, mixture: GaussianMixture, context: Array) -> Array:
        """A goal from one of the Gaussians, given the ``context`` relative to the sides of C."""
        c, g = slice(self.contexts.dim), slice(self.contexts.dim, -1)
        means, covariances = mixture.means_, mixture.covariances_
        away = context - means[:, c]  # (components, context_dim)
        scaled = np.linalg.solve(covariances[:, c, c], away[:, :, None])[:, :, 0]
        densities = -0.5 * ((away * scaled).sum(axis=1) + np.linalg.slogdet(covariances[:, c, c])[1])  # logarithms
        weights = np.maximum(means[:, -1], 0.0) * np.exp(densities - densities.max())
        if not weights.any():  # no progress anywhere
            return self.outcomes.sample(self.rng)
        k = self.rng.choice(len(weights), p=weights / weights.sum())
        gain = np.linalg.solve(covariances[k, c, c], covariances[k, c, g]).T  # (outcome_dim, context_dim)
        mean = means[k, g] + gain @ away[k]
        spread = np.linalg.cholesky(covariances[k, g, g] - gain @ covariances[k, c, g])
        draws = mean + self.rng.standard_normal((_DRAWS, self.outcomes.dim)) @ spread.T
        goals = self.outcomes.low + self.outcomes.sides * draws
        return self.outcomes.clip(goals[self.outcomes.contains(goals).argmax()])
