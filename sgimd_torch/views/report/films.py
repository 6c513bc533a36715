"""Films in a report: those that scripts/film has left beside a run, kept in the page whole, with a still of each.

films = find_films(life.path); show(films, room)
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path
from typing import Final, NamedTuple

from sgimd_torch.runs.log import RunError

MOST: Final = 3 * 2**20  # bytes of one film
ROOM: Final = 5 * 2**20  # bytes of all films of a page


class Film(NamedTuple):
    """An mp4 and a jpeg of its last scene, b"" where nothing can decode it."""

    path: Path
    data: bytes
    poster: bytes


def find_films(run: Path) -> list[Path]:
    """Of a run directory: what lies in it, and beside it under its name, as scripts/film writes it."""
    run = run.resolve()
    beside = [run.parent / f"{run.name}{kind}.mp4" for kind in ("", "-time-lapse")]
    return [path for path in (*beside, *sorted(run.glob("*.mp4"))) if path.is_file()]


def read_film(path: Path) -> Film:
    """A film with its still.

    Raises:
        OSError: it cannot be read.
    """
    return Film(path, path.read_bytes(), _still(path))


def command(run: Path) -> str:
    """What films a run."""
    return shlex.join(["scripts/film", str(run)])


def make_film(run: Path) -> None:
    """Film a run as scripts/film does, into an mp4 beside its directory.

    Raises:
        RunError: that failed; why is on stderr.
    """
    script = "sgimd_torch.views.film.command"
    with subprocess.Popen([sys.executable, "-m", script, "--", str(run)], stdout=subprocess.DEVNULL) as filming:
        try:
            code = filming.wait()
        except KeyboardInterrupt:
            filming.terminate()  # it takes its unfinished film away; leaving the block waits for that
            raise
    if code == 130:
        raise KeyboardInterrupt
    if code:
        raise RunError(f"{run} could not be filmed, see above; leave out --film")


def _still(path: Path) -> bytes:
    """The picture half a second before the end, where a landing is shown."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:  # the extra "film" is not installed; a browser then shows the first picture
        return b""
    options = ["-sseof", "-0.5", "-i", str(path), "-frames:v", "1", "-q:v", "5", "-f", "mjpeg", "-"]
    ended = subprocess.run([get_ffmpeg_exe(), "-v", "error", *options], capture_output=True)
    return ended.stdout if ended.returncode == 0 else b""
