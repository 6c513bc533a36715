"""What `LocallyLinear` computes for one goal, compiled by numba; import it through `compiled`."""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.memory.jit import LISTS, NUMBERS, TABLE, columns, compiled_for, inner, squared_distance
from sgimd_torch.spaces import Array

ALPHA, WIDTH = 0.5, 1.0  # weight of a neighbourhood's spread in eq. (8), and width of the Gaussian of eq. (9)
# Ridge, relative to the variance of the outcomes; with a larger ridge the answer is nearer to eq. (9). The ridge also
# makes the regression unique when outcomes lie on a line, or are fewer than the slopes.
RIDGE: Final = 1e-3
COINCIDENT: Final = 1e-12  # least spread of outcomes relative to their size; below it, they count as one: no slope
SMALLEST: Final = float(np.finfo(float).tiny)


@inner
def spread(outcomes: Array) -> float:
    """Standard deviation of ``outcomes`` ``(outcome_dim, n)``."""
    total, n = 0.0, outcomes.shape[1]
    for k in range(len(outcomes)):
        total += n * outcomes[k].var()
    return np.sqrt(total / (n - 1))


@compiled_for(LISTS, TABLE, TABLE, NUMBERS, TABLE)
def locally_linear(alike: np.ndarray, thetas: Array, outcomes: Array, goal: Array, box: Array) -> tuple[int, Array]:
    """The answer of `LocallyLinear`: the number of the best neighbourhood, and theta.

    Args:
        alike: ``(h, k)`` neighbourhoods K_h of eq. (8) as rows, theta_h first; -1 where there are fewer than k.
        thetas, outcomes: ``(n, theta_dim)`` and ``(n, outcome_dim)``, all movements in memory.
        goal: ``(outcome_dim,)``.
        box: ``(2, theta_dim)``, corners of the box around all thetas.
    """
    sizes, spreads, n_known = np.zeros(len(alike), np.int64), np.empty(len(alike)), 0
    for h in range(len(alike)):
        while sizes[h] < alike.shape[1] and alike[h, sizes[h]] >= 0:
            sizes[h] += 1
        if sizes[h] > 1:  # a movement without neighbours gets the median of the other spreads, see `inverses.local`
            spreads[n_known] = spread(columns(outcomes, alike[h, : sizes[h]]))
            n_known += 1
    middle, n_known = np.median(spreads[:n_known]) if n_known else 0.0, 0
    best, least = 0, np.inf
    for h in range(len(alike)):
        unreliability = np.sqrt(squared_distance(outcomes[alike[h, 0]], goal))
        unreliability += ALPHA * (spreads[n_known] if sizes[h] > 1 else middle)
        n_known += sizes[h] > 1
        if unreliability < least:
            best, least = h, unreliability
    rows = alike[best, : sizes[best]]
    neighbours, landed = columns(thetas, rows), columns(outcomes, rows)
    weights = np.array([np.sqrt(squared_distance(landed[:, j], goal)) for j in range(len(rows))])
    weights /= max(SMALLEST, WIDTH * weights.mean())
    weights = np.exp(0.5 * (weights.min() ** 2 - weights**2))  # eq. (9), see `inverses.local`
    weights /= weights.sum()
    theta, outcome, largest = neighbours @ weights, landed @ weights, np.abs(landed).max()
    for k in range(len(theta)):  # a mean lies between the values that it averages; rounding must not move it out
        theta[k] = min(max(theta[k], neighbours[k].min()), neighbours[k].max())
        neighbours[k] -= theta[k]
    for k in range(len(outcome)):
        landed[k] -= outcome[k]
    covariance = (landed * weights) @ landed.T
    variance = np.trace(covariance)
    if variance > (COINCIDENT * largest) ** 2:
        slope = np.linalg.solve(covariance + RIDGE * variance * np.eye(len(goal)), goal - outcome)
        step = neighbours @ (weights * (slope @ landed))
        theta = np.minimum(np.maximum(theta + step, box[0]), box[1])
    return best, theta
