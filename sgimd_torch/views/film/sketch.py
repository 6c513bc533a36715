"""Films of robots in the plane: chains of links from a ``Sketch``, drawn without OpenGL.

    write_film(Path("film.mp4"), shoot(Sketchbook(arm.outcomes, shots), shots))
The goal is a ring, past outcomes are dots, the outcome is a cross, and a line is the path of the chain's end. The first
two dimensions of an outcome are x and y of the picture; if an outcome has only one dimension, y is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.patches import Rectangle
from PIL import Image

from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.figures.axes import goal_rings
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.film.panel import blank, pixels
from sgimd_torch.views.film.reel import HEIGHT, WIDTH, Shot

MARGINS: Final = (0.06, 0.11)  # margins as shares of the width and the height of the picture
_PAPER, _FRAME, _LINK = "#f7f5f0", "#c9c4b8", "#2b3a4a"
_PATH, _END, _PAST = "#e08a55", "#d1341f", "#9db4c8"


class Sketchbook:
    """A `Painter` of shots whose movements are ``Sketch``es.

    Args:
        space: T, whose border is drawn.
        shots: all shots of the film; the scale fits their movements, so parts of T may lie outside the picture.
    """

    def __init__(self, space: Box, shots: Sequence[Shot]) -> None:
        self._space = space
        seen = [_chains(shot).reshape(-1, 2) for shot in shots]
        seen += [in_picture(space.clip([*shot.past, shot.goal, shot.recording.outcome])) for shot in shots]
        low, high = (end(np.concatenate(seen), axis=0) for end in (np.min, np.max))
        room = np.array([WIDTH, HEIGHT]) * (1 - 2 * np.array(MARGINS))
        half = np.array([WIDTH, HEIGHT]) / (room / np.maximum(high - low, 1e-9)).min() / 2
        self._low, self._high = (low + high) / 2 - half, (low + high) / 2 + half
        self._figure = blank(WIDTH, facecolor=_PAPER)
        self._ax = self._figure.add_axes((0, 0, 1, 1))

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The robot at ``time`` (s); after the end of the movement, the last posture and the outcome."""
        sketch, chains, ax = shot.recording, _chains(shot), self._ax
        assert isinstance(sketch, Sketch)
        chain = chains[: min(round(time / sketch.step), len(chains) - 1) + 1]
        ax.clear()
        ax.set_axis_off()
        ax.set(xlim=(self._low[0], self._high[0]), ylim=(self._low[1], self._high[1]))
        if self._space.dim > 1:
            ax.add_patch(Rectangle(self._space.low[:2], *self._space.sides[:2], fill=False, edgecolor=_FRAME))  # type: ignore[arg-type]
        ax.plot(*in_picture(shot.past).T, "o", color=_PAST, ms=2, mec="none")
        goal_rings(ax, in_picture(shot.goal[None]), 14)
        ax.plot(*chain[:, -1].T, color=_PATH, lw=1.5)
        ax.plot(*chain[-1].T, "o-", color=_LINK, mfc="white", lw=3.5, ms=4)
        ax.plot(*chain[-1, -1:].T, "o", color=_END, ms=7)
        if time >= sketch.landed:
            ax.plot(*in_picture(sketch.outcome[None]).T, "x", color=_END, ms=12, mew=2)
        return Image.fromarray(pixels(self._figure))

    def note(self, shot: Shot, time: float) -> str:
        """Always ""."""
        return ""


def in_picture(points: Array) -> Array:
    """``(n, 2)`` places of outcomes ``(n, outcome_dim)`` in the picture."""
    return points[:, :2] if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])


def _chains(shot: Shot) -> Array:
    assert isinstance(shot.recording, Sketch)
    return shot.recording.chains
