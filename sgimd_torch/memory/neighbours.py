"""Nearest rows of a growing table: exact ones by a tree, or by comparing with all; in a large policy space by an index.

Memory asks it "which movements landed near there?" (section 4.4.2 of Nguyen & Oudeyer, 2014: H of eq. 8) and "which
movements are like this one?" (K_h). scipy or faiss proposes, float64 decides; of equally near rows the older is nearer.
    side = TreeNeighbours(Table(2)); side.keys.append(keys); rows = side.nearest(query, k=10)
What is found depends on the rows alone, not on when it is asked. Trees and indices catch up with the table when asked.
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

EXACT_UP_TO: Final = 2**15  # rows that a policy space compares with all; what it finds in more rows is approximate
_SPARE: Final = 8  # proposals beyond k, so that the last one nearly always lies clearly beyond the k-th
_EPSILON32: Final = float(np.finfo(np.float32).eps)
_LARGEST32: Final = float(np.finfo(np.float32).max)  # what faiss reports where float32 overflowed
_ROUNDING: Final = 1e-9  # relative; far more than two ways to add up a float64 distance differ by

faiss.omp_set_num_threads(1)  # queries last microseconds: to wake other threads costs more than they save
faiss.cvar.distance_compute_blas_threshold = 2**20  # above it |a|^2 + |b|^2 - 2ab cancels, and _Flat's bound fails


class Table:
    """Rows in an array that doubles when full."""

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

    _NEWEST: Final = 1024  # rows without a tree, or a thirty-second of all if these are more

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._tree: cKDTree | None = None
        self._newest = _Flat(keys, 0)

    def nearest(self, query: Array, k: int) -> Rows:
        """``(min(k, n),)`` rows, nearest to ``query`` ``(dim,)`` first.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        n = len(self.keys)
        if n - self._newest.first > max(self._NEWEST, self._newest.first // 32):
            # Neither option changes what is found; without them it is built twice as fast.
            self._tree = cKDTree(self.keys.rows, balanced_tree=False, compact_nodes=False)
            self._newest = _Flat(self.keys, n)
        if self._tree is None:
            return self._newest.nearest(query[None], k)[0]
        return self._nearest(self._tree, query, k)

    def _nearest(self, tree: cKDTree, query: Array, k: int) -> Rows:
        n_proposed = min(k + _SPARE, tree.n)
        distances, proposed = tree.query(query, n_proposed)
        beyond = distances[-1] if n_proposed < tree.n else np.inf  # no row that the tree did not propose is nearer
        newest, beyond_newest = self._newest.propose(query[None], k + _SPARE)
        rows, squared = _nearest_of(self.keys.rows, query, np.sort(np.concatenate((proposed, newest[0]))), k)
        reach = math.sqrt(squared[-1])
        if reach * (1 + _ROUNDING) < beyond and _surely_proposed(query, reach, beyond_newest[0]):
            return rows
        ball = tree.query_ball_point(query, reach * (1 + _ROUNDING), return_sorted=True)
        rows = np.concatenate((np.array(ball, dtype=np.int64), np.arange(tree.n, len(self.keys))))
        return _nearest_of(self.keys.rows, query, rows, k)[0]


class PolicyNeighbours:
    """Neighbours in many dimensions: exact among up to ``EXACT_UP_TO`` rows; among more nearly all of them are found.

    Above that, rows are kept in generations, each as large as all before it together. A generation is cut into cells
    around rows of the one before (the first: around its own), and only the cells nearest to a query are searched. So no
    row ever moves, and no addition takes long.
    """

    def __init__(self, keys: Table) -> None:
        self.keys = keys
        self._all: _Flat | None = _Flat(keys, 0)
        self._generations: list[_Cells] = []

    def nearest(self, queries: Array, k: int, within: float = np.inf) -> list[Rows]:
        """For each of ``queries`` ``(m, dim)`` at most ``k`` rows not farther than ``within``, nearest first.

        Raises:
            ValueError: ``k`` is below 1.
        """
        _check_k(k)
        if len(self.keys) <= EXACT_UP_TO:
            assert self._all is not None
            return self._all.nearest(queries, k, within)
        self._all = None
        self._catch_up()
        keys, queries32 = self.keys.rows, _float32(queries)
        proposed = np.hstack([cells.propose(queries32, k + _SPARE) for cells in self._generations])
        return [
            rows[: int((squared <= within * within).sum())]
            if squared[-1] < np.inf  # too few are proposed where cells are nearly empty, or a query is beyond float32
            else _rank(keys, query, k, within)
            for query, rows, squared in zip(queries, *_decide(keys, queries, proposed, k), strict=True)
        ]

    def _catch_up(self) -> None:
        keys = self.keys.rows
        if not self._generations:
            self._generations.append(_Cells(keys[:EXACT_UP_TO], 0, EXACT_UP_TO))
        self._generations[-1].catch_up(keys)
        while (stop := self._generations[-1].stop) < len(keys):
            before = keys[self._generations[-1].first : stop]
            self._generations.append(_Cells(before, stop, 2 * stop))
            self._generations[-1].catch_up(keys)


class _Flat:
    """All rows from ``first`` on, compared in float32."""

    def __init__(self, keys: Table, first: int) -> None:
        self.keys, self.first = keys, first
        self._index = faiss.IndexFlatL2(keys.dim)

    def propose(self, queries: Array, n: int) -> tuple[Rows, Array]:
        """For each of ``queries`` ``(m, dim)`` the ``n`` rows nearest in float32, ``(m, n)`` or fewer columns, and the
        squared distance ``(m,)`` in float32 that no other row is below, infinite if there is none."""
        keys = self.keys.rows[self.first :]
        if self._index.ntotal < len(keys):
            self._index.add(_float32(keys[self._index.ntotal :]))
        if n >= len(keys):
            rows = np.arange(self.first, self.first + len(keys))
            return np.tile(rows, (len(queries), 1)), np.full(len(queries), np.inf)
        squared32, proposed = self._index.search(_float32(queries), n)
        return proposed + self.first, squared32[:, -1].astype(np.float64)

    def nearest(self, queries: Array, k: int, within: float = np.inf) -> list[Rows]:
        """The exact ones, if ``first`` is 0."""
        keys = self.keys.rows
        if len(keys) <= k + _SPARE:
            return [_rank(keys, query, k, within) for query in queries]
        proposed, beyond = self.propose(queries, k + _SPARE)
        found = _decide(keys, queries, proposed, k)
        return [
            rows[: int((squared <= within * within).sum())]
            if _surely_proposed(query, min(math.sqrt(squared[-1]), within), last)
            else _rank(keys, query, k, within)
            for query, rows, squared, last in zip(queries, *found, beyond, strict=True)
        ]


class _Cells:
    """One generation: the rows from ``first`` to ``stop``, each in the cell of the nearest of some ``rows``."""

    _SEARCHED: Final = 16  # cells for each query

    def __init__(self, rows: Array, first: int, stop: int) -> None:
        self.first, self.stop = first, stop
        n_cells = 4 * math.isqrt(stop - first)
        centres = _float32(rows[:: len(rows) // n_cells][:n_cells])
        self._centres = faiss.IndexFlatL2(centres.shape[1])
        self._centres.add(centres)
        self._index = faiss.IndexIVFFlat(self._centres, centres.shape[1], n_cells)
        self._index.is_trained = True  # nothing is left to learn: the centres are given
        self._index.nprobe = self._SEARCHED

    def catch_up(self, keys: Array) -> None:
        """Take in what is new in ``keys`` ``(n, dim)``, all rows of the table."""
        new = keys[self.first + self._index.ntotal : self.stop]
        if len(new):
            self._index.add(_float32(new))

    def propose(self, queries32: NDArray[np.float32], n: int) -> Rows:
        """``(m, n)`` rows near each of ``(m, dim)`` queries; -1 stands for none."""
        _, rows = self._index.search(queries32, n)
        return np.where(rows < 0, -1, rows + self.first)


def _check_k(k: int) -> None:
    if k < 1:
        raise ValueError(f"k must be at least 1, got {k}")


def _float32(array: Array) -> NDArray[np.float32]:
    """What is too large becomes infinite.

    Not by ``np.errstate``: it sets a context variable. In Python 3.11 the garbage collector may run meanwhile and end
    the attempt of a learner that was dropped, which asks a memory, too; to set the variable twice at once is a crash.
    """
    large = np.abs(array) > _LARGEST32
    return np.where(large, np.copysign(np.inf, array), array).astype(np.float32)


def _surely_proposed(query: Array, reach: float, beyond: float) -> bool:
    """Whether all rows within ``reach`` of ``query`` were proposed, if those that were not lie ``beyond``, a squared
    distance in float32.

    Rounding a key, the query, their difference and the sum to float32 puts nothing from ``reach`` to beyond
    ``reach + error``.
    """
    error = _EPSILON32 * (len(query) + 5) * (reach + math.sqrt((query * query).sum()))
    return beyond == np.inf or ((reach + error) ** 2 < beyond < _LARGEST32)


def _decide(keys: Array, queries: Array, proposed: Rows, k: int) -> tuple[Rows, Array]:
    """Of the rows ``proposed`` ``(m, n)`` for each query the ``k`` nearest, nearest first, and their squared distances,
    infinite for -1."""
    proposed.sort(axis=1)  # the stable sort below then leaves ties in order of row number
    squared = squared_distances(keys[proposed], queries[:, None])
    squared[proposed < 0] = np.inf
    order = squared.argsort(axis=1, kind="stable")[:, :k]
    return np.take_along_axis(proposed, order, axis=1), np.take_along_axis(squared, order, axis=1)


def _rank(keys: Array, query: Array, k: int, within: float) -> Rows:
    rows, squared = _nearest_of(keys, query, np.arange(len(keys)), k)
    return rows[squared <= within * within]


def _nearest_of(keys: Array, query: Array, rows: Rows, k: int) -> tuple[Rows, Array]:
    """The ``k`` nearest of increasing ``rows``, and their squared distances."""
    squared = squared_distances(keys[rows], query)
    order = squared.argsort(kind="stable")[:k]
    return rows[order], squared[order]


def squared_distances(points: Array, query: Array) -> Array:
    """``(...)`` between ``points`` and ``query``, ``(..., dim)``."""
    difference = points - query
    return (difference * difference).sum(axis=-1)
