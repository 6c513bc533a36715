"""The evidence of the tables of results: errors by seed, and statistics over seeds for claims, tables and figures.

    evidence = Evidence.of(Path("results")); interval_text(evidence.ratio("sgim-d", "random"))
A name is that of a variant, whose errors are those with the inverse model `process`; "sgim-d-letter by paper" names
another inverse model. Two names, "ours" and "theirs", are compared on their common seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sgimd_torch.extras.table.statistics import LEVEL, Interval, bootstrap_rng, interquartile_mean, interval
from sgimd_torch.spaces import Array
from table import read_table

LAST: Final = 5000  # number of movements of a whole run, as in the paper
Level = float | None  # confidence level of an interval; None: no interval, which takes much less time
Statistic = Callable[..., Interval]  # function with a keyword ``level``


class NotRun(LookupError):
    """Exception: runs or evaluations are missing; the message names them."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The tables of all experiments. Every method raises `NotRun` if fewer than two seeds have the rows that it needs.

    Args:
        rows: results.csv with the index answer, variant, movements and seed.
        explored, asked: tables explored.csv and asked.csv, with the index variant and seed.
        robots: table robots.csv.
        changes: table changes.csv with the index robot, change, learner, movements and seed.
        models: table model_files.csv.
    """

    rows: pd.DataFrame
    explored: pd.DataFrame
    asked: pd.DataFrame
    robots: pd.DataFrame
    changes: pd.DataFrame
    models: pd.DataFrame

    @classmethod
    def of(cls, folder: Path) -> Evidence:
        """The tables of a folder.

        Raises:
            ResultsError: a table is damaged.
        """
        key = ["answer", "variant", "movements", "seed"]
        rows = read_table(folder).set_index(key)[["error", "floor", "learning"]].sort_index()
        explored, asked = (read_table(folder, name).set_index("variant") for name in ("explored.csv", "asked.csv"))
        after = ["robot", "change", "learner", "movements", "seed"]
        changes = read_table(folder, "changes.csv").set_index(after).sort_index()
        robots, models = (read_table(folder, f"{name}.csv") for name in ("robots", "model_files"))
        return cls(rows, explored, asked, robots, changes, models)

    def at(self, name: str, movements: int = LAST, column: str = "error") -> pd.Series:
        """Errors (m) by seed after a number of movements; noise floors (m) if the column is "floor"."""
        variant, _, answer = name.partition(" by ")
        place = (answer or "process", variant, movements)
        errors = self.rows.loc[place, column].dropna() if place in self.rows.index else pd.Series(dtype=float)
        return _two_or_more(errors, f"{name} at {movements}")

    def of_variants(self, variants: Iterable[str]) -> pd.Series:
        """By which learning each row of these variants was made."""
        return self.rows["learning"][self.rows.index.isin([*variants], level="variant")]

    def curve(self, name: str) -> pd.DataFrame:
        """Errors (m): a row for each seed, a column for each number of movements; incomplete seeds are left out."""
        variant, _, answer = name.partition(" by ")
        if (answer or "process", variant) not in self.rows.index:
            raise NotRun(name)
        return self.rows["error"].loc[answer or "process", variant].unstack("movements").dropna()

    def counts(self, table: str, name: str, column: str, teachers: Sequence[str] = ()) -> pd.Series:
        """A column of explored.csv or asked.csv by seed, summed over ``teachers``, or over all if none is named."""
        rows: pd.DataFrame = getattr(self, table)
        variant = name.partition(" by ")[0]
        mine = rows[rows.index == variant].dropna(subset=column)
        mine = mine[mine["teacher"].isin(teachers)] if teachers else mine
        return _two_or_more(mine.groupby("seed")[column].sum(), f"{column} of {variant}")

    def error(self, name: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean of the error (m) after ``at`` movements."""
        return _found(interquartile_mean, self.at(name, at), level=level)

    def difference(self, ours: str, theirs: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """Our error minus theirs (m), after ``at`` movements."""
        return self.less(self.at(ours, at), self.at(theirs, at), level=level)

    def ratio(self, ours: str, theirs: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """Our error divided by theirs, after ``at`` movements."""
        return self.over(self.at(ours, at), self.at(theirs, at), level=level)

    def over_floor(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """Our error at the end divided by their noise floor."""
        return self.over(self.at(ours), self.at(theirs, column="floor"), level=level)

    def variance_ratio(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """The variance over seeds of our error at the end, divided by the variance of theirs."""

        def ratio(x: Array, y: Array) -> Array:
            return np.asarray(x.var(axis=-1, ddof=1) / y.var(axis=-1, ddof=1))

        return _found(ratio, self.at(ours), self.at(theirs), level=level)

    def growth_ratio(self, ours: Sequence[str], theirs: Sequence[str], *, level: Level = LEVEL) -> Interval:
        """The growth of our error divided by the growth of theirs: growth from the first to the second of two names."""

        def times(*errors: Array) -> Array:
            small, large, their_small, their_large = map(interquartile_mean, errors)
            return (large / small) / (their_large / their_small)

        return _found(times, *map(self.at, (*ours, *theirs)), level=level)

    def over_tasks(self, ours: Sequence[str], theirs: Sequence[str], at: int, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean over tasks of our error divided by theirs; each side has one name for each task."""

        def mean(*drawn: Array) -> Array:
            pairs = zip(drawn[: len(ours)], drawn[len(ours) :], strict=True)
            return interquartile_mean(np.stack([_ratio(x, y) for x, y in pairs], axis=-1))

        return _found(mean, *(self.at(name, at) for name in (*ours, *theirs)), level=level)

    def count(self, table: str, name: str, column: str, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean of a column of explored.csv or asked.csv."""
        return _found(interquartile_mean, self.counts(table, name, column), level=level)

    def more_tiles(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """The number of benchmark tiles that our runs reach, minus the number that theirs reach."""
        return self.less(*(self.counts("explored", name, "tiles") for name in (ours, theirs)), level=level)

    def near_goals(self, name: str) -> pd.DataFrame:
        """By seed, the number of ``goals`` that a learner chose, and the number ``near`` of those within reach."""
        return pd.DataFrame({column: self.counts("explored", name, column) for column in ("goals", "near")})

    def near_share(self, name: str, *, level: Level = LEVEL) -> Interval:
        """The share of chosen goals that can be reached, over the goals of all seeds."""
        goals = self.near_goals(name)
        return self.share(goals["near"], goals["goals"], level=level)

    def near_ratio(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """Our share of goals that can be reached divided by theirs, each over the goals of all seeds.

        To avoid a division by zero, 0.5 is added to their goals that can be reached, and 1 to all their goals.
        """

        def times(ours: Array, theirs: Array) -> Array:
            (our_goals, our_near), (goals, near) = (np.moveaxis(c.sum(axis=-2), -1, 0) for c in (ours, theirs))
            return np.asarray((our_near / our_goals) / ((near + 0.5) / (goals + 1)))

        return _found(times, self.near_goals(ours), self.near_goals(theirs), level=level)

    def less(self, ours: pd.Series, theirs: pd.Series, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean of our numbers minus theirs, both given by seed."""

        def difference(x: Array, y: Array) -> Array:
            return interquartile_mean(x - y)

        return _found(difference, *shared(ours, theirs), paired=True, level=level)

    def over(self, ours: pd.Series, theirs: pd.Series, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean of our numbers divided by that of theirs, both given by seed."""
        return _found(_ratio, *shared(ours, theirs), paired=True, level=level)

    def share(self, parts: pd.Series, wholes: pd.Series, *, level: Level = LEVEL) -> Interval:
        """The sum of ``parts`` divided by the sum of ``wholes``; the bootstrap draws the same seeds for both.

        Raises:
            NotRun: all ``wholes`` are 0.
        """
        if not wholes.sum():
            raise NotRun("nothing to count")

        def ratio(part: Array, whole: Array) -> Array:
            return np.asarray(part.sum(axis=-1) / np.maximum(whole.sum(axis=-1), 1))

        return _found(ratio, parts, wholes, paired=True, level=level)


def shared(ours: pd.Series, theirs: pd.Series) -> tuple[pd.Series, pd.Series]:
    """Both series, restricted to their common seeds.

    Raises:
        NotRun: there are fewer than two common seeds.
    """
    seeds = ours.index.intersection(theirs.index)
    if len(seeds) < 2:
        raise NotRun("fewer than two seeds in common")
    return ours.loc[seeds], theirs.loc[seeds]


def _ratio(x: Array, y: Array) -> Array:
    return interquartile_mean(x) / interquartile_mean(y)


def _found(statistic: Callable[..., Array], *of: ArrayLike, level: Level, paired: bool = False) -> Interval:
    samples = [np.asarray(sample, dtype=np.float64) for sample in of]
    if level is None:
        return Interval(float(statistic(*samples)))
    return interval(statistic, *samples, rng=bootstrap_rng(), paired=paired, level=level)


def _two_or_more(values: pd.Series, what: str) -> pd.Series:
    if len(values) < 2:
        raise NotRun(what)
    return values
