"""Predictions of many movements by local Gaussian processes, compiled by numba. Import it through `compiled`."""

from __future__ import annotations

import numpy as np

from sgimd_torch.inverses.kernels import covariances, expected, fitted_process, variance_at
from sgimd_torch.memory.jit import LISTS, NUMBERS, TABLE, as_columns, compiled_for
from sgimd_torch.spaces import Array


@compiled_for(TABLE, TABLE, LISTS, TABLE, NUMBERS)
def predict(
    inputs: Array, outcomes: Array, near: np.ndarray, points: Array, kernel: Array
) -> tuple[Array, Array, Array]:
    """Expected outcomes ``(n, outcome_dim)`` of movements, their variances ``(n,)``, noise included, and the slopes of
    the outcomes by the inputs, ``(n, outcome_dim, dim)``.

    Args:
        inputs, outcomes: ``(rows, dim)``, in lengths, and ``(rows, outcome_dim)``, exemplars.
        near: ``(n, k)``, rows of the exemplars from which each movement is predicted.
        points: ``(n, dim)``, the movements in lengths.
        kernel: ``(4,)``, see `GaussianProcess`.
    """
    n, m, dim = len(points), outcomes.shape[1], points.shape[1]
    predictions, variances, slopes = np.empty((n, m)), np.empty(n), np.empty((n, m, dim))
    covariance, slope = np.empty(near.shape[1]), np.empty(near.shape[1])
    for i in range(n):
        rows, point = near[i].copy(), points[i].copy()
        process = fitted_process(as_columns(inputs, rows), as_columns(outcomes, rows), kernel)
        covariances(process.inputs, kernel, point, covariance, slope)
        predictions[i] = expected(process, covariance)
        variances[i] = variance_at(process, covariance) + process.variance * kernel[3]
        for k in range(m):
            weighted_slopes = process.weights[k] * slope
            slopes[i, k] = point * weighted_slopes.sum() - process.inputs @ weighted_slopes
    return predictions, variances, slopes
