"""What every film is made of: shots side by side, frame by frame, captions, an mp4 file, a sheet of pictures.

A camera draws ``frame(shot, time)``: ``camera.py`` those of the rod in MuJoCo, ``sketch.py`` robots in the plane.
    write_film("film.mp4", shoot(camera, [[Shot(recording, goal)]]))

Needs the extra ``film``.
"""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.environments.protocol import Recorded
from sgimd_torch.files import replacing
from sgimd_torch.spaces import Array

try:
    from imageio_ffmpeg import get_ffmpeg_exe
    from PIL import Image, ImageDraw, ImageFont
except ImportError as error:
    raise ImportError(f"films need {error.name}; install the extra film: pip install 'sgimd-torch[film]'") from error

Frame = NDArray[np.uint8]  # (height, width, 3)

RATE: Final = 25  # frames a second
PAUSE: Final = 1.6  # s, the landing is shown


@dataclass(frozen=True, eq=False)
class Shot:
    """One movement to film: the ``goal`` ``(outcome_dim,)`` that it is for, a ``title``, and ``past`` outcomes
    ``(n, outcome_dim)``."""

    recording: Recorded
    goal: Array
    title: str = ""
    past: Array = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def missed(self) -> float:
        """Distance between goal and outcome, in the unit of T."""
        return float(np.linalg.norm(self.recording.outcome - self.goal))


class Filming(Protocol):
    """What draws shots."""

    def frame(self, shot: Shot, time: float) -> Frame:
        """The scene at ``time`` (s); from its end on, how it ended."""
        ...


def shoot(camera: Filming, scenes: Iterable[Sequence[Shot]], *, columns: int = 2) -> Iterator[Frame]:
    """The frames of a film: scene after scene, the shots of each side by side until all have landed, then a pause."""
    for shots in scenes:
        for k in range(_length(shots)):
            yield tiled([camera.frame(shot, k / RATE) for shot in shots], columns)


def landed(camera: Filming, shots: Sequence[Shot], *, columns: int = 2) -> Frame:
    """The last frame of a scene: all its shots have landed."""
    return tiled([camera.frame(shot, shot.recording.landed) for shot in shots], columns)


def count_frames(scenes: Iterable[Sequence[Shot]]) -> int:
    """How many frames ``shoot`` yields."""
    return sum(map(_length, scenes))


def tiled(frames: Sequence[Frame], columns: int) -> Frame:
    """One image made of several of equal size, row by row; empty places are black."""
    columns = min(columns, len(frames))
    rows = math.ceil(len(frames) / columns)
    height, width, _ = frames[0].shape
    image = np.zeros((rows * height, columns * width, 3), np.uint8)
    for k, frame in enumerate(frames):
        y, x = k // columns * height, k % columns * width
        image[y : y + height, x : x + width] = frame
    return image


def captioned(image: Image.Image, title: str, caption: str) -> Frame:
    """A picture with text at its upper and lower edge, "" for none."""
    font = ImageFont.load_default(image.height / 24)
    pen, margin = ImageDraw.Draw(image, "RGBA"), image.height // 48
    for text, anchor, y in ((title, "la", margin), (caption, "ld", image.height - margin)):
        if text:
            left, top, right, bottom = pen.textbbox((2 * margin, y), text, font, anchor)
            pen.rectangle((left - margin, top - margin / 2, right + margin, bottom + margin / 2), (15, 30, 45, 190))
            pen.text((2 * margin, y), text, "white", font, anchor)
    return np.asarray(image)


def write_film(path: str | os.PathLike[str], frames: Iterable[Frame]) -> None:
    """An mp4 file that every player opens (H.264, yuv420p); it appears whole or not at all.

    Args:
        path: ends in .mp4.
        frames: one or more, all of one size, even in height and width.

    Raises:
        OSError: ``path`` cannot be written, or the encoder fails.
    """
    frames = iter(frames)
    with replacing(path) as partial:
        partial.touch()  # fails before the first frame is drawn if the folder is not writable
        first = next(frames)
        size = f"{first.shape[1]}x{first.shape[0]}"
        given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(RATE), "-i", "-"]
        wanted = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", "-f", "mp4"]
        _encode([get_ffmpeg_exe(), "-v", "error", *given, *wanted, "-y", str(partial)], chain([first], frames))


def _encode(command: Sequence[str], frames: Iterable[Frame]) -> None:
    # In a session of its own, so that Ctrl-C reaches only the process that draws the frames.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as encoder:
        assert encoder.stdin is not None
        try:
            with suppress(BrokenPipeError):  # it failed, and its error output says why
                for frame in frames:
                    encoder.stdin.write(frame.tobytes())
            _, said = encoder.communicate()
        except BaseException:
            encoder.kill()
            raise
    if encoder.returncode:
        raise OSError(f"the film was not encoded: {said.decode(errors='replace').strip() or encoder.returncode}")


def write_sheet(path: str | os.PathLike[str], frames: Sequence[Frame], *, columns: int = 3, width: int = 420) -> None:
    """A png file of several frames, each made ``width`` pixels wide. It appears whole or not at all.

    Raises:
        OSError: ``path`` cannot be written.
    """
    height = round(width * frames[0].shape[0] / frames[0].shape[1])
    small = [np.asarray(Image.fromarray(frame).resize((width, height), Image.Resampling.LANCZOS)) for frame in frames]
    with replacing(path) as partial:
        Image.fromarray(tiled(small, columns)).save(partial, "PNG", optimize=True)


def place(point: Array) -> str:
    """``(0.20, 0.50)``, for captions."""
    return f"({', '.join(f'{x:.2f}' for x in point)})"


def _length(shots: Sequence[Shot]) -> int:
    return math.ceil((max(shot.recording.landed for shot in shots) + PAUSE) * RATE)
