"""A Gaussian process, which predicts outcomes and their variances from similar movements.

Our addition, not in the paper; Rasmussen & Williams (2006), chapters 2 and 5. All outcome dimensions share one kernel,
smooth plus rough, both Matern 5/2. The rough part explains what the smooth part cannot, so that only the noise stated
by the environment counts as noise.
    kernel = choose_kernel(groups, noise); process = Process(inputs, outcomes, kernel); process.predict(candidates)
Each input is divided by its length scale, see ``fit_lengths``; inputs are then "in lengths".
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, ParamSpec, TypeVar

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from threadpoolctl import ThreadpoolController

from sgimd_torch.memory import Rows
from sgimd_torch.spaces import Array

_BLAS: Final = ThreadpoolController()
_ROOT5: Final = np.sqrt(5)
_LEAST: Final = 1e-6  # least noise variance, relative to the kernel's; with less noise the matrix would be singular
_TINY: Final = 1e-300
_NOISES: Final = (_LEAST, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0)
_SCALES: Final = (0.5, 1.0, 2.0)
_ROUGH: Final = ((1.0, 0.0), *itertools.product((4.0, 12.0), (0.03, 0.1, 0.3, 0.6)))  # (finer, share)
_STEPS: Final = 30  # largest number of steps of the fit of lengths


Inputs = ParamSpec("Inputs")
Output = TypeVar("Output")


def one_thread(function: Callable[Inputs, Output]) -> Callable[Inputs, Output]:
    """Decorator: linear algebra in one thread. For these small matrices several threads are slower: on two cores a run
    of `practice` would take twice as long, on sixteen far longer."""
    found: Callable[Inputs, Output] = _BLAS.wrap(limits=1, user_api="blas")(function)
    return found


class Kernel(NamedTuple):
    """Kernel of variance 1. ``scale`` multiplies all inputs. The rough part has the ``share`` of the variance, and a
    length scale that is ``finer`` times shorter. ``noise`` is a variance, relative to the kernel's."""

    scale: float
    finer: float
    share: float
    noise: float

    def __call__(self, squared: Array) -> Array:
        """Covariances at these ``squared`` distances; 1 at distance 0."""
        distances = self.scale * np.sqrt(squared)
        return (1 - self.share) * _matern(distances) + self.share * _matern(self.finer * distances)

    def slope(self, squared: Array) -> Array:
        """Derivative of the covariance by the input, divided by the difference of the inputs."""
        distances = self.scale * np.sqrt(squared)
        rough = self.finer**2 * _matern_slope(self.finer * distances)
        return self.scale**2 * ((1 - self.share) * _matern_slope(distances) + self.share * rough)


