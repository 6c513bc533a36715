"""What `LocalProcess` computes for one goal, compiled by numba.

A local Gaussian process is fitted to a hundred movements and asked about some fifty candidates, by arrays so small that
calls of numpy would take ten times as long as their arithmetic. Compiled functions release Python's lock.
Loops write rows, because for a row assignment numba compiles the text of an error, which takes 1.6 s.
Import this module through `compiled`: loading numba takes half a second.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import float64, types

from sgimd_torch.inverses.tuples import GaussianProcess, Kernel, Movements, Predictions, Question
from sgimd_torch.memory.jit import (
    LISTS,
    NUMBERS,
    ROWS,
    TABLE,
    as_columns,
    compiled_for,
    factorised,
    jit_helper,
    solve,
    solve_lower,
    solve_transposed,
    squared_distance,
)
from sgimd_torch.spaces import Array

STEPS: Final = 4  # largest number of Gauss-Newton steps from each start
JUDGED: Final = 20  # number of movements most like a start, on which the surprise of its process is measured
DAMPINGS: Final = (1e-3, 0.1, 1.0, 10.0)  # all tried in each step, relative to the mean diagonal of J J^T
GROSS: Final = 9.0  # squared residual, relative to the usual one, from which on an exemplar is a gross error
DETERMINED: Final = 0.5  # variance of an outcome given all others, relative to the kernel's, below which they judge it
OUTLIERS: Final = 20  # largest number of gross errors among the exemplars of a process
USUAL: Final = 4.0  # largest squared residual that counts in full when the usual one is computed
TINY: Final = 1e-300  # guard against 0 where a number is divided or its logarithm is taken
KERNEL: Final = types.NamedUniTuple(float64, 4, Kernel)  # type: ignore[no-untyped-call]
MOVEMENTS: Final = types.NamedTuple([TABLE, TABLE, TABLE, TABLE, NUMBERS, TABLE], Movements)  # type: ignore[no-untyped-call]
QUESTION: Final = types.NamedTuple([NUMBERS, NUMBERS, ROWS, LISTS, ROWS, NUMBERS], Question)  # type: ignore[no-untyped-call]


@jit_helper
def covariances(inputs: Array, kernel: Kernel, point: Array, covariance: Array, slope: Array) -> None:
    """Write the covariances of ``point`` ``(dim,)`` with the first ``len(covariance)`` of ``inputs`` ``(dim, n)``, and
    slopes: the derivative of covariance j by the point is slope_j (point - input_j)."""
    scale, finer, share, _ = kernel
    n = len(covariance)
    covariance[:] = 0
    for k in range(len(point)):
        for j in range(n):
            covariance[j] += (inputs[k, j] - point[k]) ** 2
    smooth, rough = scale**2 / 6, (finer * scale) ** 2 / 6
    for j in range(n):
        near = 1 / (1 + smooth * covariance[j])
        if share > 0:
            nearer = 1 / (1 + rough * covariance[j])
            covariance[j] = (1 - share) * near**3 + share * nearer**3
            slope[j] = -6 * ((1 - share) * smooth * near**4 + share * rough * nearer**4)
        else:
            covariance[j], slope[j] = near**3, -6 * smooth * near**4


@compiled_for(TABLE, KERNEL)
def covariance_matrix(inputs: Array, kernel: Kernel) -> tuple[Array, Array]:
    """Covariance matrix ``(n, n)`` of ``inputs`` ``(dim, n)``, without noise, and its slopes, see `covariances`; the
    lower halves alone."""
    n = inputs.shape[1]
    covariance, slopes = np.zeros((n, n)), np.empty((n, n))
    for i in range(n):
        covariances(inputs, kernel, inputs[:, i].copy(), covariance[i, : i + 1], slopes[i, : i + 1])
    return covariance, slopes


@jit_helper
def fitted_process(rows: np.ndarray, inputs: Array, outcomes: Array, kernel: Kernel) -> tuple[GaussianProcess, Array]:
    """The process of the movements in ``rows`` of ``inputs`` and ``outcomes``, and its `precisions`.

    The movement that all others contradict most gets the noise that explains it, then the next one, until none is
    contradicted. So gross errors, such as those of a camera that loses the object, hardly count. A movement far from
    all others is contradicted by none."""
    n, inputs, outcomes = len(rows), as_columns(inputs, rows), as_columns(outcomes, rows)
    process = process_of(inputs, outcomes, kernel)
    precision = precisions(process.factor)
    for _ in range(OUTLIERS):
        largest, outlier, usual = 0.0, 0, 0.0
        for j in range(n):
            residual = squared_residual(process, j, precision[j])
            usual += min(residual, USUAL) / n
            if residual > largest and 1 / precision[j] < DETERMINED:
                largest, outlier = residual, j
        if largest < GROSS * max(1.0, usual):
            break
        process = with_noise(process, precision, outlier, (largest - 1) / precision[outlier])
    return process, precision


@jit_helper
def process_of(inputs: Array, outcomes: Array, kernel: Kernel) -> GaussianProcess:
    """The process of these movements, columns of ``inputs`` and ``outcomes``, all with the same noise."""
    m, n = outcomes.shape
    covariance, _ = covariance_matrix(inputs, kernel)
    factor, weights, mean, variance = factorised(covariance, kernel.noise), np.empty((m, n)), np.empty(m), 0.0
    for k in range(m):
        mean[k] = outcomes[k].sum() / n
        for j in range(n):
            weights[k, j] = outcomes[k, j] - mean[k]
        solve_lower(factor, weights[k])
        variance += weights[k] @ weights[k] / (n * m)
        solve_transposed(factor, weights[k])
    return GaussianProcess(inputs, kernel, factor, np.full(n, kernel.noise), weights, mean, max(variance, TINY))


@jit_helper
def with_noise(process: GaussianProcess, precision: Array, outlier: int, noise: float) -> GaussianProcess:
    """The process with this variance added to the noise of one movement, and its ``precision``, both in place: updates
    of rank one, of the inverse covariance by Sherman and Morrison's formula, of the factor by rotations."""
    factor, weights, variance, (m, n) = process.factor, process.weights, process.variance, process.weights.shape
    column, change = np.zeros(n), np.zeros(n)
    column[outlier], change[outlier] = 1.0, np.sqrt(noise)
    solve_lower(factor, column)
    solve_transposed(factor, column)
    shrinking = noise / (1 + noise * column[outlier])
    for j in range(n):
        precision[j] -= shrinking * column[j] ** 2
    for k in range(m):
        weight = weights[k, outlier]
        for j in range(n):
            weights[k, j] -= shrinking * weight * column[j]
        variance -= shrinking * weight**2 / (n * m)
    process.noises[outlier] += noise
    for k in range(outlier, n):
        diagonal = np.sqrt(factor[k, k] ** 2 + change[k] ** 2)
        cosine, sine = factor[k, k] / diagonal, change[k] / diagonal
        factor[k, k] = diagonal
        for i in range(k + 1, n):
            below = factor[i, k]
            factor[i, k], change[i] = cosine * below + sine * change[i], cosine * change[i] - sine * below
    return GaussianProcess(
        process.inputs, process.kernel, factor, process.noises, weights, process.mean, max(variance, TINY)
    )


