"""Tables from text files: divided by commas, semicolons, tabs or spaces, with a decimal point or a decimal comma.

recordings = read_text("recordings", ColumnNames(joints=("shoulder", "elbow"), outcome=("x", "y")))
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.extras.recordings.columns import NUMBER, ColumnNames, Recording, Sheet, recordings_of
from sgimd_torch.files import check_regular

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat")
POINTER: Final = "version https://git-lfs"  # the beginning of a file that stands for a large one
_SAMPLE: Final = 50  # number of rows that show what divides the columns


def read_text(path: str | os.PathLike[str], names: ColumnNames) -> list[Recording]:
    """Read recordings from a text file, or from the text files of a folder in the order of their names.

    The first row names the columns, unless ``names.header`` does. A file is one recording unless ``names.recording``
    divides it.

    Raises:
        ValueError: a folder holds no text file.
        OSError: there is no file.
    """
    path = Path(path)
    files = [path]
    if path.is_dir():
        by_suffix = ([file for file in sorted(path.glob(f"*{suffix}")) if file.is_file()] for suffix in SUFFIXES)
        files = next(filter(None, by_suffix), [])
    if not files:
        raise ValueError(f"{path} holds no {', '.join(SUFFIXES)} file")
    recordings: list[Recording] = []
    for file in files:
        try:
            recordings += recordings_of(_table(file, names), names)
        except ValueError as error:
            recordings.append(Recording(file.name, None, fault=str(error)))
    return recordings


def _table(file: Path, names: ColumnNames) -> Sheet:
    """Columns of a file, as arrays of text.

    Raises:
        ValueError: the file is no table, or lacks a named column.
    """
    check_regular(file)
    text = file.read_text(encoding="utf-8-sig", errors="replace")
    if text.startswith(POINTER):
        raise ValueError("it is a pointer of Git LFS, not the file itself; git lfs pull gets the file")
    if "\0" in text:
        raise ValueError("it has a NUL, so it is no text in UTF-8; was it saved as UTF-16, or cut off by a crash?")
    numbered = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    start = next((k for k, (_, line) in enumerate(numbered) if line[0] not in "#%"), len(numbered))
    remark, numbered = numbered[max(0, start - 1) : start], numbered[start:]  # a remark may name the columns
    numbers, lines = [number for number, _ in numbered], [line for _, line in numbered]
    mark = max(";\t, ", key=lambda mark: _plausibility(_split(lines[:_SAMPLE], mark)))
    rows, header = _split(lines, mark), list(names.header)
    if rows and rows[0] == [str(k) for k in range(len(rows[0]))]:
        raise ValueError(
            f"its first row, {mark.join(rows[0])}, may number the columns; delete it, or write 0.0 in a sample"
        )
    if not header and rows and all(NUMBER.fullmatch(field) for field in rows[0]):
        (header,) = _split([line.lstrip("#% ") for _, line in remark], mark) or [[]]
        if len(header) != len(rows[0]):
            raise ValueError("its first row has numbers, no names; name its columns with --columns time,q1,q2")
    elif not header:
        header, rows, numbers = (rows or [[]])[0], rows[1:], numbers[1:]
    for name in names.columns:
        if header.count(name) != 1:
            problem = "two columns" if name in header else "no column"
            hint = "; for samples at a fixed rate without times, give --rate" if name == names.time else ""
            raise ValueError(f"it has {problem} {name}; it has {', '.join(header[:20])}{hint}")
    if not rows:
        raise ValueError("it has no rows below the names of its columns")
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != len(header):
            raise ValueError(f"row {number} has {len(row)} fields instead of {len(header)}; is it cut short?")
    columns = {name: np.array([row[header.index(name)] for row in rows]) for name in names.columns}
    digits = " ".join(field for column in columns.values() for field in column.tolist() if NUMBER.fullmatch(field))
    if "," in digits and ("." in digits or mark == ","):
        raise ValueError(
            "it has decimal commas beside points, or beside commas between columns; do they mark thousands?"
        )
    return Sheet(file.name, columns, numbers, {})


def _split(lines: Sequence[str], mark: str) -> list[list[str]]:
    """Fields of each line, divided by ``mark``."""
    if mark == " ":
        return [line.split() for line in lines]
    try:
        rows = (next(csv.reader([line], delimiter=mark, skipinitialspace=True)) for line in lines)
        return [[field.strip() for field in row] for row in rows]
    except csv.Error as error:
        raise ValueError(f"it is no table: {error}") from error


def _plausibility(rows: list[list[str]]) -> tuple[bool, int, int]:
    """Order of ways to divide a table: any numbers, then numbers minus other fields; without numbers, all fields."""
    fields = [field for row in rows for field in row]
    numbers = sum(NUMBER.fullmatch(field) is not None for field in fields)
    return numbers > 0, (2 * numbers - len(fields) if numbers else 0), len(fields)
