"""Lists of the rows nearest to some queries, compiled by numba; import this module through `compiled`."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import types

from sgimd_torch.memory.jit import ROWS, TABLE, WRITABLE_LISTS, WRITABLE_TABLE, compiled_for, jit_helper
from sgimd_torch.spaces import Array

ROUNDING: Final = 2.0**-24  # largest relative error of a number in single precision
LEAST: Final = 1e-18  # distance below which squares underflow in single precision
NO_SINGLES: Final = np.empty(0, np.float32)  # no distances in single precision
SINGLE: Final = types.Array(types.float32, 2, "C", readonly=True)


@jit_helper
def add(
    table: Array, first: int, query: Array, singles: np.ndarray, slack: float, rows: np.ndarray, squared: Array
) -> None:
    """Add rows from ``first`` on to the list of one query, nearest first; of equally near rows the older stays first.

    Args:
        table: ``(n, dim)``, rows of the memory that queries are compared with.
        singles: ``(n,)``, squared distances in single precision, which rule out far rows; empty: none is ruled out.
        slack: largest error of a distance in single precision that comes from rounding the coordinates.
    """
    (n, dim), last, limit = table.shape, len(rows) - 1, np.inf
    for row in range(first, n):
        if len(singles) and singles[row] > limit:
            continue
        distance = 0.0
        for k in range(dim):
            distance += (table[row, k] - query[k]) ** 2
        if distance < squared[last]:
            position = last
            while position > 0 and squared[position - 1] > distance:
                rows[position], squared[position] = rows[position - 1], squared[position - 1]
                position -= 1
            rows[position], squared[position] = row, distance
            # The factor bounds the other rounding errors, all of which are relative to the distance.
            limit = ((np.sqrt(squared[last]) + slack) * (1 + (2 * dim + 8) * ROUNDING)) ** 2


@compiled_for(TABLE, TABLE, SINGLE, SINGLE, types.int64)
def nearest(
    table: Array, queries: Array, single_queries: np.ndarray, singles: np.ndarray, k: int
) -> tuple[np.ndarray, Array]:
    """``(q, k)`` rows nearest to each query, nearest first, and their squared distances.

    Args:
        table, queries: ``(n, dim)`` and ``(q, dim)``; n is at least k.
        single_queries: ``(q, width)``, the queries in single precision; columns beyond dim are 0.
        singles: ``(q, n)``, squared distances in single precision, which rule out far rows.
    """
    rows, squared = np.full((len(queries), k), -1), np.full((len(queries), k), np.inf)
    for q in range(len(queries)):
        slack = LEAST
        for value in single_queries[q]:  # rounding moves a coordinate of the query, and of a row as large as it
            slack += 2 * ROUNDING * abs(value)
        add(table, 0, queries[q], singles[q], slack, rows[q], squared[q])
    return rows, squared


@compiled_for(TABLE, TABLE, ROWS, ROWS, WRITABLE_LISTS, WRITABLE_TABLE)
def extend(
    table: Array, queries: Array, first: np.ndarray, list_index: np.ndarray, rows: np.ndarray, squared: Array
) -> None:
    """Add newer rows to lists.

    Args:
        table, queries: ``(n, dim)`` and ``(q, dim)``.
        first: ``(q,)``, number of rows that the list of each query has seen.
        list_index: ``(q,)``, index of each query's list in ``rows`` and ``squared``.
        rows, squared: ``(lists, k)``, the lists, and squared distances of their rows.
    """
    for q in range(len(queries)):
        add(table, first[q], queries[q], NO_SINGLES, 0.0, rows[list_index[q]], squared[list_index[q]])