@jit_helper
def precisions(factor: Array) -> Array:
    """Diagonal ``(n,)`` of the inverse covariance."""
    n = len(factor)
    root, diagonal = np.zeros((n, n)), np.zeros(n)
    for i in range(n):  # row i of the inverse factor
        whole = i - i % 4
        for k in range(0, whole, 4):  # four rows at a time; right of its diagonal a row is 0
            for j in range(k + 4):
                root[i, j] -= (
                    factor[i, k] * root[k, j]
                    + factor[i, k + 1] * root[k + 1, j]
                    + factor[i, k + 2] * root[k + 2, j]
                    + factor[i, k + 3] * root[k + 3, j]
                )
        for k in range(whole, i):
            for j in range(k + 1):
                root[i, j] -= factor[i, k] * root[k, j]
        for j in range(i):
            root[i, j] /= factor[i, i]
        root[i, i] = 1 / factor[i, i]
        for j in range(i + 1):
            diagonal[j] += root[i, j] ** 2
    return diagonal


@jit_helper
def squared_residual(process: GaussianProcess, j: int, precision: float) -> float:
    """Squared error of predicting movement ``j`` from all others, divided by the expected one, eq. (5.12) of Rasmussen
    & Williams."""
    total = 0.0
    for k in range(len(process.weights)):
        total += process.weights[k, j] ** 2
    return total / precision / (len(process.weights) * process.variance)


