"""Figures: how the error falls, where the float landed, where competence changes.

Sections 5.2 and 6 of Nguyen & Oudeyer (2014). Each function draws on the axis it is given and returns what it drew; the
caller owns the figure, its size and its file.   error_curves(ax, {"sgim-d": curves}); landing_points(ax, outcomes, box)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PolyCollection, QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.figures.axes import colour_bar, coloured_regions, note, over_movements, water_plane
from sgimd_torch.spaces import Array, Box

COLOURS = {word: entry.colour for word, entry in CATALOGUE["algorithm"].items()}
NAMES = {word: entry.label for word, entry in CATALOGUE["algorithm"].items()}


class Curve(NamedTuple):
    """The evaluations of one run: ``movements`` ``(n,)`` when, ``mean_errors`` and ``noise_floors`` ``(n,)`` m."""

    movements: Array
    mean_errors: Array
    noise_floors: Array


class DrawnCurve(NamedTuple):
    """The mean over seeds, its noise floor, and the band of one standard deviation if there are several seeds."""

    mean: Line2D
    noise_floor: Line2D
    band: PolyCollection | None


def error_curves(ax: Axes, runs: Mapping[str, Sequence[Curve]]) -> dict[str, DrawnCurve]:
    """Mean benchmark error (m) against movements, +- one standard deviation over seeds; noise floors dashed.

    Args:
        ax: drawn on.
        runs: algorithm -> one curve for each seed. Drawn at movements where all seeds of an algorithm were evaluated.

    Returns:
        What was drawn for each algorithm.

    Raises:
        ValueError: an algorithm that has no colour, or whose seeds were never evaluated at the same movement.
    """
    drawn = {}
    for algorithm, curves in runs.items():
        if algorithm not in COLOURS:
            raise ValueError(f"algorithm must be one of {sorted(COLOURS)}, got {algorithm!r}")
        movements = reduce(np.intersect1d, [curve.movements for curve in curves])
        if not len(movements):
            raise ValueError(f"the {len(curves)} seeds of {algorithm} were never evaluated after the same movement")
        shared = [np.searchsorted(curve.movements, movements) for curve in curves]
        errors = np.stack([curve.mean_errors[rows] for curve, rows in zip(curves, shared, strict=True)])
        floors = np.stack([curve.noise_floors[rows] for curve, rows in zip(curves, shared, strict=True)])
        colour, seeds = COLOURS[algorithm], f"{len(curves)} seed{'s' * (len(curves) > 1)}"
        mean = errors.mean(axis=0)
        (line,) = ax.plot(movements, mean, "o-", color=colour, markersize=4, label=f"{NAMES[algorithm]} ({seeds})")
        (floor,) = ax.plot(movements, floors.mean(axis=0), "--", color=colour, linewidth=1.2)
        band = None
        if len(curves) > 1:
            deviation = errors.std(axis=0, ddof=1)
            band = ax.fill_between(movements, mean - deviation, mean + deviation, color=colour, alpha=0.2, linewidth=0)
        drawn[algorithm] = DrawnCurve(line, floor, band)
    handles = [*(curve.mean for curve in drawn.values()), Line2D([], [], color="black", linestyle="--", linewidth=1.2)]
    ax.legend(handles, [*(str(curve.mean.get_label()) for curve in drawn.values()), "noise floor of each"])
    over_movements(ax, "mean distance to benchmark goals (m)")
    ax.set_ylim(bottom=0)
    return drawn


def landing_points(
    ax: Axes,
    outcomes: Array,
    box: Box,
    *,
    demonstrated: Array | None = None,
    side: float = 0.05,
    most: float | None = None,
    colour_bar: bool = True,
) -> QuadMesh:
    """Where the float landed, and how often: a histogram on a logarithmic scale, empty tiles white.

    Args:
        ax: drawn on, and given a colour bar unless ``colour_bar`` is False.
        outcomes: ``(n, 2)`` m; how many lie outside ``box`` is written in the corner.
        box: T, the part of the plane that is shown.
        demonstrated: ``(n, 2)`` m, drawn as crosses.
        side: of a tile, m.
        most: the count at the end of the colour scale, so that two histograms can share it; None for their own.

    Returns:
        The tiles; their array holds the counts, ``(n_y, n_x)``, masked where 0.

    Raises:
        ValueError: ``box`` is not in the plane.
    """
    mesh = histogram(ax, outcomes, box, side=side, most=most)
    if colour_bar:
        count_bar([ax], mesh, f"movements on a tile of {100 * side:g} cm")
    if demonstrated is not None:
        label = f"{len(demonstrated)} demonstrated outcomes"
        ax.plot(*demonstrated.T, "x", color=COLOURS["sgim-d"], markersize=5, markeredgewidth=1.3, label=label)
    outside = len(outcomes) - int(box.contains(outcomes).sum())
    if outside:
        note(ax, f"{outside} of {len(outcomes)} landed outside")
    water_plane(ax, box)
    return mesh


def histogram(ax: Axes, points: Array, box: Box, *, side: float, most: float | None = None) -> QuadMesh:
    """How many of the ``points`` ``(n, 2)`` m lie on each tile, nothing else; arguments and result of
    ``landing_points``."""
    tiles = np.ma.masked_equal(tile_counts(points, box, side), 0)
    x, y = _edges(box, side)
    norm = LogNorm(1, max(2, float(tiles.filled(0).max()) if most is None else most))
    blues = ListedColormap(colormaps["Blues"](np.linspace(0.25, 1.0, 256)))  # a single point is visible on white
    return ax.pcolormesh(x, y, tiles, norm=norm, cmap=blues)


def count_bar(axes: Sequence[Axes], mesh: QuadMesh, label: str) -> Colorbar:
    """One colour bar, in whole numbers, for all histograms that share the scale of ``mesh``."""
    bar = colour_bar(axes, mesh, label)
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bar.ax.yaxis.set_major_formatter("{x:.0f}")
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return bar


def tile_counts(outcomes: Array, box: Box, side: float = 0.05) -> Array:
    """``(n_y, n_x)`` how many of the ``outcomes`` ``(n, 2)`` lie on each tile of the plane.

    Raises:
        ValueError: ``box`` is not in the plane.
    """
    x, y = _edges(box, side)
    return np.histogram2d(outcomes[:, 0], outcomes[:, 1], bins=(x, y))[0].T


def interest_map(
    ax: Axes, lows: Array, highs: Array, interests: Array, *, goals: Array | None = None
) -> PatchCollection:
    """The regions of the interest map, coloured by interest, eq. (3); recent goals as points.

    Args:
        ax: drawn on, and given a colour bar.
        lows, highs: ``(n_regions, 2)`` m, the corners of the regions.
        interests: ``(n_regions,)``.
        goals: ``(n, 2)`` m.

    Returns:
        One rectangle for each region, in their order; their array holds the interests.

    Raises:
        ValueError: regions not in the plane, such as those that include contexts, or numbers that do not match.
    """
    drawn = coloured_regions(ax, lows, highs, interests, "Oranges", (0, max(float(interests.max()), 1e-6)))
    colour_bar([ax], drawn, "interest: recent change of competence")
    if goals is not None:
        ax.plot(*goals.T, ".", color="#0072b2", markersize=4, label=f"last {len(goals)} goals")
    water_plane(ax, Box(lows.min(axis=0), highs.max(axis=0)))
    return drawn


def _edges(box: Box, side: float) -> tuple[Array, Array]:
    if box.dim != 2:
        raise ValueError(f"the water plane has 2 dimensions, got a box of {box.dim}")
    x, y = (
        np.linspace(low, high, max(1, round((high - low) / side)) + 1)
        for low, high in zip(box.low, box.high, strict=True)
    )
    return x, y
