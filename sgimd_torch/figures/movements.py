"""Figures over time: demonstrated joint trajectories, and the interest map as it splits.

Sections 5.3 and 6 of Nguyen & Oudeyer (2014). Each function draws on the axes it is given and returns what it drew.
    trajectories(figure.subplots(2, 3).flat, demonstrations, names=JOINTS); interest_over_time(axes, run.regions)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.lines import Line2D

from sgimd_torch.figures.axes import GREY, colour_bar
from sgimd_torch.figures.learning import frame_regions, map_after, regions_in
from sgimd_torch.figures.sections import Section
from sgimd_torch.spaces import Demonstration


def trajectories(
    axes: Sequence[Axes], demonstrations: Sequence[Demonstration], *, names: Sequence[str] | None = None
) -> list[list[Line2D]]:
    """Joint angles (rad) against time (s), as demonstrated, thin and grey, on top of each other.

    Args:
        axes: one for each joint.
        demonstrations: one or more.
        names: of the joints; None numbers them.

    Returns:
        For each joint a line for each demonstration.
    """
    faint = max(0.15, min(1.0, 5 / len(demonstrations)))
    style: dict[str, Any] = {"color": GREY, "linewidth": 2.5}
    drawn = []
    for joint, ax in enumerate(axes):
        drawn.append([ax.plot(d.times, d.trajectory[:, joint], alpha=faint, **style)[0] for d in demonstrations])
        ax.set(title=names[joint] if names else f"joint {joint + 1}", xlabel="time (s)", ylabel="angle (rad)")
        ax.set_xlim(left=0)
        ax.grid(alpha=0.3)
    line = Line2D([], [], label=f"demonstrated ({len(demonstrations)})", **style)
    axes[0].legend(handles=[line], loc="upper right", fontsize="small")
    return drawn


def interest_over_time(
    axes: Iterable[Axes], regions: Mapping[str, np.ndarray], section: Section | None = None
) -> list[PatchCollection]:
    """The interest map as it splits: one map on each axis, evenly picked from the first to the last, on one scale.

    Args:
        axes: at least one; the last gets the colour bar for all, those without a map are hidden.
        regions: the columns of a run's ``regions``, ``movements``, ``low_0`` to ``high_1`` (m) and ``interest``.
        section: which dimensions to show; needed unless regions are of the plane.

    Returns:
        The rectangles of each map.

    Raises:
        ValueError: there is no map, or its regions are not in the plane.
    """
    axes, moments = list(axes), np.unique(regions["movements"])
    if not len(moments):
        raise ValueError("needs at least one interest map; was the run never evaluated?")
    picked = moments[np.unique(np.linspace(len(moments) - 1, 0, len(axes)).round().astype(int))]
    most = max(float(regions["interest"][np.isin(regions["movements"], picked)].max()), 1e-6)
    drawn = []
    for ax, movements in zip(axes, picked, strict=False):
        lows, highs, interests = map_after(regions, movements)
        drawn.append(regions_in(ax, lows, highs, interests, "Oranges", (0.0, most), section))
        frame_regions(ax, lows, highs, section, legend=False)
        ax.set_title(f"after {movements} movements: {len(lows)} region{'s' * (len(lows) > 1)}", fontsize="medium")
    for ax in axes[len(drawn) :]:
        ax.set_visible(False)
    colour_bar(axes, drawn[-1], "interest: recent change of competence")
    return drawn
