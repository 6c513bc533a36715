"""The table of results, one row for each variant, and tables on stdout, as text or as csv.

    for column in results(variants): column.head, column.texts()    # of sgimd table and of sgimd report
    print_table([("variant", "error (m)"), ("sgim-d", "0.123"), ("random", "0.456")])    # the first row is the head

Over seeds, every number is an interquartile mean: one bad seed does not move it. Over the goals of an evaluation there
are both the mean, eq. (10), and the median: a few goals that are missed by far move only the mean.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.evaluation import RECENT
from sgimd_torch.extras.table.statistics import Interval, interval_text, over_seeds
from sgimd_torch.extras.table.variants import EARLY, Variant, unit_of
from sgimd_torch.runs.messages import printable

MISSING: Final = "-"  # text of a number that is not known


class Column(NamedTuple):
    """A column of a table: a head, a number for each variant, and the form of the numbers as text."""

    head: str
    cells: Sequence[Interval | None]
    form: str = ".3f"

    def texts(self) -> list[str]:
        """Numbers as texts, with their intervals in brackets."""
        return [MISSING if cell is None else interval_text(cell, self.form) for cell in self.cells]

    def parts(self) -> list[list[str]]:
        """Columns, with their heads, of all digits: of the numbers and, if there are any, of the ends of intervals."""
        ends = ("", " low", " high") if any(cell and np.isfinite(cell.low) for cell in self.cells) else ("",)
        values = [[None] * 3 if cell is None else cell for cell in self.cells]
        texts = [["" if x is None or np.isnan(x) else f"{x:.17g}" for x in row] for row in zip(*values, strict=True)]
        return [[self.head + end, *row] for end, row in zip(ends, texts, strict=False)]


def results(variants: Sequence[Variant]) -> list[Column]:
    """The columns about these variants: errors of evaluations, or of the learners' own goals if there are none."""
    unit = unit_of(variants)

    def at_last(column: str) -> list[Interval | None]:
        return [variant.at(variant.compared_at, column) for variant in variants]

    if any(variant.compared_at for variant in variants):
        expected = at_last("expected_error")
        early = [variant.at(EARLY) if variant.compared_at > EARLY else None for variant in variants]
        columns = [
            Column("seeds", [Interval(len(variant.used)) for variant in variants], ".0f"),
            Column("movements", [Interval(at) if (at := variant.compared_at) else None for variant in variants], ".0f"),
            *([Column(unit(f"error at {EARLY}"), early)] if any(early) else []),
            Column(unit("error"), at_last("mean_error")),
            *([Column(unit("expected error"), expected)] if any(expected) else []),
            Column(unit("median"), at_last("median_error")),
            Column(unit("noise floor"), [floor and Interval(floor.value) for floor in at_last("noise_floor")]),
        ]
    else:
        own = [variant.own_goals for variant in variants]
        columns = [
            Column("seeds", [Interval(len(variant.runs)) for variant in variants], ".0f"),
            Column("movements", [Interval(int(curve.movements[-1])) for curve in own], ".0f"),
            Column("failed", [over_seeds(variant.failed) for variant in variants], ".1%"),
            Column(unit(f"miss of the last {RECENT} own goals"), [curve.last_missed for curve in own]),
            Column("met", [curve.last_met for curve in own], ".0%"),
        ]
    for head, part in (("physics", "physics"), ("learning", "learner")):
        columns.append(Column(f"{head} (ms)", [Interval(1e3 * variant.seconds(part)) for variant in variants], ".2f"))
    return columns


def print_table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of equal length in aligned columns, two spaces apart.

    Each row is flushed, so that a reader such as ``head``, which closes the pipe, causes its error here.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print(printable(line.rstrip()), flush=True)


def print_csv(rows: Iterable[Sequence[str]]) -> None:
    """Print rows with commas between their cells."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([printable(cell) for cell in row] for row in rows)
    print(text.getvalue(), end="", flush=True)
