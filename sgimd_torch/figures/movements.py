"""Figures of movements and goals: demonstrated joint trajectories, noise, competence, and where curiosity goes.

Sections 4.1, 4.5, 5.3 and 6 of Nguyen & Oudeyer (2014). Each function draws on the axes it is given and returns what
it drew.   trajectories(figure.subplots(2, 3).flat, demonstrations, fitted, names=JOINTS)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from sgimd_torch.figures.axes import colour_bar, coloured_regions, water_plane
from sgimd_torch.figures.learning import COLOURS
from sgimd_torch.spaces import Array, Box, Demonstration

_DEMONSTRATED, _FITTED = "0.55", COLOURS["sgim-d"]
_MOVEMENTS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")  # Okabe & Ito
_MARKERS = "osD^vPX"


class DrawnJoint(NamedTuple):
    """One joint's ``demonstrated`` trajectories, and the ``fitted`` ones, none if none were given."""

    demonstrated: list[Line2D]
    fitted: list[Line2D]


def trajectories(
    axes: Iterable[Axes],
    demonstrations: Sequence[Demonstration],
    fitted: Sequence[tuple[Array, Array]] | None = None,
    *,
    names: Sequence[str] | None = None,
) -> list[DrawnJoint]:
    """Joint angles (rad) against time (s), as demonstrated and as the motor primitive plays them, eq. (6).

    Args:
        axes: one for each joint.
        demonstrations: drawn thin and grey, on top of each other.
        fitted: for each demonstration ``(n_times,)`` s and ``(n_times, n_joints)`` rad, as
            ``primitive.trajectory(primitive.correspondence(times, trajectory))`` gives them; drawn dashed.
        names: of the joints; None numbers them.

    Returns:
        What was drawn for each joint.

    Raises:
        ValueError: no demonstration, or numbers of axes, names, fits and joints that do not match.
    """
    axes = list(axes)
    joints = {demonstration.trajectory.shape[1] for demonstration in demonstrations} | {len(axes)}
    if not demonstrations or len(joints) != 1 or len(names or axes) != len(axes):
        raise ValueError(f"needs demonstrations, an axis and a name for each joint, got {sorted(joints)} of them")
    if fitted is not None and len(fitted) != len(demonstrations):
        raise ValueError(f"needs one fit for each demonstration, got {len(fitted)} for {len(demonstrations)}")
    faint = max(0.15, min(1.0, 5 / len(demonstrations)))
    drawn = []
    for joint, ax in enumerate(axes):
        lines = [
            ax.plot(shown.times, shown.trajectory[:, joint], color=_DEMONSTRATED, linewidth=2.5, alpha=faint)[0]
            for shown in demonstrations
        ]
        fits = [
            ax.plot(times, trajectory[:, joint], "--", color=_FITTED, linewidth=1.3, alpha=faint)[0]
            for times, trajectory in fitted or ()
        ]
        ax.set(title=names[joint] if names else f"joint {joint + 1}", xlabel="time (s)", ylabel="angle (rad)")
        ax.set_xlim(left=0)
        ax.grid(alpha=0.3)
        drawn.append(DrawnJoint(lines, fits))
    handles = [Line2D([], [], color=_DEMONSTRATED, linewidth=2.5, label=f"demonstrated ({len(demonstrations)})")]
    if fitted is not None:
        handles.append(Line2D([], [], color=_FITTED, linestyle="--", label="motor primitive"))
    axes[0].legend(handles=handles, loc="best", fontsize="small")
    return drawn


def noise_ellipses(ax: Axes, outcomes: Sequence[Array], *, deviations: float = 2.0) -> list[Ellipse]:
    """Where repetitions of the same movements land: points, and for each movement an ellipse around its mean.

    Args:
        ax: drawn on.
        outcomes: for each movement ``(n_repetitions, 2)`` m, at least 2.
        deviations: half axes of the ellipses, in standard deviations along the principal axes.

    Returns:
        The ellipses, in the order of ``outcomes``.

    Raises:
        ValueError: no movement, or fewer than two landing points on the plane.
    """
    wrong = [np.shape(landed) for landed in outcomes if np.ndim(landed) != 2 or np.shape(landed) < (2, 2)]
    wrong += [np.shape(landed) for landed in outcomes if np.shape(landed)[-1:] != (2,)]
    if wrong or not len(outcomes):
        raise ValueError(f"needs (n, 2) landing points of each movement, n > 1, got {wrong or 'no movement'}")
    ellipses = []
    for k, landed in enumerate(outcomes):
        colour = _MOVEMENTS[k % len(_MOVEMENTS)]
        variances, directions = np.linalg.eigh(np.cov(landed.T))
        width, height = 2 * deviations * np.sqrt(np.maximum(variances, 0.0))
        angle = float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0])))
        centre = landed.mean(axis=0)
        ellipse = Ellipse(
            (centre[0], centre[1]), width, height, angle=angle, facecolor=(*_rgb(colour), 0.12), edgecolor=colour
        )
        ellipse.set_linewidth(1.8)
        x, y = landed.std(axis=0, ddof=1)
        marker = _MARKERS[k % len(_MARKERS)]
        ax.plot(
            *landed.T, marker, color=colour, markersize=5, alpha=0.8, label=f"movement {k + 1}: sd ({x:.3f}, {y:.3f}) m"
        )
        ax.add_patch(ellipse)
        ellipses.append(ellipse)
    ax.autoscale_view()
    ax.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    ax.margins(0.1)
    ax.grid(alpha=0.3)
    ax.legend(fontsize="small")
    return ellipses


