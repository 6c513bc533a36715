"""Memory: all exemplars (c, theta, tau) of a learner, and the nearest neighbours among them.

Sections 3.2 and 4.4 of Nguyen & Oudeyer (2014): the set M. `near_outcomes` finds movements that landed near a point (H
of eq. 8), and `near_policies` finds movements similar to a given movement (K_h of eq. 8).
    memory.add(context, theta, outcome); rows = memory.near_outcomes(context, goal, k=10); memory.thetas[rows]
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Neighbours, Rows
from sgimd_torch.spaces import Array, check_point

__all__ = ["Memory", "Rows"]

_NO_CONTEXT: Final = "an environment without contexts gives np.zeros(0)"


class Memory:
    """Exemplars in the order in which they were added; the row number of an exemplar never changes.

    In distances, one unit of context counts as much as one unit of outcome or theta.

    Args:
        context_dim: dimension of C; 0 if there are no contexts, as in the fishing task.
        theta_dim, outcome_dim: dimensions of Pi and T, at least 1.

    Raises:
        ValueError: a dimension is out of range.
    """

    def __init__(self, context_dim: int, theta_dim: int, outcome_dim: int) -> None:
        if context_dim < 0 or theta_dim < 1 or outcome_dim < 1:
            raise ValueError(
                "Memory needs context_dim >= 0, theta_dim >= 1 and outcome_dim >= 1, "
                f"got {context_dim}, {theta_dim} and {outcome_dim}"
            )
        self.context_dim, self.theta_dim, self.outcome_dim = context_dim, theta_dim, outcome_dim
        self._contexts, self._thetas, self._outcomes = Growing(context_dim), Growing(theta_dim), Growing(outcome_dim)
        # A key is a context followed by an outcome or by a theta; without contexts, outcomes and thetas are the keys.
        self._by_outcome = Neighbours(Growing(context_dim + outcome_dim) if context_dim else self._outcomes)
        self._by_theta = Neighbours(Growing(context_dim + theta_dim) if context_dim else self._thetas)
        self._range = np.stack((np.full(theta_dim, np.inf), np.full(theta_dim, -np.inf)))

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
        return self._by_outcome.nearest_to(self._key(context, goal), k)

    def near_policies(self, context: ArrayLike, theta: ArrayLike, k: int, within: float = np.inf) -> Rows:
        """At most ``k`` rows whose contexts and thetas lie nearest to ``context`` and ``theta`` ``(theta_dim,)``, not
        farther than ``within``.

        With more than ``EXACT_UP_TO`` exemplars in memory some of these rows may be missing, see `Neighbours`.
        """
        theta = check_point("theta", theta, self.theta_dim, "was a goal passed instead?")
        (rows,) = self._by_theta.nearest(self._key(context, theta)[None], k, within)
        return rows[rows >= 0]

    def neighbourhoods(self, rows: Rows, k: int, within: float = np.inf) -> Rows:
        """Result of :meth:`near_policies` for the context and theta of each of ``rows``, ``(len(rows), min(k, n))``,
        with -1 where there are fewer; a row is its own neighbour."""
        return self._by_theta.around(rows, k, within)

    def copy_for(self, dims: tuple[int, int, int]) -> Memory:
        """A copy for a learner with these dimensions.

        Raises:
            ValueError: the memory has other dimensions of context, theta or outcome.
        """
        own = self.context_dim, self.theta_dim, self.outcome_dim
        if own != dims:
            raise ValueError(f"a memory to start from must have dims {dims} of context, theta, outcome, got {own}")
        return self.copy()

    def copy(self) -> Memory:
        """A memory with copies of the exemplars."""
        memory = Memory(self.context_dim, self.theta_dim, self.outcome_dim)
        memory.extend(self.contexts, self.thetas, self.outcomes)
        return memory

    def extend(self, contexts: Array, thetas: Array, outcomes: Array) -> None:
        """Remember exemplars ``(n, dim)`` that another memory, or the learner, has checked."""
        for table, rows in ((self._contexts, contexts), (self._thetas, thetas), (self._outcomes, outcomes)):
            table.append(rows)
        if len(thetas):
            lowest, highest = self._range
            self._range = np.array((np.minimum(lowest, thetas.min(axis=0)), np.maximum(highest, thetas.max(axis=0))))
        if self.context_dim:
            self._by_outcome.keys.append(np.concatenate((contexts, outcomes), axis=1))
            self._by_theta.keys.append(np.concatenate((contexts, thetas), axis=1))

    def _key(self, context: ArrayLike, point: Array) -> Array:
        context = check_point("context", context, self.context_dim, _NO_CONTEXT)
        return np.concatenate((context, point)) if self.context_dim else point.copy()
