"""Figures of the forward model: where it was wrong, by how much, and whether it knew.

Each function draws on the axis it is given and returns what it drew. ``forward_model/diagnostics.py`` computes what
they show.   predictions(ax, outcomes, prediction.mean, box); calibration(ax, levels, {"all": coverage(...)})
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from sgimd_torch.figures.axes import GREY, colour_bar, note, over_movements, water_plane
from sgimd_torch.figures.learning import COLOURS
from sgimd_torch.forward_model.diagnostics import LEVELS, CellErrors
from sgimd_torch.spaces import Array, Box

_LINES = (COLOURS["sgim-d"], COLOURS["sagg-riac"], COLOURS["imitation"], COLOURS["observation"])
_ERRORS = ListedColormap(colormaps["YlOrRd"](np.linspace(0.15, 1.0, 256)))  # the smallest is visible on white


def predictions(ax: Axes, observed: Array, mean: Array, box: Box) -> LineCollection:
    """A line from the predicted to the observed landing point, which has a dot; coloured by the distance.

    Args:
        ax: drawn on, and given a colour bar, which ends at what 95 % of the distances do not exceed.
        observed, mean: ``(n, 2)`` m, n >= 1.
        box: T, the part of the plane that is shown.

    Returns:
        The lines; their array holds the distances (m).
    """
    distances = np.linalg.norm(observed - mean, axis=1)
    most = _end(distances)
    ends = list(np.stack([mean, observed], axis=1))
    lines = LineCollection(ends, cmap=_ERRORS, linewidths=0.8, array=distances, clim=(0, most))
    ax.add_collection(lines)
    ax.scatter(observed[:, 0], observed[:, 1], c=distances, s=7, cmap=_ERRORS, vmin=0, vmax=most, linewidths=0)
    outside = len(observed) - int(box.contains(observed).sum())
    if outside:
        note(ax, f"{outside} of {len(observed)} landed outside")
    colour_bar([ax], lines, "predicted to observed (m)", extend=_extend(distances, most))
    water_plane(ax, box)
    return lines


def error_map(ax: Axes, cells: CellErrors, box: Box) -> QuadMesh:
    """Mean distance of predictions from the outcomes in each cell, whose number is written in it; empty cells white.

    Args:
        ax: drawn on, and given a colour bar, which ends at what 95 % of the errors do not exceed.
        cells: of a grid over the plane.
        box: what that grid covers.

    Returns:
        The cells; their array holds the errors (m), ``(n_y, n_x)``, masked where a cell is empty.
    """
    errors, counts = np.ma.masked_invalid(cells.errors.T), cells.counts.T
    most = _end(errors.compressed()) if counts.any() else 1.0
    x, y = (np.linspace(low, high, n + 1) for low, high, n in zip(box.low, box.high, cells.counts.shape, strict=True))
    mesh = ax.pcolormesh(x, y, errors, cmap=_ERRORS, vmin=0, vmax=most, edgecolors="white", linewidth=0.5)
    for row, column in np.argwhere(counts):
        middle = (x[column : column + 2].mean(), y[row : row + 2].mean())
        ink = "white" if errors[row, column] > 0.6 * most else "0.15"
        ax.text(*middle, f"{counts[row, column]}", ha="center", va="center", fontsize=7, color=ink)
    colour_bar([ax], mesh, "mean error (m)", extend=_extend(errors, most))
    water_plane(ax, box)
    return mesh


def calibration(ax: Axes, levels: Array, coverages: Mapping[str, Array]) -> dict[str, Line2D]:
    """Share of the outcomes inside the regions that should hold a share of ``levels``, with the ideal diagonal.

    Args:
        ax: drawn on.
        levels: ``(n,)``, increasing, between 0 and 1; those of 50, 80 and 95 % are marked.
        coverages: label -> ``(n,)``, at most 4 of them.

    Returns:
        The line of each label.
    """
    marked = [k for k, level in enumerate(levels) if np.isclose(level, LEVELS).any()]
    ax.plot([0, 1], [0, 1], "--", color=GREY, linewidth=1.2, label="ideal")
    for level in levels[marked]:
        ax.axvline(level, color="0.85", linewidth=1, zorder=0)
    drawn = {}
    for colour, (label, shares) in zip(_LINES, coverages.items(), strict=False):
        in_words = " / ".join(f"{100 * shares[k]:.0f}" for k in marked)
        (drawn[label],) = ax.plot(levels, shares, "o-", color=colour, markersize=6, markevery=marked)
        drawn[label].set_label(f"{label}: {in_words} %" if in_words else label)
    words: dict[str, Any] = {"color": GREY, "fontsize": "small", "transform": ax.transAxes}
    ax.text(0.04, 0.62, "too cautious", **words)
    ax.text(0.96, 0.38, "overconfident", ha="right", **words)
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="level of the region", ylabel="outcomes inside")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(lambda share, _: f"{100 * share:.0f} %")
        axis.set_ticks([0, *LEVELS], minor=False)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), frameon=False, borderaxespad=0.2)
    return drawn


def error_over_time(ax: Axes, movements: Array, errors: Array) -> Line2D:
    """Mean error (m) of the predictions in each window, ``(n,)``, against the movements at its end."""
    (line,) = ax.plot(movements, errors, "o-", color=COLOURS["sgim-d"], markersize=4)
    over_movements(ax, "mean error of predictions (m)")
    ax.set_ylim(bottom=0)
    return line


def coverage_over_time(ax: Axes, movements: Array, coverages: Array) -> Line2D:
    """Share of the outcomes inside the 80 % region in each window, ``(n,)``; 70 to 90 % are acceptable."""
    ax.axhspan(0.7, 0.9, color="0.9", zorder=0, label="70 to 90 %")
    ax.axhline(0.8, linestyle="--", color=GREY, linewidth=1.2, label="ideal")
    (line,) = ax.plot(movements, coverages, "o-", color=COLOURS["sgim-d"], markersize=4)
    over_movements(ax, "outcomes inside the 80 % region")
    ax.set_ylim(0, 1)
    ax.yaxis.set_major_formatter(lambda share, _: f"{100 * share:.0f} %")
    ax.legend(loc="lower right", ncols=2)
    return line


def held_out_over_time(ax: Axes, movements: Array, held_out: Array, diverged: NDArray[np.bool_]) -> Line2D:
    """Negative log likelihood of held-out exemplars, after each refresh ``(n,)``; those that diverged as crosses.

    Values far above all others, such as at the first refresh, are cut off; a note says so.
    """
    (line,) = ax.plot(movements, held_out, "o-", color=COLOURS["sgim-d"], markersize=3, linewidth=1.2)
    if diverged.any():
        ax.plot(movements[diverged], held_out[diverged], "X", color="black", label=f"{diverged.sum()} diverged")
        ax.legend(loc="upper right")
    over_movements(ax, "held-out negative log likelihood")
    lower, upper = np.quantile(held_out, (0.25, 0.75))
    above = held_out[held_out > upper + 3 * (upper - lower)]  # Tukey's outer fence
    if len(above):
        rest = held_out[held_out < above.min()]
        margin = 0.1 * np.ptp(rest) + 1e-6
        ax.set_ylim(rest.min() - margin, rest.max() + margin)
        note(ax, f"{len(above)} of {len(held_out)} lie above, up to {above.max():.1f}", top=True)
    return line


def _end(values: Array) -> float:
    """Where the colour scale ends."""
    return max(float(np.quantile(values, 0.95)), 1e-6)


def _extend(values: Array, most: float) -> str:
    """An arrow where values lie beyond the end of the scale."""
    return "max" if (values > most).any() else "neither"
