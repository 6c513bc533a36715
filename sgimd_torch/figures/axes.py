"""What figures share: the plane of outcomes, movements along the x axis, colour bars, notes.

Each function draws on the axes it is given.   mesh = ax.pcolormesh(x, y, z); colour_bar(ax, mesh, "error (m)")
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box

GREY: Final = "0.45"
LEGEND: Final[dict[str, Any]] = {
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),  # above the axes
    "ncols": 2,
    "frameon": False,
    "borderaxespad": 0.2,
    "handletextpad": 0.2,
}


def limits(points: Array, space: Box) -> Box:
    """Where the points lie, far ones left out, in round numbers: so a single far point leaves a map its scale.

    Far is, in a dimension, what lies farther from the middle half of the distinct points than 1.5 times its width
    (Tukey's fence).

    Args:
        points: ``(n, dim)``, n >= 1, finite.
        space: T, which gives names and unit.
    """
    lower, upper = np.quantile(np.unique(points, axis=0), (0.25, 0.75), axis=0)
    fence = 1.5 * (upper - lower)
    near = np.where((points >= lower - fence) & (points <= upper + fence), points, np.nan)
    low, high = np.nanmin(near, axis=0), np.nanmax(near, axis=0)
    longest = float((high - low).max()) or float(np.abs(points).max()) or 1.0
    step = np.array([rounded((side or longest) / 40) for side in (high - low).tolist()])
    low, high = np.floor(low / step) * step, np.ceil(high / step) * step
    return replace(space, low=low, high=np.where(high > low, high, low + step))


def rounded(length: float) -> float:
    """The next larger of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * next(k for k in (1, 2, 5, 10) if power * k >= length))


def plane(ax: Axes, box: Box) -> None:
    """All of ``box``, with the names of its dimensions; equal aspect unless a side is much longer."""
    limits = {"xlim": (box.low[0], box.high[0]), "ylim": (box.low[1], box.high[1])}
    ax.set(**limits, aspect="equal" if alike(box.sides) else "auto", xlabel=box.axis(0), ylabel=box.axis(1))
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(MaxNLocator(4))


def alike(sides: Array) -> bool:
    """Whether two sides have about one scale, so that a picture need not distort them."""
    return bool(np.max(sides) <= 8 * np.min(sides))


def over_movements(ax: Axes, label: str) -> None:
    """Movements along the x axis, ``label`` on the y axis."""
    ax.set(xlabel="movements executed", ylabel=label)
    ax.set_xlim(left=0)
    ax.grid(alpha=0.3)


def colour_bar(ax: Axes, drawn: ScalarMappable, label: str, *, extend: str = "neither") -> Colorbar:
    """The bar of what was ``drawn`` on ``ax``; ``extend`` is matplotlib's."""
    figure = ax.get_figure()
    assert figure is not None
    return figure.colorbar(drawn, ax=ax, label=label, extend=extend)


def note(ax: Axes, text: str) -> None:
    """Text below the name of the x axis."""
    at = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "center", "va": "top"}
    ax.annotate(text, (0.5, 0), (0, -40), fontsize="small", **at)  # type: ignore[arg-type]


def goal_rings(ax: Axes, points: ArrayLike, size: float) -> None:
    """Yellow rings with a black edge at ``(n, 2)``, ``size`` points wide: goals that are being reached for."""
    for edge, width in (("black", 4.5), ("#f0e442", 2.5)):
        ax.plot(*np.asarray(points).T, "o", mfc="none", mec=edge, ms=size, mew=width)
