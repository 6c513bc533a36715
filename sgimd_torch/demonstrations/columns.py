"""Recordings from tables: each row is a sample of a recording, and the user names the columns.

    columns = Columns(joints=("shoulder", "elbow"), outcome=("x", "y"))
    found = read_text("recordings", columns)      # of text.py: a folder with a file for each recording, or one table
    found = in_units(found, {"": "deg"})          # of units.py: joints in rad
A column may hold vectors, as in LeRobot: ``observation.state`` is the whole vector, ``observation.state[0:6]`` and
``observation.state[2]`` are some of its entries.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.spaces import Array, Demonstration, check_vector

NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*|,\d+)?|[.,]\d+)([eE][+-]?\d+)?")
_NAME: Final = re.compile(r"(?P<name>[^\[\]]+)(\[(?P<first>\d+)(?P<slice>:(?P<end>\d+)?)?\])?")


@dataclass(frozen=True)
class Columns:
    """Names of the columns of a table.

    Args:
        joints: columns of joint angles or of motor commands, in the order of the robot's correspondence.
        outcome: columns of the outcome, read in the last row of a recording; () if the table has no outcome.
        context: columns of the context, read in the first row of a recording; () for a robot without contexts.
        time: column of the time (s); the first time of a recording counts as 0.
        recording: column with the number or name of the recording of each row; None: a table is one recording.
        rate: samples per second of a table without times; None if ``time`` has the times.
        heads: names of all columns of a text without names; () if its first row has the names.
    """

    joints: tuple[str, ...]
    outcome: tuple[str, ...] = ()
    context: tuple[str, ...] = ()
    time: str = "time"
    recording: str | None = None
    rate: float | None = None
    heads: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.names:
            if _NAME.fullmatch(name) is None:
                raise ValueError(f"{name!r} does not name a column; write, for example, state, state[2] or state[0:6]")

    @property
    def names(self) -> tuple[str, ...]:
        """All columns as the user wrote them, with entries in brackets."""
        timed = (self.time,) if self.rate is None else ()
        grouped = () if self.recording is None else (self.recording,)
        return (*self.joints, *self.outcome, *self.context, *timed, *grouped)

    @property
    def plain(self) -> list[str]:
        """All columns, each once, without entries in brackets."""
        return list(dict.fromkeys(name.partition("[")[0] for name in self.names))


class Recording(NamedTuple):
    """A recording that was read from a file, or the reason why it cannot be used.

    Attributes:
        name: name of the recording, with the name of its file.
        shown: the recording; its outcome is empty if the file has none. None if the recording cannot be used.
        joints: names of the joints.
        refused: reason why the recording cannot be used, "" if it can.
    """

    name: str
    shown: Demonstration | None
    joints: tuple[str, ...] = ()
    refused: str = ""


class Table(NamedTuple):
    """Columns of a file.

    Attributes:
        name: name of the file in messages.
        columns: ``(n_rows,)`` values or texts, or ``(n_rows, k)`` vectors, for each name in ``Columns.plain``.
        rows: number of each row in messages.
        entries: names of the entries of a vector, by column.
    """

    name: str
    columns: Mapping[str, np.ndarray]
    rows: Sequence[int]
    entries: Mapping[str, Sequence[str]]


def recordings(table: Table, columns: Columns) -> list[Recording]:
    """The recordings of one table. A fault of one recording is told in its ``refused``, with the row.

    Raises:
        ValueError: the rows of a recording are not adjacent.
    """
    found = []
    for name, rows in _groups(table, columns.recording):
        try:
            joints, names = _values(table, columns.joints, rows)
            (outcome, _), (context, _) = (_values(table, each, rows) for each in (columns.outcome, columns.context))
            if len(joints) < 2:
                raise ValueError(f"it has 1 sample, but needs 2 or more; does {columns.recording} number the rows?")
            shown = Demonstration(context[0], _times(table, columns, rows), joints, outcome[-1])
            found.append(Recording(name, shown, tuple(names)))
        except ValueError as error:
            found.append(Recording(name, None, refused=str(error)))
    return found


def _times(table: Table, columns: Columns, rows: slice) -> Array:
    """``(n_samples,)`` s, from 0."""
    if columns.rate is not None:
        return np.arange(rows.stop - rows.start) / columns.rate
    times, _ = _values(table, (columns.time,), rows)
    if times.shape[1] != 1:
        raise ValueError(f"{columns.time} must be one number for each row, got {times.shape[1]}")
    falls = np.flatnonzero(np.diff(times[:, 0]) <= 0)
    if len(falls):
        row = rows.start + falls[0] + 1
        raise ValueError(f"row {table.rows[row]}: {columns.time} must increase from row to row; were rows shuffled?")
    return times[:, 0] - times[0, 0]


def _values(table: Table, names: Sequence[str], rows: slice) -> tuple[Array, list[str]]:
    """``(n_samples, dim)`` values of the columns ``names``, side by side, and the name of each dimension."""
    parts, labels = [np.empty((rows.stop - rows.start, 0))], list[str]()
    for written in names:
        match = _NAME.fullmatch(written)
        assert match is not None
        name = match["name"]
        values = _numbers(table, name, rows)
        vectors = values.reshape(len(values), -1)
        plain = [name] if values.ndim == 1 else [f"{name}[{k}]" for k in range(vectors.shape[1])]
        called = table.entries.get(name) or plain
        if len(called) != len(plain):
            raise ValueError(f"{name} has {len(plain)} entries, but names of {len(called)}: {', '.join(called)}")
        first, end = int(match["first"] or 0), vectors.shape[1]
        if match["first"] is not None:
            end = first + 1 if match["slice"] is None else int(match["end"] or end)
        if not first < end <= vectors.shape[1]:
            raise ValueError(f"there is no {written}: {name} has {vectors.shape[1]} entries")
        part = vectors[:, first:end]
        usable = np.isfinite(part).all(axis=1)
        if not usable.all():
            row = int(usable.argmin())
            raise ValueError(f"row {table.rows[rows.start + row]}: {written} must be finite, got {part[row].tolist()}")
        parts.append(check_vector(written, part, part.shape[1]))
        labels += called[first:end]
    return np.concatenate(parts, axis=1), labels


def _numbers(table: Table, name: str, rows: slice) -> Array:
    values = table.columns[name][rows]
    if values.dtype.kind != "U":
        try:
            return np.array(values.tolist(), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{name} must be numbers: {error}") from error
    for row, text in enumerate(values.tolist(), rows.start):
        if NUMBER.fullmatch(text) is None:
            named = text == name
            hint = "the first row names the columns, so leave out --columns" if named else "is a field missing?"
            raise ValueError(f"row {table.rows[row]}: {name} is {text[:40]!r}, no number; {hint}")
    return np.array([float(text.replace(",", ".")) for text in values.tolist()])


def _groups(table: Table, recording: str | None) -> list[tuple[str, slice]]:
    """Pairs (name for messages, rows), one for each recording, in order."""
    n = len(table.rows)
    if recording is None:
        return [(table.name, slice(0, n))]
    names = table.columns[recording].tolist()
    starts = [row for row in range(n) if row == 0 or names[row] != names[row - 1]]
    found = [names[row] for row in starts]
    if len(set(found)) < len(found):
        twice = next(name for name in found if found.count(name) > 1)
        raise ValueError(f"the rows of recording {twice} are not adjacent; sort them by {recording} and time")
    return [
        (f"{table.name}: {recording} {names[row]}", slice(row, end))
        for row, end in zip(starts, [*starts[1:], n], strict=True)
    ]
