"""An array that grows by rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from sgimd_torch.spaces import Array


class Growing:
    """Rows in an array that doubles its size when full."""

    def __init__(self, dim: int, rows: Array | None = None) -> None:
        self._storage = np.empty((64, dim))
        self._rows: Array | None = None
        self._n = 0
        if rows is not None:
            self.append(rows)

    def __reduce__(self) -> tuple[Any, ...]:
        return Growing, (self.dim, self.rows)

    def __len__(self) -> int:
        return self._n

    @property
    def dim(self) -> int:
        """Number of columns."""
        return self._storage.shape[1]

    @property
    def rows(self) -> Array:
        """``(n, dim)`` read-only; rows that are added later do not appear in it."""
        if self._rows is None:
            self._rows = self._storage[: self._n]
            self._rows.flags.writeable = False
        return self._rows

    def append(self, rows: Array) -> None:
        """Add ``(m, dim)`` rows."""
        n_old, n_new = self._n, self._n + len(rows)
        if n_new > len(self._storage):
            storage = np.empty((max(n_new, 2 * len(self._storage)), self.dim))
            storage[:n_old] = self._storage[:n_old]
            self._storage = storage
        self._storage[n_old:n_new] = rows
        self._rows, self._n = None, n_new
