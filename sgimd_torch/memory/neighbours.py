"""Nearest rows of a growing table, by an index of faiss.

The memory uses it to find outcomes near a goal (section 4.4.2 of Nguyen & Oudeyer, 2014: H of eq. 8) and movements
like a given one (K_h). Faiss computes distances in single precision; those that may be among the least are computed
anew in double precision. Of equally near rows the oldest comes first. Results depend on the rows alone.
    neighbours = Neighbours(Growing(2)); neighbours.keys.append(keys); rows = neighbours.nearest(queries, k=10)
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

EXACT_UP_TO: Final = 10**5  # largest number of rows for which neighbours are exact; for more, nearly all are found
LISTED: Final = 20  # number of neighbours in the list of a row
_SPARE: Final = 8  # number of rows beyond k that cells propose
_FARTHEST: Final = 1e15  # largest coordinate in single precision, so that squared distances do not overflow
_NO_SINGLES: Final = 2 * (np.empty((0, 0), np.float32),)  # no queries and distances in single precision
_FIRST: Final = np.zeros(1, np.int64)  # index of the only list
_FAST_DIMS: Final = 1, 2, 4, 8, 12  # dimensions in which faiss is several times faster; points get zeros up to these

faiss.omp_set_num_threads(1)  # queries last microseconds, and waking threads costs more than it saves


class Neighbours:
    """Neighbours among the rows of a table, its ``keys``: exact for up to ``EXACT_UP_TO`` rows.

    If there are more, rows lie in cells around some of the first rows; only the cells nearest to a query are searched.
    """

    def __init__(self, keys: Growing) -> None:
        self.keys, self._lock = keys, RLock()
        self._width = next((width for width in _FAST_DIMS if width >= keys.dim), keys.dim)
        self._index: Any = faiss.IndexFlatL2(self._width)
        # For each row the list of its nearest rows, their squared distances, and the number of rows compared so far.
        self._rows, self._squared = np.empty((0, LISTED), np.int64), np.empty((0, LISTED))
        self._compared = np.empty(0, np.int64)
        self._last = b"", self._rows, self._squared, 0  # last single query, its list, and the number of rows compared

    def __reduce__(self) -> tuple[Any, ...]:
        return Neighbours, (self.keys,)

    def nearest(self, queries: Array, k: int, within: float = math.inf) -> Rows:
        """For each of ``queries`` ``(m, dim)`` the ``(min(k, n),)`` nearest rows, nearest first; -1 instead of rows
        farther than ``within``.

        Raises:
            ValueError: ``k`` is below 1.
        """
        rows, squared = self._search(queries, k)
        return np.where(squared <= within * within, rows, -1)

    def nearest_to(self, query: Array, k: int) -> Rows:
        """Result of `nearest` for one ``query`` ``(dim,)``; if it is asked again, only newer rows are compared.

        Raises:
            ValueError: ``k`` is below 1.
        """
        n, key = len(self.keys), query.tobytes()
        if not 1 <= k <= LISTED <= n <= EXACT_UP_TO:
            return self.nearest(query[None], k)[0]
        last_query, rows, squared, compared = self._last
        if last_query != key:
            rows, squared = self._search(query[None], LISTED)
        elif compared < n:
            rows, squared = rows.copy(), squared.copy()
            _scan().extend(self.keys.rows, query[None], *_NO_SINGLES, np.array([compared]), _FIRST, rows, squared)
        self._last = key, rows, squared, n
        return rows[0, :k]

    def around(self, rows: Rows, k: int, within: float = math.inf) -> Rows:
        """Result of `nearest` for each of ``rows``, from lists that are kept: only newer rows are compared.

        Raises:
            ValueError: ``k`` is below 1.
        """
        keys, n = self.keys.rows, len(self.keys)
        if not 1 <= k <= LISTED <= n <= EXACT_UP_TO:
            return self.nearest(keys[rows], k, within)
        with self._lock:
            if n > len(self._compared):
                size = 2 * n - len(self._compared)
                self._rows = np.concatenate((self._rows, np.empty((size, LISTED), np.int64)))
                self._squared = np.concatenate((self._squared, np.empty((size, LISTED))))
                self._compared = np.concatenate((self._compared, np.zeros(size, np.int64)))
            new = rows[self._compared[rows] == 0]
            if len(new):
                self._rows[new], self._squared[new] = self._search(keys[new], LISTED)
                self._compared[new] = n
            _scan().extend(keys, keys[rows], *_NO_SINGLES, self._compared[rows], rows, self._rows, self._squared)
            self._compared[rows] = n
            return np.where(self._squared[rows, :k] <= within * within, self._rows[rows, :k], -1)

    def _search(self, queries: Array, k: int) -> tuple[Rows, Array]:
        """The ``(m, min(k, n))`` nearest rows of each query, nearest first, and their squared distances."""
        if k < 1:
            raise ValueError(f"k must be at least 1, got {k}")
        self._add_new_rows()
        keys, n = self.keys.rows, len(self.keys)
        if n == 0:
            return np.empty((len(queries), 0), np.int64), np.empty((len(queries), 0))
        single_queries = self._single(queries)
        if n > EXACT_UP_TO:
            pairs = zip(queries[:, None], single_queries[:, None], strict=True)
            lists = [self._search_cells(*pair, k) for pair in pairs]
            rows, squared = map(np.concatenate, zip(*lists, strict=True))
            return rows, squared
        distances = np.empty((len(queries), n), np.float32)
        vectors = self._index.get_xb()
        for point, row in zip(single_queries, distances, strict=True):
            pointers = faiss.swig_ptr(row), faiss.swig_ptr(point), vectors
            faiss.fvec_L2sqr_ny(*pointers, self._width, n)  # type: ignore[attr-defined]
        return _nearest(keys, queries, single_queries, distances, min(k, n))

    def _search_cells(self, query: Array, point: Single, k: int) -> tuple[Rows, Array]:
        """Result of `_search` for one query, among the rows that the index of cells proposes."""
        _, (proposed,) = self._index.search(point, k + _SPARE)
        proposed.sort()
        if proposed[0] < 0:  # the cells are nearly empty
            proposed = np.arange(len(self.keys))
        positions, squared = _nearest(self.keys.rows[proposed], query, *_NO_SINGLES, k)
        return proposed[positions], squared

    def _add_new_rows(self) -> None:
        """Add new rows to the index; above ``EXACT_UP_TO``, to an index of cells."""
        n = len(self.keys)
        if self._index.ntotal == n:
            return
        with self._lock:
            if self._index.ntotal <= EXACT_UP_TO < n:
                self._index = _cells(self._single(self.keys.rows[:EXACT_UP_TO]), self.keys.dim)
            if self._index.ntotal < n:
                self._index.add(self._single(self.keys.rows[self._index.ntotal :]))

    def _single(self, points: Array) -> Single:
        """``points`` ``(n, dim)`` relative to the first row, in single precision; far points are moved nearer."""
        single = np.zeros((len(points), self._width), np.float32)
        single[:, : self.keys.dim] = np.minimum(np.maximum(points - self.keys.rows[:1], -_FARTHEST), _FARTHEST)
        return single


def _nearest(keys: Array, queries: Array, single_queries: Single, singles: Single, k: int) -> tuple[Rows, Array]:
    """The ``(m, k)`` rows of ``keys`` nearest to ``queries``, and their squared distances; see `scan.extend`."""
    m = len(queries)
    rows, squared = np.full((m, k), -1), np.full((m, k), np.inf)
    _scan().extend(keys, queries, single_queries, singles, np.zeros(m, np.int64), np.arange(m), rows, squared)
    return rows, squared


def _scan() -> Any:
    return compiled("sgimd_torch.memory.scan")


def _cells(points: Single, dim: int) -> faiss.IndexIVFFlat:
    """An empty index whose cells lie around some of these ``points``, which have ``dim`` dimensions."""
    n_cells = 4 * math.isqrt(len(points))
    centres = faiss.IndexFlatL2(points.shape[1])
    centres.add(points[:: len(points) // n_cells][:n_cells])
    index = faiss.IndexIVFFlat(centres, points.shape[1], n_cells)
    index.is_trained = True  # centres are given, so nothing is left to learn
    index.nprobe = min(16, 2 ** (dim - 1) + 1)  # cells searched for a query: in more dimensions more cells are adjacent
    return index
