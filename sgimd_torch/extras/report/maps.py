"""Maps of a report: where movements landed, and interest; curves over movements.

Sections 5.2 and 6 of Nguyen & Oudeyer (2014). All are drawn on axes ``ax`` of the caller, who makes and saves the
figure.   landing_points(ax, outcomes, box, section)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from numpy.typing import ArrayLike

from sgimd_torch.extras.pictures.maps import colour_bar, note, regions_in
from sgimd_torch.extras.pictures.sections import Section, alike
from sgimd_torch.extras.table.names import COLOURS
from sgimd_torch.spaces import Array, Box, rounded


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
    drawn = regions_in(ax, lows, highs, interests, section, "Oranges", Normalize(0, max(float(interests.max()), 1e-6)))
    colour_bar(ax, drawn, "interest: recent change of competence")
    ax.plot(*section.points(goals).T, ".", color="#0072b2", markersize=4, label=f"last {len(goals)} goals")
    section.frame(ax)
    return drawn


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
