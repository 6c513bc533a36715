"""Memory: all exemplars (c, theta, tau) of a learner, and the nearest neighbours among them.

Sections 3.2 and 4.4 of Nguyen & Oudeyer (2014): the set M. `near_outcomes` finds movements that landed near a point (H
of eq. 8), and `near_policies` finds movements similar to a given movement (K_h of eq. 8).
    memory.add(context, theta, outcome); rows = memory.near_outcomes(context, goal, k=10); memory.thetas[rows]
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Final, Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat, Graph, Rows, Scan
from sgimd_torch.spaces import Array, Box, check_point, read_only

__all__ = ["FlatMemory", "Memory", "Neighbours", "Rows", "ScanMemory"]

_NO_CONTEXT: Final = "an environment without contexts gives np.zeros(0)"


class Neighbours(Protocol):
    """Neighbours among the rows of a growing table, ``keys``."""

    keys: Growing

    def nearest(self, queries: Array, k: int, within: float = ...) -> Rows:
        """See `neighbours.Scan.nearest`."""


class Memory:
    """Flat index of faiss; of more than some 10^4 exemplars a graph (HNSW), which finds nearly all neighbours.

    Exemplars keep the order in which they were added; the row number of an exemplar never changes. In distances, one
    unit of context counts as much as one unit of outcome or theta. A subclass may have another `index`, by which
    inverse models, too, find similar movements.

    Args:
        context_dim: dimension of C; 0 if there are no contexts, as in the fishing task.
        theta_dim, outcome_dim: dimensions of Pi and T, at least 1.

    Raises:
        ValueError: a dimension is out of range.
    """

    space: Box | None = None  # T, if outcomes wrap

    def __init__(self, context_dim: int, theta_dim: int, outcome_dim: int) -> None:
        if context_dim < 0 or theta_dim < 1 or outcome_dim < 1:
            raise ValueError(
                "Memory needs context_dim >= 0, theta_dim >= 1 and outcome_dim >= 1, "
                f"got {context_dim}, {theta_dim} and {outcome_dim}"
            )
        self.context_dim, self.theta_dim, self.outcome_dim = context_dim, theta_dim, outcome_dim
        self._begin()

    def _begin(self) -> None:
        dims = self.context_dim, self.theta_dim, self.outcome_dim
        self._contexts, self._thetas, self._outcomes = map(Growing, dims)
        self._on_circles = Growing(dims[2] + sum(self.space.periodic)) if self.space else self._outcomes
        # A key is a context followed by an outcome or by a theta; without contexts, outcomes and thetas are the keys.
        self._by_outcome = self.index(Growing(dims[0] + self._on_circles.dim) if dims[0] else self._on_circles)
        self._by_theta = self.index(Growing(dims[0] + dims[1]) if dims[0] else self._thetas)
        self._range = np.stack((np.full(dims[1], np.inf), np.full(dims[1], -np.inf)))

    def index(self, keys: Growing) -> Neighbours:
        """Neighbours among the rows of a growing table, here and for inverse models."""
        return Graph(keys)

    def __len__(self) -> int:
        return len(self._thetas)

    @property
    def contexts(self) -> Array:
        """``(n, context_dim)`` read-only; exemplars that are added later do not appear in this array."""
        return self._contexts.rows

    @property
    def thetas(self) -> Array:
        """``(n, theta_dim)`` read-only."""
        return self._thetas.rows

    @property
    def outcomes(self) -> Array:
        """``(n, outcome_dim)`` read-only."""
        return self._outcomes.rows

    @property
    def on_circles(self) -> Array:
        """Outcomes, see `Box.on_circles`; the ``outcomes`` themselves if none wraps."""
        return self._on_circles.rows

    def outcomes_around(self, goal: Array, rows: Rows | slice = slice(None)) -> Array:
        """``(n, outcome_dim)``, the outcomes of some ``rows``, unwrapped around a ``goal`` ``(outcome_dim,)``."""
        outcomes = self.outcomes[rows]
        return read_only(self.space.unwrapped(outcomes, goal)) if self.space else outcomes

    @property
    def theta_range(self) -> Array:
        """``(2, theta_dim)``, least and greatest value of each parameter so far; infinite for an empty memory."""
        return self._range

    def add(self, context: ArrayLike, theta: ArrayLike, outcome: ArrayLike) -> None:
        """Remember one exemplar: ``(context_dim,)``, ``(theta_dim,)``, ``(outcome_dim,)``.

        Raises:
            ValueError: a shape is wrong, or a value is not finite or is beyond 1e100; then nothing is remembered.
        """
        context = check_point("context", context, self.context_dim, _NO_CONTEXT)
        theta = check_point("theta", theta, self.theta_dim, "was a goal passed instead?")
        self.extend(context[None], theta[None], self.check_outcome(theta, outcome)[None])

    def check_outcome(self, theta: Array, outcome: ArrayLike) -> Array:
        """The outcome ``(outcome_dim,)`` of a ``theta`` as float64.

        Raises:
            ValueError: another shape, or a value is not finite or is beyond 1e100.
        """
        try:
            return check_point("outcome", outcome, self.outcome_dim, "did the simulation diverge, or is it a theta?")
        except ValueError as error:
            raise ValueError(f"{error}; its theta was {theta.tolist()}") from None

    def near_outcomes(self, context: ArrayLike, goal: ArrayLike, k: int) -> Rows:
        """Rows ``(min(k, n),)`` whose contexts and outcomes lie nearest to ``context`` and ``goal`` ``(outcome_dim,)``,
        nearest first; of equally near rows, the oldest first."""
        goal = check_point("goal", goal, self.outcome_dim, "was a theta passed instead?")
        goal = self.space.on_circles(goal) if self.space else goal
        return self._by_outcome.nearest(self._key(context, goal)[None], k)[0]

    def near_each(self, context: Array, goals: Array) -> Rows:
        """Row of the exemplar whose context and outcome lie nearest to ``context`` and each of ``goals``, ``(n,)``."""
        goals = self.space.on_circles(goals) if self.space else goals
        keys = np.concatenate((np.tile(context, (len(goals), 1)), goals), axis=1) if self.context_dim else goals
        return self._by_outcome.nearest(keys, 1)[:, 0]

    def near_policies(self, context: ArrayLike, theta: ArrayLike, k: int, within: float = np.inf) -> Rows:
        """At most ``k`` rows whose contexts and thetas lie nearest to ``context`` and ``theta`` ``(theta_dim,)``, not
        farther than ``within``."""
        theta = check_point("theta", theta, self.theta_dim, "was a goal passed instead?")
        (rows,) = self._by_theta.nearest(self._key(context, theta)[None], k, within)
        return rows[rows >= 0]

    def neighbourhoods(self, rows: Rows, k: int, within: float = np.inf) -> Rows:
        """Result of :meth:`near_policies` for the context and theta of each of ``rows``, ``(len(rows), min(k, n))``,
        with -1 where there are fewer; a row is its own neighbour."""
        return self._by_theta.nearest(self._by_theta.keys.rows[rows], k, within)

    def copy(self, space: Box | None = None) -> Self:
        """A memory with copies of the exemplars; in a ``space`` T whose outcomes wrap, neighbours are found across."""
        memory = self.empty(space)
        memory.extend(self.contexts, self.thetas, self.outcomes)
        return memory

    def empty(self, space: Box | None = None) -> Self:
        """A memory of the same kind, without exemplars; for ``space`` see :meth:`copy`."""
        memory = copy(self)
        if space is not None:
            memory.space = space if space.periodic else None
        memory._begin()
        return memory

    def extend(self, contexts: Array, thetas: Array, outcomes: Array) -> None:
        """Remember exemplars ``(n, dim)`` that another memory, or the learner, has checked."""
        for table, rows in ((self._contexts, contexts), (self._thetas, thetas), (self._outcomes, outcomes)):
            table.append(rows)
        if self.space:
            self._on_circles.append(outcomes := self.space.on_circles(outcomes))
        if len(thetas):
            lowest, highest = self._range
            self._range = np.array((np.minimum(lowest, thetas.min(axis=0)), np.maximum(highest, thetas.max(axis=0))))
        if self.context_dim:
            self._by_outcome.keys.append(np.concatenate((contexts, outcomes), axis=1))
            self._by_theta.keys.append(np.concatenate((contexts, thetas), axis=1))

    def _key(self, context: ArrayLike, point: Array) -> Array:
        context = check_point("context", context, self.context_dim, _NO_CONTEXT)
        return np.concatenate((context, point)) if self.context_dim else point.copy()


class FlatMemory(Memory):
    """Flat index of faiss, however many exemplars there are."""

    def index(self, keys: Growing) -> Neighbours:
        """See `Memory.index`."""
        return Flat(keys)


class ScanMemory(Memory):
    """Comparison with every exemplar in double precision, without faiss."""

    def index(self, keys: Growing) -> Neighbours:
        """See `Memory.index`."""
        return Scan(keys)


MakeMemory: TypeAlias = Callable[[int, int, int], Memory]


def memory_for(memory: Memory | MakeMemory, dims: tuple[int, int, int], outcomes: Box | None = None) -> Memory:
    """A memory for a learner with these dimensions: a new one, or a copy of a ``memory`` to start from.

    Raises:
        ValueError: the memory has other dimensions, or one of a user's does not find the nearest rows.
    """
    if not isinstance(memory, Memory):
        memory = memory(*dims)
        if not isinstance(memory, Memory):
            raise ValueError(f"a memory must derive from Memory, got a {type(memory).__name__}")
    own = memory.context_dim, memory.theta_dim, memory.outcome_dim
    if own != dims:
        raise ValueError(f"a memory to start from must have dims {dims} of context, theta, outcome, got {own}")
    if type(memory) not in (Memory, FlatMemory, ScanMemory):
        from sgimd_torch.memory.trial import check_memory  # few users bring a memory

        check_memory(memory)
    return memory.copy(outcomes)
