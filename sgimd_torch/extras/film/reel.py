"""Common parts of all films: shots, frames, captions, and the file.

``camera.py`` draws the rod, ``sketch.py`` robots in the plane, and the map and the curve beside each robot.
    write_film(Path("film.mp4"), shoot(camera, [Shot(recording, goal)]))

Needs the extra ``film``.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.files import check_writable, replacing
from sgimd_torch.spaces import Array

if TYPE_CHECKING:
    from sgimd_torch.environments.rod_physics import RodTrace  # loads MuJoCo, which then chooses how to draw

Frame = NDArray[np.uint8]  # (height, width, 3)

WIDTH: Final = 640  # pixels, width of the picture of the robot
HEIGHT: Final = 480  # pixels, height of a frame
PAUSE: Final = 0.8  # s, time during which the end of a movement is shown
RATES: Final = {".mp4": 25.0, ".webp": 12.5}
"""Frames per second of each kind of film: .mp4 plays in every player, .webp in every browser."""

_CODECS: Final = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", "-f", "mp4"],
    ".webp": ["-c:v", "libwebp_anim", "-quality", "60", "-loop", "0", "-f", "webp"],
}


@dataclass(frozen=True, eq=False)
class Shot:
    """One movement to film.

    Args:
        recording: trajectory of the movement.
        goal: ``(outcome_dim,)`` goal of the movement.
        context: ``(context_dim,)`` context in which the movement is executed.
        title: text at the upper edge, "" for none.
        unit: unit of T.
        past: ``(n, outcome_dim)`` earlier outcomes to draw.
        beside: picture to the right of the robot, None for none.
    """

    recording: RodTrace | Sketch
    goal: Array
    context: Array = field(default_factory=lambda: np.empty(0))
    title: str = ""
    unit: str = ""
    past: Array = field(default_factory=lambda: np.empty((0, 2)))
    beside: Frame | None = None

    @property
    def missed(self) -> float:
        """Distance between goal and outcome, in the unit of T."""
        return float(np.linalg.norm(self.recording.outcome - self.goal))

    def moments(self, rate: float) -> list[float]:
        """Times (s) of the frames, ``rate`` per second."""
        return list(np.arange(0.0, self.recording.landed + PAUSE, 1 / rate).tolist())

    def caption(self, time: float) -> str:
        """The text below the picture at ``time`` (s): the goal, and at the end the outcome."""
        goal = f"goal {_place(self.goal)}"
        if time >= self.recording.landed:
            return f"{goal}, reached {_place(self.recording.outcome)}: missed by {self.missed:.2g} {self.unit}".rstrip()
        let_out = getattr(self.recording, "let_out", None)  # of the fishing rod
        return f"{goal}   {time:.2f} s{'   line let out' if let_out is not None and time > let_out else ''}"


class Painter(Protocol):
    """A painter draws the frames of shots."""

    def frame(self, shot: Shot, time: float) -> Image.Image:
        """The scene at ``time`` (s); after the end of the movement, the scene at the end."""
        ...


def shoot(painter: Painter, shots: Iterable[Shot], rate: float = RATES[".mp4"]) -> Iterator[Frame]:
    """The frames of a film, ``rate`` per second: each movement, with its end shown for ``PAUSE`` seconds."""
    for shot in shots:
        for time in shot.moments(rate):
            frame = captioned(painter.frame(shot, time), shot.title, shot.caption(time))
            yield frame if shot.beside is None else np.concatenate([frame, shot.beside], axis=1)


def captioned(image: Image.Image, title: str, caption: str) -> Frame:
    """A picture with a title at its upper edge and a caption at its lower edge, "" for none."""
    font = ImageFont.load_default(image.height / 24)
    pen, margin = ImageDraw.Draw(image, "RGBA"), image.height // 48
    for text, anchor, y in ((title, "la", margin), (caption, "ld", image.height - margin)):
        if text:
            left, top, right, bottom = pen.textbbox((2 * margin, y), text, font, anchor)
            pen.rectangle((left - margin, top - margin / 2, right + margin, bottom + margin / 2), (15, 30, 45, 190))
            pen.text((2 * margin, y), text, "white", font, anchor)
    return np.asarray(image)


def check_film(path: Path) -> None:
    """Refuse a film that could not be written, before a learner repeats its record.

    Raises:
        OSError: ``path`` cannot be written, or there is no encoder.
    """
    check_writable(path)
    with suppress(RuntimeError):
        if shutil.which(get_ffmpeg_exe()):
            return
    raise OSError("films need the program ffmpeg; install imageio-ffmpeg, or does IMAGEIO_FFMPEG_EXE name no program?")


def write_film(path: Path, frames: Iterable[Frame]) -> None:
    """Write a film as H.264 in an mp4 file, or as an animated webp picture; after a failure ``path`` is unchanged.

    Args:
        path: file with an ending in ``RATES``.
        frames: one frame or more, all of one size, with even height and width.

    Raises:
        OSError: ``path`` cannot be written, or the encoder fails.
    """
    frames, kind = iter(frames), path.suffix
    with replacing(path) as partial:
        partial.touch()  # refuses a read-only folder before the first frame is drawn
        first = next(frames)
        size = f"{first.shape[1]}x{first.shape[0]}"
        given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(RATES[kind]), "-i", "-"]
        command = [get_ffmpeg_exe(), "-v", "error", *given, *_CODECS[kind], "-y", str(partial)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
            assert encoder.stdin is not None
            with suppress(BrokenPipeError):  # the encoder failed; its message is read below
                for frame in chain([first], frames):
                    encoder.stdin.write(frame.tobytes())
            _, said = encoder.communicate()
        if encoder.returncode:
            raise OSError(f"the film was not encoded: {said.decode(errors='replace').strip()}")


def _place(point: Array) -> str:
    return f"({', '.join(f'{x:.2f}' for x in point)})"
