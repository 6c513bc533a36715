"""Tables that results are appended to as they come: a csv file with one writer at a time, no row twice.

table = Table(Path("goals.csv"), ("variant", "seed", "n_goals"), key=("variant", "seed"))
table.append([["grid", 0, 7]])
"""

from __future__ import annotations

import csv
import fcntl
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.runs.log import RunError

Key = tuple[str, ...]


class Table:
    """A csv file that rows are appended to; a last line torn off by a power cut is dropped.

    Args:
        path: of the file; it is made where there is none.
        columns: their names, the first line of the file.
        key: names of the columns that tell one row from another.

    Attributes:
        keys: of the rows that are there.

    Raises:
        RunError: the file is another table or damaged, or somebody else is writing it.
        OSError: it cannot be written.
    """

    def __init__(self, path: Path, columns: Sequence[str], key: Sequence[str]) -> None:
        self.path = path
        self._columns = [columns.index(name) for name in key]
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        try:
            _lock(self._file, path)
            self.keys, whole = read_keys(path, columns, key)
            os.ftruncate(self._file, whole)
            if not whole:
                self._write(_lines([columns]))
        except BaseException:
            self.close()
            raise

    def append(self, rows: Sequence[Sequence[object]]) -> None:
        """On disk when it returns; rows that are there already, by their key, are left out.

        Raises:
            OSError: the disk is full, say; then none of them is there.
        """
        new = {self._key(row): row for row in rows}
        new = {key: row for key, row in new.items() if key not in self.keys}
        self._write(_lines(list(new.values())))
        self.keys |= new.keys()

    def close(self) -> None:
        """Let others write."""
        os.close(self._file)

    def _key(self, row: Sequence[object]) -> Key:
        return tuple(str(row[column]) for column in self._columns)

    def _write(self, content: bytes) -> None:
        size = os.fstat(self._file).st_size
        try:
            left = memoryview(content)
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, size)
            raise OSError(error.errno, error.strerror, str(self.path)) from error


def read_keys(path: Path, columns: Sequence[str], key: Sequence[str]) -> tuple[set[Key], int]:
    """The keys of a table's rows, and how many bytes of the file are whole lines; none where there is no file.

    Raises:
        RunError: it is another table, or damaged.
    """
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return set(), 0
    header = _lines([columns])
    whole = content.rfind(b"\n") + 1
    if not (content.startswith(header) or header.startswith(content)):
        raise RunError(f"{path} must begin with {','.join(columns)}; is it another table?")
    rows = csv.DictReader(io.StringIO(content[:whole].decode(errors="replace")), restkey="", restval="")
    keys: set[Key] = set()
    for row in rows:
        if "" in row or not all(row[name] for name in key):
            raise RunError(f"{path}, line {rows.line_num} is not a row of {','.join(columns)}; was it edited?")
        keys.add(tuple(row[name] for name in key))
    return keys, whole


def _lock(file: int, path: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise RunError(
            f"{path} is being written by another compare.py; let it end, or name another --results"
        ) from None


def _lines(rows: Sequence[Sequence[object]]) -> bytes:
    """Numbers read back exactly; NaN is left empty."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([map(_field, row) for row in rows])
    return text.getvalue().encode()


def _field(value: object) -> object:
    return "" if isinstance(value, float) and math.isnan(value) else value
