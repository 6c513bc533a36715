"""Tables from text files: divided by commas, semicolons, tabs or spaces, with a decimal point or a decimal comma.

found = read_text("recordings", Columns(joints=("shoulder", "elbow"), outcome=("x", "y")))
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.columns import NUMBER, Columns, Recording, Table, recordings
from sgimd_torch.files import check_regular

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat")
POINTER: Final = "version https://git-lfs"  # the beginning of a file that stands for a large one
_SAMPLE: Final = 50  # number of rows that show what divides the columns

Rows = list[list[str]]


def read_text(path: str | os.PathLike[str], columns: Columns) -> list[Recording]:
    """Read recordings from a text file, or from the text files of a folder in the order of their names.

    The first row names the columns, unless ``columns.heads`` does. A file is one recording unless
    ``columns.recording`` divides it.

    Raises:
        ValueError: a folder holds no text file.
        OSError: there is no file.
    """
    path = Path(path)
    files = [path]
    if path.is_dir():
        kinds = ([file for file in sorted(path.glob(f"*{suffix}")) if file.is_file()] for suffix in SUFFIXES)
        files = next(filter(None, kinds), [])
    if not files:
        raise ValueError(f"{path} holds no {', '.join(SUFFIXES)} file")
    found: list[Recording] = []
    for file in files:
        try:
            found += recordings(_table(file, columns), columns)
        except ValueError as error:
            found.append(Recording(file.name, None, refused=str(error)))
    return found


def _table(file: Path, columns: Columns) -> Table:
    """Columns of a file, as arrays of text.

    Raises:
        ValueError: the file is no table, or has no column that is named.
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
    lines = [line for _, line in numbered]
    mark = max(";\t, ", key=lambda mark: _numbers_of(_split(lines[:_SAMPLE], mark)))
    rows, numbers = _split(lines, mark), [number for number, _ in numbered]
    heads = list(columns.heads)
    if rows and rows[0] == [str(k) for k in range(len(rows[0]))]:
        raise ValueError(
            f"its first row, {mark.join(rows[0])}, may number the columns; delete it, or write 0.0 in a sample"
        )
    if not heads and rows and _all_numbers(rows[0]):
        (heads,) = _split([line.lstrip("#% ") for _, line in remark], mark) or [[]]
        if len(heads) != len(rows[0]):
            raise ValueError("its first row has numbers, no names; name its columns with --columns time,q1,q2")
    elif not heads:
        heads, rows, numbers = (rows or [[]])[0], rows[1:], numbers[1:]
    for name in columns.plain:
        if heads.count(name) != 1:
            how = "two columns" if name in heads else "no column"
            hint = "; for samples at a fixed rate without times, give --rate" if name == columns.time else ""
            raise ValueError(f"it has {how} {name}; it has {', '.join(heads[:20])}{hint}")
    if not rows:
        raise ValueError("it has no rows below the names of its columns")
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != len(heads):
            raise ValueError(f"row {number} has {len(row)} fields instead of {len(heads)}; is it cut short?")
    found = {name: np.array([row[heads.index(name)] for row in rows]) for name in columns.plain}
    used = " ".join(text for texts in found.values() for text in texts.tolist() if NUMBER.fullmatch(text))
    if "," in used and ("." in used or mark == ","):
        raise ValueError(
            "it has decimal commas beside points, or beside commas between columns; do they mark thousands?"
        )
    return Table(file.name, found, numbers, {})


def _split(lines: Sequence[str], mark: str) -> Rows:
    """Fields of each line, divided by ``mark``."""
    if mark == " ":
        return [line.split() for line in lines]
    try:
        return [[text.strip() for text in next(csv.reader([line], delimiter=mark))] for line in lines]
    except csv.Error as error:
        raise ValueError(f"it is no table: {error}") from error


def _numbers_of(rows: Rows) -> tuple[bool, int, int]:
    """Order of ways to divide a table: any numbers, then numbers minus other fields; without numbers, all fields."""
    fields = [text for row in rows for text in row]
    numbers = sum(NUMBER.fullmatch(text) is not None for text in fields)
    return numbers > 0, (2 * numbers - len(fields) if numbers else 0), len(fields)


def _all_numbers(row: Sequence[str]) -> bool:
    return all(NUMBER.fullmatch(text) for text in row)
