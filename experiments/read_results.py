"""Reading results: the tables in results/, and the runs of a variant.

results = read_results("results/paper.csv"); results["sgim-d"].at(5000)    # {seed: mean error (m)}
runs = read_seeds(Path("runs"), "sgim-d")
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.runs.config import OWN
from sgimd_torch.runs.process import say
from sgimd_torch.runs.read import Run, read_run
from sgimd_torch.spaces import Array

HEADER = (
    *("experiment", "variant", "teacher", "task_space", "seed", "movements", "answer"),
    *("mean_error_m", "noise_floor_m", "tiles_reached", "goals_claimed", "goals_met"),
)
GOALS_HEADER = ("variant", "seed", "n_goals", "n_near")
CONTEXTS_HEADER = ("variant", "seed", "movements", "answer", "low", "high", "mean_error_m")
ASKED_HEADER = ("variant", "seed", "teacher", "requests", "shown", "late", "late_own", "strong", "weak")
SAID_HEADER = ("claim", "number", "verdict")
MODEL_HEADER = (
    *("run", "predicted", "error_m", "inside_50_last", "inside_80_last", "inside_95_last"),
    *("inside_50_late", "inside_80_late", "inside_95_late", "improved", "refreshes", "diverged", "ms_per_refresh"),
)
REGIONS: Final = (50, 80, 95)  # percent of the outcomes that a region of the model should hold
UNKNOWN: Final = ("", "nan")
MAY_BE_UNKNOWN: Final = ("noise_floor_m", "goals_claimed", "goals_met")
LEARNERS: Final = ("random", "sagg-riac", "observation", "imitation", "sgim-d")  # the paper's five
FRESH: Final = 100  # the first seed that was not looked at while defaults were changed
FIRST: Final = 250  # movements before the first evaluation
LAST: Final = 5000  # movements in the life of a learner of the paper


class ResultsError(ValueError):
    """A table of results that is missing or damaged."""


class Values(NamedTuple):
    """One evaluation of one run: m, m, then numbers of tiles and goals; NaN for what was not measured.

    ``claimed`` goals are near an outcome in the log, which luck may have brought there; ``met`` ones were reached
    when the answer for them was executed.
    """

    errors: float
    floors: float
    tiles: float
    claimed: float
    met: float


@dataclass(frozen=True, eq=False)
class Evaluated:
    """All evaluations of one variant of an experiment by one answer, by seed and movements."""

    variant: str
    experiment: str
    rows: dict[tuple[int, int], Values]

    def at(self, movements: int, values: str = "errors") -> dict[int, float]:
        """Seed -> value of a field of ``Values`` after these ``movements``, for seeds that have one."""
        found = {seed: getattr(row, values) for (seed, when), row in sorted(self.rows.items()) if when == movements}
        return {seed: value for seed, value in found.items() if math.isfinite(value)}

    def curves(self, last: int = LAST) -> tuple[Array, Array]:
        """Movements ``(n,)`` and errors ``(n_seeds, n)`` m up to ``last``, for seeds that have all evaluations."""
        times, seeds = sorted({when for _, when in self.rows if when <= last}), sorted({seed for seed, _ in self.rows})
        whole = [seed for seed in seeds if all((seed, when) in self.rows for when in times)]
        errors = [[self.rows[seed, when].errors for when in times] for seed in whole]
        return np.array(times, dtype=np.float64), np.array(errors).reshape(len(whole), len(times))


def read_results(path: str | os.PathLike[str], answer: str = OWN) -> dict[str, Evaluated]:
    """All variants of the table, in the order of the file, with their evaluations by one ``answer``.

    Raises:
        ResultsError: there is no such table, or a line of it makes no sense; the message names the line.
    """
    found: dict[str, Evaluated] = {}
    runs: dict[str, tuple[str, str, float]] = {}
    for where, row in _counted(read_rows(path, HEADER)):
        variant, seed, movements = row["variant"], _count(row, "seed", where), _count(row, "movements", where)
        run = (row["experiment"], row["teacher"], number(row, "task_space", where))
        if runs.setdefault(variant, run) != run:
            raise ResultsError(f"{where}: {variant} is {run}, on an earlier line {runs[variant]}; rename one")
        rows = found.setdefault(variant, Evaluated(variant, row["experiment"], {})).rows
        known = {name: number(row, name, where) if row[name] not in UNKNOWN else math.nan for name in MAY_BE_UNKNOWN}
        floor, claimed, met = known.values()
        values = Values(number(row, "mean_error_m", where), floor, _count(row, "tiles_reached", where), claimed, met)
        if row["answer"] != answer:
            continue
        if (seed, movements) in rows:
            raise ResultsError(f"{where}: seed {seed} of {variant} is there twice at {movements} movements")
        rows[seed, movements] = values
    if not found:
        raise ResultsError(f"{path} has no line below its header; is the comparison still to be run?")
    return found


def _counted(rows: Iterable[tuple[str, dict[str, str]]]) -> list[tuple[str, dict[str, str]]]:
    """Once there are fresh seeds, the rows of others do not count."""
    rows = list(rows)
    fresh = [row for row in rows if row[1]["seed"].isdigit() and int(row[1]["seed"]) >= FRESH]
    return fresh or rows


def read_goals(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Variant -> ``(n_seeds, 2)``: how many goals a run chose, and how many of them near the origin; {} without file.

    Raises:
        ResultsError: a line makes no sense.
    """
    found: dict[str, list[tuple[int, int]]] = {}
    for where, row in _counted(read_rows(path, GOALS_HEADER, optional=True)):
        goals, near = _count(row, "n_goals", where), _count(row, "n_near", where)
        if not near <= goals or goals == 0:
            raise ResultsError(f"{where}: n_near must be at most n_goals, and n_goals above 0, got {near} and {goals}")
        found.setdefault(row["variant"], []).append((goals, near))
    return {variant: np.array(counts, dtype=np.float64) for variant, counts in found.items()}


