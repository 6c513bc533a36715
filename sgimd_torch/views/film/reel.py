"""What every film is made of: shots one after the other, frame by frame, captions, a file.

``camera.py`` draws frames of the rod in MuJoCo, ``sketch.py`` those of robots in the plane, ``panel.py`` what stands
beside them.
    write_film(Path("film.mp4"), shoot(camera.frame, [Shot(recording, goal)]))

Needs the extra ``film``.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from threading import Timer
from typing import Final

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

WIDTH: Final = 640  # pixels, of the robot's picture
HEIGHT: Final = 480
PATIENCE: Final = 60.0  # s, for ffmpeg to end once it has all frames
PAUSE: Final = 0.8  # s, the landing is shown
POUR: Final = 0.6  # s, in which the landings since the last shot appear
RATES: Final = {".mp4": 25.0, ".webp": 12.5}
"""Frames a second of each kind of film: every player opens the first, every browser shows the second in a page."""

_CODECS: Final = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", "-f", "mp4"],
    ".webp": ["-c:v", "libwebp_anim", "-quality", "60", "-loop", "0", "-f", "webp"],
}


@dataclass(frozen=True, eq=False)
class Shot:
    """One movement to film: the ``goal`` ``(outcome_dim,)`` that it is for, a ``title``, the ``unit`` of T, ``past``
    outcomes ``(n, outcome_dim)``, the last ``new`` of them since the shot before, and pictures to stand ``beside`` it,
    before and after the landing."""

    recording: Recorded
    goal: Array
    title: str = ""
    unit: str = ""
    past: Array = field(default_factory=lambda: np.empty((0, 2)))
    new: int = 0
    beside: tuple[Frame, Frame] | None = None

    @property
    def missed(self) -> float:
        """Distance between goal and outcome, in the unit of T."""
        return float(np.linalg.norm(self.recording.outcome - self.goal))

    def moments(self, rate: float) -> list[tuple[Shot, float]]:
        """What is shown, frame by frame, ``rate`` of them a second, and at which time (s) of the movement."""
        counts = np.linspace(len(self.past) - self.new, len(self.past), round(POUR * rate) + 1).round().astype(int)
        pouring = [
            (replace(self, past=self.past[:count], title=f"learning: {count} landings"), 0.0)
            for count in (counts[1:] if self.new else ())
        ]
        times = np.arange(0.0, self.recording.landed + PAUSE, 1 / rate).tolist()
        return pouring + [(self, time) for time in times]

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
    """The frames of a film: of each shot the landings since the last one, the movement, its end for a moment."""
    for shot in shots:
        for part, time in shot.moments(rate):
            frame = captioned(draw(part, time), part.title, part.caption(time))
            beside = shot.beside[time >= shot.recording.landed] if shot.beside else frame[:, :0]
            yield np.concatenate([frame, beside], axis=1)


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
        # In a session of its own, so that Ctrl-C reaches only the process that draws the frames.
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        ) as encoder:
            assert encoder.stdin is not None
            try:
                with suppress(BrokenPipeError):  # it failed, and its error output says why
                    for frame in chain([first], frames):
                        with _at_most(PATIENCE, encoder):
                            encoder.stdin.write(frame.tobytes())
                with _at_most(PATIENCE, encoder):
                    _, said = encoder.communicate()
            except BaseException:
                encoder.kill()
                raise
        if encoder.returncode:
            silent = f"ffmpeg ended with {encoder.returncode}, or did nothing for {PATIENCE:g} s"
            raise OSError(f"the film was not encoded: {said.decode(errors='replace').strip() or silent}")


@contextmanager
def _at_most(seconds: float, process: subprocess.Popen[bytes]) -> Iterator[None]:
    """Kill a process that keeps this block waiting for so long."""
    timer = Timer(seconds, process.kill)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _place(point: Array) -> str:
    return f"({', '.join(f'{x:.2f}' for x in point)})"
