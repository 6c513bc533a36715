"""What `LocallyLinear` computes for one goal, compiled by numba; import this module through `compiled`.

The answer is the weighted mean of eq. (9), plus a step by ridge regression from the mean outcome to the goal.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.memory.jit import (
    LISTS,
    NUMBERS,
    TABLE,
    WRITABLE_NUMBERS,
    as_columns,
    compiled_for,
    jit_helper,
    solve,
    squared_distance,
)
from sgimd_torch.spaces import Array

ALPHA: Final = 0.5  # weight of a neighbourhood's spread in eq. (8); its distance to the goal has weight 1
WIDTH: Final = 1.0  # width of the Gaussian of eq. (9), relative to the mean distance to the goal
# Ridge, relative to the variance of the outcomes; with a larger ridge the answer is nearer to eq. (9). The ridge also
# makes the regression unique when outcomes lie on a line, or are fewer than the slopes.
RIDGE: Final = 1e-3
COINCIDENT: Final = 1e-12  # spread of outcomes, relative to their size, below which they count as one: no regression
SMALLEST: Final = float(np.finfo(float).tiny)  # guard against division by 0


@jit_helper
def spread(outcomes: Array) -> float:
    """Standard deviation of ``outcomes`` ``(outcome_dim, n)``."""
    total, n = 0.0, outcomes.shape[1]
    for k in range(len(outcomes)):
        total += n * outcomes[k].var()
    return np.sqrt(total / (n - 1))


@compiled_for(LISTS, TABLE, TABLE, NUMBERS, TABLE, WRITABLE_NUMBERS)
def locally_linear(alike: np.ndarray, thetas: Array, outcomes: Array, goal: Array, box: Array, answer: Array) -> int:
    """The answer of `LocallyLinear`; returns the number of the best neighbourhood.

    Args:
        alike: ``(h, k)`` neighbourhoods K_h of eq. (8) as rows, theta_h first; -1 where there are fewer than k.
        thetas, outcomes: ``(n, theta_dim)`` and ``(n, outcome_dim)``, all movements in memory.
        goal: ``(outcome_dim,)``.
        box: ``(2, theta_dim)``, corners of the box around all thetas.
        answer: ``(theta_dim,)``, receives theta, as numba is slow to return an array.
    """
    sizes, spreads, n_known = np.zeros(len(alike), np.int64), np.empty(len(alike)), 0
    for h in range(len(alike)):
        while sizes[h] < alike.shape[1] and alike[h, sizes[h]] >= 0:
            sizes[h] += 1
        if sizes[h] > 1:  # a movement without neighbours gets the median of the other spreads, see `inverses.local`
            spreads[n_known] = spread(as_columns(outcomes, alike[h, : sizes[h]]))
            n_known += 1
    median_spread, next_spread = np.median(spreads[:n_known]) if n_known else 0.0, 0
    best, least = 0, np.inf
    for h in range(len(alike)):
        unreliability = np.sqrt(squared_distance(outcomes[alike[h, 0]], goal))
        unreliability += ALPHA * (spreads[next_spread] if sizes[h] > 1 else median_spread)
        next_spread += sizes[h] > 1
        if unreliability < least:
            best, least = h, unreliability
    rows = alike[best, : sizes[best]]
    near_thetas, near_outcomes = as_columns(thetas, rows), as_columns(outcomes, rows)
    weights = np.array([np.sqrt(squared_distance(near_outcomes[:, j], goal)) for j in range(len(rows))])
    weights /= max(SMALLEST, WIDTH * weights.mean())
    weights = np.exp(0.5 * (weights.min() ** 2 - weights**2))  # eq. (9), see `inverses.local`
    weights /= weights.sum()
    theta, outcome = near_thetas @ weights, near_outcomes @ weights
    for k in range(len(theta)):  # a mean lies between the values that it averages; rounding must not move it out
        theta[k] = min(max(theta[k], near_thetas[k].min()), near_thetas[k].max())
    theta_deviations, outcome_deviations = near_thetas - theta[:, None], near_outcomes - outcome[:, None]
    covariance = (outcome_deviations * weights) @ outcome_deviations.T
    variance = np.trace(covariance)
    if variance > (COINCIDENT * np.abs(near_outcomes).max()) ** 2:
        pull_to_goal = goal - outcome
        solve(covariance, RIDGE * variance, pull_to_goal)
        step = theta_deviations @ (weights * (pull_to_goal @ outcome_deviations))
        theta = np.minimum(np.maximum(theta + step, box[0]), box[1])
    answer[:] = theta
    return best
