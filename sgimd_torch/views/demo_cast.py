"""Four goals and the answers of the demo's learners: the arm, and the way of the float, from above and from the side.

casts = {algorithm: answers(path) for algorithm, path in paths.items()}; from_above(ax, casts, box)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

try:
    from matplotlib.axes import Axes
except ImportError as error:
    raise ImportError(f"the figure needs matplotlib: pip install 'sgimd-torch[plot]' ({error})") from error

from sgimd_torch.figures.axes import goal_rings, water_plane
from sgimd_torch.figures.learning import COLOURS, NAMES
from sgimd_torch.runs.build import build
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.spaces import Array, Box, stream
from sgimd_torch.views.memories import remember

GOALS = np.array([[-0.6, -0.6], [-0.6, 0.6], [0.6, 0.6], [0.6, -0.6]])  # m; few random movements lead behind the arm
TOP = 1.2  # m above the water, the side view's upper edge
_WATER = "#4f93b8"


@dataclass(frozen=True, eq=False)
class Cast:
    """An answer: of the float its ``path`` ``(n, 3)`` m down to the water, of the arm its ``posture`` ``(7, 3)`` m when
    the float is let go or lands."""

    goal: Array
    path: Array
    posture: Array

    @property
    def missed(self) -> float:
        """How far (m) from the goal the float has landed."""
        return float(np.linalg.norm(self.path[-1, :2] - self.goal))


def answers(directory: Path) -> list[Cast]:
    """What a run of the fishing rod answers to ``GOALS`` after its last movement; all runs have the same noise."""
    run = read_run(directory)
    parts = build(config_of(run))
    remember(run, parts, 0, len(run.index))
    rod: Any = parts.environment
    context, found = (rod.contexts.low + rod.contexts.high) / 2, []
    for k, goal in enumerate(GOALS):
        recording = rod.record(context, parts.inverse(context, goal).theta, stream(run.config["seed"], "demo", k))
        path = np.stack([recording.float_at(time) for time in np.linspace(0, recording.landed, 100)])
        end = recording.landed if recording.let_out is None else recording.let_out
        found.append(Cast(goal, path, rod.posture(recording, end)))
    return found


def from_above(ax: Axes, casts: Mapping[str, Sequence[Cast]], box: Box) -> None:
    """The water plane: the float's paths to all goals, by algorithm; the goals as rings."""
    for algorithm, each in casts.items():
        missed = 100 * np.mean([cast.missed for cast in each])
        for cast in each:
            label = f"{NAMES[algorithm]}: misses by {missed:.0f} cm" if cast is each[0] else None
            _draw_path(ax, cast, algorithm, [0, 1], label)
    goal_rings(ax, GOALS, 17)
    water_plane(ax, box)


def from_the_side(ax: Axes, casts: Mapping[str, Sequence[Cast]], box: Box) -> None:
    """The casts for the first goal along y, with the arms: x and the height above the water."""
    ax.axhspan(-0.12, 0, color=_WATER, alpha=0.5, linewidth=0)
    ax.plot([0, 0], [0, 0.25], color="0.4", linewidth=7, solid_capstyle="butt")
    for algorithm, (cast, *_) in casts.items():
        colour, chain = COLOURS[algorithm], cast.posture[:, [0, 2]]
        ax.plot(*chain.T, "-", color=colour, linewidth=1.5, alpha=0.7)  # with the rod
        ax.plot(*chain[:-1].T, "o-", color=colour, linewidth=5, markersize=6, mec="white", alpha=0.9)
        _draw_path(ax, cast, algorithm, [0, 2])
    goal_rings(ax, [[GOALS[0, 0], 0.0]], 17)
    ax.set(xlim=(box.low[0], box.high[0]), ylim=(-0.12, TOP), aspect="equal", xlabel="x (m)", ylabel="height (m)")


def _draw_path(ax: Axes, cast: Cast, algorithm: str, seen: list[int], label: str | None = None) -> None:
    ax.plot(*cast.path[:, seen].T, ":", color=COLOURS[algorithm], linewidth=1.8)
    ax.plot(*cast.path[-1:, seen].T, "X", color=COLOURS[algorithm], mec="white", ms=10, label=label)
