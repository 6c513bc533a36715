"""The tables of results: the results of each finished run, collected from its directory and merged with earlier rows.

table = Table(Path("results/paper.csv"), *RESULTS); table.merge(result_rows("learners", config, run)); table.rows()
A row made again from a run is the row that was there, byte for byte.
"""

from __future__ import annotations

import csv
import io
import math
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from read_results import ASKED_HEADER, CONTEXTS_HEADER, GOALS_HEADER, HEADER
from sgimd_torch.catalogue import ROD
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.files import lock, write_text
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run
from sgimd_torch.runs.tasks import benchmark_of, demonstrations_of
from sgimd_torch.spaces import Array
from sgimd_torch.teachers.answering import middle
from variants import ARMS, teacher_of

Key = tuple[str, ...]
# Columns, and which of them identify a row.
RESULTS: Final = (HEADER, ("variant", "seed", "movements", "answer"))
GOALS: Final = (GOALS_HEADER, ("variant", "seed"))
COLUMNS: Final = {
    "goals.csv": GOALS,
    "asked.csv": (ASKED_HEADER, ("variant", "seed", "teacher")),
    "contexts.csv": (CONTEXTS_HEADER, ("variant", "seed", "movements", "answer", "low")),
}
LATE: Final = 1000  # movements; from then on a learner should know whom to ask
CORNER = -1.0  # m, where the tiles of a benchmark begin in x and y: the corner of T, of rod and arms
NEAR = 1.5  # m from the base: goals farther away cannot be reached


@dataclass(frozen=True)
class Table:
    """A csv file that several processes may add rows to; it is replaced whole.

    Args:
        path: of the file, in a folder that exists.
        columns: their names, the first line of the file.
        key: names of the columns that identify a row.
    """

    path: Path
    columns: Sequence[str]
    key: Sequence[str]

    def rows(self) -> dict[Key, list[str]]:
        """Every row by its key, none without a file. An incomplete last line counts as missing.

        Raises:
            RunError: the file is another table, or damaged.
            OSError: it cannot be read.
        """
        try:
            content = self.path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return {}
        header = _text([self.columns]).encode()
        if not (content.startswith(header) or header.startswith(content)):
            raise RunError(f"{self.path} must begin with {','.join(self.columns)}; is it another table?")
        lines = csv.reader(io.StringIO(content[len(header) : content.rfind(b"\n") + 1].decode(errors="replace")))
        rows: dict[Key, list[str]] = {}
        for row in lines:
            if len(row) != len(self.columns) or not all(self._key(row)):
                where = f"{self.path}, line {lines.line_num + 1}"
                raise RunError(f"{where} is not a row of {','.join(self.columns)}; was it edited?")
            rows[self._key(row)] = row
        return rows

    def merge(self, rows: Sequence[Sequence[object]]) -> None:
        """Add rows, or replace those with the same key; the others stay as they are, in their order.

        Raises:
            RunError: see ``rows``.
            OSError: it cannot be written; then it is unchanged.
        """
        new = [[as_text(value) for value in row] for row in rows]
        with _alone(self.path.parent):
            merged = self.rows() | {self._key(row): row for row in new}
            write_text(self.path, _text([self.columns, *merged.values()]))

    def _key(self, row: Sequence[str]) -> Key:
        return tuple(row[self.columns.index(name)] for name in self.key)


def result_rows(experiment: str, config: Config, run: Run) -> list[list[object]]:
    """A row of ``RESULTS`` for each evaluation of a finished run and each of its answers."""
    benchmark, low = _benchmark(config["environment"], config.benchmark)
    corner = CORNER if config["environment"] in (ROD, *ARMS) else low
    columns = ("movements", "mean_error_m", "noise_floor_m", "goals_met")
    found = {
        (int(movements), answer): (float(error), float(floor), float(met))
        for answer, each in run.answers.items()
        for movements, error, floor, met in zip(*(each[name] for name in columns), strict=True)
    }
    space = config.values.get("environment.task_space", 1.0)
    first = (experiment, config.variant, teacher_of(config), space, config.seed)
    rows: list[list[object]] = []
    for movements in run.evaluation["movements"].tolist():
        landed = run.outcomes[:movements]
        reached = tiles_reached(landed, benchmark, corner), goals_claimed(landed, benchmark)
        for answer in run.answers:
            error, floor, met = found[movements, answer]
            rows.append([*first, movements, answer, error, floor, *reached, met if math.isnan(met) else int(met)])
    return rows


