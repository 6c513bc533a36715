"""The record of a learner's life: one SQLite file with all events. Reading the file detects every change by others.

    with Record.make(path, dims, settings) as record: record.add(event); record.commit()  # one writer
    with Record(path) as record: list(record.events()); record.rows("evaluations")  # any number of readers

Tables (``docs/runs.md`` explains each column):
    about            settings, versions and run times, as json
    events           everything that happened, in order: moved, rested, shown, asked, failed, interrupted
    demonstrations   each demonstration that was shown, once
    goals            goals of evaluation
    evaluations, errors, regions     rows of each evaluation
    predictions, refreshes           rows of a forward model
    seals            number of rows of each table, and seal of its last row

Every row ends in a seal: a checksum of the row, of all earlier rows, of the table and of the run. So reading raises an
error if a row was changed, lost, doubled, moved or taken from another run.
"""

from __future__ import annotations

import json
import marshal
import os
import sqlite3
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Self

from sgimd_torch.files import replacing
from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.record.layout import (
    DERIVED,
    HINT,
    SEALS,
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

__all__ = ["DERIVED", "Dims", "Record", "ReplayError", "RunError", "layout"]

_PATIENCE: Final = 60.0  # s, longest time that a commit waits for readers of other programs
_IMPATIENCE: Final = 0.1  # s, the same for a commit that can be made later
_AT_ONCE: Final = 4096  # number of rows that one query reads


class Record:
    """An existing record, open for reading and, on request, for writing; a context manager.

    A reader copies the file into its memory at once. So it keeps no lock, and sees one state of the file.

    Args:
        path: SQLite file.
        write: whether to open the file for writing, too. Other processes can then only read it, until ``close``.

    Attributes:
        about: settings, versions and other facts about the run, by name, without damaged ones; see ``settle``.
        dims: dimensions of context, theta and outcome.

    Raises:
        RunError: there is no record at ``path``, its tables are damaged, or another process is writing it.
    """

    def __init__(self, path: str | os.PathLike[str], *, write: bool = False) -> None:
        self.path = Path(path)
        self._seals: dict[str, tuple[int, int]] = {}  # by table: number of rows, seal of the last row
        self._version: Any = None  # version of the file at the last lock; each writer changes it
        self._movements = 0
        self._shown: dict[bytes, int] = {}
        self._lost: Exception | None = None  # the error of a failed write
        self._connection = _connect(self.path, write)
        try:
            with self._told():
                self._lock() if write else self._copy()
                self._open()
        except BaseException:
            self._connection.close()
            raise

    @classmethod
    def make(cls, path: str | os.PathLike[str], dims: Dims, about: Mapping[str, Any]) -> Self:
        """A new record, open for writing; ``about`` has facts about the run that json can express.

        Raises:
            OSError: the file cannot be written.
        """
        path, told = Path(path), {"run": os.urandom(8).hex(), "dims": dims, **about}
        try:
            with closing(sqlite3.connect(path, isolation_level=None)) as connection, connection:
                connection.execute("BEGIN IMMEDIATE")
                for statement in _tables(dims).values():
                    connection.execute(statement)
                rows = _sealed(_about_rows(told), _root("", "about"))
                connection.executemany("INSERT INTO about VALUES (?, ?, ?)", rows)
                seals = [(name, 0, _root(told["run"], name)) for name in layout(dims)]
                seals[0] = "about", len(rows), rows[-1][-1]
                connection.executemany("INSERT INTO seals VALUES (?, ?, ?)", seals)
        except sqlite3.Error as error:
            raise OSError(f"{path} cannot be written: {error}") from error
        return cls(path, write=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; uncommitted rows are lost."""
        self._connection.close()

    @property
    def movements(self) -> int:
        """Number of recorded movements, rests and uncommitted movements included."""
        return self._movements

    def rows(self, table: str) -> Iterator[Row]:
        """The rows of a table, in order, without their seals.

        Raises:
            RunError: a row was changed, or rows are missing or added; all rows before it have been yielded.
        """
        n, seal, last = 0, self._first_seal(table), -(2**63)
        # No cursor stays open between yields, because a writer cannot commit while one is open.
        next_rows = f"SELECT rowid, * FROM {table} WHERE rowid > ? ORDER BY rowid LIMIT {_AT_ONCE}"
        with self._told():
            while rows := self._connection.execute(next_rows, (last,)).fetchall():
                last = rows[-1][0]
                for _, *row, found in rows:
                    seal = found if seal is None else zlib.crc32(_row_bytes(row), seal)
                    if seal != found:
                        raise RunError(f"{self.path}: row {n + 1} of {table} is not what was written; {HINT}")
                    n += 1
                    yield tuple(row)
        if n != self._seals[table][0] or seal not in (None, self._seals[table][1]):
            raise RunError(f"{self.path}: {table} has {n} rows, {self._seals[table][0]} were written; {HINT}")

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
        lesson = None if event.lesson is None else self._demonstration(event.lesson)
        self._append("events", [event_row(event, self._movements, lesson, self.dims)])
        self._movements = movements_after(self._movements, event.kind)

    def add_rows(self, table: str, rows: Iterable[Sequence[Any]]) -> None:
        """Append rows to one of the ``DERIVED`` tables; NaN is stored as NULL."""
        self._append(table, [plain(row) for row in rows])

    def replace_rows(self, table: str, rows: Iterable[Sequence[Any]]) -> None:
        """Replace all rows of a table."""
        with self._told(writing=True):
            self._connection.execute(f"DELETE FROM {table}")
        self._seals[table] = 0, self._first_seal(table) or 0
        self._append(table, [plain(row) for row in rows])

    def settle(self, **about: Any) -> None:
        """Add or replace entries of ``about``; json must be able to express their values."""
        self.about |= about
        self.replace_rows("about", _about_rows(self.about))

    def commit(self, *, wait: bool = True) -> bool:
        """Bring all new rows to the disk, or none of them.

        Args:
            wait: whether to wait for other programs that are reading the file. If False, the rows stay for the next
                commit while a program is reading.

        Returns:
            Whether the rows are on the disk.

        Raises:
            OSError: the disk is full or cannot be written; earlier commits remain.
            RunError: another process has written in the meantime, or has read for too long.
        """
        seals = [(n, seal, table) for table, (n, seal) in self._seals.items()]
        with self._told(writing=True):
            self._connection.execute(f"PRAGMA busy_timeout = {int(1000 * (_PATIENCE if wait else _IMPATIENCE))}")
            self._connection.executemany("UPDATE seals SET n_rows = ?, seal = ? WHERE name = ?", seals)
            try:
                self._connection.execute("COMMIT")
            except sqlite3.OperationalError as error:
                if wait or error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                    raise
                return False
            self._lock()
        return True

    def check(self) -> dict[str, str]:
        """Error messages about damaged tables, by name of the table; {} if no table is damaged."""
        wrong = {}
        for table in layout(self.dims):
            try:
                for _ in self.rows(table):
                    pass
            except RunError as error:
                wrong[table] = str(error)
        return wrong

    def rewrite(self) -> Record:
        """Replace the file by a new one with all events before the first damaged row, and close this record.

        Returns:
            The new record, open for writing. Its ``DERIVED`` tables are empty until a replay fills them again.

        Raises:
            OSError: the file cannot be written.
        """
        about = {name: value for name, value in self.about.items() if name not in ("run", "dims")}
        shown = list[Demonstration]()
        with replacing(self.path) as partial:
            with Record.make(partial, self.dims, about) as new:
                with suppress(RunError):
                    for row in self.rows("demonstrations"):
                        shown.append(read_demonstration(row, self.dims))
                with suppress(RunError, IndexError):  # IndexError: an event refers to a lost demonstration
                    asked: list[Event] = []  # a request is kept with the demonstration that follows, or not at all
                    for event in map(event_reader(self.dims, shown), self.rows("events")):
                        asked.append(event)
                        if event.kind != Kind.ASKED or event.reply != "shown":
                            for each in asked:
                                new.add(each)
                            asked.clear()
                new.commit()
            self.close()
        return Record(self.path, write=True)

    def _demonstration(self, shown: Demonstration) -> int:
        """The row number of a demonstration; a new demonstration is appended first."""
        row = demonstration_row(shown, self.dims)
        if not self._shown:
            self._shown = {_row_bytes(each): k for k, each in enumerate(self.rows("demonstrations"))}
        key = _row_bytes(row)
        if key not in self._shown:
            self._shown[key] = len(self._shown)
            self._append("demonstrations", [row])
        return self._shown[key]

    def _append(self, table: str, rows: Sequence[Row]) -> None:
        if rows:
            n, seal = self._seals[table]
            new = _sealed(rows, seal)
            with self._told(writing=True):
                marks = ", ".join("?" * len(new[0]))
                self._connection.executemany(f"INSERT INTO {table} VALUES ({marks})", new)
            self._seals[table] = n + len(new), new[-1][-1]

    def _first_seal(self, table: str) -> int | None:
        """The seal before the first row; None if the number of the run is lost, so the first row is believed."""
        if table == "about":
            return _root("", table)
        return _root(self.about["run"], table) if "run" in self.about else None

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
        found = dict(self._connection.execute("SELECT name, sql FROM sqlite_schema").fetchall())
        if not found:
            raise RunError("it is still empty")
        self._seals = {name: (n, seal) for name, n, seal in self._connection.execute("SELECT * FROM seals")}
        c, p, t = (found["events"].count(f" {name}_") for name in ("context", "theta", "outcome"))
        self.dims: Dims = c, p, t
        tables = _tables(self.dims)  # a viewer may have added an index, a view or statistics
        if {name: found.get(name) for name in tables} != tables or self._seals.keys() != layout(self.dims).keys():
            raise RunError(f"its tables are not those of a record; {HINT}")
        self.about = self._whole_about()
        last = self._connection.execute("SELECT movement, kind FROM events ORDER BY rowid DESC LIMIT 1").fetchone()
        self._movements = 0 if last is None else movements_after(*last)

    def _whole_about(self) -> dict[str, Any]:
        """The entries of ``about`` that are as they were written."""
        about, before = dict[str, Any](), _root("", "about")
        with suppress(sqlite3.DatabaseError, TypeError):  # a page of the table is damaged, or a seal is no number
            for name, value, seal in self._connection.execute("SELECT * FROM about ORDER BY rowid"):
                if zlib.crc32(_row_bytes((name, value)), before) == seal:
                    about[name] = json.loads(value)
                before = seal
        return about

    def _lock(self) -> None:
        """Lock the file against other writers until this record is closed; readers are still admitted."""
        before = self._version
        self._connection.execute("BEGIN IMMEDIATE")
        self._version = self._connection.execute("PRAGMA data_version").fetchone()
        if before not in (None, self._version):
            raise RunError("another process has written to it")

    @contextmanager
    def _told(self, *, writing: bool = False) -> Iterator[None]:
        """Turn errors of SQLite, and errors from unexpected values, into RunError or OSError with the path."""
        if self._lost is not None:
            raise self._lost
        said: Exception
        try:
            yield
        except (RunError, sqlite3.Error, ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            if isinstance(error, RunError):
                said = error if str(self.path) in str(error) else RunError(f"{self.path}: {error}")
            elif isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
                said = RunError(f"{self.path} is in use by another process; wait for it, or choose another --out")
            elif writing:
                said = OSError(f"{self.path} cannot be written: {error}")
            else:
                said = RunError(f"{self.path} cannot be read as a record: {error}; {HINT}")
            if writing:  # the next rows would follow a gap
                self._lost = said
                self._connection.close()
            raise said from error


def _connect(path: Path, write: bool) -> sqlite3.Connection:
    # Never open the file here in another way: closing it would release all locks that this process has on the file.
    if not path.is_file():
        raise RunError(f"there is no record {path}")
    if not path.stat().st_size:
        raise RunError(f"{path} is still empty")
    try:
        # Readers need mode=rw, too, to clean up after a killed writer. SQLite still opens a read-only file for reading.
        # check_same_thread=False: teaching by hand opens the record in one thread and later uses it in another.
        place, patience = f"{path.resolve().as_uri()}?mode=rw", 0.5 if write else 10.0
        return sqlite3.connect(place, uri=True, isolation_level=None, timeout=patience, check_same_thread=False)
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path} cannot be opened: {error}") from error


def _tables(dims: Dims) -> dict[str, str]:
    """The statement that creates each table."""
    every = {**layout(dims), "seals": SEALS}
    return {name: f"CREATE TABLE {name} ({', '.join(columns)})" for name, columns in every.items()}


def _about_rows(about: Mapping[str, Any]) -> list[Row]:
    return [(name, json.dumps(value)) for name, value in about.items()]


def _root(run: str, table: str) -> int:
    """The seal with which the checksums of a table begin, before its first row."""
    return zlib.crc32(f"{run} {table}".encode())


def _row_bytes(row: Sequence[Any]) -> bytes:
    """A row as bytes, for its seal. Binary floats take a fifth of the time of text."""
    return marshal.dumps(tuple(row), 2)


def _sealed(rows: Iterable[Row], seal: int) -> list[Row]:
    return [(*row, seal := zlib.crc32(_row_bytes(row), seal)) for row in rows]
