"""Lists of the rows nearest to some queries, compiled by numba; import this module through `compiled`."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import types

from sgimd_torch.memory.jit import ROWS, TABLE, WRITABLE_LISTS, WRITABLE_TABLE, compiled_for
from sgimd_torch.spaces import Array

ROUNDING: Final = 2.0**-24  # largest relative error of a number in single precision
LEAST: Final = 1e-18  # distance below which squares underflow in single precision
SINGLE: Final = types.Array(types.float32, 2, "C", readonly=True)


@compiled_for(TABLE, TABLE, SINGLE, SINGLE, ROWS, ROWS, WRITABLE_LISTS, WRITABLE_TABLE)
def extend(
    table: Array,
    queries: Array,
    single_queries: np.ndarray,
    singles: np.ndarray,
    first: np.ndarray,
    list_index: np.ndarray,
    rows: np.ndarray,
    squared: Array,
) -> None:
    """Extend lists of the rows nearest to some queries, nearest first; of equally near rows the older stays first.

    Args:
        table, queries: ``(n, dim)`` and ``(q, dim)``.
        single_queries: ``(q, width)``, the queries in single precision; columns beyond dim are 0.
        singles: ``(q, n)``, squared distances in single precision, which rule out far rows; ``(0, 0)``: none is.
        first: ``(q,)``, number of rows that the list of each query has seen.
        list_index: ``(q,)``, index of each query's list in ``rows`` and ``squared``.
        rows, squared: ``(lists, k)``, the lists, and squared distances of their rows; at first -1 and infinity.
    """
    (n, dim), last = table.shape, rows.shape[1] - 1
    for q in range(len(queries)):
        query, near, distances = queries[q], rows[list_index[q]], squared[list_index[q]]
        slack, limit = LEAST, np.inf
        if len(singles):
            for value in single_queries[q]:  # rounding moves a coordinate of the query, and of a row as large as it
                slack += 2 * ROUNDING * abs(value)
        for row in range(first[q], n):
            if len(singles) and singles[q, row] > limit:
                continue
            distance = 0.0
            for k in range(dim):
                distance += (table[row, k] - query[k]) ** 2
            if distance < distances[last]:
                position = last
                while position > 0 and distances[position - 1] > distance:
                    near[position], distances[position] = near[position - 1], distances[position - 1]
                    position -= 1
                near[position], distances[position] = row, distance
                # The factor bounds the other rounding errors, all of which are relative to the distance.
                limit = ((np.sqrt(distances[last]) + slack) * (1 + (2 * dim + 8) * ROUNDING)) ** 2