def goal_rows(config: Config, run: Run) -> list[list[object]]:
    """The row of ``GOALS``: how many goals a learner chose for itself, and how many of them can be reached. None for a
    learner without goals."""
    goals = run.chosen_goals()
    near = int((np.linalg.norm(goals, axis=1) <= NEAR).sum())
    return [[config.variant, config.seed, len(goals), near]] if len(goals) else []


def asked_rows(config: Config, run: Run) -> list[list[object]]:
    """A row for each teacher that could be asked: how often, and where; none for a learner that does not ask."""
    if "teachers" not in config:
        return []
    task = task_of(config)
    dim, contexts = task.environment.contexts.dim, task.environment.contexts
    asked = run.requests or {"teacher": np.empty(0, dtype=np.str_)}
    rows: list[list[object]] = []
    for teacher in config["teachers"]:
        mine = asked["teacher"] == teacher
        if not mine.any():
            rows.append([config.variant, config.seed, teacher, 0, 0, 0, 0, 0, 0])
            continue
        late = mine & (asked["index"] >= LATE)
        own = asked[f"wanted_{dim}"] < middle(demonstrations_of(task, config.demonstrations)[0])
        own = own if teacher == "low-half" else ~own
        near_border = np.zeros(len(mine))
        if dim:
            near_border = np.abs(2 * (asked["wanted_0"] - contexts.low[0]) / contexts.sides[0] - 1)
        strong, weak = mine & (near_border > 2 / 3), mine & (near_border < 1 / 3)
        counts = [mine, mine & (asked["reply"] == "shown"), late, late & own, strong, weak]
        rows.append([config.variant, config.seed, teacher, *(int(each.sum()) for each in counts)])
    return rows


def context_rows(config: Config, run: Run) -> list[list[object]]:
    """A row for each evaluation, answer and part of C that had goals; none where there is no context, or several."""
    if run.by_context is None or run.contexts.shape[1] != 1:
        return []
    names = ("movements", "answer", "low", "high", "mean_error_m")
    rows = zip(*(run.by_context[name].tolist() for name in names), strict=True)
    return [[config.variant, config.seed, *row] for row in rows if not math.isnan(row[-1])]


ROWS: Final = {"goals.csv": goal_rows, "asked.csv": asked_rows, "contexts.csv": context_rows}


def tiles_reached(outcomes: Array, benchmark: Benchmark, corner: Array | float = CORNER) -> int:
    """How many of the benchmark's tiles, one for each of its goals, hold one or more of the ``outcomes``.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: its tiles were laid out from ``corner``, those of rod and arms from -1 m, whatever their T.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    reached, wanted = (
        {tuple(tile) for tile in np.floor((points - corner) / benchmark.side).tolist()}
        for points in (landed, benchmark.goals)
    )
    return len(reached & wanted)


def goals_claimed(outcomes: Array, benchmark: Benchmark) -> int:
    """How many of the benchmark's goals have one or more of the ``outcomes`` within half a tile's side.

    These are claims: noise may have carried a movement there once. Whether the learner can do it again, the goals that
    are met in evaluations say.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: its goals.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    if not len(landed):
        return 0
    distances, _ = KDTree(landed).query(benchmark.goals)
    return int((distances <= benchmark.side / 2).sum())


@cache
def _benchmark(environment: str, path: Path | None) -> tuple[Benchmark, Array]:
    """With the lower corner of T."""
    task = task_of(Config(parts={"environment": environment}))
    return benchmark_of(task, path)[0], task.environment.outcomes.low


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """In this block, no other process changes a table of this folder."""
    while True:
        try:
            held = lock(folder / ".lock")
            break
        except BlockingIOError:
            time.sleep(0.05)  # the other process only writes a file
    try:
        yield
    finally:
        os.close(held)


def _text(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def as_text(value: object) -> str:
    """A field of a table. Numbers read back exactly; NaN is left empty."""
    return "" if isinstance(value, float) and math.isnan(value) else str(value)
