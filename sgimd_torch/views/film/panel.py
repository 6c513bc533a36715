"""Beside a film: which goals the learner meets already, and how its error falls.

    panel = Panel(space, goals, colour, movements, errors)
    shot = Shot(recording, goal, beside=panel.beside(500, goal_errors, goal, recording.outcome))

The map shows each goal of the benchmark in the first two dimensions of T, coloured by how far its answer misses it. A
yellow ring is the present goal, a cross where its answer has landed. Needs the extra ``film``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

try:
    from matplotlib import rc_context
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError(f"films need {error.name}; install the extra film: pip install 'sgimd-torch[film]'") from error

from sgimd_torch.figures.axes import goal_rings, limits, over_movements, rounded
from sgimd_torch.figures.learning import misses
from sgimd_torch.figures.save import STYLE
from sgimd_torch.figures.sections import sections
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.film.reel import HEIGHT, Frame

_DPI: Final = 100
_TEXT: Final[Any] = {"font.size": 8, "axes.titlesize": 9, "axes.titlelocation": "left"}


class Panel:
    """Draws map and curve.

    Args:
        space: T, which gives names and unit.
        goals: ``(n, outcome_dim)`` of the benchmark.
        colour: of the curve.
        movements, errors: ``(m,)`` each, m >= 1: the curve, mean errors after so many movements.
    """

    def __init__(self, space: Box, goals: Array, colour: str, movements: Array, errors: Array) -> None:
        self._goals, self._colour, self._movements, self._errors = goals, colour, movements, errors
        shown = limits(goals, space)
        margin = shown.sides / 20  # for rings at the edge
        self._space = replace(shown, low=shown.low - margin, high=shown.high + margin)
        self.near = rounded(float(np.ptp(goals, axis=0).max() or 1.0) / 50)
        """Nearer than this, in the unit of T, is met."""

    def beside(self, movements: int, errors: Array, goal: Array, outcome: Array) -> tuple[Frame, Frame]:
        """After so many ``movements``, missing the goals by ``errors`` ``(n,)``: pictures before and after the answer
        to ``goal`` has landed at ``outcome``."""
        return self._draw(movements, errors, [goal]), self._draw(movements, errors, [goal, outcome])

    def _draw(self, movements: int, errors: Array, marked: Sequence[Array]) -> Frame:
        with rc_context({**STYLE, **_TEXT}):
            figure = Figure(figsize=(0.75 * HEIGHT / _DPI, HEIGHT / _DPI), dpi=_DPI, layout="constrained")
            above, below = figure.subplots(2, height_ratios=[2.2, 1])
            self._map(above, errors, *marked)
            self._curve(below, movements)
            canvas: Any = FigureCanvasAgg(figure)
            canvas.draw()
            return np.array(canvas.buffer_rgba())[..., :3]

    def _map(self, ax: Axes, errors: Array, goal: Array, outcome: Array | None = None) -> None:
        section = sections(self._space)[0]
        misses(ax, self._goals, errors, self._space, section, 6 * self.near)
        if not section.is_strip:
            goal_rings(ax, section.points(goal[None]), 14)
            if outcome is not None:
                ax.plot(*section.points(outcome[None]).T, "X", color="#d55e00", mec="white", ms=10, mew=1)
        met = int((errors <= self.near).sum())
        ax.set_title(f"{met} of {len(errors)} met within {self._space.amount(self.near)}")

    def _curve(self, ax: Axes, movements: int) -> None:
        seen = self._movements <= movements
        ax.plot(self._movements[seen], self._errors[seen], "o-", color=self._colour, ms=4)
        over_movements(ax, self._space.in_unit("mean error"))
        ax.set(xlim=(0, 1.05 * float(self._movements.max())), ylim=(0, 1.1 * float(self._errors.max()) or 1.0))
        if seen.any():
            ax.set_title(f"{self._space.amount(self._errors[seen][-1])} after {movements} movements")
