"""The log of a run, a line for each movement; and all files of a run directory.

    config.json      every choice that makes the run
    versions.json    of Python, the libraries and this repository; "before": those of earlier parts of a resumed run
    episodes.csv     the log, append-only:
                         index, origin ("" at rest), demonstration (its row in the file, when one came just before),
                         context_*, theta_*, goal_*, outcome_*
    evaluation.csv   movements, answer, mean_error_m, median_error_m, p90_error_m, noise_floor_m, goals_met: a line for
                         each inverse model that answered
    by_context.csv   where there are contexts: the mean error in each third of each of them
    regions.csv      the regions of the goal model at each evaluation, a line for each, corners in C x T
    requests.csv     of a learner that asks, a line for each request: index of the movement that came next, teacher,
                         strategy, reply (see ``Episode``), shown (row of the demonstration, -1 without one), wanted_*
                         and got_*, the points of C x T that it asked for and that it was shown, apart_m, how far their
                         outcomes are from each other, and brought: by how much the best competence at the goal rose
    predictions.csv  with a forward model: what it predicted of each exemplar before learning it, and what happened
    refreshes.csv    with a forward model: a line each time that it has learnt
    summary.json     movements so far, the last evaluation, seconds spent on physics, learning and evaluating
    lessons/         what a person has shown, see teachers/by_hand.py
    lock             held by the process that writes
    *.lost-0         a log as it was found, where movements of it were missing or damaged

The csv files have a last column, crc32, the checksum of the fields before it. Numbers read back exactly, and no time of
day is written: equal seeds make the same csv files, byte for byte. A file that does not grow is replaced whole, so
nobody reads half of it.

``tables.py`` writes and reads such lines, ``directory.py`` writes a run directory, ``read.py`` reads it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.runs.tables import Rows, Table, numbers, sealed, small_table
from sgimd_torch.session import Answers, Recorded
from sgimd_torch.spaces import Array, Demonstration, Episode
from sgimd_torch.teachers.answering import Demonstrator

_LARGEST_JSON: Final = 16 * 2**20  # bytes


class RunError(ValueError):
    """A run directory cannot be used: it belongs to another run, is in use, is damaged, or holds no run."""


@dataclass(frozen=True)
class Columns:
    """The columns of the log: how many there are of each kind."""

    context_dim: int
    theta_dim: int
    outcome_dim: int

    @property
    def names(self) -> tuple[str, ...]:
        """In order, without the checksum."""
        return (
            *("index", "origin", "demonstration"),
            *(f"context_{k}" for k in range(self.context_dim)),
            *(f"theta_{k}" for k in range(self.theta_dim)),
            *(f"goal_{k}" for k in range(self.outcome_dim)),
            *(f"outcome_{k}" for k in range(self.outcome_dim)),
        )

    @property
    def header(self) -> bytes:
        """The first line of the log."""
        return self.table(Path()).header

    @classmethod
    def of(cls, directory: Path) -> Columns:
        """The columns that the first line of a run's log names; none if there is no log yet.

        Raises:
            RunError: it is not the first line of a log.
            OSError: the log cannot be read.
        """
        log = directory / "episodes.csv"
        if not os.path.lexists(log):
            return cls(0, 0, 0)
        with log.open("rb") as file:
            header = file.readline()
        columns = cls(*(header.count(name) for name in (b"context_", b"theta_", b"outcome_")))
        if header == columns.header:
            return columns
        if not header.endswith(b"\n") and b"index,".startswith(header[:6]):  # it is still being written
            return cls(0, 0, 0)
        names = f"the names of its columns, this one with {header[:60]!r}"
        raise RunError(f"{log}: a log begins with {names}; was it edited?")

    def table(self, directory: Path) -> Table:
        """The log of a run."""
        return Table(directory / "episodes.csv", self.names, grows=True, standing=_in_order)

    def line(self, episode: Episode, demonstration: int | None) -> bytes:
        """One episode; ``demonstration`` is the row of the one that came just before it."""
        move = episode.move
        fields = [str(episode.index), move.origin if move else "", "" if demonstration is None else str(demonstration)]
        fields += numbers(episode.context, self.context_dim)
        fields += numbers(move.theta if move else None, self.theta_dim)
        fields += numbers(move.goal if move else None, self.outcome_dim)
        fields += numbers(episode.outcome, self.outcome_dim)
        return sealed(fields)

    def split(self, rows: Rows) -> tuple[Array, Array, Array, Array]:
        """Contexts, thetas, goals and outcomes ``(n, dim)`` from n rows of fields; empty fields are NaN."""
        ends = np.cumsum([self.context_dim, self.theta_dim, self.outcome_dim, self.outcome_dim])
        fields = [[field or "nan" for field in row[3:]] for row in rows]
        values = np.array(fields, dtype=np.float64).reshape(len(rows), ends[-1])
        contexts, thetas, goals, outcomes = np.split(values, ends[:-1], axis=1)
        return contexts, thetas, goals, outcomes

    def difference(self, recorded: bytes, now: bytes) -> str:
        """Of two lines that should be the same: which columns differ, the first three in full."""
        were, are = (line.decode().split(",")[:-1] for line in (recorded, now))
        differences = [
            f"{name} was {old or 'empty'}, now {new or 'empty'}"
            for name, old, new in zip(self.names, were, are, strict=True)
            if old != new
        ]
        more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
        return (
            f"movement {were[0]} is replayed otherwise than recorded: {'; '.join(differences[:3])}{more}. "
            "Was it recorded by another version, or on another processor?"
        )

    def recorded(self, lines: Sequence[bytes]) -> list[Recorded]:
        """What ``session.replay`` needs of these lines."""
        rest, found = Recorded(None, None), list[Recorded]()
        for k in range(0, len(lines), 1000):  # the fields of all lines at once would take ten times their size
            _, thetas, _, outcomes = self.split([line.decode().split(",")[:-1] for line in lines[k : k + 1000]])
            found += [rest if np.isnan(o).any() else Recorded(t, o) for t, o in zip(thetas, outcomes, strict=True)]
        return found


class Requests:
    """The table of what a learner asked for; a run without requests has no file."""

    def __init__(self, directory: Path, dims: int) -> None:
        self.table, self.dims = small_table(directory / "requests.csv", dims), dims
        self._rows: Rows = []
        self._written: tuple[int, int] = 0, 0

    def answers(self, teachers: Mapping[str, Demonstrator], row_of: Callable[[Demonstration], int | None]) -> Answers:
        """What an earlier part of the run has written, so that a replay agrees with it and waits for nobody.

        Args:
            teachers: by name. What they have is taken from their ``demonstrations``; who has no such list is asked.
            row_of: of a demonstration, as in the table.
        """
        found: dict[tuple[int, str], tuple[Demonstration | None, str]] = {}
        for index, name, _, reply, *shown in (row[: 5 + 2 * self.dims] for row in self.table.read().rows):
            if reply != "shown":
                found[int(index), name] = None, reply
                continue
            for each in getattr(teachers.get(name), "demonstrations", ()):
                got = numbers(np.concatenate((each.context, each.outcome)), self.dims)
                if [str(row_of(each)), *got] == [shown[0], *shown[1 + self.dims :]]:
                    found[int(index), name] = each, reply
                    break
        return found

    def add(self, episode: Episode, row: int | None) -> None:
        """Any episode; ``row`` is that of its demonstration, None if it is not known or there was none."""
        if episode.request is None:
            return
        asked, shown = episode.request, episode.demonstration
        wanted = np.concatenate((episode.context, asked.goal))
        got = np.full(self.dims, np.nan) if shown is None else np.concatenate((shown.context, shown.outcome))
        apart = np.nan if shown is None else float(np.linalg.norm(shown.outcome - asked.goal))
        first = [str(episode.index), asked.teacher, asked.strategy, episode.reply, str(-1 if row is None else row)]
        self._rows.append([*first, *numbers(wanted, self.dims), *numbers(got, self.dims), repr(apart)])

    def write(self, brought: Sequence[float]) -> None:
        """Replace the file, if there is anything new; what the requests ``brought``, as far as it is known."""
        now = len(self._rows), len(brought)
        if now != self._written:
            known = [*map(repr, brought), *["nan"] * len(self._rows)]
            self.table.replace([*row, value] for row, value in zip(self._rows, known, strict=False))
            self._written = now


def read_json(path: Path, *, missing: Any) -> Any:
    """A json object; ``missing`` if there is no such file.

    Raises:
        RunError: it is damaged, or a directory.
    """
    try:
        size = path.stat().st_size
        if size > _LARGEST_JSON:
            raise ValueError(f"{size} bytes, at most {_LARGEST_JSON} are read")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return missing
    except (ValueError, OSError, RecursionError) as error:
        raise RunError(f"{path} cannot be read ({error}); was it edited, or the disk full?") from error
    if not isinstance(content, dict):
        raise RunError(f"{path} must hold a json object, got {type(content).__name__}; was it edited?")
    return content


def _in_order(rows: Iterable[list[str]]) -> int:
    """How many rows, from the first on, are numbered in order."""
    return sum(1 for _ in takewhile(lambda each: each[1][0] == str(each[0]), enumerate(rows)))
