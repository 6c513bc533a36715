"""A grid of cells that never split, in place of the interest map, to measure what its splits contribute.

All else follows section 3.2 of Nguyen & Oudeyer (2014). A grid may be as good as the map if there are few dimensions
and all of the task space can be reached.
    sgimd run --goals experiments.progress_grid:ProgressGrid          # in the root folder of the repository
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.regions import Progress, Region, Tiling, gained_progress, interest_of
from sgimd_torch.parts import Goals, Problem
from sgimd_torch.spaces import Array

DEFAULT_CELLS: Final = 100  # number of cells; each needs four goals before its progress is known
MAX_CELLS: Final = 100_000  # largest number of cells, more than any run has goals


class ProgressGrid(Goals):
    """Goals where competence changes fastest, from equal cells of C x T, which never split.

    Args:
        problem: problem to learn.
        cells: number of cells in each dimension of C x T; None: about 100 in all, but at least 2 in each dimension.
        window: number of recent goals that a cell remembers; even, at least 4.
        near: largest distance from a cell's goal of least competence at which mode 3 draws a new goal, relative to the
            cell's sides.
        progress: measure of progress, as in `InterestMap`.

    Raises:
        ValueError: a number is out of its range, or there are more cells than any run has goals.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        cells: int | None = None,
        window: int = 24,
        near: float = 0.05,
        progress: Progress = gained_progress,
    ) -> None:
        super().__init__(problem)
        if window % 2 or window < 4:
            raise ValueError(f"window must be even and at least 4, got {window}")
        dim = problem.contexts.dim + problem.outcomes.dim
        if cells is None:
            cells = max(2, round(DEFAULT_CELLS ** (1 / dim)))
        if cells < 1 or cells**dim > MAX_CELLS:
            raise ValueError(
                f"cells must be at least 1 for each dimension and at most {MAX_CELLS} in all, "
                f"got {cells} in {dim} dimensions"
            )
        self.window = window
        self._tiling = Tiling(problem, partial(interest_of, window=window, progress=progress), near=near)
        edges = np.linspace(self._tiling.box.low, self._tiling.box.high, cells + 1)  # (cells + 1, dim)
        axes = np.arange(dim)

        def cell(corner: tuple[int, ...]) -> Region:
            low = np.array(corner)
            path = "R" + "".join(f".{index}" for index in corner)
            return self._tiling.region(path, edges[low, axes], edges[low + 1, axes])

        self._tiling.plant([cell(corner) for corner in itertools.product(range(cells), repeat=dim)])

    @property
    def regions(self) -> list[Region]:
        """The cells, which tile C x T. ``R.3.7`` is the fourth in the first dimension and the eighth in the second."""
        return list(self._tiling.regions)

    def sample(self, context: ArrayLike) -> Array:
        """Decide a goal, section 3.2.2: ``(outcome_dim,)`` in T.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        return self._tiling.sample(context)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Learn the competence at a goal. The cell of the goal forgets all but its last ``window`` goals.

        Raises:
            ValueError: see `Goals.add`.
        """
        index = self._tiling.add(context, goal, competence, strategy, gain)
        self._tiling.regions[index] = self._tiling.regions[index].keep(slice(-self.window, None))
