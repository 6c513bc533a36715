"""The tables of a run: csv files whose lines end in a checksum, each read up to its first damaged line.

One line codec for all: the log, which grows, and the small tables; those of evaluations are replaced whole.
    table = Table(folder / "evaluation.csv", EVALUATION); table.replace(rows); table.read().rows
``log.py`` says what is in each.
"""

from __future__ import annotations

import math
import os
import re
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.files import write_bytes
from sgimd_torch.runs.config import OWN
from sgimd_torch.spaces import Array

SMALL: Final = ("evaluation.csv", "by_context.csv", "regions.csv", "requests.csv", "predictions.csv", "refreshes.csv")
_WORDS: Final = ("path", "answer", "teacher", "strategy", "reply")
EVALUATION: Final = (
    *("movements", "answer", "mean_error_m", "median_error_m", "p90_error_m", "noise_floor_m", "goals_met"),
)
BY_CONTEXT: Final = ("movements", "answer", "context", "low", "high", "goals", "mean_error_m")
_LATER: Final = {"answer": OWN, "goals_met": "nan"}  # columns that earlier versions lacked, and what they mean there
REFRESHES: Final = ("movements", "exemplars", "steps", "held_out", "relative_error", "diverged")
Rows = list[list[str]]
WHOLE: Final = (
    "movements",
    "attempts",
    "goals",
    "exemplar",
    "exemplars",
    "steps",
    "diverged",
    "context",
    "index",
    "shown",
)
_CELL: Final = r"R(\.[0-9]{1,6})+"  # the path of a cell of a grid
_PART_OF_A_HEADER: Final = re.compile(rb"[a-z0-9_,]*")
_MAY_BE_NAN: Final = ("noise_floor_m", "goals_met", "competence")  # not measured; no goals


@dataclass(frozen=True)
class Found:
    """What the file of a table held, up to its first bad line.

    ``lines``, without the header, as they are in the file; ``size`` (bytes) of header and lines; ``tail``, what comes
    after them; ``checked``: the lines have checksums, those of earlier versions have none; ``grows``: it is written
    line by line; ``later``: place -> value of each column that an earlier version lacked.
    """

    lines: list[bytes]
    size: int
    tail: bytes
    checked: bool
    grows: bool
    later: dict[int, str] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        """The fields of each line, its checksum left out."""
        return [self.fields(line) for line in self.lines]

    def fields(self, line: bytes) -> list[str]:
        """Of one of the lines."""
        row = line.decode().rstrip("\n").split(",")[: -1 if self.checked else None]
        for place, value in self.later.items():
            row.insert(place, value)
        return row

    @property
    def bad(self) -> int | None:
        """Number of the first bad line, the header being line 1; None if there is none."""
        return (len(self.lines) + 2 if self.size else 1) if self.tail else None

    @property
    def damage(self) -> int | None:
        """The same, but None if only the end of the last line of a file that grows is missing: its writer was killed
        there, or is still writing. A file that is replaced whole is never empty."""
        if not self.size and not self.grows:
            return 1
        cut = self.grows and b"\n" not in self.tail and (self.size > 0 or _PART_OF_A_HEADER.fullmatch(self.tail))
        return None if cut else self.bad

    def first(self, n: int) -> Found:
        """Its first ``n`` lines; the next one counts as bad."""
        rest = b"".join(self.lines[n:])
        return replace(self, lines=self.lines[:n], size=self.size - len(rest), tail=rest + self.tail)


class Table:
    """A csv file of a run: the names of its columns, then lines that each end in the checksum of their fields.

    Args:
        path: of the file; nothing is written before ``begin`` or ``replace``.
        names: of the columns, without crc32.
        grows: it is written line by line, rather than replaced whole.
        standing: (rows) -> how many of them, from the first on, make sense together; None: all of them.
    """

    def __init__(
        self,
        path: Path,
        names: Sequence[str],
        *,
        grows: bool = False,
        standing: Callable[[Iterable[list[str]]], int] | None = None,
    ) -> None:
        self.path, self.names, self._grows, self._standing = path, tuple(names), grows, standing
        self.header = _header(names)
        self._pending = bytearray()
        self._begun = False

    def read(self) -> Found:
        """What the file holds; nothing if there is none.

        Raises:
            OSError: it cannot be read.
        """
        return self.parse(self.path.read_bytes() if os.path.lexists(self.path) else b"")

    def parse(self, content: bytes) -> Found:
        """The same, from the content of a file."""
        header, *lines = content.splitlines(keepends=True) or [b""]
        for later in ({}, _LATER):  # today's columns, then those of earlier versions
            names = [name for name in self.names if name not in later]
            checked = header != ",".join(names).encode() + b"\n"
            if not checked or header == _header(names):
                break
        else:
            return Found([], 0, content, checked, self._grows)
        is_good = _is_sealed if checked else partial(_is_possible, names)
        n = next((k for k, line in enumerate(lines) if not is_good(line)), len(lines))
        places = {place: later[name] for place, name in enumerate(self.names) if name in later}
        found = Found(lines, len(content), b"", checked, self._grows, places).first(n)
        # One row at a time: all rows of a long log would take ten times its size.
        return found if self._standing is None else found.first(self._standing(map(found.fields, found.lines)))

    def notes(self, found: Found, outlook: str) -> list[str]:
        """Messages: what was bad, with the ``outlook``: what happens now; and whether checksums were missing."""
        notes = []
        if found.tail:
            dropped = f"{len(found.tail)} bytes in {len(found.tail.splitlines())} line(s)"
            notes.append(f"{self.path}: dropped {dropped} from line {found.bad} on, torn or damaged; {outlook}")
        if not found.checked:
            notes.append(f"{self.path} was made without checksums: its numbers are not checked, and get checksums now")
        return notes

    def arrays(self, found: Found) -> dict[str, np.ndarray]:
        """The columns of a small table: integers, words such as the paths of regions, or numbers."""
        rows = np.array(found.rows, dtype=np.str_).reshape(len(found.lines), len(self.names))
        kinds = {**dict.fromkeys(_WORDS, np.str_), **dict.fromkeys(WHOLE, np.int64)}
        return {name: rows[:, k].astype(kinds.get(name, np.float64)) for k, name in enumerate(self.names)}

    def begin(self, size: int = 0) -> None:
        """Keep the first ``size`` bytes of the file; what is appended comes after them."""
        with self.path.open("ab") as file:
            file.truncate(size)
        if not size:
            self._pending[:0] = self.header
        self._begun = True

    def append(self, line: bytes) -> None:
        """One more line, see ``sealed``, for the next ``flush``."""
        self._pending += line

    def flush(self, *, sync: bool = False) -> None:
        """Once begun, hand all lines to the operating system, so that a killed process loses none; or to the disk."""
        if not self._begun:
            return
        file = os.open(self.path, os.O_WRONLY | os.O_APPEND)
        try:
            while self._pending:
                del self._pending[: os.write(file, self._pending)]
            if sync:
                os.fsync(file)
        finally:
            os.close(file)

    def replace(self, rows: Iterable[Sequence[str]]) -> None:
        """Replace the whole table."""
        write_bytes(self.path, self.header + b"".join(map(sealed, rows)))


