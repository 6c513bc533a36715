"""Films of robots in the plane: what their ``record`` gives, drawn as a chain of links, without OpenGL.

    write_film(Path("film.mp4"), shoot(Sketchbook(arm.outcomes, shots).frame, shots))
The goal is a ring, past outcomes are dots, the outcome is a cross, the end of the chain leaves a path. The first two
dimensions of the outcome are x and y of the picture; an outcome of one dimension lies on y = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.film.reel import HEIGHT, WIDTH, Shot

MARGINS: Final = (0.06, 0.11)  # of width and height of the picture, around all that happens
_FINER: Final = 2  # supersampling factor
_PAPER, _FRAME, _LINK, _JOINT = "#f7f5f0", "#c9c4b8", "#2b3a4a", "#ffffff"
_PATH, _GOAL, _END, _PAST = "#e08a55", "#d99a00", "#d1341f", "#9db4c8"


class Sketchbook:
    """Draws shots whose recordings are ``Sketch``es.

    Args:
        space: T, whose frame is drawn.
        shots: all that will be drawn, so that pictures have one scale; they show what happens, not all of T.
    """

    def __init__(self, space: Box, shots: Sequence[Shot]) -> None:
        self._frame = in_picture(np.stack([space.low, space.high])) if space.dim > 1 else None
        seen = [_chains(shot).reshape(-1, 2) for shot in shots]
        seen += [in_picture(space.clip([*shot.past, shot.goal, shot.recording.outcome])) for shot in shots]
        low, high = (end(np.concatenate(seen), axis=0) for end in (np.min, np.max))
        self._size = np.array([WIDTH, HEIGHT]) * _FINER
        room = self._size * (1 - 2 * np.array(MARGINS))
        self._middle = (low + high) / 2
        self._scale = float((room / np.maximum(high - low, 1e-9)).min())  # pixels for each unit

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The robot at ``time`` (s); from its end on, where it ended."""
        sketch, chains = shot.recording, _chains(shot)
        assert isinstance(sketch, Sketch)
        row = min(round(time / sketch.step), len(chains) - 1)
        image = Image.new("RGB", tuple(self._size.tolist()), _PAPER)
        pen = ImageDraw.Draw(image)
        if self._frame is not None:
            (left, bottom), (right, top) = self._pixels(self._frame)
            pen.rectangle((left, top, right, bottom), outline=_FRAME, width=_FINER)
        self._dots(pen, in_picture(shot.past), 1.5, fill=_PAST)
        self._dots(pen, in_picture(shot.goal[None]), 9, outline=_GOAL, width=3 * _FINER)
        self._line(pen, chains[: row + 1, -1], _PATH, 2)
        self._line(pen, chains[row], _LINK, 5)
        self._dots(pen, chains[row][:-1], 3, fill=_JOINT, outline=_LINK, width=_FINER)
        self._dots(pen, chains[row][-1:], 5, fill=_END)
        if time >= sketch.landed:
            for slope in (-1, 1):
                arm = np.array([[-8, -8 * slope], [8, 8 * slope]]) * _FINER / self._scale
                self._line(pen, in_picture(sketch.outcome[None]) + arm, _END, 3)
        return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)

    def _pixels(self, points: Array) -> Array:
        """``(n, 2)`` from places in the plane, y upwards, to pixels, y downwards."""
        return self._size / 2 + (points - self._middle) * np.array([self._scale, -self._scale])

    def _line(self, pen: ImageDraw.ImageDraw, points: Array, colour: str, width: int) -> None:
        if len(points) > 1:
            pen.line([tuple(p) for p in self._pixels(points).tolist()], colour, width * _FINER, joint="curve")

    def _dots(
        self,
        pen: ImageDraw.ImageDraw,
        points: Array,
        radius: float,
        *,
        fill: str | None = None,
        outline: str | None = None,
        width: int = 1,
    ) -> None:
        for at in self._pixels(points):
            corners = (*(at - radius * _FINER), *(at + radius * _FINER))
            pen.ellipse(corners, fill=fill, outline=outline, width=width)


def in_picture(points: Array) -> Array:
    """``(n, 2)`` where outcomes ``(n, outcome_dim)`` lie in the picture."""
    return points[:, :2] if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])


def _chains(shot: Shot) -> Array:
    assert isinstance(shot.recording, Sketch)
    return shot.recording.chains