@jit_helper
def variance_at(process: GaussianProcess, covariance: Array) -> float:
    """Variance of the outcome of a point that has this ``covariance`` with the inputs, without noise."""
    known = covariance.copy()
    solve_lower(process.factor, known)
    return process.variance * max(1 - float(known @ known), 0.0)


@jit_helper
def expected(process: GaussianProcess, covariance: Array) -> Array:
    """Expected outcome of a point that has this ``covariance`` with the inputs."""
    return process.weights @ covariance + process.mean


@jit_helper
def expected_error(process: GaussianProcess, goal: Array, inflation: float, covariance: Array, limit: float) -> float:
    """Squared bias plus ``inflation`` times the variance; the squared bias alone if that is ``limit`` or more."""
    error = squared_distance(expected(process, covariance), goal)
    return error if error >= limit else error + inflation * variance_at(process, covariance)


@jit_helper
def in_lengths(theta: Array, context: Array, units: Array) -> Array:
    """Input ``(dim,)`` of the process, see `Movements`."""
    point, t = np.empty(units.shape[1]), len(theta)
    for k in range(len(point)):
        point[k] = ((theta[k] if k < t else context[k - t]) - units[0, k]) / units[1, k]
    return point


@jit_helper
def descend(
    process: GaussianProcess, start: Array, context: Array, goal: Array, known: Movements, inflation: float
) -> tuple[float, Array]:
    """Least expected squared error, and its theta, after damped Gauss-Newton steps from ``start`` ``(theta_dim,)``.
    Steps end when they do not help; they have the least norm, so unimportant parameters hardly change."""
    units, spreads, box = known.units, known.spreads, known.box
    n, t, m = process.inputs.shape[1], len(start), len(goal)
    least, best = np.inf, start
    covariance, slope = np.empty((1 + len(DAMPINGS), n)), np.empty((1 + len(DAMPINGS), n))
    tried, jacobian = np.empty((len(DAMPINGS), t)), np.empty((m, t))
    covariances(process.inputs, process.kernel, in_lengths(best, context, units), covariance[0], slope[0])
    for _ in range(STEPS):
        point = in_lengths(best, context, units)
        for k in range(m):
            weighted_slopes = process.weights[k] * slope[0]
            weighted_inputs = process.inputs @ weighted_slopes
            for i in range(t):
                jacobian[k, i] = (point[i] * weighted_slopes.sum() - weighted_inputs[i]) * spreads[i] / units[1, i]
        residual, gram = goal - expected(process, covariance[0]), jacobian @ jacobian.T
        mean_gram, best_try = np.trace(gram) / m + TINY, 0  # best_try 0: no try is better
        for d in range(len(DAMPINGS)):
            pull = residual.copy()
            solve(gram, mean_gram * DAMPINGS[d], pull)
            step = pull @ jacobian
            for i in range(t):
                tried[d, i] = min(max(best[i] + spreads[i] * step[i], box[0, i]), box[1, i])
            point = in_lengths(tried[d], context, units)
            covariances(process.inputs, process.kernel, point, covariance[1 + d], slope[1 + d])
            error = expected_error(process, goal, inflation, covariance[1 + d], least)
            if error < least:
                least, best_try = error, 1 + d
        if not best_try:
            break
        best = tried[best_try - 1].copy()
        for j in range(n):
            covariance[0, j], slope[0, j] = covariance[best_try, j], slope[best_try, j]
    return least, best


