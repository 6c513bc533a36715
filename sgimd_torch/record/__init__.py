"""The record of a learner's life: one SQLite file with all events. Reading the file detects damage.

    with Record.make(path, dims, settings) as record: record.add(event); record.commit()  # one writer
    with Record(path) as record: list(record.events()); record.rows("evaluations")  # any number of readers

`layout` has the tables, and ``docs/runs.md`` explains each column: settings and other facts (``about``), everything
that happened (``events``), each demonstration once, and tables that a replay fills again (``DERIVED``).

Every row ends in a checksum of itself and its number, and ``about`` has the number of rows of each table. So
reading raises an error if a row was changed, lost, doubled or moved.
"""

from __future__ import annotations

import json
import marshal
import os
import sqlite3
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from sgimd_torch import __version__
from sgimd_torch.learner.events import Event
from sgimd_torch.record.layout import (
    DERIVED,
    HINT,
    Dims,
    ReplayError,
    Row,
    RunError,
    demonstration_row,
    event_reader,
    event_row,
    layout,
    movements_after,
    plain,
    read_demonstration,
)
from sgimd_torch.spaces import Demonstration

__all__ = ["DERIVED", "Dims", "Record", "ReplayError", "Row", "RunError", "layout"]

_LOCAL: Final = {"ext2", "ext3", "ext4", "xfs", "btrfs", "tmpfs", "overlay", "zfs", "f2fs", "bcachefs"}
"""File systems of one machine."""
_ROWS_AT_ONCE: Final = 4096  # number of rows that one query reads


