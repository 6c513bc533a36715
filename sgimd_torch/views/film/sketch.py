"""Films of robots in the plane: what their ``record`` gives, drawn as a chain of links, without OpenGL.

    sketchbook = Sketchbook(arm.outcomes, shots); write_film("film.mp4", shoot(sketchbook, [shots]))
The goal is a ring, past outcomes are dots, the end of the chain leaves a path. The first two dimensions of the outcome
are x and y of the picture; an outcome of one dimension lies on y = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from sgimd_torch.environments.protocol import Sketch
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.film.reel import Frame, Shot, captioned, place

MARGINS: Final = (0.06, 0.11)  # of width and height of the picture, around all that happens
_SHARPER: Final = 2  # drawn so many times larger, then made smaller: smooth edges
_PAPER, _FRAME, _LINK, _JOINT = "#f7f5f0", "#c9c4b8", "#2b3a4a", "#ffffff"
_PATH, _GOAL, _END, _PAST = "#e08a55", "#d99a00", "#d1341f", "#9db4c8"


class Sketchbook:
    """Draws shots whose recordings are ``Sketch``es.

    Args:
        space: T, whose frame is drawn.
        shots: all that will be drawn, so that pictures have one scale; they show what happens, not all of T.
        width, height: of an image, pixels, even.
    """

    def __init__(self, space: Box, shots: Sequence[Shot], *, width: int = 640, height: int = 480) -> None:
        self._frame = in_picture(np.stack([space.low, space.high])) if space.dim > 1 else None
        seen = [_sketch(shot).chains.reshape(-1, 2) for shot in shots]
        seen += [in_picture(space.clip([*shot.past, shot.goal])) for shot in shots]
        low, high = (end(np.concatenate(seen), axis=0) for end in (np.min, np.max))
        self._size = np.array([width, height]) * _SHARPER
        room = self._size * (1 - 2 * np.array(MARGINS))
        self._middle = (low + high) / 2
        self._scale = float((room / np.maximum(high - low, 1e-9)).min())  # pixels for each unit
        self._papers: dict[int, Image.Image] = {}

    def frame(self, shot: Shot, time: float) -> Frame:
        """The robot at ``time`` (s); from its end on, where it ended."""
        sketch = _sketch(shot)
        row = min(round(time / sketch.step), len(sketch.chains) - 1)
        image = self._paper(shot).copy()
        pen = ImageDraw.Draw(image)
        self._line(pen, sketch.chains[: row + 1, -1], _PATH, 2)
        self._line(pen, sketch.chains[row], _LINK, 5)
        for joint in self._pixels(sketch.chains[row][:-1]):
            self._dot(pen, joint, 3, _JOINT, outline=_LINK)
        self._dot(pen, self._pixels(sketch.chains[row][-1:])[0], 5, _END)
        small = image.resize(tuple((self._size // _SHARPER).tolist()), Image.Resampling.LANCZOS)
        return captioned(small, shot.title, caption(shot, time))

    def _paper(self, shot: Shot) -> Image.Image:
        """What does not move: the frame of T, past outcomes and the goal; drawn once."""
        if id(shot) not in self._papers:
            image = Image.new("RGB", tuple(self._size.tolist()), _PAPER)
            pen = ImageDraw.Draw(image)
            if self._frame is not None:
                (left, bottom), (right, top) = self._pixels(self._frame)
                pen.rectangle((left, top, right, bottom), outline=_FRAME, width=_SHARPER)
            for past in self._pixels(in_picture(shot.past)):
                self._dot(pen, past, 1.5, _PAST)
            goal, radius = self._pixels(in_picture(shot.goal[None]))[0], 9 * _SHARPER
            pen.ellipse((*(goal - radius), *(goal + radius)), outline=_GOAL, width=3 * _SHARPER)
            self._papers[id(shot)] = image
        return self._papers[id(shot)]

    def _pixels(self, points: Array) -> Array:
        """``(n, 2)`` from places in the plane, y upwards, to pixels, y downwards."""
        return self._size / 2 + (points - self._middle) * np.array([self._scale, -self._scale])

    def _line(self, pen: ImageDraw.ImageDraw, points: Array, colour: str, width: int) -> None:
        if len(points) > 1:
            pen.line([tuple(p) for p in self._pixels(points).tolist()], colour, width * _SHARPER, joint="curve")

    def _dot(self, pen: ImageDraw.ImageDraw, at: Array, radius: float, colour: str, outline: str | None = None) -> None:
        radius *= _SHARPER
        pen.ellipse((*(at - radius), *(at + radius)), fill=colour, outline=outline, width=_SHARPER)


def caption(shot: Shot, time: float) -> str:
    """The text below the picture at ``time`` (s)."""
    sketch = _sketch(shot)
    if time >= sketch.landed:
        return f"goal {place(shot.goal)}, reached {place(sketch.outcome)}: missed by {shot.missed:.3g}"
    return f"goal {place(shot.goal)}   {time:.2f} s"


def _sketch(shot: Shot) -> Sketch:
    assert isinstance(shot.recording, Sketch)
    return shot.recording


def in_picture(points: Array) -> Array:
    """``(n, 2)`` where outcomes ``(n, outcome_dim)`` lie in the picture."""
    return points[:, :2] if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])
