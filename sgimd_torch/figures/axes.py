"""Axes of figures: limits, labels, colour bars, notes.

Functions with an argument ``ax`` draw on it.   mesh = ax.pcolormesh(x, y, z); colour_bar(ax, mesh, "error (m)")
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LogNorm
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box, rounded

LEGEND: Final[dict[str, Any]] = {
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),  # above the axes
    "ncols": 2,
    "frameon": False,
    "borderaxespad": 0.2,
    "handletextpad": 0.2,
}


def limits(points: Array, space: Box) -> Box:
    """The box around points without outliers, with corners in round numbers.

    A point is an outlier if, in some dimension, its distance from the interquartile range of the distinct points is
    more than 1.5 times the width of this range (Tukey's fence).

    Args:
        points: ``(n, dim)``, n >= 1, finite.
        space: T, from which the box has its names and its unit.
    """
    lower, upper = np.quantile(np.unique(points, axis=0), (0.25, 0.75), axis=0)
    fence = 1.5 * (upper - lower)
    near = np.where((points >= lower - fence) & (points <= upper + fence), points, np.nan)
    low, high = np.nanmin(near, axis=0), np.nanmax(near, axis=0)
    longest = float((high - low).max()) or float(np.abs(points).max()) or 1.0
    step = np.array([rounded((side or longest) / 40) for side in (high - low).tolist()])
    low, high = np.floor(low / step) * step, np.ceil(high / step) * step
    return replace(space, low=low, high=np.where(high > low, high, low + step))


def alike(sides: Array) -> bool:
    """Whether a picture can show ``sides`` at one scale: the longest is at most 8 times the shortest."""
    return bool(np.max(sides) <= 8 * np.min(sides))


def over_movements(ax: Axes, label: str) -> None:
    """Label the axes of a curve over movements; ``label`` is the label of the y axis."""
    ax.set(xlabel="movements executed", ylabel=label)
    ax.set_xlim(left=0)
    ax.grid(alpha=0.3)


def curve_in_band(ax: Axes, movements: ArrayLike, curve: Iterable[Array], colour: str, label: str) -> None:
    """Draw a curve over movements, with points at the evaluations and its intervals as a band.

    Args:
        ax: axes.
        movements: ``(n,)`` numbers of movements.
        curve: values and both ends of their intervals, each ``(n,)``; without intervals (NaN) there is no band.
        colour: colour of the curve.
        label: name of the curve in a legend.
    """
    centre, low, high = curve
    ax.fill_between(movements, low, high, color=colour, alpha=0.2, linewidth=0)
    ax.plot(movements, centre, "o-", color=colour, markersize=4, label=label)


def colour_bar(ax: Axes, drawn: ScalarMappable, label: str, *, extend: str = "neither") -> Colorbar:
    """Add a colour bar for ``drawn`` beside ``ax``; ``extend`` says which ends are arrows: "neither", "max" ..."""
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(drawn, ax=ax, label=label, extend=extend)
    if isinstance(drawn.norm, LogNorm):
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_locator(NullLocator())
    return bar


def note(ax: Axes, text: str) -> None:
    """Write a text below the name of the x axis."""
    at = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "center", "va": "top"}
    ax.annotate(text, (0.5, 0), (0, -40), fontsize="small", **at)  # type: ignore[arg-type]
