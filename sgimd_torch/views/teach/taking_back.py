"""Taking back the last lesson: the run directory goes back to the state before it; what is taken back is kept.

take_back(directory, lesson)    # runs/taught/seed-003/taken-back-0 has all as it was
"""

from __future__ import annotations

import os
import shutil
from itertools import count
from pathlib import Path
from typing import Final

from sgimd_torch.files import write_bytes, write_json
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.teachers.by_hand import FOLDER, GivenLesson, lesson_path

KEPT: Final = "taken-back-"  # and a number: a copy of the run directory as it was


def take_back(directory: RunDirectory, lesson: GivenLesson) -> Path:
    """Let a run end before a lesson; the copy of what was there.

    Killed on the way, the run is as before, or it goes on with that lesson once more.

    Args:
        directory: of the run, which nobody writes in now.
        lesson: the last one.

    Raises:
        OSError: it cannot be written.
    """
    path, log = directory.path, directory.log
    copy = next(place for n in count() if not os.path.lexists(place := path / f"{KEPT}{n}"))
    partial = copy.with_name(f"{copy.name}.part")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(path, partial, ignore=shutil.ignore_patterns("lock", f"{KEPT}*"))
    os.replace(partial, copy)
    write_json(path / "summary.json", {**directory.summary, "movements": lesson.index, "finished": False})
    write_bytes(log.path, log.header + b"".join(log.read().lines[: lesson.index]))
    lesson_path(path / FOLDER, lesson).unlink()
    return copy
