"""Maps of T: outcomes, interest, competence, errors.

Sections 5.2 and 6 of Nguyen & Oudeyer (2014). Each map is drawn on axes ``ax`` of the caller, who makes and saves the
figure.   landing_points(ax, outcomes, box, section)
"""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.colors import FuncNorm, ListedColormap, LogNorm, Normalize
from matplotlib.patches import Rectangle

from sgimd_torch.figures.axes import alike, colour_bar, note
from sgimd_torch.figures.names import COLOURS
from sgimd_torch.figures.sections import Section
from sgimd_torch.spaces import Array, Box


def landing_points(
    ax: Axes,
    outcomes: Array,
    box: Box,
    section: Section,
    *,
    demonstrated: Array,
    side: float,
) -> QuadMesh:
    """Outcomes of movements: a histogram on a logarithmic scale, in which empty tiles are white.

    Args:
        ax: axes, which get a colour bar.
        outcomes: ``(n, outcome_dim)``; outcomes outside ``box`` are squares at its edge, and a note has their number.
        box: part of T to show.
        section: dimensions to show.
        demonstrated: ``(n, outcome_dim)`` demonstrated outcomes, each drawn once as a cross.
        side: side of a tile, in the unit of T.

    Returns:
        Tiles, whose array holds the number of outcomes on each, ``(n_y, n_x)``, masked where it is 0.
    """
    plane, (x, y) = section.box, section.points(outcomes).T
    n_tiles = np.maximum(1, np.round(plane.sides / section.tile(side))).astype(int)
    counts, *edges = np.histogram2d(x, y, bins=n_tiles, range=np.stack((plane.low, plane.high), axis=1))
    tiles = np.ma.masked_equal(counts.T, 0)
    norm = LogNorm(1, max(2, float(tiles.filled(0).max())))
    blues = ListedColormap(colormaps["Blues"](np.linspace(0.25, 1.0, 256)))  # a single outcome is visible on white, too
    mesh = ax.pcolormesh(*edges, tiles, norm=norm, cmap=blues)
    same_scale = box.dim == 2 and alike(box.sides)
    label = f"movements on a tile of {box.amount(side)}" if same_scale else "movements on a tile"
    colour_bar(ax, mesh, label)
    if len(demonstrated):
        different = np.unique(demonstrated, axis=0)
        crosses, label = section.points(different), f"{len(different)} demonstrated outcomes"
        ax.plot(*crosses.T, "x", color=COLOURS["sgim-d"], markersize=5, markeredgewidth=1.3, label=label)
    outside = outcomes[~box.contains(outcomes)]
    if len(outside):
        x, y = section.points(box.clip(outside)).T
        ax.scatter(x, y, marker="s", color="0.25", s=9, alpha=0.5, linewidths=0, clip_on=False)
        note(ax, f"{len(outside)} of {len(outcomes)} landed outside: squares at the edge")
    section.frame(ax)
    return mesh


def interest_map(
    ax: Axes, lows: Array, highs: Array, interests: Array, section: Section, *, goals: Array
) -> PatchCollection:
    """Regions of the interest map, coloured by interest, eq. (3), with recent goals as points.

    Args:
        ax: axes, which get a colour bar.
        lows, highs: ``(n_regions, context_dim + outcome_dim)`` corners of the regions.
        interests: ``(n_regions,)``.
        section: dimensions to show.
        goals: ``(n, outcome_dim)``.

    Returns:
        Rectangles, one for each region that is shown, in the order of the regions; their array holds the interests.
    """
    drawn = _regions_in(ax, lows, highs, interests, section, "Oranges", Normalize(0, max(float(interests.max()), 1e-6)))
    colour_bar(ax, drawn, "interest: recent change of competence")
    ax.plot(*section.points(goals).T, ".", color="#0072b2", markersize=4, label=f"last {len(goals)} goals")
    section.frame(ax)
    return drawn


def competence_map(ax: Axes, lows: Array, highs: Array, competences: Array, section: Section) -> PatchCollection:
    """Regions of the interest map, coloured by mean competence, eqs. (2) and (7).

    Competence is 0 if goals are met, and -1 if outcomes are no better than ``rest``. Colours go from -1 to 0, so maps
    can be compared; they follow the square root, so good regions differ, too.

    Args:
        ax, lows, highs, section: arguments as for ``interest_map``.
        competences: ``(n_regions,)``; NaN for a region without goals, which stays white.
    """
    scale = FuncNorm((lambda j: -np.sqrt(np.maximum(-j, 0)), lambda root: -np.square(root)), vmin=-1, vmax=0)
    drawn = _regions_in(ax, lows, highs, np.ma.masked_invalid(competences), section, "viridis", scale)
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


def _regions_in(
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
