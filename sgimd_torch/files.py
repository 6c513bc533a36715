"""Files on disk: written whole or not at all, locked by one process at a time, refused by name when they are broken.

Everything that replaces a file or takes a lock goes through here.
    write_json(folder / "summary.json", {"movements": 90})
    with replacing(folder / "film.mp4") as partial: encode(frames, partial)
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

Stored = NDArray[Any]

UNPACKED: Final = 64 * 2**20
"""Bytes that any npz file may unpack to."""

_UNREADABLE: Final = (
    *(ValueError, TypeError, KeyError, OverflowError, OSError, EOFError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
_NPY: Final = re.compile(
    rb"\x93NUMPY\x01\x00(?P<size>..)\{'descr': '(?P<dtype>[<>|][biufcU][0-9]{1,9})', "
    rb"'fortran_order': (?P<fortran>True|False), 'shape': \((?P<shape>[0-9, ]{0,200})\), \} *\n",
    re.DOTALL,
)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A file next to ``path``, to be written in the block; it replaces ``path`` when the block ends.

    ``path`` holds the old file or the whole new one, also after a power cut; after an error nothing else is left.

    Raises:
        OSError: ``path`` is a directory, or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a directory; was the name of the file left out?")
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        yield partial
        with open(partial, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Replace ``path``, see ``replacing``."""
    with replacing(path) as partial:
        partial.write_bytes(content)


def write_text(path: str | os.PathLike[str], content: str) -> None:
    """Replace ``path`` by text in UTF-8, line ends as they are; see ``replacing``."""
    write_bytes(path, content.encode())


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Replace ``path`` by a json object, see ``replacing``; NaN becomes null, since json has none."""
    finite = {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in content.items()}
    write_text(path, json.dumps(finite, indent=2, allow_nan=False) + "\n")


def write_npz(path: str | os.PathLike[str], arrays: dict[str, Any], *, compressed: bool = False) -> None:
    """Replace ``path`` by an npz file without pickle, which holds ``arrays`` by name; see ``replacing``."""
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_npz(path: str | os.PathLike[str], kind: str, writer: str, version: int, names: Sequence[str]) -> list[Stored]:
    """The arrays called ``names``, read-only, of a file that also holds its ``version``; nothing in it is executed.

    It may unpack to 64 MiB, or to eight times its own size where that is more. The sizes that it states are checked
    before memory is taken, and every checksum before a number is used.

    Args:
        path: of the file.
        kind, writer: what the file should be and what writes it, for errors.
        version: the one that is read.
        names: of the arrays.

    Raises:
        ValueError: not an npz file, truncated or corrupt, larger than allowed, of another version, without one of the
            arrays, or with one that does not hold numbers or text.
        OSError: there is no file, it is a directory, or it may not be read.
    """
    slip = f"was it written by {writer}, and whole?"
    with open(path, "rb") as file:
        try:
            found = _members(file, ("version", *names)) if zipfile.is_zipfile(file) else None
        except _UNREADABLE as error:
            why = f"it is damaged, or holds more than numbers ({str(error)[:100]})"
            raise ValueError(f"{path} is no {kind}: {why}; {slip}") from error
    if found is None:
        raise ValueError(f"{path} is no {kind}: it is not an npz file; {slip}")
    missing = sorted({"version", *names} - set(found))
    if missing:
        raise ValueError(f"{path} is no {kind}: it lacks {', '.join(missing)}; {slip}")
    stated = found["version"]
    if stated.shape != () or stated != version:
        raise ValueError(
            f"{path} has version {str(stated)[:40]}, this library reads {version}; was it saved by a newer one?"
        )
    return [found[name] for name in names]


def _members(file: BinaryIO, names: Sequence[str]) -> dict[str, Stored]:
    """The arrays called ``names``, as far as an npz file holds them."""
    size = os.fstat(file.fileno()).st_size
    with zipfile.ZipFile(file) as archive:
        inside = archive.namelist()
        if len(set(inside)) < len(inside):
            raise ValueError("two arrays have the same name")
        members = {name: archive.getinfo(f"{name}.npy") for name in names if f"{name}.npy" in inside}
        unpacked, most = sum(member.file_size for member in members.values()), max(UNPACKED, 8 * size)
        if unpacked > most:
            raise ValueError(f"its {size} bytes unpack to {unpacked}, at most {most} are read")
        if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members.values()):
            raise ValueError("packed in a way that numpy does not write")  # Python unpacks it without a limit
        return {name: _array(_content(archive, member)) for name, member in members.items()}


def _content(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    with archive.open(member) as stream:
        content = stream.read(member.file_size)  # compares the checksum when it has read the last byte
    if len(content) != member.file_size:
        raise ValueError(f"{member.filename} is cut short")
    return content


def _array(content: bytes) -> Stored:
    """The array of an npy file: its header as numpy writes it, then exactly as many bytes as the header says."""
    header = _NPY.match(content)
    if header is None:
        raise ValueError("an array holds neither numbers nor text")
    dtype, start = np.dtype(header["dtype"].decode()), 10 + int.from_bytes(header["size"], "little")
    shape = tuple(int(n) for n in header["shape"].split(b",") if n.strip())
    if header.end() != start or len(content) - start != math.prod(shape) * dtype.itemsize:
        raise ValueError(f"an array of shape {shape} does not fit its {len(content)} bytes")
    values = np.frombuffer(content, dtype, offset=start) if len(content) > start else np.empty(0, dtype)
    array: Stored = values.reshape(shape, order="F" if header["fortran"] == b"True" else "C")
    array.flags.writeable = False
    return array


def checksum(path: Path) -> str:
    """Of the content of a file, in hexadecimal."""
    return f"{zlib.crc32(path.read_bytes()):08x}"


def make_folder(path: Path) -> None:
    """Make a folder, and its parents if they are missing.

    Raises:
        OSError: something is in the way, or it may not be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        inside = (place for place in (path, *path.parents) if os.path.lexists(place) and not place.is_dir())
        blocker = next(inside, None)
        why = f"{blocker} is no folder" if blocker else f"{error.strerror}"
        raise OSError(f"{path} cannot be made: {why}; choose another --out") from error


def lock(path: str | os.PathLike[str]) -> int:
    """Open ``path``, which is made where it is missing, and lock it without waiting.

    Returns:
        The descriptor; the lock is held until it is closed, or the process ends.

    Raises:
        BlockingIOError: another process holds the lock.
        OSError: ``path`` cannot be opened, or this system has no such locks.
    """
    try:
        import fcntl  # Windows has none
    except ImportError as error:
        raise OSError(f"{path} cannot be locked: this system has no flock; runs need Linux or macOS") from error
    file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(file)
        raise
    return file


def locked(path: str | os.PathLike[str]) -> bool:
    """Whether a process holds the ``lock`` of ``path``; False if there is no such file."""
    try:
        import fcntl  # Windows has none, so nobody holds it

        file = os.open(path, os.O_RDONLY)
    except (FileNotFoundError, NotADirectoryError, ImportError):
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # shared, so that two callers do not block each other
    except BlockingIOError:
        return True
    finally:
        os.close(file)
    return False
