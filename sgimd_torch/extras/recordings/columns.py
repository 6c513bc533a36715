"""Recordings from tables: a row is a sample of a recording, and the user names the columns.

    names = ColumnNames(joints=("shoulder", "elbow"), outcome=("x", "y"))
    recordings = read_text("recordings", names)   # of text.py: a folder with a file for each recording, or one table
    recordings = in_units(recordings, {"": "deg"})                                   # of units.py: joints in rad
A column may hold vectors, as in LeRobot: ``observation.state`` is the whole vector, ``observation.state[0:6]`` and
``observation.state[2]`` are some of its entries.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.spaces import Array, Demonstration, first_fall

NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*|,\d+)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_NAME: Final = re.compile(r"(?P<column>[^\[\]]+)(\[(?P<first>\d+)(?P<slice>:(?P<end>\d+)?)?\])?", re.ASCII)


@dataclass(frozen=True)
class ColumnNames:
    """Names of the columns of a table.

    Args:
        joints: columns of joint angles or of motor commands, in the order of the robot's correspondence.
        outcome: columns of the outcome, read in the last row of a recording; () if the table has no outcome.
        context: columns of the context, read in the first row of a recording; () for a robot without contexts.
        time: column of the time, in s or in ISO 8601; the first time of a recording counts as 0.
        recording: column with the number or name of the recording of each row; None: a table is one recording.
        rate: samples per second of a table without times; None if ``time`` has the times.
        header: names of all columns of a text without names; () if its first row has the names.
    """

    joints: tuple[str, ...]
    outcome: tuple[str, ...] = ()
    context: tuple[str, ...] = ()
    time: str = "time"
    recording: str | None = None
    rate: float | None = None
    header: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self._names:
            if _NAME.fullmatch(name) is None:
                raise ValueError(f"{name!r} does not name a column; write, for example, state, state[2] or state[0:6]")

    @property
    def _names(self) -> tuple[str, ...]:
        timed = (self.time,) if self.rate is None else ()
        grouped = () if self.recording is None else (self.recording,)
        return (*self.joints, *self.outcome, *self.context, *timed, *grouped)

    @property
    def columns(self) -> list[str]:
        """Names of the needed columns, without entries in brackets and without repetitions."""
        return list(dict.fromkeys(name.partition("[")[0] for name in self._names))


class Recording(NamedTuple):
    """A recording that was read from a file, or the reason why it cannot be used.

    Attributes:
        name: name of the recording, with the name of its file.
        demonstration: the recording; its outcome is empty if the file has none. None if it cannot be used.
        joints: names of the joints.
        fault: reason why the recording cannot be used, "" if it can.
    """

    name: str
    demonstration: Demonstration | None
    joints: tuple[str, ...] = ()
    fault: str = ""


class Sheet(NamedTuple):
    """Columns of a file.

    Attributes:
        name: name of the file in messages.
        columns: ``(n_rows,)`` values or texts, or ``(n_rows, k)`` vectors, for each of ``ColumnNames.columns``.
        rows: number of each row in messages.
        entries: names of the entries of a vector, by column.
    """

    name: str
    columns: Mapping[str, np.ndarray]
    rows: Sequence[int]
    entries: Mapping[str, Sequence[str]]


def recordings_of(table: Sheet, names: ColumnNames) -> list[Recording]:
    """The recordings of one table. A fault of one recording is told in its ``fault``, with the row.

    Raises:
        ValueError: the rows of a recording are not adjacent.
    """
    recordings = []
    for title, rows in _groups(table, names.recording):
        try:
            joints, joint_names = _values(table, names.joints, rows)
            outcomes, _ = _values(table, names.outcome, slice(rows.stop - 1, rows.stop))
            contexts, _ = _values(table, names.context, slice(rows.start, rows.start + 1))
            if len(joints) < 2:
                raise ValueError(f"it has 1 sample, but needs 2 or more; does {names.recording} number the rows?")
            demonstration = Demonstration(contexts[0], _times(table, names, rows), joints, outcomes[-1])
            recordings.append(Recording(title, demonstration, tuple(joint_names)))
        except ValueError as error:
            recordings.append(Recording(title, None, fault=str(error)))
    return recordings


def _times(table: Sheet, names: ColumnNames, rows: slice) -> Array:
    """``(n_samples,)`` s, from 0."""
    if names.rate is not None:
        return np.arange(rows.stop - rows.start) / names.rate
    moments = _moments(table, names.time, rows)
    times = np.array(moments)[:, None] if moments else _values(table, (names.time,), rows)[0]
    if times.shape[1] != 1:
        raise ValueError(f"{names.time} must be one number for each row, got {times.shape[1]}")
    if fall := first_fall(times[:, 0]):
        row = table.rows[rows.start + fall[0]]
        raise ValueError(f"row {row}: {names.time} must increase from row to row, but this row {fall[1]}")
    return times[:, 0] - times[0, 0]


def _moments(table: Sheet, column: str, rows: slice) -> list[float]:
    """Times of a column of dates, or of ISO texts, as s after the first; [] for a column of numbers."""
    values = table.columns.get(column, np.empty(0))[rows].tolist()  # empty: the entry of a vector
    first = next(iter(values), 0.0)
    if not isinstance(first, str | datetime) or NUMBER.fullmatch(str(first)) or first == column:
        return []
    moments = list[datetime]()
    for row, value in enumerate(values, rows.start):
        try:
            moments.append(value if isinstance(value, datetime) else datetime.fromisoformat(value))
        except ValueError as error:
            wanted = "neither a number of s nor an ISO time, such as 2014-05-01T08:00:00.25+02:00"
            raise ValueError(f"row {table.rows[row]}: {column} is {value[:40]!r}, {wanted}") from error
    if len({moment.tzinfo is None for moment in moments}) > 1:
        raise ValueError(f"some times of {column} have a zone, others have none")
    return [(moment - moments[0]).total_seconds() for moment in moments]


def _values(table: Sheet, names: Sequence[str], rows: slice) -> tuple[Array, list[str]]:
    """``(n_samples, dim)`` values of the columns ``names``, side by side, and the name of each dimension."""
    parts, labels = [np.empty((rows.stop - rows.start, 0))], list[str]()
    for name in names:
        match = _NAME.fullmatch(name)
        assert match is not None
        column, first = match["column"], int(match["first"] or 0)
        values = _numbers(table, column, rows)
        size = values.shape[1]
        entries = table.entries.get(column) or ([column] if size == 1 else [f"{column}[{k}]" for k in range(size)])
        if len(entries) != size:
            raise ValueError(f"{column} has {size} entries, but names of {len(entries)}: {', '.join(entries)}")
        end = first + 1 if match["first"] and not match["slice"] else int(match["end"] or size)
        if not first < end <= size:
            raise ValueError(f"there is no {name}: {column} has {size} entries")
        part = values[:, first:end]
        finite = np.isfinite(part).all(axis=1)
        if not finite.all():
            row = int(finite.argmin())
            raise ValueError(f"row {table.rows[rows.start + row]}: {name} must be finite, got {part[row].tolist()}")
        parts.append(part)
        labels += entries[first:end]
    return np.concatenate(parts, axis=1), labels


def _numbers(table: Sheet, column: str, rows: slice) -> Array:
    """``(n_samples, k)`` numbers of a column of vectors or texts; a column of single numbers has k = 1."""
    values = table.columns[column][rows]
    if values.dtype.kind != "U":
        try:
            return np.array(values.tolist(), dtype=np.float64).reshape(len(values), -1)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{column} must be numbers: {error}") from error
    for row, text in enumerate(values.tolist(), rows.start):
        if NUMBER.fullmatch(text) is None:
            is_header = text == column
            hint = "the first row names the columns, so leave out --columns" if is_header else "is a field missing?"
            raise ValueError(f"row {table.rows[row]}: {column} is {text[:40]!r}, no number; {hint}")
    return np.array([[float(text.replace(",", "."))] for text in values.tolist()])


def _groups(table: Sheet, recording: str | None) -> list[tuple[str, slice]]:
    """Pairs (name for messages, rows), one for each recording, in order."""
    if recording is None:
        return [(table.name, slice(0, len(table.rows)))]
    groups, start = dict[object, slice](), 0
    for name, rows in groupby(table.columns[recording].tolist()):
        if name in groups:
            raise ValueError(f"the rows of recording {name} are not adjacent; sort them by {recording} and time")
        end = start + len(list(rows))
        groups[name], start = slice(start, end), end
    return [(f"{table.name}: {recording} {name}", rows) for name, rows in groups.items()]
