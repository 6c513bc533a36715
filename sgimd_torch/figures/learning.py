"""Figures: where the float landed, where competence changes.

Sections 5.2 and 6 of Nguyen & Oudeyer (2014). Each function draws on the axis it is given and returns what it drew; the
caller owns the figure, its size and its file.   landing_points(ax, outcomes, box); interest_map(ax, lows, highs, each)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullLocator

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.figures.axes import alike, colour_bar, note
from sgimd_torch.figures.sections import Section, in_the_plane
from sgimd_torch.spaces import Array, Box

COLOURS = {word: entry.colour for word, entry in CATALOGUE["algorithm"].items()}
NAMES = {word: entry.label for word, entry in CATALOGUE["algorithm"].items()}


def landing_points(
    ax: Axes,
    outcomes: Array,
    box: Box,
    *,
    demonstrated: Array | None = None,
    side: float = 0.05,
    most: float | None = None,
    colour_bar: bool = True,
    section: Section | None = None,
) -> QuadMesh:
    """Where the float landed, and how often: a histogram on a logarithmic scale, empty tiles white.

    Args:
        ax: drawn on, and given a colour bar unless ``colour_bar`` is False.
        outcomes: ``(n, outcome_dim)`` m; those outside ``box`` are marked at its edge, with their number.
        box: T, or another part of it, which is shown.
        demonstrated: ``(n, outcome_dim)`` m, drawn as crosses, those that were demonstrated several times once.
        side: of a tile, m.
        most: the count at the end of the colour scale, so that two histograms can share it; None for their own.
        section: which dimensions to show; needed unless T has two.

    Returns:
        The tiles; their array holds the counts, ``(n_y, n_x)``, masked where 0.

    Raises:
        ValueError: ``box`` is not in the plane, and there is no ``section``.
    """
    section = in_the_plane(box) if section is None else section
    mesh = histogram(ax, section.points(outcomes), section.box, side=section.tile(side), most=most)
    if colour_bar:
        same_scale = box.dim == 2 and alike(box.sides)
        count_bar([ax], mesh, f"movements on a tile of {box.amount(side)}" if same_scale else "movements on a tile")
    if demonstrated is not None:
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


def histogram(ax: Axes, points: Array, box: Box, *, side: float | Array, most: float | None = None) -> QuadMesh:
    """How many of the ``points`` ``(n, 2)`` m lie on each tile, nothing else; arguments and result of
    ``landing_points``."""
    tiles = np.ma.masked_equal(tile_counts(points, box, side), 0)
    x, y = _edges(box, side)
    norm = LogNorm(1, max(2, float(tiles.filled(0).max()) if most is None else most))
    blues = ListedColormap(colormaps["Blues"](np.linspace(0.25, 1.0, 256)))  # a single point is visible on white
    return ax.pcolormesh(x, y, tiles, norm=norm, cmap=blues)


def count_bar(axes: Sequence[Axes], mesh: QuadMesh, label: str) -> Colorbar:
    """One colour bar, in numbers and not in powers of ten, for all histograms that share the scale of ``mesh``."""
    bar = colour_bar(axes, mesh, label)
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return bar


def tile_counts(outcomes: Array, box: Box, side: float | Array = 0.05) -> Array:
    """``(n_y, n_x)`` how many of the ``outcomes`` ``(n, 2)`` lie on each tile of the plane.

    Raises:
        ValueError: ``box`` is not in the plane.
    """
    x, y = _edges(box, side)
    return np.histogram2d(outcomes[:, 0], outcomes[:, 1], bins=(x, y))[0].T


def interest_map(
    ax: Axes, lows: Array, highs: Array, interests: Array, *, goals: Array | None = None, section: Section | None = None
) -> PatchCollection:
    """The regions of the interest map, coloured by interest, eq. (3); recent goals as points.

    Args:
        ax: drawn on, and given a colour bar.
        lows, highs: ``(n_regions, context_dim + outcome_dim)`` m, the corners of the regions.
        interests: ``(n_regions,)``.
        goals: ``(n, outcome_dim)`` m.
        section: which dimensions to show; needed unless regions are of the plane.

    Returns:
        One rectangle for each region that is shown, in their order; their array holds the interests.

    Raises:
        ValueError: without a ``section``, regions not in the plane, such as those that include contexts.
    """
    most = max(float(interests.max()), 1e-6)
    drawn = _regions_in(ax, lows, highs, interests, "Oranges", (0, most), section)
    colour_bar([ax], drawn, "interest: recent change of competence")
    if goals is not None:
        shown = _section_of(lows, highs, section).points(goals)
        ax.plot(*shown.T, ".", color="#0072b2", markersize=4, label=f"last {len(goals)} goals")
    _frame_regions(ax, lows, highs, section)
    return drawn


def competence_map(
    ax: Axes, lows: Array, highs: Array, competences: Array, *, worst: float = -1.0, section: Section | None = None
) -> PatchCollection:
    """Like ``interest_map``, but coloured by mean competence, eqs. (2) and (7): 0 met, -1 no better than rest.

    Args:
        ax, lows, highs, section: as for ``interest_map``.
        competences: ``(n_regions,)``; NaN, a region without goals, is left white.
        worst: the competence at the end of the colour scale.
    """
    drawn = _regions_in(ax, lows, highs, np.ma.masked_invalid(competences), "viridis", (worst, 0.0), section)
    colour_bar([ax], drawn, "mean competence: 0 met, -1 not at all")
    _frame_regions(ax, lows, highs, section)
    return drawn


def misses(ax: Axes, goals: Array, errors: Array, space: Box, section: Section, most: float) -> None:
    """Where is it bad? Each goal of an evaluation, coloured by its error.

    Args:
        ax: drawn on, and given a colour bar.
        goals: ``(n, outcome_dim)``.
        errors: ``(n,)``, in the unit of T.
        space: T.
        section: which dimensions to show.
        most: the error at the end of the colours.
    """
    label = space.in_unit("distance from goal to outcome")
    if section.is_strip:  # there is room for heights
        ax.plot(goals[:, 0], errors, ".", color="#0072b2", markersize=4)
        ax.set(xlabel=space.axis(0), ylabel=label)
        ax.set_ylim(bottom=0)
        return
    x, y = section.points(goals).T
    drawn = ax.scatter(x, y, c=errors, s=14, cmap="viridis_r", vmin=0, vmax=most, edgecolors="none")
    colour_bar([ax], drawn, label, extend="max")
    section.frame(ax, legend=False)


def map_after(regions: Mapping[str, np.ndarray], movements: int) -> tuple[Array, Array, Array]:
    """Corners ``(n_regions, context_dim + outcome_dim)`` m, twice, and interest ``(n_regions,)``: one map of the
    columns of the table ``regions``."""
    now = regions["movements"] == movements
    dims = range(sum(name.startswith("low_") for name in regions))
    lows, highs = (np.stack([regions[f"{side}_{k}"][now] for k in dims], axis=1) for side in ("low", "high"))
    return lows, highs, regions["interest"][now]


def _regions_in(
    ax: Axes,
    lows: Array,
    highs: Array,
    values: Array,
    colours: str,
    limits: tuple[float, float],
    section: Section | None,
) -> PatchCollection:
    """The regions that a ``section`` meets as rectangles, coloured by their ``values`` ``(n_regions,)``."""
    lows, highs, met = _section_of(lows, highs, section).cut(lows, highs)
    patches = [Rectangle((low[0], low[1]), *(high - low)) for low, high in zip(lows, highs, strict=True)]
    drawn = PatchCollection(patches, cmap=colours, edgecolor="0.35", linewidth=0.8, array=values[met], clim=limits)
    ax.add_collection(drawn)
    return drawn


def _frame_regions(ax: Axes, lows: Array, highs: Array, section: Section | None) -> None:
    """Limits and names of the axes, and a note on where regions are cut."""
    section = _section_of(lows, highs, section)
    section.frame(ax)
    if where := section.cut_at(lows, highs):
        note(ax, f"at {where}")


def _section_of(lows: Array, highs: Array, section: Section | None) -> Section:
    return in_the_plane(Box(lows.min(axis=0), highs.max(axis=0))) if section is None else section


def _edges(box: Box, side: float | Array) -> tuple[Array, Array]:
    box = in_the_plane(box).box
    x, y = (
        np.linspace(low, high, max(1, round((high - low) / each)) + 1)
        for low, high, each in zip(box.low, box.high, np.broadcast_to(side, 2), strict=True)
    )
    return x, y
