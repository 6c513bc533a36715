"""Figures over time: demonstrated joint trajectories, section 5.3 of Nguyen & Oudeyer (2014).

trajectories(figure.subplots(2, 3).flat, demonstrations, names=JOINTS)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from sgimd_torch.figures.axes import GREY
from sgimd_torch.spaces import Demonstration


def trajectories(
    axes: Sequence[Axes], demonstrations: Sequence[Demonstration], *, names: Sequence[str]
) -> list[list[Line2D]]:
    """Joint angles (rad) against time (s), as demonstrated, thin and grey, on top of each other.

    Args:
        axes: one for each joint.
        demonstrations: one or more.
        names: of the joints.

    Returns:
        For each joint a line for each demonstration.
    """
    faint = max(0.15, min(1.0, 5 / len(demonstrations)))
    style: dict[str, Any] = {"color": GREY, "linewidth": 2.5}
    drawn = []
    for joint, ax in enumerate(axes):
        drawn.append([ax.plot(d.times, d.trajectory[:, joint], alpha=faint, **style)[0] for d in demonstrations])
        ax.set(title=names[joint], xlabel="time (s)", ylabel="angle (rad)")
        ax.set_xlim(left=0)
        ax.grid(alpha=0.3)
    return drawn
