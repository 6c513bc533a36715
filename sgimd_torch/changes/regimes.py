"""A regime: what a local process has learnt while the robot was the same, and predictions from it.

regime = Regime(process, rows); outcomes, variances, slopes = regime.predict(contexts, thetas)
"""

from __future__ import annotations

from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.inverses.local_process import Learnt
from sgimd_torch.memory import Memory, Rows
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.memory.neighbours import PolicyNeighbours, Table
from sgimd_torch.spaces import Array

NEAR: Final = 60  # largest number of exemplars from which a movement is predicted


class Exemplars(NamedTuple):
    """Contexts, thetas and outcomes of some movements, ``(n, dim)`` each."""

    contexts: Array
    thetas: Array
    outcomes: Array

    @classmethod
    def of(cls, memory: Memory, rows: slice | Rows = slice(None)) -> Self:
        """Some exemplars of a memory."""
        return cls(memory.contexts[rows], memory.thetas[rows], memory.outcomes[rows])

    def of_rows(self, rows: slice | Rows | NDArray[np.bool_]) -> Exemplars:
        """Some of these exemplars."""
        return Exemplars(*(table[rows] for table in self))

    def and_then(self, others: Exemplars) -> Exemplars:
        """These exemplars, then the others."""
        return Exemplars(*map(np.concatenate, zip(self, others, strict=True)))

    @property
    def memory(self) -> Memory:
        """A memory of these exemplars."""
        memory = Memory(*(table.shape[1] for table in self))
        memory.extend(*self)
        return memory


class Regime:
    """What a local process had learnt from some exemplars; it predicts at any theta, outside Pi, too.

    Args:
        learnt: lengths and kernel of the process.
        exemplars: exemplars of the regime, at least one.
    """

    def __init__(self, learnt: Learnt, exemplars: Exemplars) -> None:
        self.learnt, self.exemplars, self.kernel, self.units = learnt, exemplars, learnt.kernel, learnt.units
        self._neighbours = neighbours_of(self.in_lengths(exemplars.contexts, exemplars.thetas))

    def in_lengths(self, contexts: Array, thetas: Array) -> Array:
        """Inputs ``(n, dim)`` of the process."""
        scaled: Array = (np.concatenate((thetas, contexts), axis=1) - self.units[0]) / self.units[1]
        return scaled

    def predict(self, contexts: Array, thetas: Array) -> tuple[Array, Array, Array]:
        """Outcomes ``(n, outcome_dim)``, variances ``(n,)`` with noise, slopes ``(n, outcome_dim, theta_dim)``."""
        here = self.in_lengths(contexts, thetas)
        near = self._neighbours.nearest(here, NEAR)
        found, variances, slopes = predicted(self._neighbours, self.exemplars.outcomes, near, here, self.kernel)
        dim = thetas.shape[1]
        return found, variances, slopes[:, :, :dim] / self.units[1, :dim]

    def left_out(self, rows: Rows) -> tuple[Array, Array]:
        """See the function `left_out`."""
        return left_out(self._neighbours, self.exemplars.outcomes, rows, self.kernel)

    def doubt(self, rows: Rows) -> float:
        """Mean squared error of predicting each of these rows from all others, divided by the expected one."""
        errors, variances = self.left_out(rows)
        return float(errors.sum() / (variances.sum() * self.exemplars.outcomes.shape[1] + 1e-300))


def left_out(inputs: PolicyNeighbours, outcomes: Array, rows: Rows, kernel: Array) -> tuple[Array, Array]:
    """Squared errors ``(len(rows),)`` of predicting each of these rows from all other rows, and their variances."""
    here = inputs.keys.rows[rows]
    near = inputs.nearest(here, NEAR + 1)
    itself_last = np.argsort(near == rows[:, None], axis=1, kind="stable")
    near = np.take_along_axis(near, itself_last[:, :-1], axis=1)
    found, variances, _ = predicted(inputs, outcomes, near, here, kernel)
    return squared(found - outcomes[rows]), variances


def among_themselves(inputs: Array, outcomes: Array, kernel: Array) -> Array:
    """Squared errors ``(n,)`` of predicting each movement from all others of them."""
    return left_out(neighbours_of(inputs), outcomes, np.arange(len(inputs)), kernel)[0]


def predicted(
    inputs: PolicyNeighbours, outcomes: Array, near: Rows, here: Array, kernel: Array
) -> tuple[Array, Array, Array]:
    """Result of `kernels.predict`."""
    found: tuple[Array, Array, Array] = compiled("sgimd_torch.changes.kernels").predict(
        inputs.keys.rows, outcomes, near, here, kernel
    )
    return found


def neighbours_of(inputs: Array) -> PolicyNeighbours:
    """Neighbours among these inputs ``(n, dim)``."""
    found = PolicyNeighbours(Table(inputs.shape[1]))
    found.keys.append(inputs)
    return found


def squared(differences: Array) -> Array:
    """Squared lengths of vectors, over the last axis."""
    found: Array = (differences * differences).sum(axis=-1)
    return found
