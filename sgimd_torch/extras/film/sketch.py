"""What matplotlib draws in films: robots in the plane, and the panel beside each robot.

    write_film(Path("film.mp4"), shoot(Sketchbook(arm.outcomes, shots), shots))
    picture = panel(space, goals, errors, 500, (movements, mean_errors), colour)

A ``Sketch`` has chains of links and objects, drawn without OpenGL. The goal is a ring, past outcomes are dots, the
outcome is a cross, and lines are the paths of the chains' ends. The first two dimensions of an outcome are x and y of
the picture; if an outcome has only one dimension, y is 0. Needs the extra ``film``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.extras.film.reel import HEIGHT, WIDTH, Frame, Shot
from sgimd_torch.extras.pictures.maps import misses, pixels
from sgimd_torch.extras.pictures.sections import sections
from sgimd_torch.extras.report.maps import limits, over_movements
from sgimd_torch.extras.report.save import STYLE
from sgimd_torch.spaces import Array, Box, rounded

MARGINS: Final = (0.06, 0.11)  # margins as shares of the width and the height of the picture
DPI: Final = 100
TEXT: Final[Any] = {"font.size": 8, "axes.titlesize": 9, "axes.titlelocation": "left"}  # style of the panel
PAPER: Final = "#f7f5f0"  # colour of the background
BORDER: Final = "#c9c4b8"  # colour of the border of T
LINK: Final = "#2b3a4a"  # colour of the robot's links
PATH: Final = "#e08a55"  # colour of the path of a chain's end
END: Final = "#d1341f"  # colour of a chain's end, and of the outcome
OBJECT: Final = "#2f7f6f"  # colour of an object
PAST: Final = "#9db4c8"  # colour of past outcomes
GOAL: Final = "#f0e442"  # colour of the goal's ring, which has a black edge


class Sketchbook:
    """A `Painter` of shots whose movements are ``Sketch``es.

    Args:
        space: T, whose border is drawn.
        shots: all shots of the film. The scale fits T, their first chains and their chains of links; other objects may
            leave the picture.
    """

    def __init__(self, space: Box, shots: Sequence[Shot]) -> None:
        self._space = space
        chains = [
            chain for shot in shots for k, chain in enumerate(_sketch(shot).chains) if k == 0 or chain.shape[1] > 1
        ]
        seen = [chain.reshape(-1, 2) for chain in chains]
        seen.append(in_picture(np.stack([space.low, space.high])))
        low, high = (end(np.concatenate(seen), axis=0) for end in (np.min, np.max))
        room = np.array([WIDTH, HEIGHT]) * (1 - 2 * np.array(MARGINS))
        half = np.array([WIDTH, HEIGHT]) / (room / np.maximum(high - low, 1e-9)).min() / 2
        self._low, self._high = (low + high) / 2 - half, (low + high) / 2 + half
        self._figure = blank(WIDTH, facecolor=PAPER)
        self._ax = self._figure.add_axes((0, 0, 1, 1))

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The robot at ``time`` (s); after the end of the movement, the last posture and the outcome."""
        sketch, ax = _sketch(shot), self._ax
        last = round(min(time, sketch.landed) / sketch.step)
        ax.clear()
        ax.set_axis_off()
        ax.set(xlim=(self._low[0], self._high[0]), ylim=(self._low[1], self._high[1]))
        if self._space.dim > 1:
            ax.add_patch(Rectangle(self._space.low[:2], *self._space.sides[:2], fill=False, edgecolor=BORDER))  # type: ignore[arg-type]
        ax.plot(*in_picture(shot.past).T, "o", color=PAST, ms=2, mec="none")
        for edge, width in (("black", 4.5), (GOAL, 2.5)):
            ax.plot(*in_picture(shot.goal[None]).T, "o", mfc="none", mec=edge, ms=14, mew=width)
        for chain in sketch.chains:
            ax.plot(*chain[: last + 1, -1].T, color=PATH, lw=1.5)
        for chain in sketch.chains:
            ax.plot(*chain[last].T, "o-", color=LINK, mfc="white", lw=3.5, ms=4)
            ax.plot(*chain[last, -1:].T, "o", color=OBJECT if chain.shape[1] == 1 else END, ms=7)
        if time >= sketch.landed:
            ax.plot(*in_picture(sketch.outcome[None]).T, "x", color=END, ms=12, mew=2)
        return Image.fromarray(pixels(self._figure)[..., :3])


def in_picture(points: Array) -> Array:
    """``(n, 2)`` places of outcomes ``(n, outcome_dim)`` in the picture."""
    return points[:, :2] if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])


def _sketch(shot: Shot) -> Sketch:
    assert isinstance(shot.recording, Sketch)
    return shot.recording


def panel(space: Box, goals: Array, errors: Array, now: int, curve: tuple[Array, Array], colour: str) -> Frame:
    """A map of the benchmark goals, in the first two dimensions of T, above the curve of the mean error.

    Args:
        space: T, with names and unit.
        goals: ``(n, outcome_dim)`` goals of the benchmark.
        errors: ``(n,)`` errors of these goals, in the unit of T.
        now: number of movements of the learner.
        curve: ``(m,)`` numbers of movements and ``(m,)`` mean errors; later points than ``now`` are left out.
        colour: colour of the curve.
    """
    plane, near = limits(goals, space), rounded(float(np.ptp(goals, axis=0).max() or 1.0) / 50)
    margin = plane.sides / 20
    section = sections(replace(plane, low=plane.low - margin, high=plane.high + margin))[0]
    with style.context({**STYLE, **TEXT}, after_reset=True):
        figure = blank(0.75 * HEIGHT, layout="constrained")
        above, below = figure.subplots(2, height_ratios=[2.2, 1])
        misses(above, goals, errors, space, section, 6 * near)
        above.set_title(f"{(errors <= near).sum()} of {len(errors)} met within {space.amount(near)}")
        movements, means = curve
        seen = movements <= now
        below.plot(movements[seen], means[seen], "o-", color=colour, ms=4)
        over_movements(below, space.in_unit("mean error"))
        below.set(xlim=(0, 1.05 * float(movements.max())), ylim=(0, 1.1 * float(means.max()) or 1.0))
        return pixels(figure)[..., :3]


def blank(width: float, **options: Any) -> Figure:
    """A figure with a width in pixels and the height of the film; ``options`` go to matplotlib."""
    return Figure(figsize=(width / DPI, HEIGHT / DPI), dpi=DPI, **options)
