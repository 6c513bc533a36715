"""Functions that write a file whole or not at all, and functions that refuse to read a damaged file.

All modules of the library replace files by these functions.
    write_text(folder / "report.html", page)
    with replacing(folder / "film.mp4") as partial: encode(frames, partial)
"""

from __future__ import annotations

import csv
import io
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Stored = NDArray[Any]

_RECORD: Final = b"SQLite format 3", b"7\x7f\x06"  # beginnings of a record and of its write-ahead log


def check_regular(path: str | os.PathLike[str]) -> None:
    """Refuse a named pipe or a device, which might keep its reader waiting for ever.

    Raises:
        OSError: ``path`` is neither a file nor a folder.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(f"{path} is a pipe or a device, not a file")


@contextmanager
def replacing(path: str | os.PathLike[str], *, record: bool = False) -> Iterator[Path]:
    """Path of a temporary file next to ``path``. The block writes this file, which replaces ``path`` at the end.

    Even after a power cut, ``path`` holds the old file or the whole new one. An error removes the temporary file. A
    link stays, and the file to which it leads is replaced.

    Args:
        path: file to write.
        record: whether the file may replace a record.

    Raises:
        OSError: ``path`` is a directory, a pipe, a device or a record, or cannot be written.
    """
    target, partial = _places(path, record)
    try:
        yield partial
        with open(partial, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Refuse a file that ``replacing`` could not write, before the work for its content begins.

    Raises:
        OSError: see ``replacing``.
    """
    _, partial = _places(path)
    partial.touch()
    partial.unlink()


def is_record(path: Path) -> bool:
    """Whether a file is an SQLite file or the write-ahead log of one, as the record of a run is."""
    with path.open("rb") as file:
        return file.read(16).startswith(_RECORD)


def _places(path: str | os.PathLike[str], record: bool = False) -> tuple[Path, Path]:
    """The file that ``path`` is or to which it leads, and the temporary file next to it."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(f"{path} is a directory; was the name of the file left out?")
    if os.path.exists(path):
        check_regular(path)
        if not record and is_record(target):
            raise OSError(f"{path} is the record of a run, which no other output replaces; choose another file")
    return target, target.with_name(f"{target.name}.{os.getpid()}.part")


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Replace ``path`` by ``content``, see ``replacing``."""
    with replacing(path) as partial:
        partial.write_bytes(content)


def write_text(path: str | os.PathLike[str], content: str) -> None:
    """Replace ``path`` by text in UTF-8, line ends unchanged; see ``replacing``."""
    write_bytes(path, content.encode())


def write_npz(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Replace ``path`` by a compressed npz file of named ``arrays``; see ``replacing``."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_npz(path: str | os.PathLike[str], kind: str, writer: str, names: Sequence[str]) -> list[Stored]:
    """Read the arrays with these ``names``, as read-only arrays. Code in the file is never executed.

    Args:
        path: npz file.
        kind: kind of the file, for error messages.
        writer: command that writes such files, for error messages.
        names: names of the arrays.

    Raises:
        ValueError: the file is not an npz file, is damaged, lacks an array, or holds an array of objects.
        OSError: there is no file, ``path`` is a directory, or the file may not be read.
    """

    def refused(why: str) -> ValueError:
        return ValueError(f"{path} is no {kind}: {why}; was it written by {writer}, and whole?")

    check_regular(path)
    with open(path, "rb") as file:
        if not zipfile.is_zipfile(file):
            raise refused("it is not an npz file")
        file.seek(0)
        try:
            stored = np.load(file, allow_pickle=False)
            arrays: dict[str, Stored] = {name: stored[name] for name in names if name in stored}
            if not all(isinstance(array, np.ndarray) for array in arrays.values()):
                raise ValueError
        except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise refused("it is damaged, or holds more than numbers") from error
    for array in arrays.values():
        array.flags.writeable = False
    if missing := [name for name in names if name not in arrays]:
        raise refused(f"it lacks {', '.join(missing)}")
    return [arrays[name] for name in names]


def checksum(path: Path) -> str:
    """CRC-32 of the content of a file, in hexadecimal."""
    check_regular(path)
    return f"{zlib.crc32(path.read_bytes()):08x}"


def make_folder(path: Path) -> None:
    """Make a folder and its missing parents.

    Raises:
        OSError: there is a file at ``path``, or the folder may not be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(
            f"{path} cannot be made: {error.strerror}; is a file in its place? Choose another --out"
        ) from error


def read_csv(path: Path) -> list[tuple[int, list[str]]]:
    """The rows of a table with commas that have any field, each with the number of its line, from 1; a BOM is no text.

    Raises:
        ValueError: the file is no such table.
        OSError: there is no file, or it is a pipe or a device.
    """
    check_regular(path)
    with path.open(encoding="utf-8-sig", newline="") as file:
        try:
            return [(rows.line_num, row) for rows in [csv.reader(file)] for row in rows if row]
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(f"{path} is no csv file: {error}") from error
