"""Sections: pictures of T in the plane.

    for ax, section in zip(axes, sections(space), strict=True): ax.plot(*section.points(outcomes).T); section.frame(ax)
If T has one dimension, its picture is a strip. Otherwise each picture shows two dimensions: the first and the second,
the third and the fourth, and so on; if their number is odd, the last picture shows the first and the last dimension.
Points are projected. Projected regions would hide each other, so a picture shows the regions that its plane cuts: the
plane through the middle of C and of the other dimensions of T.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullLocator
from numpy.typing import NDArray

from sgimd_torch.spaces import Array, Box

LEGEND: Final[dict[str, Any]] = {
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),  # above the axes
    "ncols": 2,
    "frameon": False,
    "borderaxespad": 0.2,
    "handletextpad": 0.2,
}
NO_CONTEXTS: Final = Box.cube(0, 1, 0)
_MOST_NAMED: Final = 2  # largest number of dimensions in a note; more do not fit


@dataclass(frozen=True, eq=False)
class Section:
    """A picture of T in the plane.

    Args:
        space: T.
        dims: dimensions of T along x and y; a single dimension gives a strip along x.
        contexts: C.
    """

    space: Box
    dims: tuple[int, ...]
    contexts: Box

    @property
    def is_strip(self) -> bool:
        """Whether T has one dimension."""
        return len(self.dims) == 1

    @property
    def box(self) -> Box:
        """The part of T that the picture shows, as a box of two dimensions; a strip has the height 1."""
        names = tuple(self.space.axis(k) for k in self.dims)
        flat = self._flat(self.space.low, 0.0), self._flat(self.space.high, 1.0)
        return Box(*flat, (*names, "") if self.is_strip else names)

    def points(self, outcomes: Array) -> Array:
        """``(n, 2)`` points of ``outcomes`` ``(n, outcome_dim)`` in the picture; in a strip, at half its height."""
        return self._flat(outcomes, 0.5)

    def tile(self, side: float) -> Array:
        """``(2,)`` sides of a tile: ``side`` along x, and also along y if x and y have one scale."""
        sides = self.box.sides
        return np.array([side, 1.0 if self.is_strip else side if alike(sides) else side * sides[1] / sides[0]])

    def height(self, width: float) -> float:
        """Height of the axes of this picture if they are ``width`` wide."""
        shape = float(self.box.sides[1] / self.box.sides[0]) if alike(self.box.sides) else 1.0
        return width * (0.5 if self.is_strip else min(max(shape, 0.5), 1.5))

    def cut(self, lows: Array, highs: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Regions in the picture: a cut through the middle of the dimensions that the picture does not show.

        Args:
            lows, highs: ``(n, context_dim + outcome_dim)`` corners of regions.

        Returns:
            Lower and upper corners, each ``(n_met, 2)``, of the regions that the cut meets, and their mask ``(n,)``.
        """
        context_dim, middle = lows.shape[1] - self.space.dim, (lows.min(axis=0) + highs.max(axis=0)) / 2
        inside = (lows <= middle) & (middle < highs)
        inside[:, context_dim + np.array(self.dims)] = True
        met = inside.all(axis=1)
        if not met.any():  # a user's goal model may leave gaps between regions
            met[:] = True
        return self._flat(lows[met, context_dim:], 0.0), self._flat(highs[met, context_dim:], 1.0), met

    def cut_at(self, lows: Array, highs: Array) -> str:
        """Text with the place of the cut, such as "z = 0.5"; "" if the picture shows all dimensions."""
        context_dim, middle = self.contexts.dim, (lows.min(axis=0) + highs.max(axis=0)) / 2
        kinds = (self.contexts, "context"), (self.space, "outcome")
        names = [box.axis(k, kind) for box, kind in kinds for k in range(box.dim)]
        hidden = [k for k in range(len(names)) if k - context_dim not in self.dims]
        if len(hidden) > _MOST_NAMED:
            return f"the middle of {len(hidden)} others"
        return ", ".join(f"{names[k]} = {middle[k]:.3g}" for k in hidden)

    def frame(self, ax: Axes) -> None:
        """Set limits, aspect and names of the axes, and the legend. The aspect is equal if the sides are `alike`."""
        box = self.box
        ax.set(xlim=(box.low[0], box.high[0]), ylim=(box.low[1], box.high[1]), xlabel=box.axis(0), ylabel=box.axis(1))
        ax.set_aspect("equal" if alike(box.sides) and not self.is_strip else "auto")
        ax.xaxis.set_major_locator(MaxNLocator(6 if self.is_strip else 4))
        ax.yaxis.set_major_locator(NullLocator() if self.is_strip else MaxNLocator(4))
        if ax.get_legend_handles_labels()[0]:
            ax.legend(**LEGEND)

    def _flat(self, points: Array, height: float) -> Array:
        coordinates = np.asarray(points)[..., list(self.dims)]
        return (
            coordinates
            if not self.is_strip
            else np.concatenate([coordinates, np.full_like(coordinates, height)], axis=-1)
        )


def sections(space: Box, contexts: Box = NO_CONTEXTS) -> list[Section]:
    """The pictures of T; together they show every dimension. C, ``contexts``, has names for notes about regions.

    Raises:
        ValueError: T has no dimension.
    """
    if space.dim == 0:
        raise ValueError("there is nothing to draw of a task space without dimensions")
    if space.dim == 1:
        return [Section(space, (0,), contexts)]
    pairs = [(k, k + 1) for k in range(0, space.dim - 1, 2)] + ([(0, space.dim - 1)] if space.dim % 2 else [])
    return [Section(space, pair, contexts) for pair in pairs]


def alike(sides: Array) -> bool:
    """Whether a picture can show ``sides`` at one scale: the longest is at most 8 times the shortest."""
    return bool(np.max(sides) <= 8 * np.min(sides))
