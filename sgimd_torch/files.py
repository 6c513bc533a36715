"""Arrays on disk: one ``.npz`` file without pickle, written whole or not at all, and refused by name when broken."""

from __future__ import annotations

import io
import os
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_UNREADABLE = (ValueError, TypeError, KeyError, OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


def write_npz(path: str | os.PathLike[str], arrays: dict[str, Any], *, compressed: bool = False) -> None:
    """Write ``arrays`` by name; ``path`` holds the old file or the whole new one, and nothing else is left behind.

    Raises:
        OSError: ``path`` is a directory, or cannot be written.
    """
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write ``content``; ``path`` holds the old file or the whole new one, and nothing else is left behind.

    Raises:
        OSError: ``path`` is a directory, or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a directory; was the name of the file left out?")
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with open(partial, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def read_npz(path: str | os.PathLike[str], kind: str, writer: str, names: Sequence[str]) -> list[NDArray[Any]]:
    """The arrays called ``names``; ``kind`` and ``writer`` say in errors what the file should be and what writes it.

    Raises:
        ValueError: not an npz file, truncated or corrupt, without one of the arrays, or with one that needs pickle.
        OSError: there is no file, it is a directory, or it may not be read.
    """
    slip = f"was it written by {writer}, and whole?"
    with open(path, "rb") as file:
        if not zipfile.is_zipfile(file):
            raise ValueError(f"{path} is no {kind}: it is not an npz file; {slip}")
        file.seek(0)
        try:
            with np.load(file, allow_pickle=False) as archive:
                missing = sorted(set(names) - set(archive.files))
                arrays = [] if missing else [np.asarray(archive[name]) for name in names]
        except _UNREADABLE as error:
            raise ValueError(f"{path} is no {kind}: it is damaged, or holds more than numbers; {slip}") from error
    if missing:
        raise ValueError(f"{path} is no {kind}: it lacks {', '.join(missing)}; {slip}")
    return arrays
