"""Recordings from tables: each row is a sample of a recording, and the user names the columns.

    columns = Columns(joints=("shoulder", "elbow"), outcome=("x", "y"))
    shown = read_csv("recordings", columns)              # a folder with a file for each recording, or one long table
    save_demonstrations("shown.npz", shown)
A column may hold vectors, as in LeRobot: ``observation.state`` is the whole vector, ``observation.state[0:6]`` and
``observation.state[2]`` are some of its entries.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.spaces import Array, Demonstration, check_vector

_NAME: Final = re.compile(r"(?P<name>[^\[\]]+)(\[(?P<first>\d+)(?P<slice>:(?P<end>\d+)?)?\])?")


@dataclass(frozen=True)
class Columns:
    """Names of the columns of a table.

    Args:
        joints: columns of joint angles (rad) or of motor commands, in the order of the robot's correspondence.
        outcome: columns of the outcome, read in the last row of a recording.
        context: columns of the context, read in the first row of a recording; () for a robot without contexts.
        time: column of the time (s); the first time of a recording counts as 0.
        recording: column with the number or name of the recording of each row; None: a table is one recording.
        degrees: whether joint angles in the table are in degrees; they are converted to rad.
    """

    joints: tuple[str, ...]
    outcome: tuple[str, ...]
    context: tuple[str, ...] = ()
    time: str = "time"
    recording: str | None = None
    degrees: bool = False

    def __post_init__(self) -> None:
        if not self.joints or not self.outcome:
            raise ValueError("name at least one column for joints and one for outcome")
        for name in self.names:
            if _NAME.fullmatch(name) is None:
                raise ValueError(f"{name!r} does not name a column; write, for example, state, state[2] or state[0:6]")

    @property
    def names(self) -> tuple[str, ...]:
        """All columns as the user wrote them, with entries in brackets."""
        grouped = () if self.recording is None else (self.recording,)
        return (*self.joints, *self.outcome, *self.context, self.time, *grouped)

    @property
    def plain(self) -> list[str]:
        """All columns, each once, without entries in brackets."""
        return list(dict.fromkeys(name.partition("[")[0] for name in self.names))


def read_csv(path: str | os.PathLike[str], columns: Columns) -> list[Demonstration]:
    """Read recordings from a CSV file, or from all CSV files of a folder in the order of their names.

    The first line of a file names its columns. A file is one recording unless ``columns.recording`` divides it.

    Raises:
        ValueError: a column is missing, a field is not a number, or `recordings` refuses the rows; the message names
            the file, and the row or recording.
        OSError: there is no file.
    """
    path = Path(path)
    files = sorted(path.glob("*.csv")) if path.is_dir() else [path]
    if not files:
        raise ValueError(f"{path} holds no .csv file")
    return [each for file in files for each in recordings(str(file), _table(file, columns.plain), columns)]


def recordings(source: str, table: Mapping[str, np.ndarray], columns: Columns) -> list[Demonstration]:
    """The recordings of one table.

    Args:
        source: name of the table in error messages.
        table: ``(n_rows,)`` values or ``(n_rows, k)`` vectors for each name in ``columns.plain``.
        columns: meaning of the columns.

    Raises:
        ValueError: a vector lacks an entry, or a recording has fewer than two samples, rows that are not adjacent, or
            times that do not increase.
    """
    times = _values(source, table, (columns.time,))
    if times.shape[1] != 1:
        raise ValueError(f"{source}: {columns.time} must be one number for each row, got {times.shape[1]}")
    joints = _values(source, table, columns.joints)
    joints = np.deg2rad(joints) if columns.degrees else joints
    outcomes, contexts = _values(source, table, columns.outcome), _values(source, table, columns.context)
    found: list[Demonstration] = []
    for what, rows in _groups(source, table, columns.recording, len(times)):
        since = times[rows, 0] - times[rows.start, 0]
        if len(since) < 2:
            raise ValueError(f"{what} has 1 sample, but needs 2 or more; does {columns.recording} number the rows?")
        if not (np.diff(since) > 0).all():
            raise ValueError(f"{what}: {columns.time} must increase from row to row; were the rows shuffled?")
        found.append(Demonstration(contexts[rows.start], since, joints[rows], outcomes[rows.stop - 1]))
    return found


def _table(file: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of a CSV file, as arrays of text."""
    with open(file, encoding="utf-8-sig", errors="replace", newline="") as text:
        lines = text.readlines()
    if any("\0" in line for line in lines):
        raise ValueError(f"{file} has a NUL, so it is no text in UTF-8; was it saved as UTF-16, or cut off by a crash?")
    heads, *rows = [[field.strip() for field in row] for row in csv.reader(lines) if row] or [[]]
    missing = [name for name in names if name not in heads]
    if missing:
        raise ValueError(f"{file} has no column {', '.join(missing)}; it has {', '.join(heads[:20])}")
    if not rows:
        raise ValueError(f"{file} has no rows below the names of its columns")
    for number, row in enumerate(rows, 1):
        if len(row) != len(heads):
            raise ValueError(f"{file}: row {number} has {len(row)} fields instead of {len(heads)}; is it cut short?")
    return {name: np.array([row[heads.index(name)] for row in rows]) for name in names}


def _values(source: str, table: Mapping[str, np.ndarray], names: Sequence[str]) -> Array:
    """``(n_rows, dim)`` values of the columns ``names``, side by side."""
    parts = [np.empty((len(next(iter(table.values()))), 0))]
    for written in names:
        match = _NAME.fullmatch(written)
        assert match is not None
        try:
            values = np.array(table[match["name"]].tolist(), dtype=np.float64)
        except ValueError as error:
            raise ValueError(f"{source}: {match['name']} must be numbers: {error}; is a field missing?") from error
        vectors = values.reshape(len(values), -1)
        if match["first"] is not None:
            first = int(match["first"])
            end = first + 1 if match["slice"] is None else int(match["end"] or vectors.shape[1])
            if not first < end <= vectors.shape[1]:
                raise ValueError(f"{source}: there is no {written}: {match['name']} has {vectors.shape[1]} entries")
            vectors = vectors[:, first:end]
        parts.append(check_vector(f"{source}: {written}", vectors, vectors.shape[1]))
    return np.concatenate(parts, axis=1)


def _groups(source: str, table: Mapping[str, np.ndarray], recording: str | None, n: int) -> list[tuple[str, slice]]:
    """Pairs (name for error messages, rows), one for each recording, in order."""
    if recording is None:
        return [(source, slice(0, n))]
    names = table[recording].tolist()
    starts = [row for row in range(n) if row == 0 or names[row] != names[row - 1]]
    found = [names[row] for row in starts]
    if len(set(found)) < len(found):
        twice = next(name for name in found if found.count(name) > 1)
        raise ValueError(f"{source}: the rows of recording {twice} are not adjacent; sort them by {recording} and time")
    return [
        (f"{source}: recording {names[row]}", slice(row, end))
        for row, end in zip(starts, [*starts[1:], n], strict=True)
    ]
