"""What every film is made of: shots one after the other, frame by frame, captions, a file, a sheet of pictures.

A camera draws ``frame(shot, time)``: ``camera.py`` those of the rod in MuJoCo, ``sketch.py`` robots in the plane.
``panel.py`` draws what stands beside it.
    write_film("film.mp4", shoot(camera, [Shot(recording, goal)]))

Needs the extra ``film``.
"""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.environments.protocol import Recorded, Sketch
from sgimd_torch.files import replacing
from sgimd_torch.spaces import Array

try:
    from imageio_ffmpeg import get_ffmpeg_exe
    from PIL import Image, ImageDraw, ImageFont
except ImportError as error:
    raise ImportError(f"films need {error.name}; install the extra film: pip install 'sgimd-torch[film]'") from error

Frame = NDArray[np.uint8]  # (height, width, 3)

PAUSE: Final = 0.8  # s, the landing is shown
POUR: Final = 0.6  # s, in which the landings since the last shot appear
RATES: Final = {".mp4": 25.0, ".webp": 12.5}
"""Frames a second of each kind of film: every player opens the first, every browser shows the second in a page."""

_CODECS: Final = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", "-f", "mp4"],
    ".webp": ["-c:v", "libwebp_anim", "-quality", "60", "-loop", "0", "-f", "webp"],
}
_STILL: Final = 0.01  # of the longest way: the end of the robot has not moved yet


@dataclass(frozen=True, eq=False)
class Shot:
    """One movement to film: the ``goal`` ``(outcome_dim,)`` that it is for, a ``title``, ``past`` outcomes
    ``(n, outcome_dim)``, the last ``new`` of them since the shot before, and pictures to stand ``beside`` it, before
    and after the landing."""

    recording: Recorded
    goal: Array
    title: str = ""
    past: Array = field(default_factory=lambda: np.empty((0, 2)))
    new: int = 0
    beside: tuple[Frame, Frame] | None = None

    @property
    def missed(self) -> float:
        """Distance between goal and outcome, in the unit of T."""
        return float(np.linalg.norm(self.recording.outcome - self.goal))

    @property
    def begins(self) -> float:
        """When the robot starts to move, s: nobody wants to see it wait."""
        recorded: Any = self.recording
        if isinstance(recorded, Sketch):
            places, step = recorded.chains.reshape(len(recorded.chains), -1), recorded.step
        else:
            places, step = recorded.floats[:, :3], recorded.step
        moved = np.linalg.norm(places - places[0], axis=1)
        return float(step * max(0, int((moved > _STILL * moved.max()).argmax()) - 1))

    def moments(self, rate: float) -> list[tuple[Shot, float]]:
        """What is shown, frame by frame, ``rate`` of them a second, and at which time (s) of the movement."""
        n = round(POUR * rate) if self.new else 0
        known = len(self.past) - self.new
        counts = [known + round(self.new * (k + 1) / n) for k in range(n)]
        pouring = [
            (replace(self, past=self.past[:count], title=f"learning: {count} landings"), self.begins)
            for count in counts
        ]
        times = np.arange(self.begins, self.recording.landed + PAUSE, 1 / rate).tolist()
        return pouring + [(self, time) for time in times]


class Filming(Protocol):
    """What draws shots."""

    def frame(self, shot: Shot, time: float) -> Frame:
        """The scene at ``time`` (s); from its end on, how it ended."""
        ...


def shoot(camera: Filming, shots: Iterable[Shot], rate: float = RATES[".mp4"]) -> Iterator[Frame]:
    """The frames of a film: of each shot the landings since the last one, the movement, its end for a moment."""
    for shot in shots:
        for part, time in shot.moments(rate):
            frame = camera.frame(part, time)
            beside = shot.beside[time >= shot.recording.landed] if shot.beside else frame[:, :0]
            yield np.concatenate([frame, beside], axis=1)


def count_frames(shots: Iterable[Shot], rate: float = RATES[".mp4"]) -> int:
    """How many frames ``shoot`` yields."""
    return sum(len(shot.moments(rate)) for shot in shots)


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
    """A film, which appears whole or not at all: H.264 in an mp4 file, or a moving picture for a page.

    Args:
        path: its ending is one of ``RATES``, which says how fast it plays.
        frames: one or more, all of one size, even in height and width.

    Raises:
        OSError: ``path`` cannot be written, or the encoder fails.
    """
    frames, kind = iter(frames), Path(path).suffix
    with replacing(path) as partial:
        partial.touch()  # fails before the first frame is drawn if the folder is not writable
        first = next(frames)
        size = f"{first.shape[1]}x{first.shape[0]}"
        given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(RATES[kind]), "-i", "-"]
        wanted = [*_CODECS[kind], "-y", str(partial)]
        _encode([get_ffmpeg_exe(), "-v", "error", *given, *wanted], chain([first], frames))


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