@compiled_for(QUESTION, MOVEMENTS, KERNEL)
def answer(question: Question, known: Movements, kernel: Kernel) -> tuple[Array, Array, float]:
    """theta of the candidate with the least expected squared error, noise included, its expected outcome, and the
    standard deviation of the outcome from it.

    Candidates are each start, the end of steps from it, and the answer by linear regression. A process of the movements
    most like a start has a variance and a noise of its own. So a slow movement is preferred to a fast one, which cannot
    be repeated.
    """
    context, goal, starts, alike, process_of, linear = question
    m, k = len(goal), alike.shape[1]
    covariance, slope = np.empty(k), np.empty(k)
    least, best, outcome, sd, held = np.inf, linear, goal, 0.0, 0
    rows = alike[0]
    process, precision = fitted_process(rows, known.inputs, known.outcomes, kernel)
    for start in range(len(starts)):
        if process_of[start] != held:
            held = process_of[start]
            rows = alike[held]
            process, precision = fitted_process(rows, known.inputs, known.outcomes, kernel)
        surprise = 0.0  # mean squared residual near the start
        for row in rows[:JUDGED]:
            j = int(np.argmax(rows == row))
            surprise += squared_residual(process, j, precision[j]) / min(JUDGED, k)
        inflation = m * max(1.0, surprise)
        scatter = inflation * process.variance * kernel.noise
        row = starts[start]
        theta, j = known.thetas[row], int(np.argmax(rows == row))
        if len(context):
            covariances(process.inputs, kernel, in_lengths(theta, context, known.units), covariance, slope)
            error = expected_error(process, goal, inflation, covariance, np.inf)
        else:  # posterior of its outcome without noise, given itself and all others
            noise = process.noises[j]
            error = inflation * process.variance * noise * max(1 - noise * precision[j], 0.0)
            for i in range(m):
                error += (known.outcomes[row, i] - noise * process.weights[i, j] - goal[i]) ** 2
        if start == 0:
            covariances(process.inputs, kernel, in_lengths(linear, context, known.units), covariance, slope)
            error_of_linear = expected_error(process, goal, inflation, covariance, error)
            if error_of_linear < error:
                error, theta = error_of_linear, linear
        error_of_end, end = descend(process, known.thetas[row], context, goal, known, inflation)
        if error_of_end < error:
            error, theta = error_of_end, end
        if error + scatter < least:
            least, best = error + scatter, theta.copy()
            covariances(process.inputs, kernel, in_lengths(best, context, known.units), covariance, slope)
            outcome, variance = expected(process, covariance), variance_at(process, covariance)
            sd = np.sqrt(max(1.0, surprise) * (variance + process.variance * kernel.noise))
    return best.copy(), outcome.copy(), sd


@compiled_for(LISTS, TABLE, NUMBERS, MOVEMENTS, KERNEL)
def uncertainty(alike: np.ndarray, goals: Array, context: Array, known: Movements, kernel: Kernel) -> Array:
    """Standard deviation ``(n,)``, without noise, of the outcome of a movement to each of ``goals``: the end of steps
    from one start, by the process of the movements most like it.

    Args:
        alike: ``(n, k)``, rows of the movements most like each start, the start first.
        goals: ``(n, outcome_dim)``.
        context: ``(context_dim,)``.
        known, kernel: all movements, and the kernel.
    """
    n, k = alike.shape
    sds, covariance, slope = np.empty(n), np.empty(k), np.empty(k)
    for i in range(n):
        rows = alike[i]
        process, _ = fitted_process(rows, known.inputs, known.outcomes, kernel)
        _, theta = descend(process, known.thetas[rows[0]], context, goals[i], known, float(goals.shape[1]))
        covariances(process.inputs, kernel, in_lengths(theta, context, known.units), covariance, slope)
        sds[i] = np.sqrt(variance_at(process, covariance))
    return sds


@compiled_for(TABLE, TABLE, ROWS, KERNEL)
def gross_errors(inputs: Array, outcomes: Array, rows: np.ndarray, kernel: Kernel) -> np.ndarray:
    """Whether each movement in ``rows`` is a gross error, see `fitted_process`."""
    return fitted_process(rows, inputs, outcomes, kernel)[0].noises > kernel.noise


@compiled_for(TABLE, TABLE, KERNEL)
def left_out(inputs: Array, outcomes: Array, kernel: Kernel) -> Array:
    """Squared errors ``(n,)`` of predicting each of some movements from all others, eq. (5.12) of Rasmussen & Williams.

    Args:
        inputs, outcomes: ``(n, dim)``, in lengths, and ``(n, outcome_dim)``.
        kernel: kernel.
    """
    process, precision = fitted_process(np.arange(len(inputs)), inputs, outcomes, kernel)
    errors = np.zeros(len(inputs))
    for weights in process.weights:
        errors += (weights / precision) ** 2
    return errors


