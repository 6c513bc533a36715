"""The files that evaluations write: evaluation.csv; by_context.csv, where there are contexts; and regions.csv, the
regions of the goal model at each of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.evaluation import PARTS, Evaluation
from sgimd_torch.goals.regions import Region
from sgimd_torch.runs.tables import EVALUATION, Rows, Table, numbers, small_table
from sgimd_torch.spaces import Box


class Evaluations:
    """The evaluations of one run: those found in its directory, then those ``add``-ed.

    Args:
        directory: of the run.
        contexts: C.
        region_dims: dimensions of C x T, where the goal model has regions; None where it has none.
        notes: gets lines on what was dropped.
    """

    def __init__(self, directory: Path, contexts: Box, region_dims: int | None, notes: list[str]) -> None:
        self._contexts = contexts
        tables = [small_table(directory / "evaluation.csv", 0)]
        if contexts.dim:
            tables.append(small_table(directory / "by_context.csv", 0))
        if region_dims is not None:
            tables.append(small_table(directory / "regions.csv", region_dims))
        self._rows: dict[Table, dict[int, Rows]] = {}  # by the number of movements before the evaluation
        self._begun = False
        for table in tables:
            found = table.read()
            notes += table.notes(found, "it will be evaluated again")
            self._rows[table] = {}
            for row in found.rows:
                self._rows[table].setdefault(int(row[0]), []).append(row)

    def __contains__(self, movements: int) -> bool:
        return all(movements in rows for rows in self._rows.values())

    @property
    def last(self) -> dict[str, float]:
        """The last evaluation of the run's own answers by column, {} before the first."""
        evaluated, *_ = self._rows.values()
        if not evaluated:
            return {}
        row = dict(zip(EVALUATION, evaluated[max(evaluated)][0], strict=True))
        return {name: float(field) for name, field in row.items() if name != "answer"}

    def keep(self, movements: Iterable[int], answers: Sequence[str]) -> None:
        """Keep only those after these numbers of ``movements`` that have these ``answers``, in all parts of C."""
        evaluated, *others = self._rows.values()
        complete = {number for number, rows in evaluated.items() if [row[1] for row in rows] == [*answers]}
        if self._contexts.dim:
            n_parts = len(answers) * PARTS * self._contexts.dim
            complete = {number for number in complete if len(others[0].get(number, ())) == n_parts}
        wanted = {number for number in movements if number in self and number in complete}
        for table, rows in self._rows.items():
            self._rows[table] = {number: rows[number] for number in wanted}

    def begin(self) -> None:
        """Start to write; from now on every change goes to disk."""
        self._begun = True
        for table in self._rows:
            self._write(table)

    def add(self, movements: int, found: Mapping[str, Evaluation], near: float, regions: Sequence[Region]) -> None:
        """Keep an evaluation, and the regions as they were then.

        Args:
            movements: before it.
            found: by answer, the run's own first.
            near: distance (m) at which a goal counts as met.
            regions: of the goal model, none if it has none.
        """
        rows = {
            "evaluation.csv": [[answer, *_errors(each, near)] for answer, each in found.items()],
            "by_context.csv": [
                [answer, *map(str, part)] for answer, each in found.items() for part in each.by_context(self._contexts)
            ],
            "regions.csv": [_fields(region) for region in regions],
        }
        for table in self._rows:
            self._rows[table][movements] = [[str(movements), *fields] for fields in rows[table.path.name]]
            if self._begun:
                self._write(table)

    def _write(self, table: Table) -> None:
        rows = self._rows[table]
        table.replace(row for number in sorted(rows) for row in rows[number])


def _errors(found: Evaluation, near: float) -> list[str]:
    errors = found.errors
    values = [found.mean_error, np.median(errors), np.quantile(errors, 0.9), found.noise_floor]
    return [*numbers(np.array(values), len(values)), str(found.met(near))]


def _fields(region: Region) -> list[str]:
    n = len(region.competences)
    competence = float(region.competences.mean()) if n else math.nan
    corners = numbers(region.low, len(region.low)) + numbers(region.high, len(region.high))
    return [region.path, *corners, str(region.attempts), str(n), repr(competence), repr(float(region.interest()))]
