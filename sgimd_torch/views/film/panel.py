"""Beside a film: which goals the learner meets already, and how its error falls.

    panel = Panel(goals, stages, colour, height=480)
    shot = Shot(recording, goal, beside=panel.beside(0, goal, recording.outcome))

The map shows T around the goals of the benchmark: the bluer a place, the nearer the answer to its nearest goal has
landed. A yellow ring is the present goal, a cross where its answer has landed. Diamonds are what teachers have shown
because they were asked, in a colour for each teacher. Needs the extra ``film``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

try:
    from matplotlib import colormaps, rc_context
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError(f"films need {error.name}; install the extra film: pip install 'sgimd-torch[film]'") from error

from scipy.spatial import cKDTree

from sgimd_torch.figures.axes import colours, goal_rings, rounded
from sgimd_torch.figures.save import STYLE
from sgimd_torch.spaces import Array
from sgimd_torch.views.film.reel import Frame
from sgimd_torch.views.film.sketch import in_picture

_INCHES: Final = 4.8  # the height of the figure: sizes of its text and lines are relative to this
_FINE: Final = 240  # places of the map along each side
_LANDED = "#d55e00"
_BLUES: Final = ListedColormap(colormaps["Blues_r"](np.linspace(0.08, 0.95, 256)))
_TEXT: Final[Any] = {"font.size": 10, "axes.titlesize": 11, "axes.titlelocation": "left"}
_LEGEND: Final[Any] = {
    "loc": "upper center",
    "bbox_to_anchor": (0.5, 0.0),  # below the map
    "ncols": 2,
    "fontsize": 8,
    "frameon": False,
    "columnspacing": 0.6,
    "handletextpad": 0.0,
}


@dataclass(frozen=True, eq=False)
class Stage:
    """What a learner can do after some ``movements``: how far it misses each goal of the benchmark, ``(n,)``; and by
    teacher, what they have ``shown`` because they were asked, ``(m, outcome_dim)``, none of who was not asked."""

    movements: int
    errors: Array
    shown: Mapping[str, Array] = field(default_factory=dict)


class Panel:
    """Draws map and curve.

    Args:
        goals: ``(n, outcome_dim)`` of the benchmark.
        stages: all that the film shows, in order, so that its pictures have one scale.
        colour: of the curve.
        curve: ``(2, m)`` movements and mean errors to draw in the place of the stages' own.
        height: pixels; the width is three quarters of it.
    """

    def __init__(
        self, goals: Array, stages: Sequence[Stage], colour: str, *, curve: Array | None = None, height: int = 480
    ) -> None:
        places, self._stages, self._colour = in_picture(goals), stages, colour
        own = np.array([[stage.movements, stage.errors.mean()] for stage in stages]).T
        self._movements, self._errors = own if curve is None else curve
        self._dpi = height / _INCHES
        self._size = np.array([2 * round(0.375 * height), height]) + 0.01  # pixels, even; a fraction more is cut off
        side = float(np.ptp(places, axis=0).max()) or 1.0
        self.near = rounded(side / 50)
        """Nearer than this, in the unit of T, is met."""
        self._teachers = colours(name for stage in stages for name in stage.shown)
        self._low, self._high = places.min(axis=0) - side / 20, places.max(axis=0) + side / 20
        x, y = np.linspace(self._low, self._high, _FINE).T
        self._nearest = cKDTree(places).query(np.stack(np.meshgrid(x, y), axis=-1))[1]  # (_FINE, _FINE)

    def beside(self, k: int, goal: Array, outcome: Array) -> tuple[Frame, Frame]:
        """At stage ``k``: pictures before and after the answer to ``goal`` has landed at ``outcome``."""
        return self._draw(k, [goal]), self._draw(k, [goal, outcome])

    def _draw(self, k: int, marked: Sequence[Array]) -> Frame:
        with rc_context({**STYLE, **_TEXT}):
            width, height = (self._size / self._dpi).tolist()
            figure = Figure(figsize=(width, height), dpi=self._dpi, layout="constrained")
            above, below = figure.subplots(2, height_ratios=[2.7, 1])
            self._map(above, self._stages[k], *marked)
            self._curve(below, self._stages[k].movements)
            canvas: Any = FigureCanvasAgg(figure)
            canvas.draw()
            return np.array(canvas.buffer_rgba())[..., :3]

    def _map(self, ax: Axes, stage: Stage, goal: Array, outcome: Array | None = None) -> None:
        (left, bottom), (right, top) = self._low.tolist(), self._high.tolist()
        errors = stage.errors
        shades = np.clip(errors / (6 * self.near), 0, 1)[self._nearest]
        ax.imshow(shades, cmap=_BLUES, vmin=0, vmax=1, origin="lower", extent=(left, right, bottom, top))
        for name, colour in self._teachers.items():
            shown = stage.shown.get(name, np.empty((0, len(goal))))
            ax.plot(*in_picture(shown).T, "D", color=colour, mec="white", mew=0.6, ms=4, label=f"{name} {len(shown)}")
        if self._teachers:
            ax.legend(**_LEGEND)
        goal_rings(ax, in_picture(goal[None]), 14)
        if outcome is not None:
            ax.plot(*in_picture(outcome[None]).T, "X", color=_LANDED, mec="white", ms=10, mew=1)
        met = int((errors <= self.near).sum())
        ax.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[])
        ax.set_title(f"{met} of {len(errors)} goals met within {self.near:g}")
        ax.spines[:].set_visible(False)

    def _curve(self, ax: Axes, movements: int) -> None:
        seen = self._movements <= movements
        ax.plot(self._movements[seen], self._errors[seen], "o-", color=self._colour, ms=4)
        first, last = float(self._movements.min()), float(self._movements.max())
        if last > 20 * first:
            ax.set_xscale("log")
        ax.set(xlim=(first / 1.2, last * 1.2), ylim=(0, 1.1 * float(self._errors.max()) or 1.0))
        ax.xaxis.set_major_formatter("{x:.0f}")
        ax.xaxis.set_minor_formatter("")
        ax.set_title(f"mean error {self._errors[seen][-1]:.3f} after {movements} movements" if seen.any() else "")
        ax.grid(alpha=0.3)
