"""What every film is made of: shots one after the other, frame by frame, captions, a file.

``camera.py`` draws frames of the rod in MuJoCo, ``sketch.py`` those of robots in the plane, ``panel.py`` what stands
beside them.
    write_film(Path("film.mp4"), shoot(camera.frame, [Shot(recording, goal)]))

Needs the extra ``film``.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from sgimd_torch.environments.protocol import Trace
from sgimd_torch.files import replacing
from sgimd_torch.spaces import Array

Frame = NDArray[np.uint8]  # (height, width, 3)

WIDTH: Final = 640  # pixels, of the robot's picture
HEIGHT: Final = 480
PAUSE: Final = 0.8  # s, the landing is shown
RATES: Final = {".mp4": 25.0, ".webp": 12.5}
"""Frames a second of each kind of film: every player opens the first, every browser shows the second in a page."""

_CODECS: Final = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", "-f", "mp4"],
    ".webp": ["-c:v", "libwebp_anim", "-quality", "60", "-loop", "0", "-f", "webp"],
}


@dataclass(frozen=True, eq=False)
class Shot:
    """One movement to film: the ``goal`` ``(outcome_dim,)`` that it is for, a ``title``, the ``unit`` of T, ``past``
    outcomes ``(n, outcome_dim)``, and a picture to stand ``beside`` it."""

    recording: Trace
    goal: Array
    title: str = ""
    unit: str = ""
    past: Array = field(default_factory=lambda: np.empty((0, 2)))
    beside: Frame | None = None

    @property
    def missed(self) -> float:
        """Distance between goal and outcome, in the unit of T."""
        return float(np.linalg.norm(self.recording.outcome - self.goal))

    def moments(self, rate: float) -> list[float]:
        """At which times (s) of the movement it is shown, ``rate`` of them a second."""
        return list(np.arange(0.0, self.recording.landed + PAUSE, 1 / rate).tolist())

    def caption(self, time: float) -> str:
        """The text below the picture at ``time`` (s)."""
        goal = f"goal {_place(self.goal)}"
        if time >= self.recording.landed:
            return f"{goal}, reached {_place(self.recording.outcome)}: missed by {self.missed:.2g} {self.unit}".rstrip()
        let_out = getattr(self.recording, "let_out", None)  # of the rod
        return f"{goal}   {time:.2f} s{'   line let out' if let_out is not None and time > let_out else ''}"


Draw = Callable[[Shot, float], Image.Image]
"""(shot, time) -> the scene at ``time`` (s); from its end on, how it ended."""


def shoot(draw: Draw, shots: Iterable[Shot], rate: float = RATES[".mp4"]) -> Iterator[Frame]:
    """The frames of a film: of each shot the movement, and its end for a moment."""
    for shot in shots:
        for time in shot.moments(rate):
            frame = captioned(draw(shot, time), shot.title, shot.caption(time))
            yield frame if shot.beside is None else np.concatenate([frame, shot.beside], axis=1)


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


def write_film(path: Path, frames: Iterable[Frame]) -> None:
    """A film, which appears whole or not at all: H.264 in an mp4 file, or a moving picture for a page.

    Args:
        path: its ending is one of ``RATES``, which says how fast it plays.
        frames: one or more, all of one size, even in height and width.

    Raises:
        OSError: ``path`` cannot be written, or the encoder fails.
    """
    frames, kind = iter(frames), path.suffix
    with replacing(path) as partial:
        partial.touch()  # fails before the first frame is drawn if the folder is not writable
        first = next(frames)
        size = f"{first.shape[1]}x{first.shape[0]}"
        given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(RATES[kind]), "-i", "-"]
        command = [get_ffmpeg_exe(), "-v", "error", *given, *_CODECS[kind], "-y", str(partial)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
            assert encoder.stdin is not None
            with suppress(BrokenPipeError):  # it failed, and its error output says why
                for frame in chain([first], frames):
                    encoder.stdin.write(frame.tobytes())
            _, said = encoder.communicate()
        if encoder.returncode:
            raise OSError(f"the film was not encoded: {said.decode(errors='replace').strip()}")


def _place(point: Array) -> str:
    return f"({', '.join(f'{x:.2f}' for x in point)})"