class Record(AbstractContextManager["Record"]):
    """An existing record, open for reading and, on request, for writing; a context manager.

    A reader copies the file into its memory at once. So it keeps no lock, and sees one state of the file. A writer
    keeps a write-ahead log beside the file until ``close``, so no reader delays a commit. Each commit enters the file,
    too, so a copy of the file alone has all commits.

    Args:
        path: SQLite file.
        write: whether to open the file for writing, too. Other processes can then only read it, until ``close``.

    Attributes:
        about: settings, versions and other facts about the run, by name; ``commit`` writes them.
        dims: dimensions of context, theta and outcome.
        movements: number of recorded movements, rests and uncommitted movements included.

    Raises:
        RunError: there is no record at ``path``, it is damaged, or another process is writing it.
    """

    def __init__(self, path: str | os.PathLike[str], *, write: bool = False) -> None:
        self.path = Path(path)
        self._n_rows: dict[str, int] = {}  # by table
        self._version: Any = None  # version of the file at the last lock; each writer changes it
        self.movements = 0
        self._numbers: dict[bytes, int] = {}  # number of each demonstration, from 0, by its content
        self._failure: Exception | None = None  # the error of a failed write
        self._connection = _connect(self.path, write)
        self._log_waits = write and _shares_memory(self.path)  # for the first commit, which is to begin it
        try:
            with self.translated_errors():
                self._lock() if write else self._copy()
                self._open()
                for table in layout(self.dims) if write else ():  # nothing is added to a damaged record
                    deque(self.rows(table), maxlen=0)
        except BaseException:
            self._connection.close()
            raise

    @classmethod
    def make(cls, path: str | os.PathLike[str], dims: Dims, about: Mapping[str, Any]) -> Self:
        """A new record, open for writing; ``about`` has facts about the run that json can express.

        Raises:
            OSError: the file cannot be written.
        """
        n_rows = dict.fromkeys(layout(dims), 0)
        try:
            with closing(sqlite3.connect(path, isolation_level=None)) as connection, connection:
                connection.execute("BEGIN IMMEDIATE")
                for statement in _tables(dims).values():
                    connection.execute(statement)
                rows = _with_checksums(_about_rows(about, n_rows))
                connection.executemany("INSERT INTO about VALUES (?, ?, ?)", rows)
        except sqlite3.Error as error:
            raise OSError(f"{path} cannot be written: {error}") from error
        return cls(path, write=True)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, a writer without a write-ahead log; uncommitted rows are lost."""
        with suppress(sqlite3.Error):  # where another program has the file open, the log stays until that ends
            self._connection.rollback()
            self._connection.execute("PRAGMA journal_mode = DELETE")
        self._connection.close()

    def rows(self, table: str) -> Iterator[Row]:
        """The rows of a table, in order, without their checksums.

        Raises:
            RunError: a row was changed, or rows are missing or added; all rows before it have been yielded.
        """
        number = 0
        # No cursor stays open between yields, because the log cannot begin while one is open.
        next_rows = f"SELECT rowid, * FROM {table} WHERE rowid > ? ORDER BY rowid LIMIT {_ROWS_AT_ONCE}"
        with self.translated_errors():
            while rows := self._connection.execute(next_rows, (number,)).fetchall():
                for rowid, *row, checksum in rows:
                    number += 1
                    if rowid != number or checksum != _checksum(number, row):
                        raise RunError(f"row {number} of {table} is not what was written; {HINT}")
                    yield tuple(row)
            if number != self._n_rows.get(table, number):
                raise RunError(f"{table} has {number} rows, {self._n_rows[table]} were written; {HINT}")

    def events(self) -> Iterator[Event]:
        """All events, in order.

        Raises:
            RunError: see ``rows``.
        """
        yield from map(event_reader(self.dims, self.demonstrations()), self.rows("events"))

    def demonstrations(self) -> list[Demonstration]:
        """Each demonstration that was shown, once, in the order of first showing."""
        return [read_demonstration(row, self.dims) for row in self.rows("demonstrations")]

    def add(self, event: Event) -> None:
        """Append an event; it is on the disk after ``commit``."""
        lesson = None if event.lesson is None else self._number_of(event.lesson)
        if event.kept is not None:
            number = self._n_rows["events"] + 1
            self._append("kept", [(number, *row) for row in np.concatenate(event.kept, axis=1).tolist()])
        self._append("events", [event_row(event, self.movements, lesson, self.dims)])
        self.movements = movements_after(self.movements, event.kind)

    def add_rows(self, table: str, rows: Iterable[Sequence[Any]]) -> None:
        """Append rows to one of the ``DERIVED`` tables; NaN is stored as NULL."""
        self._append(table, [plain(row) for row in rows])

    def replace_rows(self, table: str, rows: Iterable[Sequence[Any]]) -> None:
        """Replace all rows of a table."""
        with self.translated_errors(writing=True):
            self._connection.execute(f"DELETE FROM {table}")
        self._n_rows[table] = 0
        self._append(table, [plain(row) for row in rows])

    def commit(self) -> bool:
        """Bring all new rows and ``about`` to the disk, or nothing.

        Returns:
            Whether the rows are on the disk. Without a write-ahead log, which the first commit begins if the file
            system allows it, the rows wait for the next commit while another program is reading the file.

        Raises:
            OSError: the disk is full or cannot be written; earlier commits remain.
            RunError: another process has written in the meantime.
        """
        self.replace_rows("about", _about_rows(self.about, self._n_rows))
        with self.translated_errors(writing=True):
            try:
                self._connection.execute("COMMIT")
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                    raise
                return False
            if self._log_waits:
                with suppress(sqlite3.OperationalError):  # a program that is reading delays it to the next commit
                    self._connection.execute("PRAGMA journal_mode = WAL")
                    self._log_waits = False
                    self._version = self._connection.execute("PRAGMA data_version").fetchone()  # the log changed it
            with suppress(sqlite3.OperationalError):  # what cannot enter the file now is still in the log
                self._connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
            self._lock()
        return True

    def _number_of(self, demonstration: Demonstration) -> int:
        """The number of a demonstration in its table, from 0; a new demonstration is appended first."""
        row = demonstration_row(demonstration, self.dims)
        if not self._numbers:
            self._numbers = {_as_bytes(earlier): k for k, earlier in enumerate(self.rows("demonstrations"))}
        content = _as_bytes(row)
        if content not in self._numbers:
            self._numbers[content] = len(self._numbers)
            self._append("demonstrations", [row])
        return self._numbers[content]

    def _append(self, table: str, rows: Sequence[Row]) -> None:
        if rows:
            complete = _with_checksums(rows, self._n_rows[table])
            marks = ", ".join("?" * len(complete[0]))
            with self.translated_errors(writing=True):
                self._connection.executemany(f"INSERT INTO {table} VALUES ({marks})", complete)
            self._n_rows[table] += len(rows)

    def _copy(self) -> None:
        """Read from a copy in memory from now on."""
        copy = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
        try:
            self._connection.execute("BEGIN")
            self._connection.execute("SELECT * FROM sqlite_schema").fetchall()  # locks, within the time limit
            self._connection.backup(copy)
        except BaseException:
            copy.close()
            raise
        self._connection.close()
        self._connection = copy

    def _open(self) -> None:
        statements = dict(self._connection.execute("SELECT name, sql FROM sqlite_schema").fetchall())
        if not statements:
            raise RunError("it is still empty")
        c, p, t = (statements.get("events", "").count(f" {name}_") for name in ("context", "theta", "outcome"))
        self.dims: Dims = c, p, t
        tables = _tables(self.dims)  # a viewer may have added an index, a view or statistics
        if {name: statements.get(name) for name in tables} != tables:
            raise RunError(f"its tables are not those of sgimd_torch {__version__}{self._made_by()}")
        self.about: dict[str, Any] = {name: json.loads(value) for name, value in self.rows("about")}
        self._n_rows = self.about.pop("rows")
        last = self._connection.execute("SELECT movement, kind FROM events ORDER BY rowid DESC LIMIT 1").fetchone()
        self.movements = 0 if last is None else movements_after(*last)

    def _made_by(self) -> str:
        """End of a message about tables of another layout: the version that wrote them, if it is known."""
        name = "SELECT value FROM about WHERE name = 'versions'"
        with suppress(sqlite3.Error, ValueError, TypeError, KeyError):
            wrote = json.loads(self._connection.execute(name).fetchone()[0])
            if wrote["sgimd_torch"] != __version__:
                return f": sgimd_torch {wrote['sgimd_torch']} wrote it, and can read it"
        return f"; {HINT}"

    def _lock(self) -> None:
        """Lock the file against other writers until this record is closed; readers are still admitted."""
        before = self._version
        self._connection.execute("BEGIN IMMEDIATE")
        self._version = self._connection.execute("PRAGMA data_version").fetchone()
        if before not in (None, self._version):
            raise RunError("another process has written to it")

    @contextmanager
    def translated_errors(self, *, writing: bool = False) -> Iterator[None]:
        """Turn errors of SQLite, and errors from unexpected values, into RunError or OSError with the path."""
        if self._failure is not None:
            raise self._failure
        translated: Exception
        try:
            yield
        except (RunError, sqlite3.Error, ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            if isinstance(error, RunError):
                translated = error if str(self.path) in str(error) else RunError(f"{self.path}: {error}")
            elif isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
                told = "is in use by another process; wait for it; a new run needs another --out"
                translated = RunError(f"{self.path} {told}")
            elif writing:
                translated = OSError(f"{self.path} cannot be written: {error}")
            else:
                translated = RunError(f"{self.path} cannot be read as a record: {error}; {HINT}")
            if writing:  # the next rows would follow a gap
                self._failure = translated
                self._connection.close()
            raise translated from error


def _connect(path: Path, write: bool) -> sqlite3.Connection:
    # Never open the file here in another way: closing it would release all locks that this process has on the file.
    if not path.is_file():
        raise RunError(f"there is no record {path}")
    try:
        # Readers need mode=rw, too, to clean up after a killed writer. SQLite still opens a read-only file for reading.
        # check_same_thread=False: teaching by hand opens the record in one thread and later uses it in another.
        address, patience = f"{path.resolve().as_uri()}?mode=rw", 0.5 if write else 10.0
        if not (write or os.access(path.parent, os.W_OK) or path.with_name(f"{path.name}-wal").exists()):
            address += "&immutable=1"  # else SQLite would make a log for the record of a run that was killed
        return sqlite3.connect(address, uri=True, isolation_level=None, timeout=patience, check_same_thread=False)
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path} cannot be opened: {error}") from error


def _shares_memory(path: Path) -> bool:
    """Whether all programs that can open a file run on this machine: a write-ahead log needs memory that they share."""
    try:
        mounts = [line.split()[1:3] for line in Path("/proc/mounts").read_text(encoding="utf-8").splitlines()]
    except OSError:  # only Linux has this list
        return True
    kinds = {folder: kind for folder, kind in mounts if path.resolve().is_relative_to(folder)}
    return kinds.get(max(kinds, key=len, default="")) in _LOCAL


def _tables(dims: Dims) -> dict[str, str]:
    """The statement that creates each table."""
    return {name: f"CREATE TABLE {name} ({', '.join(columns)})" for name, columns in layout(dims).items()}


def _about_rows(about: Mapping[str, Any], n_rows: Mapping[str, int]) -> list[Row]:
    """The rows of the table ``about``, the last one with the number of rows of each table."""
    entries = {**about, "rows": {**n_rows, "about": len(about) + 1}}
    return [(name, json.dumps(value)) for name, value in entries.items()]


def _as_bytes(row: Sequence[Any]) -> bytes:
    """A row as bytes. Binary floats take a fifth of the time of text."""
    return marshal.dumps(tuple(row), 2)


def _checksum(number: int, row: Sequence[Any]) -> int:
    """The checksum of a row, which has this ``number`` in its table, from 1."""
    return zlib.crc32(_as_bytes((number, *row)))


def _with_checksums(rows: Iterable[Row], n_before: int = 0) -> list[Row]:
    return [(*row, _checksum(number, row)) for number, row in enumerate(rows, n_before + 1)]
