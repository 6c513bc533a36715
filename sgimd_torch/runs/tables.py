"""What evaluations leave on disk: evaluation.csv, and regions.csv, the interest map as it was at each of them.

Both tables begin each line with the number of movements before the evaluation. ``runfiles.py`` explains all files.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.goals.regions import Region
from sgimd_torch.runs.log import RunError, dropped, numbers, write_whole

EVALUATION = ("movements", "mean_error_m", "median_error_m", "p90_error_m", "noise_floor_m")
_WHOLE = ("movements", "attempts", "goals")  # columns of whole numbers


class Evaluations:
    """The evaluations of one run: those found in its directory, then those ``add``-ed.

    Args:
        directory: of the run.
        region_dims: dimensions of C x T, where the learner has an interest map; None where it has none.
        notes: gets a line for each table of which something was dropped.
    """

    def __init__(self, directory: Path, region_dims: int | None, notes: list[str]) -> None:
        self._errors = _Table(directory / "evaluation.csv", EVALUATION, notes)
        self._regions = None
        if region_dims is not None:
            self._regions = _Table(directory / "regions.csv", _region_columns(region_dims), notes)

    def __contains__(self, movements: int) -> bool:
        return movements in self._errors.rows

    @property
    def last(self) -> dict[str, float]:
        """Its columns, {} before the first."""
        if not self._errors.rows:
            return {}
        row = self._errors.rows[max(self._errors.rows)][0]
        return dict(zip(EVALUATION, map(float, row.split(",")), strict=True))

    def keep(self, movements: Iterable[int]) -> None:
        """Drop all but those after these numbers of ``movements``."""
        wanted = set(movements)
        if self._regions is not None:
            self._regions.keep(wanted)
            wanted &= self._regions.rows.keys()
        self._errors.keep(wanted)

    def begin(self) -> None:
        """Start to write; from now on every change goes to disk."""
        if self._regions is not None:
            self._regions.begin()
        self._errors.begin()

    def add(self, movements: int, evaluation: Evaluation, regions: Sequence[Region]) -> None:
        """Keep an evaluation, and the interest map as it was then."""
        if self._regions is not None:
            self._regions.put(movements, [_region_fields(region) for region in regions])
        errors = evaluation.errors
        row = [evaluation.mean_error, np.median(errors), np.quantile(errors, 0.9), evaluation.noise_floor]
        self._errors.put(movements, [numbers(np.array(row), len(row))])


def read_table(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray] | None:
    """An array for each column, None if there is no such file; ``names`` None takes those of its first line.

    Raises:
        RunError: it cannot be read.
    """
    if not path.exists():
        return None
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RunError(f"{path} cannot be read: {error.strerror}") from error
    header = content.partition(b"\n")[0].decode(errors="replace") if names is None else ",".join(names)
    groups, _ = _read_rows(content, header)
    columns = header.split(",")
    rows = [row.split(",") for group in groups.values() for row in group]
    table = np.array(rows, dtype=np.str_).reshape(len(rows), len(columns))
    return {
        name: table[:, k] if name == "path" else table[:, k].astype(np.int64 if name in _WHOLE else np.float64)
        for k, name in enumerate(columns)
    }


class _Table:
    """A small csv file whose first column is the number of movements; once begun, it is replaced at every change."""

    def __init__(self, path: Path, names: Sequence[str], notes: list[str]) -> None:
        self.path = path
        self.header = ",".join(names)
        self.rows: dict[int, list[str]] = {}
        self._begun = False
        if path.exists():
            content = path.read_bytes()
            self.rows, whole = _read_rows(content, self.header)
            if whole < len(content):
                notes.append(dropped(path, content[whole:], "it will be evaluated again"))

    def begin(self) -> None:
        self._begun = True
        self._write()

    def keep(self, movements: set[int]) -> None:
        self.rows = {key: rows for key, rows in self.rows.items() if key in movements}

    def put(self, movements: int, rows: list[list[str]]) -> None:
        self.rows[movements] = [",".join([str(movements), *fields]) for fields in rows]
        if self._begun:
            self._write()

    def _write(self) -> None:
        lines = [self.header, *(line for key in sorted(self.rows) for line in self.rows[key])]
        write_whole(self.path, "".join(f"{line}\n" for line in lines))


def _region_columns(dims: int) -> tuple[str, ...]:
    corners = [f"{corner}_{k}" for corner in ("low", "high") for k in range(dims)]
    return ("movements", "path", *corners, "attempts", "goals", "competence", "interest")


def _region_fields(region: Region) -> list[str]:
    n = len(region.competences)
    competence = float(region.competences.mean()) if n else math.nan
    corners = numbers(region.low, len(region.low)) + numbers(region.high, len(region.high))
    return [region.path, *corners, str(region.attempts), str(n), repr(competence), repr(region.interest())]


def _read_rows(content: bytes, header: str) -> tuple[dict[int, list[str]], int]:
    """Rows by number of movements, and how many bytes they make; what follows the first damaged line is left out."""
    lines = content.splitlines(keepends=True)
    if not lines or lines[0] != f"{header}\n".encode():
        return {}, 0
    columns = ["movements", *header.split(",")[1:]]
    groups: dict[int, list[str]] = {}
    for line in lines[1:]:
        fields = line.decode(errors="replace").removesuffix("\n").split(",")
        if not line.endswith(b"\n") or len(fields) != len(columns) or not all(map(_is_value, columns, fields)):
            break
        groups.setdefault(int(fields[0]), []).append(",".join(fields))
    if header.startswith("movements,path,"):
        groups = {movements: rows for movements, rows in groups.items() if _is_whole_tree(rows)}
    kept = sum(len(row) + 1 for rows in groups.values() for row in rows)
    return groups, len(lines[0]) + kept


def _is_value(column: str, field: str) -> bool:
    if column in _WHOLE:
        return re.fullmatch("0|[1-9][0-9]{0,17}", field) is not None
    if column == "path":
        return re.fullmatch("R[01]*", field) is not None
    try:
        float(field)
    except ValueError:
        return False
    return True


def _is_whole_tree(rows: list[str]) -> bool:
    """Whether the regions are all leaves of one tree: each cut halves what its leaves count for."""
    return sum(0.5 ** (len(row.split(",")[1]) - 1) for row in rows) == 1
