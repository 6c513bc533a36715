"""Which dimensions of T a picture shows: a strip of one, the plane of two, of three and more a plane for each pair.

    for ax, section in zip(axes, sections(space), strict=True): ax.plot(*section.points(outcomes).T); section.frame(ax)
Pairs are the first dimension with the second, the third with the fourth and so on; a last one goes with the first. So
each dimension is in a picture. Points are projected. Regions would hide each other, so they are cut at the middle of
the dimensions that are not shown, and at the middle of C where regions include contexts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from sgimd_torch.figures.axes import LEGEND, alike, plane
from sgimd_torch.spaces import Array, Box

_MOST_NAMED: Final = 2  # dimensions, in a note: more would not fit


@dataclass(frozen=True, eq=False)
class Section:
    """One picture: ``dims`` are the dimensions of T, ``space``, along x and y; a single one is a strip along x."""

    space: Box
    dims: tuple[int, ...]

    @property
    def is_strip(self) -> bool:
        """Whether T has one dimension."""
        return len(self.dims) == 1

    @property
    def box(self) -> Box:
        """What the picture covers, of two dimensions; a strip has the height 1."""
        names = tuple(self.space.axis(k) for k in self.dims)
        flat = self._flat(self.space.low, 0.0), self._flat(self.space.high, 1.0)
        return Box(*flat, (*names, "") if self.is_strip else names)

    def points(self, outcomes: Array) -> Array:
        """``(n, 2)`` where ``(n, outcome_dim)`` lie in the picture; on a strip, in the middle of its height."""
        return self._flat(outcomes, 0.5)

    def tile(self, side: float) -> Array:
        """``(2,)`` a tile of this ``side`` along x; as long along y, if both have about one scale."""
        sides = self.box.sides
        return np.array([side, 1.0 if self.is_strip else side if alike(sides) else side * sides[1] / sides[0]])

    def height(self, width: float) -> float:
        """How high the axes of the picture are if they are ``width`` wide, with room for their labels."""
        shape = float(self.box.sides[1] / self.box.sides[0]) if alike(self.box.sides) else 1.0
        return width * (0.5 if self.is_strip else min(max(shape, 0.5), 1.5))

    def cut(self, lows: Array, highs: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """The regions that the picture meets: their corners in it, twice ``(n_met, 2)``, and ``(n,)`` which they are.

        Args:
            lows, highs: ``(n, context_dim + outcome_dim)`` corners of regions.
        """
        context_dim, middle = lows.shape[1] - self.space.dim, (lows.min(axis=0) + highs.max(axis=0)) / 2
        inside = (lows <= middle) & (middle < highs)
        inside[:, context_dim + np.array(self.dims)] = True
        met = inside.all(axis=1)
        if not met.any():  # regions of a user's own may leave gaps
            met[:] = True
        return self._flat(lows[met, context_dim:], 0.0), self._flat(highs[met, context_dim:], 1.0), met

    def cut_at(self, lows: Array, highs: Array) -> str:
        """Where ``cut`` cuts, in words; "" if nothing is hidden."""
        context_dim, middle = lows.shape[1] - self.space.dim, (lows.min(axis=0) + highs.max(axis=0)) / 2
        names = [f"context {k}" for k in range(context_dim)] + [self.space.axis(k) for k in range(self.space.dim)]
        hidden = [k for k in range(len(names)) if k - context_dim not in self.dims]
        if len(hidden) > _MOST_NAMED:
            return f"the middle of {len(hidden)} others"
        return ", ".join(f"{names[k]} = {middle[k]:.3g}" for k in hidden)

    def frame(self, ax: Axes) -> None:
        """Limits and names of the axes."""
        plane(ax, self.box)
        if self.is_strip:
            ax.set(aspect="auto", yticks=[])
            ax.xaxis.set_major_locator(MaxNLocator(6))
        if ax.get_legend_handles_labels()[0]:
            ax.legend(**LEGEND)

    def _flat(self, points: Array, height: float) -> Array:
        shown = np.asarray(points)[..., list(self.dims)]
        return shown if not self.is_strip else np.concatenate([shown, np.full_like(shown, height)], axis=-1)


def sections(space: Box) -> list[Section]:
    """The pictures that show each dimension of T.

    Raises:
        ValueError: T has no dimension.
    """
    if space.dim == 0:
        raise ValueError("there is nothing to draw of a task space without dimensions")
    if space.dim == 1:
        return [Section(space, (0,))]
    pairs = [(k, k + 1) for k in range(0, space.dim - 1, 2)] + ([(0, space.dim - 1)] if space.dim % 2 else [])
    return [Section(space, pair) for pair in pairs]


def of_regions(lows: Array, highs: Array, space: Box) -> list[Section]:
    """The pictures of the part of T, ``space``, that regions ``(n, context_dim + outcome_dim)`` fill."""
    return sections(replace(space, low=lows.min(axis=0)[-space.dim :], high=highs.max(axis=0)[-space.dim :]))
