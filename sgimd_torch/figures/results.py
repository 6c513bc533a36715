"""Figures over seeds: error curves with intervals, where goals lie, and what each change of the learner makes.

Section 6 of Nguyen & Oudeyer (2014). Each function draws on the axis it is given and returns what it drew. The caller
computes the statistics.   seed_curves(ax, curves); forest(ax, differences, reference="SGIM-D")
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.lines import Line2D

from sgimd_torch.figures.axes import GREY, over_movements, plane
from sgimd_torch.figures.learning import COLOURS, NAMES, histogram
from sgimd_torch.spaces import Array, Box


class SeedCurves(NamedTuple):
    """The runs of one learner: ``errors`` ``(n_seeds, n)`` m after ``movements`` ``(n,)``; over seeds their ``centre``
    and the interval from ``low`` to ``high``, each ``(n,)`` m. ``algorithm`` gives the colour."""

    algorithm: str
    label: str
    movements: Array
    errors: Array
    centre: Array
    low: Array
    high: Array
    dashed: bool = False


class Difference(NamedTuple):
    """A variant against the learner that it varies: ``seeds`` ``(n_seeds,)`` paired differences of error (m), their
    ``centre`` and its interval from ``low`` to ``high`` (m), NaN where there are too few seeds for one."""

    label: str
    seeds: Array
    centre: float
    low: float
    high: float


def seed_curves(ax: Axes, runs: Sequence[SeedCurves]) -> list[Line2D]:
    """Mean benchmark error (m) against movements: the centre over seeds thick, its interval a band, each seed thin.

    Returns:
        The thick lines, in the order of ``runs``.
    """
    lines = []
    for run in runs:
        colour, style = COLOURS[run.algorithm], "--" if run.dashed else "-"
        if len(run.errors) > 1:
            ax.plot(run.movements, run.errors.T, style, color=colour, linewidth=0.7, alpha=0.35)
            ax.fill_between(run.movements, run.low, run.high, color=colour, alpha=0.22, linewidth=0)
        label = f"{run.label} ({_seeds(len(run.errors))})"
        lines += ax.plot(run.movements, run.centre, f"o{style}", color=colour, markersize=4, label=label)
    over_movements(ax, "mean distance to benchmark goals (m)")
    ax.set_ylim(bottom=0)
    ax.legend(handles=lines, loc="upper right")
    return lines


def goal_histogram(ax: Axes, goals: Array, box: Box, *, side: float, most: float | None = None) -> QuadMesh:
    """Where a learner's goals ``(n, 2)`` m lie in the task space; like ``landing_points``, but for a whole task space.

    Raises:
        ValueError: ``box`` is not in the plane.
    """
    mesh = histogram(ax, goals, box, side=side, most=most)
    plane(ax, box)
    return mesh


def goal_distances(ax: Axes, runs: Mapping[str, Sequence[Array]], *, reach: float) -> list[Line2D]:
    """The share of a learner's goals within a distance of the arm's base: all seeds thick, each seed thin.

    Args:
        ax: drawn on, with logarithmic axes.
        runs: algorithm -> goals ``(n, 2)`` m of each seed.
        reach: m, marked: goals within it can be reached.

    Returns:
        The thick lines, in the order of ``runs``.
    """
    lines = []
    for algorithm, seeds in runs.items():
        colour = COLOURS[algorithm]
        for goals in seeds:
            ax.step(*_shares(goals), where="post", color=colour, linewidth=0.7, alpha=0.35)
        label = f"{NAMES[algorithm]} ({_seeds(len(seeds))})"
        lines += ax.step(*_shares(np.concatenate(list(seeds))), where="post", color=colour, label=label)
    ax.axvline(reach, color=GREY, linestyle=":")
    ax.text(1.1 * reach, 0.97, f"reach, about {reach:g} m", transform=ax.get_xaxis_transform(), va="top", color=GREY)
    ax.set(xscale="log", yscale="log", xlabel="distance from the base (m)", ylabel="goals within that distance (%)")
    ax.set_ylim(0.02, 150)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:g}")
    ax.grid(alpha=0.3)
    ax.legend(handles=lines, loc="lower right")
    return lines


def forest(ax: Axes, differences: Sequence[Difference], *, reference: str, space: Box) -> list[Line2D]:
    """One row for each variant, the best on top: error, in the unit of ``space``, minus the reference's, with interval.

    A filled mark: the interval excludes 0. Small ticks behind are seeds; their number is next to the name. A row
    without an interval has its seeds as points and no mark.

    Returns:
        The marks of the centres, from the top; of a row without an interval its points.
    """
    ordered = sorted(differences, key=lambda row: row.centre)
    marks = []
    for height, row in enumerate(ordered):
        if np.isnan(row.low):
            marks += ax.plot(row.seeds, np.full(len(row.seeds), height), "o", color=GREY, markersize=4.5)
            continue
        certain = row.low > 0 or row.high < 0
        ax.plot(row.seeds, np.full(len(row.seeds), height), "|", color=GREY, markersize=7, alpha=0.6, zorder=1)
        ax.plot([row.low, row.high], [height, height], color="black", linewidth=1.8, solid_capstyle="butt")
        face = "black" if certain else "white"
        marks += ax.plot(row.centre, height, "o", color="black", markerfacecolor=face, markersize=6.5)
    ax.axvline(0, color=COLOURS["sgim-d"], zorder=0)
    ax.set_yticks(range(len(ordered)), [f"{row.label} ({_seeds(len(row.seeds))})" for row in ordered])
    ax.set_ylim(len(ordered) - 0.4, -0.6)
    ax.set_xlabel(space.in_unit(f"error less that of {reference}, seed by seed"))
    ax.grid(axis="x", alpha=0.3)
    return marks


def _shares(goals: Array) -> tuple[Array, Array]:
    """Distances in order, and how many goals (%) lie within each."""
    distances = np.sort(np.linalg.norm(goals, axis=1))
    return distances, 100 * np.arange(1, len(distances) + 1) / len(distances)


def _seeds(n: int) -> str:
    return f"{n} seed{'s' * (n != 1)}"
