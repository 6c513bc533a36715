"""The panel beside the robot in a film: a map of the benchmark goals, and the curve of the mean error.

    picture = panel(space, goals, errors, 500, (movements, mean_errors), colour)
The map shows the first two dimensions of T. Needs the extra ``film``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import limits, over_movements
from sgimd_torch.figures.learning import misses
from sgimd_torch.figures.save import STYLE
from sgimd_torch.figures.sections import sections
from sgimd_torch.spaces import Array, Box, rounded
from sgimd_torch.views.film.reel import HEIGHT, Frame

_DPI: Final = 100
_TEXT: Final[Any] = {"font.size": 8, "axes.titlesize": 9, "axes.titlelocation": "left"}


def panel(space: Box, goals: Array, errors: Array, now: int, curve: tuple[Array, Array], colour: str) -> Frame:
    """A picture of map and curve after ``now`` movements of the learner.

    Args:
        space: T, with names and unit.
        goals: ``(n, outcome_dim)`` goals of the benchmark.
        errors: ``(n,)`` errors of these goals, in the unit of T.
        now: number of movements of the learner.
        curve: ``(m,)`` numbers of movements and ``(m,)`` mean errors; later points than ``now`` are left out.
        colour: colour of the curve.
    """
    shown, near = limits(goals, space), rounded(float(np.ptp(goals, axis=0).max() or 1.0) / 50)
    margin = shown.sides / 20
    section = sections(replace(shown, low=shown.low - margin, high=shown.high + margin))[0]
    with rc_context({**STYLE, **_TEXT}):
        figure = blank(0.75 * HEIGHT, layout="constrained")
        above, below = figure.subplots(2, height_ratios=[2.2, 1])
        misses(above, goals, errors, space, section, 6 * near)
        above.set_title(f"{(errors <= near).sum()} of {len(errors)} met within {space.amount(near)}")
        movements, means = curve
        seen = movements <= now
        below.plot(movements[seen], means[seen], "o-", color=colour, ms=4)
        over_movements(below, space.in_unit("mean error"))
        below.set(xlim=(0, 1.05 * float(movements.max())), ylim=(0, 1.1 * float(means.max()) or 1.0))
        return pixels(figure)


def blank(width: float, **options: Any) -> Figure:
    """A figure with a width in pixels and the height of the film; ``options`` go to matplotlib."""
    return Figure(figsize=(width / _DPI, HEIGHT / _DPI), dpi=_DPI, **options)


def pixels(figure: Figure) -> Frame:
    """The drawing of a figure as a frame."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]
