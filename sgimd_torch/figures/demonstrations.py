"""Demonstrations as figures: each joint as it was recorded and as the robot plays it, and where the movements end.

figure = draw(shown, played, places)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import GREY
from sgimd_torch.figures.sections import sections
from sgimd_torch.spaces import Array, Box, Demonstration

RECORDED: Final = "#0072b2"
PLAYED: Final = "#d55e00"
MOST_CURVES: Final = 12  # recordings whose curves are drawn; more would hide each other


def draw(shown: Sequence[Demonstration], played: Sequence[Array | None], places: Sequence[Array | None]) -> Figure:
    """A panel for each joint, and one for the outcomes.

    Args:
        shown: the recordings, of one robot.
        played: ``(n_times, n_joints)`` that the robot plays in the place of each; None where that is not known.
        places: ``(outcome_dim,)`` where each lands on the simulated robot; None where it cannot be used.
    """
    n_joints = shown[0].trajectory.shape[1]
    columns = min(4, n_joints + 1)
    rows = -(-(n_joints + 1) // columns)
    figure = Figure(figsize=(4 * columns, 3 * rows), layout="constrained")
    panels: list[Axes] = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for joint, ax in enumerate(panels[:n_joints]):
        curves(ax, shown, played, joint)
    outcomes(panels[n_joints], shown, places)
    for ax in panels[n_joints + 1 :]:
        ax.set_axis_off()
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False)
    return figure


def curves(ax: Axes, shown: Sequence[Demonstration], played: Sequence[Array | None], joint: int) -> None:
    """One joint of the first recordings against time (s), and what the robot plays in its place."""
    for row, (each, robot) in enumerate(zip(shown[:MOST_CURVES], played, strict=False)):
        times = each.times - each.times[0]
        first = row == 0
        ax.plot(times, each.trajectory[:, joint], color=RECORDED, lw=1, alpha=0.6, label="recorded" if first else None)
        if robot is not None:
            ax.plot(times, robot[:, joint], "--", color=PLAYED, lw=1, alpha=0.6, label="played" if first else None)
    ax.set(xlabel="time (s)", ylabel=f"joint {joint} (rad, or command)")


def outcomes(ax: Axes, shown: Sequence[Demonstration], places: Sequence[Array | None]) -> None:
    """Where the recordings say that they end, and where the simulated robot ends; the first two dimensions."""
    said = np.stack([each.outcome for each in shown])
    section, *_ = sections(Box.cube(0, 1, said.shape[1]))
    flat = section.points(said)
    for point, place in zip(flat, places, strict=True):
        if place is not None:
            end = section.points(place)
            ax.plot([point[0], end[0]], [point[1], end[1]], color=GREY, lw=0.8, zorder=1)
            ax.plot(*end, "x", color=PLAYED, markersize=5)
    ax.plot(flat[:, 0], flat[:, 1], "o", color=RECORDED, markersize=4, label="recorded")
    ax.set(xlabel="outcome 0", ylabel="outcome 1" if said.shape[1] > 1 else "", title="said (o) and landed (x)")
    ax.set_aspect("equal", adjustable="datalim")
