"""What compiled functions share: types of arguments, decorators, columns of tables, distances, linear equations."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numba import njit, types

from sgimd_torch.spaces import Array

_FAST: Final = {"reassoc", "contract", "nsz", "arcp"}  # sums may be reordered; NaN and infinity keep their meaning
# Decorator of a function that is compiled as part of its callers. Without forceinline, a process that also compiled the
# function by itself would take that machine code, whose last bits differ.
jit_helper = njit(nogil=True, fastmath=_FAST, forceinline=True)
NUMBERS: Final = types.Array(types.float64, 1, "C", readonly=True)
TABLE: Final = types.Array(types.float64, 2, "C", readonly=True)
ROWS: Final = types.Array(types.int64, 1, "C", readonly=True)  # row numbers of a table
LISTS: Final = types.Array(types.int64, 2, "C", readonly=True)  # row numbers, one list in each row
WRITABLE_NUMBERS: Final = types.Array(types.float64, 1, "C")  # the function writes into the caller's array


def compiled_for(*arguments: types.Type) -> Any:
    """Decorator of a function that Python calls. Its types are given, so it is compiled when this module is loaded."""
    return njit(tuple(arguments), cache=True, nogil=True, fastmath=_FAST)


@jit_helper
def squared_distance(one: Array, other: Array) -> float:
    """Squared distance of two points."""
    total = 0.0
    for k in range(len(one)):
        total += (one[k] - other[k]) ** 2
    return total


@jit_helper
def as_columns(table: Array, rows: np.ndarray) -> Array:
    """These rows of a table, as contiguous columns ``(dim, n)``."""
    selected = np.empty((table.shape[1], len(rows)))
    for j in range(len(rows)):
        for k in range(len(selected)):
            selected[k, j] = table[rows[j], k]
    return selected


@jit_helper
def factorised(matrix: Array, ridge: float) -> Array:
    """Cholesky factor ``(n, n)`` of the symmetric ``matrix`` plus ``ridge`` on its diagonal; the lower halves count. To
    compile `np.linalg.solve` numba takes up to 2.6 s, in each module anew."""
    n, factor = len(matrix), np.zeros(matrix.shape)
    for i in range(0, n, 2):  # two rows by two columns at a time, so that half as many numbers are read
        last = min(i + 1, n - 1)
        for j in range(0, i, 2):
            upper_left, upper_right, lower_left, lower_right = 0.0, 0.0, 0.0, 0.0
            for k in range(j):
                upper_left += factor[i, k] * factor[j, k]
                upper_right += factor[i, k] * factor[j + 1, k]
                lower_left += factor[last, k] * factor[j, k]
                lower_right += factor[last, k] * factor[j + 1, k]
            factor[i, j] = (matrix[i, j] - upper_left) / factor[j, j]
            factor[last, j] = (matrix[last, j] - lower_left) / factor[j, j]
            upper_right += factor[i, j] * factor[j + 1, j]
            lower_right += factor[last, j] * factor[j + 1, j]
            factor[i, j + 1] = (matrix[i, j + 1] - upper_right) / factor[j + 1, j + 1]
            factor[last, j + 1] = (matrix[last, j + 1] - lower_right) / factor[j + 1, j + 1]
        for row in range(i, last + 1):
            for j in range(i, row + 1):
                total = 0.0
                for k in range(j):
                    total += factor[row, k] * factor[j, k]
                left = matrix[row, j] - total
                factor[row, j] = left / factor[j, j] if j < row else np.sqrt(left + ridge)
    return factor


@jit_helper
def solve_lower(factor: Array, b: Array) -> None:
    """``b`` ``(n,)`` becomes ``factor``^-1 b."""
    for i in range(len(b)):
        total = 0.0
        for k in range(i):
            total += factor[i, k] * b[k]
        b[i] = (b[i] - total) / factor[i, i]


@jit_helper
def solve_transposed(factor: Array, b: Array) -> None:
    """``b`` ``(n,)`` becomes ``factor``^-T b."""
    for i in range(len(b) - 1, -1, -1):
        b[i] /= factor[i, i]
        for k in range(i):
            b[k] -= factor[i, k] * b[i]


@jit_helper
def solve(matrix: Array, ridge: float, b: Array) -> None:
    """``b`` ``(n,)`` becomes (``matrix`` + ``ridge`` I)^-1 b."""
    factor = factorised(matrix, ridge)
    solve_lower(factor, b)
    solve_transposed(factor, b)
