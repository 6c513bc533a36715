"""Maps of T: competence by region, and errors at goals; pixels of a figure.

Sections 5.2 and 6 of Nguyen & Oudeyer (2014). Each map is drawn on axes ``ax`` of the caller, who makes and saves the
figure.   misses(ax, goals, errors, space, section, most)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import FuncNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from sgimd_torch.extras.pictures.sections import Section
from sgimd_torch.spaces import Array, Box


def competence_map(ax: Axes, lows: Array, highs: Array, competences: Array, section: Section) -> PatchCollection:
    """Regions of the interest map, coloured by mean competence, eqs. (2) and (7).

    Competence is 0 if goals are met, and -1 if outcomes are no better than ``rest``. Colours go from -1 to 0, so maps
    can be compared; they follow the square root, so good regions differ, too.

    Args:
        ax: axes, which get a colour bar.
        lows, highs: ``(n_regions, context_dim + outcome_dim)`` corners of the regions.
        section: dimensions to show.
        competences: ``(n_regions,)``; NaN for a region without goals, which stays white.
    """
    scale = FuncNorm((lambda j: -np.sqrt(np.maximum(-j, 0)), lambda root: -np.square(root)), vmin=-1, vmax=0)
    drawn = regions_in(ax, lows, highs, np.ma.masked_invalid(competences), section, "viridis", scale)
    colour_bar(ax, drawn, "competence").set_ticks([-1, -0.5, -0.2, -0.05, -0.01, 0])
    section.frame(ax)
    return drawn


def misses(
    ax: Axes,
    goals: Array,
    errors: Array,
    space: Box,
    section: Section,
    most: float,
    label: str = "distance from goal to outcome",
    *,
    least: float = 0.0,
) -> None:
    """Goals of an evaluation, coloured by their error; if T has one dimension, the y axis shows the error instead.

    Args:
        ax: axes, which get a colour bar.
        goals: ``(n, outcome_dim)``.
        errors: ``(n,)``, in the unit of T.
        space: T.
        section: dimensions to show.
        most: error at the upper end of the colour scale.
        label: name of the errors, without their unit.
        least: error at the lower end of the colour scale, which is logarithmic unless it is 0.
    """
    label = space.in_unit(label)
    if section.is_strip:
        ax.plot(goals[:, 0], errors, ".", color="#0072b2", markersize=4)
        ax.set(xlabel=space.axis(0), ylabel=label)
        ax.set_ylim(bottom=0)
        return
    x, y = section.points(goals).T
    norm = LogNorm(least, most) if least else Normalize(0, most)
    shown = np.maximum(errors, least)  # a logarithmic scale would leave out an error of 0
    drawn = ax.scatter(x, y, c=shown, s=14, cmap="viridis_r", norm=norm, edgecolors="none")
    colour_bar(ax, drawn, label, extend="both" if least else "max")
    section.frame(ax)


def regions_in(
    ax: Axes,
    lows: Array,
    highs: Array,
    values: Array,
    section: Section,
    colours: str,
    scale: Normalize,
) -> PatchCollection:
    """The regions in a ``section``, coloured by ``values`` ``(n_regions,)``; a note has the place of the section."""
    if where := section.cut_at(lows, highs):
        note(ax, f"at {where}")
    lows, highs, met = section.cut(lows, highs)
    patches = [Rectangle((low[0], low[1]), *(high - low)) for low, high in zip(lows, highs, strict=True)]
    drawn = PatchCollection(patches, cmap=colours, edgecolor="0.35", linewidth=0.8, array=values[met], norm=scale)
    ax.add_collection(drawn)
    return drawn


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


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """The drawing of a figure, ``(height, width, 4)``: red, green, blue and opacity."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())
