"""Comparison of all rows of a table with some queries, compiled by numba.

    rows, squared = nobody_yet(len(queries), k); scan(keys, first, queries, rows, squared)
Import this module through `compiled`: loading numba takes half a second.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

from sgimd_torch.spaces import Array

FLOATS = types.Array(types.float64, 2, "C", readonly=True)
_NUMBERS = types.Array(types.int64, 1, "C", readonly=True)
_FOUND, _SQUARED = types.Array(types.int64, 2, "C"), types.Array(types.float64, 2, "C")


# Sums may be reordered, so that they use vector registers; a faiss index of all rows takes as long.
@njit(types.void(FLOATS, _NUMBERS, FLOATS, _FOUND, _SQUARED), cache=True, nogil=True, fastmath={"reassoc"})
def scan(keys: Array, first: np.ndarray, queries: Array, rows: np.ndarray, squared: Array) -> None:
    """Add rows to lists of the rows nearest to some queries; of equally near rows the older stays first.

    Args:
        keys: ``(n, dim)``.
        first: ``(m,)``, first row of ``keys`` that is not in the list of each query yet.
        queries: ``(m, dim)``.
        rows: ``(m, k)``, the lists, nearest first; -1 where there are fewer than k rows.
        squared: ``(m, k)``, squared distances of the ``rows``; infinite where there are fewer than k.
    """
    last = rows.shape[1] - 1
    for query in range(len(queries)):
        for row in range(first[query], len(keys)):
            distance = 0.0
            for k in range(keys.shape[1]):
                distance += (keys[row, k] - queries[query, k]) ** 2
            if distance < squared[query, last]:
                place = last
                while place > 0 and squared[query, place - 1] > distance:
                    rows[query, place], squared[query, place] = rows[query, place - 1], squared[query, place - 1]
                    place -= 1
                rows[query, place], squared[query, place] = row, distance
