"""Lengths and kernel of a Gaussian process, which predicts outcomes from similar movements.

Our addition, not in the paper; Rasmussen & Williams (2006), chapters 2 and 5. All outcome dimensions share one kernel,
smooth plus rough, both rational quadratic (eq. 4.19, alpha 3). The rough part explains what the smooth part cannot, so
that only the noise stated by the environment counts as noise.
    lengths = fit_lengths(inputs, outcomes); kernel = choose_kernel(groups, noise)
Each input is divided by its length scale, see ``fit_lengths``; inputs are then "in lengths".
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Final, ParamSpec, TypeVar

import numpy as np
from scipy.linalg.lapack import dormqr, dpotrf, dpotri, dpotrs, dsytrd
from scipy.optimize import minimize
from threadpoolctl import ThreadpoolController

from sgimd_torch.inverses.tuples import Kernel
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.spaces import Array

_BLAS: Final = ThreadpoolController()
_LEAST_NOISE: Final = 1e-6  # least noise variance, relative to the kernel's; with less the matrix would be singular
_NOISES: Final = (_LEAST_NOISE, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0)  # of the grid of kernels
_SCALES: Final = (0.5, 1.0, 2.0)  # of the grid of kernels
_ROUGH: Final = ((1.0, 0.0), *itertools.product((4.0, 12.0), (0.03, 0.1, 0.3, 0.6)))  # (finer, share) of the grid
_SMOOTH: Final = Kernel(1.0, 1.0, 0.0, 0.0)
_STEPS: Final = 30  # largest number of steps of the fit of lengths
_ENOUGH: Final = 1e-4  # relative gain of likelihood below which the fit of lengths ends


Inputs = ParamSpec("Inputs")
Output = TypeVar("Output")


def one_thread(function: Callable[Inputs, Output]) -> Callable[Inputs, Output]:
    """Decorator: linear algebra in one thread. For these small matrices several threads are slower: on two cores a life
    of the learner `practice` would take twice as long, on sixteen far longer."""
    limited: Callable[Inputs, Output] = _BLAS.wrap(limits=1, user_api="blas")(function)
    return limited


def fit_lengths(inputs: Array, outcomes: Array) -> Array:
    """Most likely length scale ``(dim,)`` of each input, relative to its standard deviation.

    Type II maximum likelihood by L-BFGS, with a weak prior. A length is at most twice the first guess, because few
    movements cannot show that an input has no effect.

    Args:
        inputs: ``(n, dim)`` of standard deviation 1; the time grows with n^3.
        outcomes: ``(n, outcome_dim)``, not all the same.
    """
    dim = inputs.shape[1]
    deviations = outcomes - outcomes.mean(axis=0)
    deviations = deviations / deviations.std()
    guess = np.log(1.5 * np.sqrt(max(1, np.ptp(inputs, axis=0).astype(bool).sum())))  # constant inputs do not count
    transposed, kernels = np.ascontiguousarray(inputs.T), compiled("sgimd_torch.inverses.kernels")

    def loss(parameters: Array) -> tuple[float, Array]:
        scaled, noise = transposed * np.exp(-parameters[:dim, None]), float(np.exp(parameters[dim]))
        covariance, slopes = kernels.covariance_matrix(scaled, _SMOOTH)  # slopes: its derivatives by inputs
        covariance.flat[:: len(inputs) + 1] += noise
        # The lower half of an array of C is the upper half of an array of Fortran.
        factor, failed = dpotrf(covariance.T, lower=False, overwrite_a=True)
        if failed:
            raise np.linalg.LinAlgError("the covariance is not positive definite")
        half_log_determinant = np.log(np.diag(factor)).sum()
        weights, _ = dpotrs(factor, deviations, lower=False)
        inverse, _ = dpotri(factor, lower=False, overwrite_c=True)
        variance = (deviations * weights).mean()
        by_lengths, by_noise = kernels.gradient(scaled, inverse.T, np.ascontiguousarray(weights.T), slopes, variance)
        from_guess = (parameters[:dim] - guess) / 1.5
        cost = 0.5 * deviations.size * np.log(variance) + deviations.shape[1] * half_log_determinant
        value = float(cost + 0.5 * (from_guess * from_guess).sum())
        return value, np.append(by_lengths + from_guess / 1.5, noise * by_noise)

    bounds = [(guess - 5, guess + np.log(2))] * dim + [(np.log(_LEAST_NOISE), np.log(3))]
    start = np.append(np.full(dim, guess), np.log(0.05))
    fit = minimize(
        loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS, "ftol": _ENOUGH}
    )
    return np.exp(fit.x[:dim])


def choose_kernel(groups: Sequence[tuple[Array, Array]], noise: float) -> Kernel:
    """The most likely kernel of a grid, over all groups of neighbours together.

    Args:
        groups: pairs of inputs ``(n, dim)``, in lengths, and outcomes ``(n, outcome_dim)``, not all the same.
        noise: standard deviation of each outcome dimension, as the environment states it. Near some movements it may be
            twice or half as large, so other values are less likely, but possible. With 0 there is no noise.
    """
    noises = np.array(_NOISES if noise > 0 else [_LEAST_NOISE])
    grid = [Kernel(scale, *rough, 0.0) for scale, rough in itertools.product(_SCALES, _ROUGH)]
    scores = np.zeros((len(grid), len(noises)))
    kernels = compiled("sgimd_torch.inverses.kernels")
    for inputs, outcomes in groups:
        deviations, inputs = outcomes - outcomes.mean(axis=0), np.ascontiguousarray(inputs.T)
        for row, kernel in zip(scores, grid, strict=True):
            covariance, _ = kernels.covariance_matrix(inputs, kernel)
            # Tridiagonal once, so that each noise is cheap: by reflections of all movements but the first.
            reflections, diagonal, beside_diagonal, factors, _ = dsytrd(covariance, lower=True)
            others, _, _ = dormqr("L", "T", reflections[1:, :-1], factors, deviations[1:], 64 * deviations.shape[1])
            reflected = np.concatenate((deviations[:1], others)).T.copy()
            row += kernels.scores(diagonal, beside_diagonal, reflected, noises, float(noise))
    best_row, best_noise = np.unravel_index(scores.argmax(), scores.shape)
    return grid[int(best_row)]._replace(noise=float(noises[best_noise]))
