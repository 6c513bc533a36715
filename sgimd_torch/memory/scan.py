"""Comparison of all rows of a table with some queries, compiled by numba.

    rows, squared = np.full((len(queries), k), -1), np.full((len(queries), k), np.inf)
    scan(keys, 0, queries, rows, squared)
Import this module through `compiled`: loading numba takes half a second.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import types

from sgimd_torch.memory.jit import FOUND, ROWS, SEEN, SQUARED, TABLE, compiled_for, inner
from sgimd_torch.spaces import Array

_BLOCK: Final = 128  # number of rows that stay in the cache while all queries are compared with them


@inner
def _compare(keys: Array, first: int, end: int, query: Array, rows: np.ndarray, squared: Array) -> None:
    """Add the rows from ``first`` to ``end`` to the list of a query."""
    last = len(rows) - 1
    for row in range(first, end):
        distance = 0.0
        for k in range(keys.shape[1]):
            distance += (keys[row, k] - query[k]) ** 2
        if distance < squared[last]:
            place = last
            while place > 0 and squared[place - 1] > distance:
                rows[place], squared[place] = rows[place - 1], squared[place - 1]
                place -= 1
            rows[place], squared[place] = row, distance


@compiled_for(TABLE, types.int64, TABLE, FOUND, SQUARED)
def scan(keys: Array, first: int, queries: Array, rows: np.ndarray, squared: Array) -> None:
    """Add rows to lists of the rows nearest to some queries; of equally near rows the older stays first.

    Args:
        keys: ``(n, dim)``.
        first: first row of ``keys`` that is not in the lists yet.
        queries: ``(m, dim)``.
        rows: ``(m, k)``, the lists, nearest first; -1 where there are fewer than k rows.
        squared: ``(m, k)``, squared distances of the ``rows``; infinite where there are fewer than k.
    """
    for begin in range(first, len(keys), _BLOCK):
        for m in range(len(queries)):
            _compare(keys, begin, min(begin + _BLOCK, len(keys)), queries[m], rows[m], squared[m])


@compiled_for(TABLE, ROWS, SEEN, FOUND, SQUARED)
def scan_around(keys: Array, asked: np.ndarray, seen: np.ndarray, rows: np.ndarray, squared: Array) -> None:
    """Bring the lists of the rows ``asked`` up to date.

    Args:
        keys: ``(n, dim)``.
        asked: ``(m,)``, rows whose lists are wanted.
        seen: ``(n,)``, number of rows that each list has seen.
        rows, squared: ``(n, k)``, the list of each row, see `scan`.
    """
    for begin in range(seen[asked].min(), len(keys), _BLOCK):
        end = min(begin + _BLOCK, len(keys))
        for row in asked:
            _compare(keys, max(begin, seen[row]), end, keys[row], rows[row], squared[row])
            seen[row] = max(end, seen[row])