@compiled_for(TABLE, TABLE, LISTS, TABLE, KERNEL)
def predictions(inputs: Array, outcomes: Array, near: np.ndarray, points: Array, kernel: Kernel) -> Predictions:
    """Predictions of movements.

    Args:
        inputs, outcomes: ``(rows, dim)``, in lengths, and ``(rows, outcome_dim)``, exemplars.
        near: ``(n, k)``, rows of the exemplars from which each movement is predicted.
        points: ``(n, dim)``, the movements in lengths.
        kernel: kernel.
    """
    n, m, dim = len(points), outcomes.shape[1], points.shape[1]
    outcome, variances, noises, slopes = np.empty((n, m)), np.empty(n), np.empty(n), np.empty((n, m, dim))
    covariance, slope = np.empty(near.shape[1]), np.empty(near.shape[1])
    for i in range(n):
        rows, point = near[i].copy(), points[i].copy()
        process, _ = fitted_process(rows, inputs, outcomes, kernel)
        covariances(process.inputs, kernel, point, covariance, slope)
        variances[i], noises[i] = variance_at(process, covariance), process.variance * kernel.noise
        means = expected(process, covariance)
        for k in range(m):
            outcome[i, k] = means[k]
            weighted_slopes = process.weights[k] * slope
            weighted_inputs, total = process.inputs @ weighted_slopes, weighted_slopes.sum()
            for d in range(dim):
                slopes[i, k, d] = point[d] * total - weighted_inputs[d]
    return Predictions(outcome, variances, noises, slopes)


@compiled_for(NUMBERS, NUMBERS, TABLE, NUMBERS, float64)
def scores(diagonal: Array, beside: Array, outcomes: Array, noises: Array, stated: float) -> Array:
    """Log likelihoods ``(noises,)`` of movements with each noise, see `choose_kernel`.

    Args:
        diagonal, beside: ``(n,)`` and ``(n - 1,)``, covariance matrix without noise, after reflections of the
            movements that make it tridiagonal.
        outcomes: ``(outcome_dim, n)``, of mean 0, reflected likewise.
        noises: ``(noises,)``, variances relative to the kernel's.
        stated: standard deviation of the noise, as the environment states it.
    """
    m, n = outcomes.shape
    likelihoods = np.empty(len(noises))
    for a in range(len(noises)):
        eliminated, pivot = outcomes[:, 0].copy(), diagonal[0] + noises[a]
        total, logs = eliminated @ eliminated / pivot, np.log(pivot)
        for i in range(1, n):
            ratio = beside[i - 1] / pivot
            pivot = diagonal[i] + noises[a] - ratio * beside[i - 1]
            logs += np.log(pivot)
            for k in range(m):
                eliminated[k] = outcomes[k, i] - ratio * eliminated[k]
                total += eliminated[k] ** 2 / pivot
        variance = max(total / (n * m), TINY)
        likelihoods[a] = -0.5 * m * (n * np.log(variance) + logs)
        if stated > 0:  # prior: the log variance has a standard deviation of 1/2 if m = 1 and n = 60
            likelihoods[a] -= 2 * m * np.log(noises[a] * variance / stated**2) ** 2 * n / 60
    return likelihoods


@compiled_for(TABLE, TABLE, TABLE, TABLE, float64)
def gradient(inputs: Array, inverse: Array, weights: Array, slopes: Array, variance: float) -> tuple[Array, float]:
    """Derivatives of -log likelihood (5.9 in Rasmussen & Williams) by log lengths ``(dim,)``, and by the noise.

    Args:
        inputs: ``(dim, n)``, in lengths.
        inverse: ``(n, n)``, inverse covariance; the lower half alone.
        weights: ``(outcome_dim, n)``, inverse covariance times outcomes.
        slopes: ``(n, n)``, slopes of the covariances; the lower half alone.
        variance: most likely variance.
    """
    n, m = len(inverse), len(weights)
    by_lengths, by_noise, by_covariance = np.zeros(len(inputs)), 0.0, np.empty(n)
    for i in range(n):
        for j in range(i + 1):
            by_covariance[j] = m * inverse[i, j]
        for k in range(m):
            for j in range(i + 1):
                by_covariance[j] -= weights[k, i] * weights[k, j] / variance
        by_noise += by_covariance[i] / 2
        for j in range(i):
            by_covariance[j] *= slopes[i, j]
        for k in range(len(inputs)):
            for j in range(i):
                by_lengths[k] -= by_covariance[j] * (inputs[k, i] - inputs[k, j]) ** 2
    return by_lengths, by_noise
