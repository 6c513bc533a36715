"""Nearest rows of a growing table, found by faiss.

The memory uses it to find outcomes near a goal (section 4.4.2 of Nguyen & Oudeyer, 2014: H of eq. 8) and movements
like a given one (K_h of eq. 8). Faiss computes distances in single precision and proposes a few rows more than asked;
these are put in order in double precision. Where rounding may hide a nearer row, all rows are compared. Results depend
on the rows alone.
    neighbours = Flat(Growing(2)); neighbours.keys.append(keys); rows = neighbours.nearest(queries, k=10)
"""

from __future__ import annotations

import math
from threading import RLock
from typing import Any, Final

import faiss
import numpy as np
from numpy.typing import NDArray

from sgimd_torch.memory.compiled import compiled
from sgimd_torch.memory.growing import Growing
from sgimd_torch.spaces import Array

Rows = NDArray[np.int64]
Single = NDArray[np.float32]

_FLAT_UP_TO: Final = 10_000, 400  # rows from which a graph is quicker: so many, and so many for each dimension
_BLOCK: Final = 1000  # rows that enter a graph together
_SPARE: Final = 8  # number of rows beyond k that faiss proposes
_LINKS: Final = 32  # number of links of a row in the graph
_BUILT_WITH: Final = 80  # number of candidates for the links of a row
_SEARCHED: Final = 64, 3.5  # least number of candidates of a search in the graph; least number for each dimension

faiss.omp_set_num_threads(1)  # queries last microseconds, and waking threads costs more than it saves


class Scan:
    """Exact neighbours in double precision, by comparison with every row."""

    def __init__(self, keys: Growing) -> None:
        self.keys, self._lock = keys, RLock()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.keys,)

    def nearest(self, queries: Array, k: int, within: float = math.inf) -> Rows:
        """For each of ``queries`` ``(m, dim)`` the ``(min(k, n),)`` nearest rows, nearest first, of equally near rows
        the oldest first; -1 instead of rows farther than ``within``.

        Raises:
            ValueError: ``k`` is below 1.
        """
        if k < 1:
            raise ValueError(f"k must be at least 1, got {k}")
        n, table = len(self.keys), self.keys.rows
        k = min(k, n)
        if n == 0:
            return np.empty((len(queries), 0), np.int64)
        proposed = self._proposed(table, queries, min(k + _SPARE, n))
        rows: Rows = _kernels().ordered(table, queries, table[0], *proposed, k, within * within)
        return rows

    def _proposed(self, table: Array, queries: Array, k: int) -> tuple[Rows, Single]:
        """Rows of the ``table`` that may be the nearest, and their squared distances, see `ordered.ordered`."""
        return np.full((len(queries), 1), -1), np.full((len(queries), 1), -1, np.float32)


class Flat(Scan):
    """Neighbours by a flat index of faiss, which compares every row in single precision."""

    def __init__(self, keys: Growing) -> None:
        super().__init__(keys)
        self._flat: Any = faiss.IndexFlatL2(keys.dim)
        self._n = 0  # rows that are indexed

    def _proposed(self, table: Array, queries: Array, k: int) -> tuple[Rows, Single]:
        if self._n < len(table):
            with self._lock:
                self._add(table)
        squared, proposed = self._flat.search(_kernels().single(queries, table[0]), k)
        return proposed, squared

    def _add(self, table: Array) -> None:
        """Add the rows that are not indexed yet."""
        rows = _kernels().single(table[self._n :], table[0])
        try:
            self._flat.add(rows)
        except (MemoryError, RuntimeError) as error:
            raise ValueError(f"faiss cannot index {len(table)} rows of {table.shape[1]} numbers: {error}") from error
        self._n = len(table)


class Graph(Flat):
    """Neighbours by a flat index; of more than ``flat_up_to`` rows by a graph, which finds nearly all of them.

    Rows enter the graph (HNSW, Malkov & Yashunin 2018) in blocks; the newest lie in the flat index until then.
    """

    def __init__(self, keys: Growing) -> None:
        super().__init__(keys)
        self.flat_up_to = _FLAT_UP_TO[0] + _FLAT_UP_TO[1] * keys.dim
        self._graph: Any = faiss.IndexHNSWFlat(keys.dim, _LINKS)
        self._graph.hnsw.efConstruction = _BUILT_WITH

    def _proposed(self, table: Array, queries: Array, k: int) -> tuple[Rows, Single]:
        (newest, squared), first = super()._proposed(table, queries, k), self._graph.ntotal
        if not first:
            return newest, squared
        self._graph.hnsw.efSearch = max(_SEARCHED[0], int(_SEARCHED[1] * table.shape[1]), 2 * k)
        _, earlier = self._graph.search(_kernels().single(queries, table[0]), k)
        proposed = np.concatenate((earlier, np.where(newest < 0, -1, newest + first)), axis=1)
        return proposed, np.full(proposed.shape, np.inf, np.float32)

    def _add(self, table: Array) -> None:
        n, first = len(table), self._graph.ntotal
        if n > self.flat_up_to and n - first >= _BLOCK:
            for row in range(first, n - _BLOCK + 1, _BLOCK):
                self._graph.add(_kernels().single(table[row : row + _BLOCK], table[0]))
            self._flat.reset()
            self._n = self._graph.ntotal
        if self._n < n:
            super()._add(table)


def _kernels() -> Any:
    return compiled("sgimd_torch.memory.ordered")
