"""Memory: all exemplars (c, theta, tau) of a learner, and the exact nearest neighbours among them.

Sections 3.2 and 4.4 of Nguyen & Oudeyer (2014): the set M. The outcome side answers "which movements landed near
there?" (H of eq. 8), the policy side "which movements are like this one?" (K_h of eq. 8).
    memory.add(context, theta, outcome); rows = memory.near_outcomes(context, goal, k=10); memory.thetas[rows]
"""

from __future__ import annotations

import os
from typing import Final

import faiss
import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.files import read_npz, write_npz
from sgimd_torch.spaces import Array, check_point, check_vector

Rows = NDArray[np.int64]

_VERSION: Final = 1
_MOST_DIMS: Final = 100_000  # of a table in a file
_NO_CONTEXT: Final = "an environment without contexts gives np.zeros(0)"
_EPSILON32: Final = float(np.finfo(np.float32).eps)
_LARGEST32: Final = float(np.finfo(np.float32).max)  # what faiss reports where float32 overflowed

faiss.omp_set_num_threads(1)  # queries last microseconds: to wake other threads costs more than they save
faiss.cvar.distance_compute_blas_threshold = 2**20  # above it |a|^2 + |b|^2 - 2ab cancels, and _Neighbours' bound fails


class Memory:
    """Exemplars in the order in which they were added; the row number of an exemplar never changes.

    Args:
        context_dim: 0 without contexts, as in the fishing task.
        theta_dim, outcome_dim: at least 1.
        context_weight: in distances, the length of one unit of context next to one unit of outcome or theta.

    Raises:
        ValueError: a dimension or the weight is out of range.
    """

    def __init__(self, context_dim: int, theta_dim: int, outcome_dim: int, *, context_weight: float = 1.0) -> None:
        if context_dim < 0 or theta_dim < 1 or outcome_dim < 1:
            raise ValueError(
                "Memory needs context_dim >= 0, theta_dim >= 1 and outcome_dim >= 1, "
                f"got {context_dim}, {theta_dim} and {outcome_dim}"
            )
        if not 0 <= context_weight < np.inf:
            raise ValueError(f"context_weight must be finite and >= 0, got {context_weight}")
        self.context_dim, self.theta_dim, self.outcome_dim = context_dim, theta_dim, outcome_dim
        self.context_weight = context_weight
        self._contexts, self._thetas, self._outcomes = _Table(context_dim), _Table(theta_dim), _Table(outcome_dim)
        self._outcome_side = _Neighbours(context_dim + outcome_dim)
        self._policy_side = _Neighbours(context_dim + theta_dim)

    def __len__(self) -> int:
        return len(self._thetas.rows)

    @property
    def contexts(self) -> Array:
        """``(n, context_dim)`` read-only; exemplars that are added later do not appear in it."""
        return self._contexts.rows

    @property
    def thetas(self) -> Array:
        """``(n, theta_dim)`` read-only."""
        return self._thetas.rows

    @property
    def outcomes(self) -> Array:
        """``(n, outcome_dim)`` read-only."""
        return self._outcomes.rows

    def add(self, context: ArrayLike, theta: ArrayLike, outcome: ArrayLike) -> None:
        """Remember one exemplar: ``(context_dim,)``, ``(theta_dim,)``, ``(outcome_dim,)``.

        Raises:
            ValueError: a wrong shape, or a value that is not finite or beyond 1e100; nothing is remembered then.
        """
        context = check_point("context", context, self.context_dim, _NO_CONTEXT)
        theta = check_point("theta", theta, self.theta_dim, "was a goal passed instead?")
        try:
            outcome = check_point("outcome", outcome, self.outcome_dim, "did the simulation diverge, or is it a theta?")
        except ValueError as error:
            raise ValueError(f"{error}; its theta was {theta.tolist()}") from None
        self._append(context[None], theta[None], outcome[None])

    def near_outcomes(self, context: ArrayLike, goal: ArrayLike, k: int) -> Rows:
        """``(min(k, n),)`` rows whose outcomes lie nearest to ``goal`` ``(outcome_dim,)``, nearest first; of equally
        near ones the oldest first."""
        goal = check_point("goal", goal, self.outcome_dim, "was a theta passed instead?")
        return self._outcome_side.nearest(self._key(context, goal)[None], k)[0]

    def near_policies(self, context: ArrayLike, theta: ArrayLike, k: int, within: float = np.inf) -> Rows:
        """At most ``k`` rows whose thetas lie nearest to ``theta`` ``(theta_dim,)``, not farther than ``within``."""
        theta = check_point("theta", theta, self.theta_dim, "was a goal passed instead?")
        return self._policy_side.nearest(self._key(context, theta)[None], k, within)[0]

    def neighbourhoods(self, rows: Rows, k: int, within: float = np.inf) -> list[Rows]:
        """For each of ``rows`` what :meth:`near_policies` gives for its context and theta; it is its own neighbour."""
        return self._policy_side.nearest(self._policy_side.keys.rows[rows], k, within)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an npz file without pickle; ``path`` holds the old file or the whole new one."""
        arrays = {"contexts": self.contexts, "thetas": self.thetas, "outcomes": self.outcomes}
        write_npz(path, {"version": _VERSION, "context_weight": self.context_weight, **arrays})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Memory:
        """The memory that :meth:`save` wrote.

        Raises:
            ValueError: not such a file, truncated, of another version, or with arrays that do not fit together.
            OSError: there is no file, or it is a directory.
        """
        weight, contexts, thetas, outcomes = _read(path)
        memory = cls(contexts.shape[1], thetas.shape[1], outcomes.shape[1], context_weight=weight)
        memory._append(contexts, thetas, outcomes)
        return memory

    def _append(self, contexts: Array, thetas: Array, outcomes: Array) -> None:
        weighted = self.context_weight * contexts
        self._contexts.append(contexts)
        self._thetas.append(thetas)
        self._outcomes.append(outcomes)
        self._outcome_side.append(np.concatenate((weighted, outcomes), axis=1))
        self._policy_side.append(np.concatenate((weighted, thetas), axis=1))

    def _key(self, context: ArrayLike, point: Array) -> Array:
        context = check_point("context", context, self.context_dim, _NO_CONTEXT)
        return np.concatenate((self.context_weight * context, point))


class _Table:
    """Rows in an array that doubles when full."""

    def __init__(self, dim: int) -> None:
        self._room = np.empty((64, dim))
        self.rows: Array = _read_only_view(self._room[:0])

    def append(self, rows: Array) -> None:
        n_old, n_new = len(self.rows), len(self.rows) + len(rows)
        if n_new > len(self._room):
            room = np.empty((max(n_new, 2 * len(self._room)), self._room.shape[1]))
            room[:n_old] = self.rows
            self._room = room
        self._room[n_old:n_new] = rows
        self.rows = _read_only_view(self._room[:n_new])


class _Neighbours:
    """Exact float64 neighbours: faiss proposes in float32, float64 decides."""

    _SPARE: Final = 8  # proposals beyond k, so that the last one nearly always lies clearly beyond the k-th

    def __init__(self, dim: int) -> None:
        self.keys = _Table(dim)
        self._index = faiss.IndexFlatL2(dim)

    def append(self, keys: Array) -> None:
        self.keys.append(keys)
        with np.errstate(over="ignore"):  # faiss then finds nothing near, and ``nearest`` compares all rows
            self._index.add(keys.astype(np.float32))

    def nearest(self, queries: Array, k: int, within: float = np.inf) -> list[Rows]:
        """For each of ``queries`` ``(m, dim)`` at most ``k`` rows not farther than ``within``, nearest first; ties stay
        in the order of row numbers."""
        if k < 1:
            raise ValueError(f"k must be at least 1, got {k}")
        keys = self.keys.rows
        if len(keys) <= k + self._SPARE:
            return [_rank(keys, query, k, within) for query in queries]
        with np.errstate(over="ignore"):
            squared32, proposed = self._index.search(queries.astype(np.float32), k + self._SPARE)
        proposed.sort(axis=1)  # the stable sort below then leaves ties in order of row number
        squared = _squared_distances(keys[proposed], queries[:, None])
        order = squared.argsort(axis=1, kind="stable")[:, :k]
        squared = np.take_along_axis(squared, order, axis=1)
        rows = np.take_along_axis(proposed, order, axis=1)
        # A row that was not proposed has squared32 >= the last one's. If it were as near as `reach`, rounding its key,
        # the query, their difference and the sum to float32 could not have put it beyond `reach + error`.
        reach = np.minimum(np.sqrt(squared[:, -1]), within)
        error = _EPSILON32 * (queries.shape[1] + 5) * (reach + np.sqrt((queries * queries).sum(axis=1)))
        last = squared32[:, -1]
        certain = ((reach + error) ** 2 < last) & (last < _LARGEST32)
        inside = (squared <= within * within).sum(axis=1)
        return [rows[i, : inside[i]] if certain[i] else _rank(keys, queries[i], k, within) for i in range(len(queries))]


def _rank(keys: Array, query: Array, k: int, within: float) -> Rows:
    squared = _squared_distances(keys, query)
    rows = squared.argsort(kind="stable")[:k]
    return rows[squared[rows] <= within * within]


def _squared_distances(points: Array, query: Array) -> Array:
    difference = points - query
    return (difference * difference).sum(axis=-1)


def _read_only_view(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _read(path: str | os.PathLike[str]) -> tuple[float, Array, Array, Array]:
    names = ("context_weight", "contexts", "thetas", "outcomes")
    weight, *tables = read_npz(path, "saved Memory", "Memory.save", _VERSION, names)
    fitting = all(t.dtype == np.float64 and t.ndim == 2 and len(t) == len(tables[0]) for t in tables)
    if weight.shape != () or weight.dtype.kind not in "iuf" or not fitting:
        shapes = [f"{array.dtype} {array.shape}" for array in (weight, *tables)]
        raise ValueError(f"{path} must hold a number and three float64 tables of equal length, got {shapes}")
    if not 0 <= weight < np.inf:
        raise ValueError(f"{path} has context_weight {weight}, which must be finite and >= 0")
    dims = [table.shape[1] for table in tables]
    if not (dims[1] and dims[2]) or max(dims) > _MOST_DIMS:  # room is made for a table without rows, too
        raise ValueError(f"{path} must have 1 to {_MOST_DIMS} dimensions of theta and outcome, got {dims[1:]}")
    contexts, thetas, outcomes = (check_vector(f"a table of {path}", table, table.shape[1]) for table in tables)
    return float(weight), contexts, thetas, outcomes
