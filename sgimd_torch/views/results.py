"""The table of results, one row for each variant: with the same columns, units and statistics wherever it is shown.

for column in results(variants): column.head, column.texts()    # of sgimd table and of sgimd report
Over seeds, every number is an interquartile mean: one bad seed does not move it. Over the goals of an evaluation there
are both the mean, eq. (10), and the median: a few goals that are missed by far move only the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sgimd_torch.evaluation import RECENT
from sgimd_torch.views.statistics import Interval, over_seeds, point, show
from sgimd_torch.views.variants import EARLY, Variant, unit_of

MISSING = "-"  # text of a number that is not known


class Column(NamedTuple):
    """A column of a table: a head, a number for each variant, and the form of the numbers as text."""

    head: str
    cells: Sequence[Interval | None]
    form: str = ".3f"

    def texts(self) -> list[str]:
        """Numbers as texts, with their intervals in brackets."""
        return [MISSING if cell is None else show(cell, self.form) for cell in self.cells]

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
        return [variant.at(variant.last, column) for variant in variants]

    if any(variant.last for variant in variants):
        expected = at_last("expected_error")
        early = [variant.at(EARLY) if variant.last > EARLY else None for variant in variants]
        found = [
            Column("seeds", [point(len(variant.used)) for variant in variants], ".0f"),
            Column("movements", [point(variant.last) if variant.last else None for variant in variants], ".0f"),
            *([Column(unit(f"error at {EARLY}"), early)] if any(early) else []),
            Column(unit("error"), at_last("mean_error")),
            *([Column(unit("expected error"), expected)] if any(expected) else []),
            Column(unit("median"), at_last("median_error")),
            Column(unit("noise floor"), [each and point(each.value) for each in at_last("noise_floor")]),
        ]
    else:
        own = [variant.own for variant in variants]
        found = [
            Column("seeds", [point(len(variant.runs)) for variant in variants], ".0f"),
            Column("movements", [point(int(each.movements[-1])) for each in own], ".0f"),
            Column("failed", [over_seeds(variant.failed) for variant in variants], ".1%"),
            Column(unit(f"miss of the last {RECENT} own goals"), [each.last_missed for each in own]),
            Column("met", [each.last_met for each in own], ".0%"),
        ]
    for head, part in (("physics", "physics"), ("learning", "learner")):
        found.append(Column(f"{head} (ms)", [point(1e3 * variant.seconds(part)) for variant in variants], ".2f"))
    return found
