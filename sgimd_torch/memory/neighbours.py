"""Nearest rows of a growing table: by a tree, by comparing all rows, or, for very many rows, by cells.

The memory uses it to find outcomes near a goal (section 4.4.2 of Nguyen & Oudeyer, 2014: H of eq. 8) and movements
like a given one (K_h). scipy or faiss proposes rows, and float64 distances decide; equally near rows keep their order.
    side = TreeNeighbours(Table(2)); side.keys.append(keys); rows = side.nearest(query, k=10)
Results depend on the rows alone, not on earlier queries. A query first adds new rows to the tree or the index.
"""

from __future__ import annotations

import math
from typing import Final

import faiss
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sgimd_torch.spaces import Array

Rows = NDArray[np.int64]

EXACT_UP_TO: Final = 2**15  # largest number of rows for which `PolicyNeighbours` is exact; for more it is approximate
_SPARE: Final = 8  # number of proposals beyond k, so that the last is nearly always clearly farther than the k-th
_EPSILON32: Final = float(np.finfo(np.float32).eps)
_LARGEST32: Final = float(np.finfo(np.float32).max)  # distance that faiss reports where float32 overflows
_ROUNDING: Final = 1e-9  # relative error far above the rounding of float64 distances

faiss.omp_set_num_threads(1)  # queries last microseconds, and waking threads costs more than it saves
# Above this threshold faiss computes |a|^2 + |b|^2 - 2ab, whose cancellation would break `_surely_proposed`.
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

    _NEWEST: Final = 1024  # most rows outside the tree, or a thirty-second of the tree if that is more

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._tree: cKDTree | None = None
        self._n_in_tree = 0

    def nearest(self, query: Array, k: int) -> Rows:
        """The ``(min(k, n),)`` rows nearest to ``query`` ``(dim,)``, nearest first.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        keys, n = self.keys.rows, len(self.keys)
        if n - self._n_in_tree > max(self._NEWEST, self._n_in_tree // 32):
            # The two options do not change results; while they are off, the tree is built twice as fast.
            self._tree, self._n_in_tree = cKDTree(keys, balanced_tree=False, compact_nodes=False), n
        newest = np.arange(self._n_in_tree, n)
        if self._tree is None:
            return _nearest_of(keys, query, newest, k)[0]
        n_proposed = min(k + _SPARE, self._tree.n)
        distances, proposed = self._tree.query(query, n_proposed)
        beyond = distances[-1] if n_proposed < self._tree.n else np.inf  # least distance of the other rows of the tree
        rows, squared = _nearest_of(keys, query, np.concatenate((np.sort(proposed), newest)), k)
        reach = math.sqrt(squared[-1]) * (1 + _ROUNDING)
        if reach < beyond:
            return rows
        ball = self._tree.query_ball_point(query, reach, return_sorted=True)
        return _nearest_of(keys, query, np.concatenate((np.array(ball, dtype=np.int64), newest)), k)[0]


class PolicyNeighbours:
    """Neighbours in many dimensions: exact for up to ``EXACT_UP_TO`` rows; for more rows, nearly all are found.

    If there are more, rows lie in cells around some of the first rows; only the cells nearest to a query are searched.
    """

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._index: faiss.Index = faiss.IndexFlatL2(keys.dim)
        self._exact = True

    def nearest(self, queries: Array, k: int, within: float = np.inf) -> list[Rows]:
        """For each of ``queries`` ``(m, dim)`` at most ``k`` rows not farther than ``within``, nearest first.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        keys = self.keys.rows
        if len(keys) <= k + _SPARE:
            return [_rank(keys, query, k, within) for query in queries]
        if self._exact and len(keys) > EXACT_UP_TO:
            self._index, self._exact = _in_cells(_float32(keys[:EXACT_UP_TO])), False
        if self._index.ntotal < len(keys):
            self._index.add(_float32(keys[self._index.ntotal :]))
        squared32, proposed = self._index.search(_float32(queries), k + _SPARE)
        found: list[Rows] = []
        for query, rows, squared, beyond in zip(
            queries, *_decide(keys, queries, proposed, k), squared32[:, -1].astype(np.float64), strict=True
        ):
            if self._exact:
                enough = _surely_proposed(query, min(math.sqrt(squared[-1]), within), beyond)
            else:
                enough = squared[-1] < np.inf  # False if cells are nearly empty, or the query overflows float32
            found.append(rows[squared <= within * within] if enough else _rank(keys, query, k, within))
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


def _surely_proposed(query: Array, reach: float, beyond: float) -> bool:
    """Whether all rows within ``reach`` of ``query`` were proposed, if all other rows have a squared float32 distance
    of at least ``beyond``.

    Rounding a key, the query, their difference and the sum to float32 changes a distance of ``reach`` by at most
    ``error``.
    """
    error = _EPSILON32 * (len(query) + 5) * (reach + math.sqrt((query * query).sum()))
    return (reach + error) ** 2 < beyond < _LARGEST32


def _decide(keys: Array, queries: Array, proposed: Rows, k: int) -> tuple[Rows, Array]:
    """The ``k`` nearest of the rows ``proposed`` ``(m, n)`` for each query, nearest first, and their squared distances;
    the distance is infinite for row -1."""
    proposed.sort(axis=1)  # the stable sort below then leaves ties in order of row number
    squared = squared_distances(keys[proposed], queries[:, None])
    squared[proposed < 0] = np.inf
    order = squared.argsort(axis=1, kind="stable")[:, :k]
    return np.take_along_axis(proposed, order, axis=1), np.take_along_axis(squared, order, axis=1)


def _rank(keys: Array, query: Array, k: int, within: float) -> Rows:
    rows, squared = _nearest_of(keys, query, np.arange(len(keys)), k)
    return rows[squared <= within * within]


def _nearest_of(keys: Array, query: Array, rows: Rows, k: int) -> tuple[Rows, Array]:
    """The ``k`` nearest of the increasing ``rows``, and their squared distances."""
    squared = squared_distances(keys[rows], query)
    if k < len(rows):
        near = squared <= np.partition(squared, k - 1)[k - 1]  # equal distances included; the sort keeps older rows
        rows, squared = rows[near], squared[near]
    order = squared.argsort(kind="stable")[:k]
    return rows[order], squared[order]


def squared_distances(points: Array, query: Array) -> Array:
    """Squared distances ``(...)`` between ``points`` and ``query``, ``(..., dim)`` each."""
    difference = points - query
    return (difference * difference).sum(axis=-1)
