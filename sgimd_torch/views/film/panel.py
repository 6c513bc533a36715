"""Beside a film: which goals the learner meets already, and how its error falls.

    panel = Panel(goals, colour, movements, errors)
    shot = Shot(recording, goal, beside=panel.beside(500, goal_errors, goal, recording.outcome))

The map shows T around the goals of the benchmark: the bluer a place, the nearer the answer to its nearest goal has
landed. A yellow ring is the present goal, a cross where its answer has landed. Needs the extra ``film``.
"""

from __future__ import annotations

from collections.abc import Sequence
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

from sgimd_torch.figures.axes import goal_rings, rounded
from sgimd_torch.figures.save import STYLE
from sgimd_torch.spaces import Array
from sgimd_torch.views.film.reel import HEIGHT, Frame
from sgimd_torch.views.film.sketch import in_picture

_DPI: Final = 100
_FINE: Final = 240  # places of the map along each side
_BLUES: Final = ListedColormap(colormaps["Blues_r"](np.linspace(0.08, 0.95, 256)))
_TEXT: Final[Any] = {"font.size": 10, "axes.titlesize": 11, "axes.titlelocation": "left"}


class Panel:
    """Draws map and curve.

    Args:
        goals: ``(n, outcome_dim)`` of the benchmark.
        colour: of the curve.
        movements, errors: ``(m,)`` each, m >= 1: the curve, mean errors after so many movements.
    """

    def __init__(self, goals: Array, colour: str, movements: Array, errors: Array) -> None:
        places = in_picture(goals)
        self._colour, self._movements, self._errors = colour, movements, errors
        side = float(np.ptp(places, axis=0).max()) or 1.0
        self.near = rounded(side / 50)
        """Nearer than this, in the unit of T, is met."""
        self._low, self._high = places.min(axis=0) - side / 20, places.max(axis=0) + side / 20
        x, y = np.linspace(self._low, self._high, _FINE).T
        self._nearest = cKDTree(places).query(np.stack(np.meshgrid(x, y), axis=-1))[1]  # (_FINE, _FINE)

    def beside(self, movements: int, errors: Array, goal: Array, outcome: Array) -> tuple[Frame, Frame]:
        """After so many ``movements``, missing the goals by ``errors`` ``(n,)``: pictures before and after the answer
        to ``goal`` has landed at ``outcome``."""
        return self._draw(movements, errors, [goal]), self._draw(movements, errors, [goal, outcome])

    def _draw(self, movements: int, errors: Array, marked: Sequence[Array]) -> Frame:
        with rc_context({**STYLE, **_TEXT}):
            figure = Figure(figsize=(0.75 * HEIGHT / _DPI, HEIGHT / _DPI), dpi=_DPI, layout="constrained")
            above, below = figure.subplots(2, height_ratios=[2.7, 1])
            self._map(above, errors, *marked)
            self._curve(below, movements)
            canvas: Any = FigureCanvasAgg(figure)
            canvas.draw()
            return np.array(canvas.buffer_rgba())[..., :3]

    def _map(self, ax: Axes, errors: Array, goal: Array, outcome: Array | None = None) -> None:
        (left, bottom), (right, top) = self._low.tolist(), self._high.tolist()
        shades = np.clip(errors / (6 * self.near), 0, 1)[self._nearest]
        ax.imshow(shades, cmap=_BLUES, vmin=0, vmax=1, origin="lower", extent=(left, right, bottom, top))
        goal_rings(ax, in_picture(goal[None]), 14)
        if outcome is not None:
            ax.plot(*in_picture(outcome[None]).T, "X", color="#d55e00", mec="white", ms=10, mew=1)
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
