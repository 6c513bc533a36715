"""Nearest rows of a growing table: by comparing all rows, or, for very many rows, by a tree or by cells.

The memory uses it to find outcomes near a goal (section 4.4.2 of Nguyen & Oudeyer, 2014: H of eq. 8) and movements
like a given one (K_h). If scipy or faiss proposes rows, float64 distances decide; equally near rows keep their order.
    side = TreeNeighbours(Table(2)); side.keys.append(keys); rows = side.nearest(query, k=10)
Results depend on the rows alone, not on earlier queries. A query first adds new rows to the tree or the index.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from threading import Lock
from typing import Final, NamedTuple, Self

import faiss
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sgimd_torch.memory.compiled import compiled
from sgimd_torch.spaces import Array

Rows = NDArray[np.int64]

EXACT_UP_TO: Final = 2**15  # largest number of rows for which `PolicyNeighbours` is exact; for more it is approximate
LISTED: Final = 20  # number of neighbours of a row that are kept
_SPARE: Final = 8  # number of proposals beyond k, so that the last is nearly always clearly farther than the k-th
_LARGEST32: Final = float(np.finfo(np.float32).max)
_ROUNDING: Final = 1e-9  # relative error far above the rounding of float64 distances

faiss.omp_set_num_threads(1)  # queries last microseconds, and waking threads costs more than it saves
# With more queries at once than this, faiss would round distances otherwise than for one query.
faiss.cvar.distance_compute_blas_threshold = 2**20


class Table:
    """Rows in an array that doubles its size when full."""

    def __init__(self, dim: int) -> None:
        self._room = np.empty((64, dim))
        self._rows: Array | None = None
        self._n = 0

    def __len__(self) -> int:
        return self._n

    @property
    def dim(self) -> int:
        """Number of columns."""
        return self._room.shape[1]

    @property
    def rows(self) -> Array:
        """``(n, dim)`` read-only; rows that are added later do not appear in it."""
        if self._rows is None:
            self._rows = self._room[: self._n]
            self._rows.flags.writeable = False
        return self._rows

    def append(self, rows: Array) -> None:
        """Add ``(m, dim)`` rows."""
        n_old, n_new = self._n, self._n + len(rows)
        if n_new > len(self._room):
            room = np.empty((max(n_new, 2 * len(self._room)), self.dim))
            room[:n_old] = self._room[:n_old]
            self._room = room
        self._room[n_old:n_new] = rows
        self._rows, self._n = None, n_new


class TreeNeighbours:
    """Exact neighbours in few dimensions: a tree of all rows but the newest, which are compared one by one."""

    _NEWEST: Final = 2**13  # most rows outside the tree, or a thirty-second of the tree if that is more

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._tree: cKDTree | None = None
        self._n_in_tree = 0
        self._last = b"", Found.none(keys.rows[:0], 0), 0  # last query, its neighbours, and how many rows were compared

    def nearest(self, query: Array, k: int) -> Rows:
        """The ``(min(k, n),)`` rows nearest to ``query`` ``(dim,)``, nearest first. If the query is that of the last
        call, only newer rows are compared.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        keys, n = self.keys.rows, len(self.keys)
        (asked, found, seen), key = self._last, query.tobytes()
        if asked != key or k > found.rows.shape[1]:
            found = self._seek(query, max(k, LISTED))
        elif seen < n:
            found = found.copy().extend(keys, seen)
        self._last = key, found, n
        return found.rows[0, : min(k, n)]

    def _seek(self, query: Array, k: int) -> Found:
        keys, n = self.keys.rows, len(self.keys)
        if n - self._n_in_tree > max(self._NEWEST, self._n_in_tree // 32):
            # The two options do not change results; while they are off, the tree is built twice as fast.
            self._tree, self._n_in_tree = cKDTree(keys, balanced_tree=False, compact_nodes=False), n
        if self._tree is None:
            return Found.none(query[None], k).extend(keys)
        n_proposed = min(k + _SPARE, self._tree.n)
        distances, proposed = self._tree.query(query, n_proposed)
        beyond = distances[-1] if n_proposed < self._tree.n else np.inf  # least distance of the other rows of the tree
        found = _among(keys, query, k, np.sort(proposed)).extend(keys, self._n_in_tree)
        reach = math.sqrt(found.squared[0, -1]) * (1 + _ROUNDING)
        if reach >= beyond:
            ball = self._tree.query_ball_point(query, reach, return_sorted=True)
            found = _among(keys, query, k, np.array(ball, dtype=np.int64)).extend(keys, self._n_in_tree)
        return found


class PolicyNeighbours:
    """Neighbours in many dimensions: exact for up to ``EXACT_UP_TO`` rows; for more rows, nearly all are found.

    If there are more, rows lie in cells around some of the first rows; only the cells nearest to a query are searched.
    """

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._cells: faiss.Index | None = None
        # Neighbours of each row, found among its first ``_seen`` rows.
        self._lists, self._seen, self._extending = Found.none(keys.rows[:0], LISTED), np.empty(0, np.int64), Lock()

    def nearest(self, queries: Array, k: int, within: float = np.inf) -> Rows:
        """For each of ``queries`` ``(m, dim)`` the ``(min(k, n),)`` nearest rows, nearest first; -1 instead of rows
        farther than ``within``.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        keys = self.keys.rows
        if len(keys) <= EXACT_UP_TO:
            return Found.none(queries, min(k, len(keys))).extend(keys).within(within)
        return np.concatenate([found.within(within) for found in self._from_cells(queries, k)])

    def around(self, rows: Rows, k: int, within: float = np.inf) -> Rows:
        """Result of `nearest` for each of ``rows``; neighbours that are known from earlier calls are not sought again.

        Raises:
            ValueError: ``k`` is below 1.
        """
        keys, n = self.keys.rows, len(self.keys)
        if k > LISTED or n > EXACT_UP_TO:
            return self.nearest(keys[rows], k, within)
        _check_k(k)
        with self._extending:
            lists = self._lists
            if n > len(self._seen):
                more = Found.none(keys, LISTED)
                self._seen = np.concatenate((self._seen, np.zeros(n, np.int64)))
                found, squared = (np.concatenate(both) for both in zip(lists[1:], more[1:], strict=True))
                self._lists = lists = Found(lists.queries, found, squared)
            compiled("sgimd_torch.memory.scan").scan_around(keys, rows, self._seen, lists.rows, lists.squared)
            return np.ascontiguousarray(lists.within(within, rows)[:, : min(k, n)])

    def _from_cells(self, queries: Array, k: int) -> Iterator[Found]:
        """The rows nearest to each query in the cells nearest to it."""
        keys = self.keys.rows
        if self._cells is None:
            self._cells = _in_cells(_float32(keys[:EXACT_UP_TO]))
        if self._cells.ntotal < len(keys):
            self._cells.add(_float32(keys[self._cells.ntotal :]))
        _, proposed = self._cells.search(_float32(queries), k + _SPARE)
        for query, rows in zip(queries, np.sort(proposed, axis=1), strict=True):
            rows = rows[rows >= 0]
            if len(rows) < k:  # the cells are nearly empty, or the query overflows float32
                yield Found.none(query[None], k).extend(keys)
            else:
                yield _among(keys, query, k, rows)


class Found(NamedTuple):
    """Rows nearest to some queries among the rows seen so far, nearest first.

    Attributes:
        queries: ``(m, dim)``.
        rows: ``(m, k)``; -1 while fewer than k rows were seen.
        squared: ``(m, k)``, their squared distances; infinite while fewer than k rows were seen.
    """

    queries: Array
    rows: Rows
    squared: Array

    @classmethod
    def none(cls, queries: Array, k: int) -> Self:
        """Lists of k rows, before any row was seen."""
        return cls(queries, np.full((len(queries), k), -1), np.full((len(queries), k), np.inf))

    def copy(self) -> Found:
        """A copy that `extend` changes alone."""
        return Found(self.queries, self.rows.copy(), self.squared.copy())

    def extend(self, keys: Array, first: int = 0) -> Found:
        """Add the rows of ``keys`` ``(n, dim)`` from row ``first`` on."""
        compiled("sgimd_torch.memory.scan").scan(keys, first, self.queries, self.rows, self.squared)
        return self

    def within(self, radius: float, queries: Rows | slice = slice(None)) -> Rows:
        """``rows`` of these queries, as a copy, with -1 instead of those farther than ``radius``."""
        return np.where(self.squared[queries] <= radius * radius, self.rows[queries], -1)


def _among(keys: Array, query: Array, k: int, proposed: Rows) -> Found:
    """The rows nearest to a query among the increasing rows ``proposed``."""
    found = Found.none(query[None], k).extend(keys[proposed])
    n = min(k, len(proposed))
    found.rows[0, :n] = proposed[found.rows[0, :n]]
    return found


def _in_cells(rows32: NDArray[np.float32]) -> faiss.IndexIVFFlat:
    """An empty index whose cells lie around some of these rows ``(n, dim)``."""
    n_cells = 4 * math.isqrt(len(rows32))
    centres = faiss.IndexFlatL2(rows32.shape[1])
    centres.add(rows32[:: len(rows32) // n_cells][:n_cells])
    index = faiss.IndexIVFFlat(centres, rows32.shape[1], n_cells)
    index.is_trained = True  # centres are given, so nothing is left to learn
    index.nprobe = 16  # number of cells that are searched for a query
    return index


def _check_k(k: int) -> None:
    if k < 1:
        raise ValueError(f"k must be at least 1, got {k}")


def _float32(array: Array) -> NDArray[np.float32]:
    """The ``array`` as float32; values that are too large become infinite.

    ``np.errstate`` would be unsafe here, because it sets a context variable. In Python 3.11 the garbage collector may
    run meanwhile and end the attempt of a dropped learner, which queries a memory, too. If the variable is set twice at
    once, the program crashes.
    """
    large = np.abs(array) > _LARGEST32
    return np.where(large, np.copysign(np.inf, array), array).astype(np.float32)
