"""Order of the rows that an index proposes, compiled by numba; import this module through `compiled`."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import float64, int64, types

from sgimd_torch.memory.jit import LISTS, NUMBERS, TABLE, compiled_for, jit_helper, squared_distance
from sgimd_torch.spaces import Array

SINGLE: Final = types.Array(types.float32, 2, "C", readonly=True)
FARTHEST: Final = 1e15  # largest coordinate in single precision, so that squared distances do not overflow
ROUNDING: Final = 2.0**-24  # largest relative error of a number in single precision
LEAST: Final = 1e-18  # distance below which squares underflow in single precision
TIE: Final = 1e-6  # relative difference of squared distances below which rows may count as equally near


@compiled_for(TABLE, NUMBERS)
def single(points: Array, origin: Array) -> np.ndarray:
    """``points`` ``(n, dim)`` relative to the ``origin`` in single precision; far points are moved nearer."""
    moved = np.empty(points.shape, np.float32)
    for i in range(len(points)):
        for k in range(len(origin)):
            moved[i, k] = min(max(points[i, k] - origin[k], -FARTHEST), FARTHEST)
    return moved


@jit_helper
def enter(table: Array, row: int, query: Array, near: np.ndarray, squared: Array, found: int, limit: float) -> int:
    """Enter a row into the list of the ``found`` nearest so far, with their squared distances, both in place; returns
    how many are in the list then."""
    distance, k = squared_distance(table[row], query), len(near)
    if distance > limit or (found == k and (distance, row) >= (squared[k - 1], near[k - 1])):
        return found
    place = min(found, k - 1)
    while place > 0 and (distance, row) < (squared[place - 1], near[place - 1]):
        near[place], squared[place] = near[place - 1], squared[place - 1]
        place -= 1
    near[place], squared[place] = row, distance
    return min(found + 1, k)


@compiled_for(TABLE, TABLE, NUMBERS, LISTS, SINGLE, int64, float64)
def ordered(
    table: Array, queries: Array, origin: Array, proposed: np.ndarray, singles: np.ndarray, k: int, limit: float
) -> np.ndarray:
    """The ``(m, k)`` rows nearest to some queries, nearest first, of equally near rows the oldest first.

    Args:
        table, queries: ``(n, dim)`` and ``(m, dim)``.
        origin: ``(dim,)``, see `single`.
        proposed: ``(m, at least k)``, rows that may be the nearest; -1: none.
        singles: ``(m, at least k)``, squared distances of the proposed rows in single precision, ascending. If rounding
            may hide a row that is nearer, all rows are compared. Negative: none is proposed; infinity: none is hidden.
        k: number of rows.
        limit: squared distance from which on a row does not count; -1 takes its place.
    """
    rows, squared, dim = np.full((len(queries), k), -1), np.empty(k), len(origin)
    for q in range(len(queries)):
        near, found, slack = rows[q], 0, LEAST
        for row in proposed[q]:
            if row >= 0:
                found = enter(table, row, queries[q], near, squared, found, limit)
        for d in range(dim):  # rounding moves a coordinate of the query, and of a row as large as it
            slack += 2 * ROUNDING * abs(queries[q, d] - origin[d])
        others = max(np.sqrt(max(float64(singles[q, -1]), 0.0)) * (1 - (2 * dim + 8) * ROUNDING) - slack, 0.0) ** 2
        if singles[q, -1] < 0 or others < (1 - TIE) * (squared[k - 1] if found == k else limit):
            found = 0
            for row in range(len(table)):
                found = enter(table, row, queries[q], near, squared, found, limit)
    return rows