def sealed(fields: Sequence[str]) -> bytes:
    """A line: the fields and their checksum.

    Raises:
        ValueError: a field that would be read back as something else, such as a name with a comma.
    """
    body = ",".join(fields)
    if body.count(",") != len(fields) - 1 or not body.isprintable():
        raise ValueError(f"fields of a table must be printable and without commas, got {body[:80]!r}")
    return body.encode() + b",%08x\n" % zlib.crc32(body.encode())


def numbers(values: Array | None, dim: int) -> list[str]:
    """Fields that read back exactly; ``dim`` empty ones for None."""
    return [""] * dim if values is None else [repr(value) for value in values.tolist()]


def small_table(path: Path, dims: int | None = None) -> Table:
    """One of the small tables, by the name of its file.

    Args:
        path: of one of ``SMALL``.
        dims: of C x T for regions and requests, of outcomes for predictions; None for those that the file names.
    """
    if dims is None:
        with path.open("rb") as file:
            header = file.readline()
        dims = sum(header.count(name) for name in (b"low_", b"predicted_", b"wanted_"))
    match path.name:
        case "evaluation.csv":
            return Table(path, EVALUATION)
        case "by_context.csv":
            return Table(path, BY_CONTEXT)
        case "regions.csv":
            corners = (f"{corner}_{k}" for corner in ("low", "high") for k in range(dims))
            names = ("movements", "path", *corners, "attempts", "goals", "competence", "interest")
            return Table(path, names, standing=_whole_maps)
        case "requests.csv":
            points = (f"{part}_{k}" for part in ("wanted", "got") for k in range(dims))
            return Table(path, ("index", "teacher", "strategy", "reply", "shown", *points, "apart_m", "brought"))
        case "predictions.csv":
            parts = ("outcome", "predicted", "epistemic", "aleatoric")
            return Table(path, ("exemplar", *(f"{part}_{k}" for part in parts for k in range(dims))), grows=True)
        case _:
            return Table(path, REFRESHES, grows=True)


def _whole_maps(rows: Iterable[list[str]]) -> int:
    """How many rows of regions.csv belong to evaluations that have all their regions."""
    n = 0
    for _, regions in groupby(rows, key=lambda row: row[0]):
        paths = [row[1] for row in regions]
        if not _tile(paths):
            break
        n += len(paths)
    return n


def _tile(paths: list[str]) -> bool:
    """Whether nothing was cut off: these are all leaves of a tree, or all cells of a grid. Other names say nothing."""
    if all(re.fullmatch("R[01]*", path) for path in paths):
        return sum(0.5 ** (len(path) - 1) for path in paths) == 1  # each cut halves the weight of its leaves
    if all(re.fullmatch(_CELL, path) for path in paths):
        cells = np.array([path.split(".")[1:] for path in paths], dtype=np.int64)
        return len(cells) == np.prod(cells.max(axis=0) + 1)
    return True


def _header(names: Sequence[str]) -> bytes:
    return ",".join((*names, "crc32")).encode() + b"\n"


def _is_possible(names: Sequence[str], line: bytes) -> bool:
    fields = line.decode(errors="replace").removesuffix("\n").split(",")
    return line.endswith(b"\n") and len(fields) == len(names) and all(map(_can_be, names, fields))


def _is_sealed(line: bytes) -> bool:
    body, _, checksum = line.rpartition(b",")
    return checksum == b"%08x\n" % zlib.crc32(body)


def _can_be(name: str, field: str) -> bool:
    """Whether a column can hold this, judged by its name: for lines that have no checksum."""
    if name == "path":
        return re.fullmatch(f"R[01]*|{_CELL}", field) is not None
    if name == "answer":
        return field != ""
    if name in WHOLE:
        return re.fullmatch("0|[1-9][0-9]{0,17}", field) is not None
    try:
        value = float(field)
    except ValueError:
        return False
    if math.isnan(value):
        return name in _MAY_BE_NAN
    if name == "competence":
        return -1 <= value <= 0
    is_length = name.endswith("_m") or name.startswith(("epistemic", "aleatoric"))
    return math.isfinite(value) and (value >= 0 or not is_length)