class Process:
    """Gaussian process given some movements.

    Args:
        inputs: ``(n, dim)``, theta and context in lengths.
        outcomes: ``(n, outcome_dim)``.
        kernel: kernel of variance 1; the process multiplies it by the most likely variance.
    """

    def __init__(self, inputs: Array, outcomes: Array, kernel: Kernel) -> None:
        self.outcomes, self.kernel = outcomes, kernel
        self.mean = outcomes.mean(axis=0)
        n, dim = outcomes.shape
        try:
            lower = self._factor(inputs, origin=np.zeros(inputs.shape[1]))
        except np.linalg.LinAlgError:  # inputs far from 0, where rounding of squares hides small differences
            lower = self._factor(inputs, origin=inputs.mean(axis=0))
        root = solve_triangular(lower, np.eye(n), lower=True)
        self._root = root.T  # root of the inverse covariance: root times transpose is the inverse
        self._weights = self._root @ (root @ (outcomes - self.mean))  # (n, outcome_dim)
        self._precisions = (root * root).sum(axis=0)
        self.variance = max(float(((outcomes - self.mean) * self._weights).sum()) / (n * dim), _TINY)

    def _factor(self, inputs: Array, origin: Array) -> Array:
        """Cholesky factor ``(n, n)`` of the covariance of the inputs; from now on inputs are measured from
        ``origin``."""
        self._origin, self._inputs = origin, inputs - origin
        covariance = self.kernel(squared_distances(self._inputs, self._inputs))
        return np.asarray(np.linalg.cholesky(covariance + self.kernel.noise * np.eye(len(inputs))), dtype=np.float64)

    def _covariances(self, inputs: Array) -> Array:
        """Covariances ``(m, n)`` of new inputs ``(m, dim)`` with the inputs of the process."""
        return self.kernel(squared_distances(inputs - self._origin, self._inputs))

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Expected outcomes ``(m, outcome_dim)`` of new inputs ``(m, dim)``, and the variance ``(m,)`` of each
        dimension, without noise."""
        across = self._covariances(inputs)
        known = across @ self._root
        return across @ self._weights + self.mean, self.variance * np.maximum(1 - (known * known).sum(axis=1), 0)

    def expect(self, inputs: Array) -> Array:
        """Expected outcomes ``(m, outcome_dim)`` of new inputs ``(m, dim)``."""
        expected: Array = self._covariances(inputs) @ self._weights + self.mean
        return expected

    def without_noise(self, rows: Rows) -> tuple[Array, Array]:
        """Expected outcomes of the movements in ``rows`` without their noise, and their variances, as in `predict`."""
        noise = self.kernel.noise
        variances = self.variance * noise * np.maximum(1 - noise * self._precisions[rows], 0)
        return self.outcomes[rows] - noise * self._weights[rows], variances

    def surprise(self, rows: Rows) -> float:
        """Mean squared error of predicting each of ``rows`` from all other rows, divided by the expected squared error;
        1 if the variances of the process are right."""
        squared = (self._weights[rows] ** 2).mean(axis=1)
        return float((squared / self._precisions[rows]).mean()) / self.variance

    def jacobians(self, points: Array) -> Array:
        """Jacobians ``(m, outcome_dim, dim)`` of the expected outcomes at ``points`` ``(m, dim)``."""
        differences = (points - self._origin)[:, None] - self._inputs  # (m, n, dim)
        slopes = self.kernel.slope((differences * differences).sum(axis=2))
        found: Array = self._weights.T @ (slopes[..., None] * differences)
        return found


def fit_lengths(inputs: Array, outcomes: Array) -> Array:
    """Most likely length scale ``(dim,)`` of each input, relative to its standard deviation.

    Type II maximum likelihood by L-BFGS, with a weak prior. A length is at most twice the first guess, because few
    movements cannot show that an input has no effect.

    Args:
        inputs: ``(n, dim)`` of standard deviation 1; the time grows with n^3.
        outcomes: ``(n, outcome_dim)``, not all the same.
    """
    n, dim = inputs.shape
    deviations = outcomes - outcomes.mean(axis=0)
    deviations = deviations / deviations.std()
    guess = np.log(1.5 * np.sqrt(dim))
    squares = inputs * inputs

    def loss(parameters: Array) -> tuple[float, Array]:
        shrunk, noise = np.exp(-parameters[:dim]), float(np.exp(parameters[dim]))
        scaled = inputs * shrunk
        distances = np.sqrt(squared_distances(scaled, scaled))
        root = np.linalg.inv(np.linalg.cholesky(_matern(distances) + noise * np.eye(n)))
        inverse = root.T @ root
        weights = inverse @ deviations
        variance = (deviations * weights).mean()
        by_covariance = 0.5 * (deviations.shape[1] * inverse - weights @ weights.T / variance)
        by_square = -by_covariance * _matern_slope(distances)
        off = (parameters[:dim] - guess) / 1.5
        gradient = 2 * (by_square.sum(axis=1) @ squares - (inputs * (by_square @ inputs)).sum(axis=0)) * shrunk**2
        likelihood = 0.5 * deviations.size * np.log(variance) - deviations.shape[1] * np.log(np.diag(root)).sum()
        value = float(likelihood + 0.5 * (off * off).sum())
        return value, np.append(gradient + off / 1.5, noise * np.trace(by_covariance))

    bounds = [(guess - 5, guess + np.log(2))] * dim + [(np.log(_LEAST), np.log(3))]
    start = np.append(np.full(dim, guess), np.log(0.05))
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
    return np.exp(found.x[:dim])


def choose_kernel(groups: Sequence[tuple[Array, Array]], noise: float) -> Kernel:
    """The most likely kernel of a grid, over all groups of neighbours together.

    Args:
        groups: pairs of inputs ``(n, dim)``, in lengths, and outcomes ``(n, outcome_dim)``, not all the same.
        noise: standard deviation of each outcome dimension, as the environment states it. Near some movements it may be
            twice or half as large, so other values are less likely, but possible. With 0 there is no noise.
    """
    noises = np.array(_NOISES if noise > 0 else [_LEAST])
    scores: dict[tuple[float, float, float], Array] = {}
    for inputs, outcomes in groups:
        squared, deviations = squared_distances(inputs, inputs), outcomes - outcomes.mean(axis=0)
        n, dim = outcomes.shape
        for scale, (finer, share) in itertools.product(_SCALES, _ROUGH):
            values, vectors = np.linalg.eigh(Kernel(scale, finer, share, 0.0)(squared))
            spectrum = np.maximum(values, 0) + noises[:, None]  # (noises, n)
            projected = ((vectors.T @ deviations) ** 2).sum(axis=1)
            variances = np.maximum((projected / spectrum).sum(axis=1) / (n * dim), _TINY)
            score = -0.5 * dim * (n * np.log(variances) + np.log(spectrum).sum(axis=1))
            if noise > 0:
                score -= 2 * dim * np.log(noises * variances / noise**2) ** 2 * n / 60
            scores[scale, finer, share] = scores.get((scale, finer, share), np.zeros(len(noises))) + score
    best = max(scores, key=lambda each: scores[each].max())
    return Kernel(*best, noise=float(noises[scores[best].argmax()]))


def squared_distances(one: Array, other: Array) -> Array:
    """Squared distances ``(n, m)`` between the rows of two arrays."""
    products = (one * one).sum(axis=1)[:, None] + (other * other).sum(axis=1) - 2 * one @ other.T
    return np.maximum(products, 0)


def _matern(distances: Array) -> Array:
    """Matern 5/2 kernel."""
    return (1 + _ROOT5 * distances + 5 / 3 * distances**2) * np.exp(-_ROOT5 * distances)


def _matern_slope(distances: Array) -> Array:
    """Derivative of the Matern 5/2 kernel, divided by the distance."""
    return -5 / 3 * (1 + _ROOT5 * distances) * np.exp(-_ROOT5 * distances)
