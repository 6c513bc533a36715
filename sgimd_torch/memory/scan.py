"""Lists of the rows nearest to some queries, compiled by numba; import it through `compiled`."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import types

from sgimd_torch.memory.jit import CHANGED_LISTS, CHANGED_TABLE, ROWS, TABLE, compiled_for, inner
from sgimd_torch.spaces import Array

ROUNDING: Final = 2.0**-24  # largest relative error of a number in single precision
LEAST: Final = 1e-18  # distance below which squares underflow in single precision
NOT_KNOWN: Final = np.empty(0, np.float32)
SINGLE: Final = types.Array(types.float32, 2, "C", readonly=True)


@inner
def add(
    keys: Array, first: int, query: Array, singles: np.ndarray, slack: float, rows: np.ndarray, squared: Array
) -> None:
    """Add rows from ``first`` on to the list of one query, nearest first; of equally near rows the older stays first.
    ``singles`` ``(n,)`` are squared distances in single precision, or nothing; their error is ``slack`` at most."""
    (n, dim), last, limit = keys.shape, len(rows) - 1, np.inf
    for row in range(first, n):
        if len(singles) and singles[row] > limit:
            continue
        distance = 0.0
        for k in range(dim):
            distance += (keys[row, k] - query[k]) ** 2
        if distance < squared[last]:
            place = last
            while place > 0 and squared[place - 1] > distance:
                rows[place], squared[place] = rows[place - 1], squared[place - 1]
                place -= 1
            rows[place], squared[place] = row, distance
            limit = ((np.sqrt(squared[last]) + slack) * (1 + (2 * dim + 8) * ROUNDING)) ** 2


@compiled_for(TABLE, TABLE, SINGLE, SINGLE, types.int64)
def nearest(keys: Array, queries: Array, points: np.ndarray, distances: np.ndarray, k: int) -> tuple[np.ndarray, Array]:
    """``(m, k)`` rows nearest to each query, nearest first, and their squared distances.

    Args:
        keys, queries: ``(n, dim)`` and ``(m, dim)``; n is at least k.
        points: ``(m, width)``, the queries in single precision.
        distances: ``(m, n)``, squared distances in single precision, which rule out far rows.
    """
    rows, squared = np.full((len(queries), k), -1), np.full((len(queries), k), np.inf)
    for m in range(len(queries)):
        slack = LEAST
        for value in points[m]:
            slack += 2 * ROUNDING * abs(value)
        add(keys, 0, queries[m], distances[m], slack, rows[m], squared[m])
    return rows, squared


@compiled_for(TABLE, TABLE, ROWS, ROWS, CHANGED_LISTS, CHANGED_TABLE)
def extend(
    keys: Array, queries: Array, first: np.ndarray, places: np.ndarray, rows: np.ndarray, squared: Array
) -> None:
    """Add newer rows to lists.

    Args:
        keys, queries: ``(n, dim)`` and ``(m, dim)``.
        first: ``(m,)``, number of rows that the list of each query has seen.
        places: ``(m,)``, place of each list in ``rows`` and ``squared``.
        rows, squared: ``(lists, k)``, the lists, and squared distances of their rows.
    """
    for m in range(len(queries)):
        add(keys, first[m], queries[m], NOT_KNOWN, 0.0, rows[places[m]], squared[places[m]])
