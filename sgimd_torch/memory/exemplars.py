"""Some exemplars, as arrays."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.memory import Memory, Rows
from sgimd_torch.spaces import Array


class Exemplars(NamedTuple):
    """Contexts, thetas and outcomes of some movements, ``(n, dim)`` each."""

    contexts: Array
    thetas: Array
    outcomes: Array

    @classmethod
    def of(cls, memory: Memory, rows: slice | Rows = slice(None)) -> Self:
        """Some exemplars of a memory."""
        return cls(memory.contexts[rows], memory.thetas[rows], memory.outcomes[rows])

    def some(self, rows: slice | Rows | NDArray[np.bool_]) -> Exemplars:
        """Some of these exemplars."""
        return Exemplars(*(table[rows] for table in self))

    def and_then(self, others: Exemplars) -> Exemplars:
        """These exemplars, then the others."""
        return Exemplars(*map(np.concatenate, zip(self, others, strict=True)))

    def memory_like(self, other: Memory) -> Memory:
        """A memory of these exemplars, of the same kind as the ``other``."""
        memory = other.empty()
        memory.extend(*self)
        return memory