class Asked(NamedTuple):
    """Requests of one run to one teacher: all, those that were answered, those late in life and of these those in the
    teacher's own half (meant for teachers of a half), those in a strong and in a weak wind."""

    requests: float
    shown: float
    late: float
    late_own: float
    strong: float
    weak: float


def read_asked(path: str | os.PathLike[str]) -> dict[str, dict[int, dict[str, Asked]]]:
    """Variant -> seed -> teacher -> requests; {} without file.

    Raises:
        ResultsError: a line makes no sense.
    """
    found: dict[str, dict[int, dict[str, Asked]]] = {}
    for where, row in read_rows(path, ASKED_HEADER, optional=True):
        counts = Asked(*(number(row, name, where) if row[name] not in UNKNOWN else math.nan for name in Asked._fields))
        found.setdefault(row["variant"], {}).setdefault(_count(row, "seed", where), {})[row["teacher"]] = counts
    return found


ByPart = dict[tuple[str, int, str, tuple[float, float]], dict[int, float]]
"""(variant, movements, answer, (low, high) of a part of C) -> seed -> mean error (m)."""


def read_contexts(path: str | os.PathLike[str]) -> ByPart:
    """Errors by part of C; {} without file.

    Raises:
        ResultsError: a line makes no sense.
    """
    found: ByPart = {}
    for where, row in read_rows(path, CONTEXTS_HEADER, optional=True):
        try:
            part = float(row["low"]), float(row["high"])
        except ValueError:
            raise ResultsError(f"{where}: low and high must be numbers, got {row['low']!r}, {row['high']!r}") from None
        key = row["variant"], _count(row, "movements", where), row["answer"], part
        found.setdefault(key, {})[_count(row, "seed", where)] = number(row, "mean_error_m", where)
    return found


def read_coverages(path: str | os.PathLike[str]) -> dict[str, dict[int, Array]]:
    """Variant -> 50, 80 or 95 -> ``(n_seeds,)``, the share of outcomes in the model's regions of so many percent, from
    2000 movements on; {} without file.

    Raises:
        ResultsError: a line makes no sense.
    """
    found: dict[str, list[list[float]]] = {}
    for where, row in read_rows(path, MODEL_HEADER, optional=True):
        names = [f"inside_{region}_late" for region in REGIONS]
        if not any(row[name] in UNKNOWN for name in names):
            found.setdefault(row["run"].split("/")[0], []).append([number(row, name, where) for name in names])
    return {variant: dict(zip(REGIONS, np.array(shares).T, strict=True)) for variant, shares in found.items()}


def read_rows(
    path: str | os.PathLike[str], header: tuple[str, ...], *, optional: bool = False
) -> Iterator[tuple[str, dict[str, str]]]:
    """The place of each line, for messages, and its fields by name; nothing if an ``optional`` table has no file.

    Raises:
        ResultsError: it is missing, cannot be read, or is another table.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError):
        if optional:
            return
        raise ResultsError(f"{path} does not exist; experiments/compare.py writes it") from None
    except OSError as error:
        raise ResultsError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ResultsError(f"{path} is no text: {error.reason}") from error
    lines = csv.reader(text.splitlines())
    first = next(lines, [])
    if tuple(first) != header:
        raise ResultsError(
            f"{path} must begin with {','.join(header)}, got {','.join(first)[:100]!r}; is it another table?"
        )
    for fields in lines:
        where = f"{path}, line {lines.line_num}"
        if len(fields) != len(header):
            raise ResultsError(f"{where} has {len(fields)} fields, not {len(header)}; was writing cut short?")
        yield where, dict(zip(header, fields, strict=True))


def read_said(path: str | os.PathLike[str]) -> dict[str, tuple[str, str]]:
    """Claim -> our number and the verdict in an earlier version of the page; {} without file.

    Raises:
        ResultsError: it is another table.
    """
    return {row["claim"]: (row["number"], row["verdict"]) for _, row in read_rows(path, SAID_HEADER, optional=True)}


def read_seeds(folder: Path, variant: str) -> list[Run]:
    """All runs of a variant in a folder of run directories, finished or not; there may be none.

    Raises:
        RunError: one is damaged.
    """
    paths = sorted(config.parent for config in folder.glob(f"{variant}/seed-*/config.json"))
    if paths:
        say(f"reading {folder}/{variant}: {len(paths)} runs")
    return [read_run(path) for path in paths]


def number(row: dict[str, str], name: str, where: str) -> float:
    """A finite number of 0 or more.

    Raises:
        ResultsError: it is not; the message says where.
    """
    try:
        value = float(row[name])
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise ResultsError(f"{where}: {name} must be a finite number of 0 or more, got {row[name]!r}")
    return value


def _count(row: dict[str, str], name: str, where: str) -> int:
    if not row[name].isascii() or not row[name].isdigit():
        raise ResultsError(f"{where}: {name} must be a whole number, got {row[name]!r}")
    return int(row[name])