def competence_map(ax: Axes, lows: Array, highs: Array, competences: Array) -> PatchCollection:
    """The regions of the interest map, coloured by mean competence, eqs. (2) and (7): 0 met, -1 no better than rest.

    Args:
        ax: drawn on, and given a colour bar.
        lows, highs: ``(n_regions, 2)`` m, the corners of the regions.
        competences: ``(n_regions,)``; NaN, a region without goals, is left white.

    Returns:
        One rectangle for each region, in their order; their array holds the competences.

    Raises:
        ValueError: regions that are not in the plane, or numbers that do not match.
    """
    drawn = coloured_regions(ax, lows, highs, np.ma.masked_invalid(competences), "viridis", (-1.0, 0.0))
    colour_bar([ax], drawn, "mean competence: 0 met, -1 not at all")
    water_plane(ax, Box(lows.min(axis=0), highs.max(axis=0)))
    return drawn


def interest_over_time(axes: Iterable[Axes], regions: Mapping[str, np.ndarray]) -> list[PatchCollection]:
    """The interest map as it splits: one map on each axis, evenly picked from the first to the last, on one scale.

    Args:
        axes: at least one; the last gets the colour bar for all, those without a map are hidden.
        regions: the columns of a run's regions.csv, ``movements``, ``low_0`` to ``high_1`` (m) and ``interest``.

    Returns:
        The rectangles of each map.

    Raises:
        ValueError: there is no map, or its regions are not in the plane.
    """
    axes, moments = list(axes), np.unique(regions["movements"])
    if not len(moments) or "low_2" in regions:
        raise ValueError("needs at least one interest map of the plane; was the run never evaluated?")
    picked = moments[np.unique(np.linspace(len(moments) - 1, 0, len(axes)).round().astype(int))]
    most = max(float(regions["interest"][np.isin(regions["movements"], picked)].max()), 1e-6)
    drawn = []
    for ax, movements in zip(axes, picked, strict=False):
        now = regions["movements"] == movements
        lows, highs = (np.stack([regions[f"{side}_{k}"][now] for k in (0, 1)], axis=1) for side in ("low", "high"))
        drawn.append(coloured_regions(ax, lows, highs, regions["interest"][now], "Oranges", (0.0, most)))
        water_plane(ax, Box(lows.min(axis=0), highs.max(axis=0)))
        _legend_off(ax)
        ax.set_title(f"after {movements} movements: {now.sum()} region{'s' * bool(now.sum() > 1)}", fontsize="medium")
    for ax in axes[len(drawn) :]:
        ax.set_visible(False)
    colour_bar(axes, drawn[-1], "interest: recent change of competence")
    return drawn


def chosen_goals(ax: Axes, goals: Array, times: Array, box: Box | None = None) -> PathCollection:
    """The goals that a learner chose itself, coloured by time.

    Args:
        ax: drawn on, and given a colour bar.
        goals: ``(n, 2)`` m.
        times: ``(n,)`` movements executed before.
        box: T; None for a box around the goals.

    Returns:
        The points; their array holds the times.

    Raises:
        ValueError: no goals, goals that are not in the plane, or another number of times.
    """
    if goals.ndim != 2 or goals.shape[1] != 2 or not 0 < len(goals) == len(times):
        raise ValueError(f"needs (n, 2) goals and (n,) times, n > 0, got {goals.shape} and {np.shape(times)}")
    points = ax.scatter(goals[:, 0], goals[:, 1], c=times, s=14, cmap="viridis", linewidths=0)
    colour_bar([ax], points, "movements executed before")
    margin = 1e-3 + 0.05 * np.ptp(goals, axis=0)
    water_plane(ax, Box(goals.min(axis=0) - margin, goals.max(axis=0) + margin) if box is None else box)
    return points


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _legend_off(ax: Axes) -> None:
    legend: Any = ax.get_legend()
    if legend is not None:
        legend.remove()
