"""The rows as evidence: errors by seed, and the statistics over seeds that claims, tables, figures and prose read.

    found = Evidence.of(Path("results")); show(found.ratio("sgim-d", "random"))
A name is that of a variant, answered by `process`; "sgim-d-letter by paper" is answered by another inverse model. Two
names are compared on their common seeds, or, without any, as independent samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import (
    LEVEL,
    Interval,
    improvement_interval,
    interquartile_mean,
    interval,
    point,
    rng,
)
from table import read_table

LAST: Final = 5000  # movements in the life of a learner of the paper
Level = float | None  # confidence of an interval; None for the number alone, which costs much less
Measure = Callable[..., Interval]  # takes the ``level``
BySeed = Mapping[int, float]


class NotRun(LookupError):
    """What is asked for needs runs or evaluations that are not there; the message names them."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of all experiments. Every method raises `NotRun` where fewer than two seeds have what it needs.

    Args:
        rows: error and floor by answer, variant, movements and seed.
        explored, asked: the small tables, by variant and seed.
    """

    rows: pd.DataFrame
    explored: pd.DataFrame
    asked: pd.DataFrame

    @classmethod
    def of(cls, folder: Path) -> Evidence:
        """From the tables of a folder.

        Raises:
            ResultsError: a table makes no sense.
        """
        key = ["answer", "variant", "movements", "seed"]
        rows = read_table(folder).drop_duplicates(key).set_index(key)[["error", "floor"]].sort_index()
        explored, asked = (read_table(folder, name).set_index("variant") for name in ("explored.csv", "asked.csv"))
        return cls(rows, explored, asked)

    def at(self, name: str, movements: int = LAST, column: str = "error") -> dict[int, float]:
        """Seed -> error (m), or its noise floor."""
        variant, _, answer = name.partition(" by ")
        place = (answer or "process", variant, movements)
        found = self.rows.loc[place, column].dropna() if place in self.rows.index else pd.Series(dtype=float)
        return _two_or_more(found, f"{name} at {movements}")

    def errors(self, name: str, movements: int = LAST) -> Array:
        """``(n_seeds,)`` m."""
        return _array(self.at(name, movements))

    def curve(self, name: str) -> tuple[Array, Array]:
        """``(n,)`` movements and ``(n_seeds, n)`` errors (m), of the seeds that were evaluated at each of them."""
        variant, _, answer = name.partition(" by ")
        if (answer or "process", variant) not in self.rows.index:
            raise NotRun(name)
        table = self.rows["error"].loc[answer or "process", variant].unstack("movements").dropna()
        return table.columns.to_numpy(np.float64), table.to_numpy()

    def error(self, name: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean of the error (m)."""
        return _found(interquartile_mean, self.errors(name, at), level=level)

    def difference(self, ours: str, theirs: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """Our error less theirs (m)."""
        return self.less(self.at(ours, at), self.at(theirs, at), level=level)

    def ratio(self, ours: str, theirs: str, at: int = LAST, *, level: Level = LEVEL) -> Interval:
        """Our error over theirs."""
        return self.over(self.at(ours, at), self.at(theirs, at), level=level)

    def growth(self, name: str, late: int, early: int, *, level: Level = LEVEL) -> Interval:
        """The error late over that early."""
        return self.over(self.at(name, late), self.at(name, early), level=level)

    def over_floor(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """Our error at the end over their noise floor."""
        return self.over(self.at(ours), self.at(theirs, column="floor"), level=level)

    def improvement(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """The probability that a run of ours has a smaller error than one of theirs at the end."""
        return improvement_interval(self.errors(ours), self.errors(theirs), level=LEVEL if level is None else level)

    def variance_ratio(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """The variance over seeds of our error at the end over that of theirs."""

        def ratio(x: Array, y: Array) -> Array:
            return np.asarray(x.var(axis=-1, ddof=1) / y.var(axis=-1, ddof=1))

        return _found(ratio, self.errors(ours), self.errors(theirs), level=level)

    def growth_ratio(self, ours: Sequence[str], theirs: Sequence[str], *, level: Level = LEVEL) -> Interval:
        """How many times more our error grows than theirs, from the first to the second name of each."""

        def times(*errors: Array) -> Array:
            small, large, their_small, their_large = map(interquartile_mean, errors)
            return (large / small) / (their_large / their_small)

        return _found(times, *map(self.errors, (*ours, *theirs)), level=level)

    def over_tasks(self, ours: Sequence[str], theirs: Sequence[str], at: int, *, level: Level = LEVEL) -> Interval:
        """The interquartile mean over tasks of our error over theirs; a name for each task on either side."""
        samples = [self.errors(name, at) for name in (*ours, *theirs)]

        def mean(*drawn: Array) -> Array:
            pairs = zip(drawn[: len(ours)], drawn[len(ours) :], strict=True)
            ratios = [interquartile_mean(x) / interquartile_mean(y) for x, y in pairs]
            return interquartile_mean(np.stack(ratios, axis=-1))

        return _found(mean, *samples, level=level)

    def time_to_reach(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """After how many movements our mean error falls to theirs at the end; twice a life if it never does."""
        movements, curves = self.curve(ours)

        def time(curves: Array, errors: Array) -> Array:
            means = interquartile_mean(np.swapaxes(curves, -1, -2))
            return np.minimum(movements_to_reach(movements, means, interquartile_mean(errors)), 2 * LAST)

        return _found(time, curves, self.errors(theirs), level=level)

    def tiles(self, name: str, *, level: Level = LEVEL) -> Interval:
        """How many tiles of the benchmark were reached in a life."""
        return _found(interquartile_mean, _array(self.counts("explored", name, "tiles")), level=level)

    def more_tiles(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """How many more tiles we have reached."""
        return self.less(*(self.counts("explored", name, "tiles") for name in (ours, theirs)), level=level)

    def near_goals(self, name: str) -> Array:
        """``(n_seeds, 2)``: how many goals a learner chose, and how many of them can be reached."""
        found = [self.counts("explored", name, column) for column in ("goals", "near")]
        return np.array([[*each.values()] for each in found]).T

    def near_ratio(self, ours: str, theirs: str, *, level: Level = LEVEL) -> Interval:
        """Our share of goals that can be reached over theirs, all seeds together.

        Half a goal more is counted as theirs, which avoids a division by zero.
        """

        def times(ours: Array, theirs: Array) -> Array:
            (our_goals, our_near), (goals, near) = (np.moveaxis(c.sum(axis=-2), -1, 0) for c in (ours, theirs))
            return np.asarray((our_near / our_goals) / ((near + 0.5) / (goals + 1)))

        return _found(times, self.near_goals(ours), self.near_goals(theirs), level=level)

    def counts(self, table: str, name: str, column: str, teachers: Sequence[str] = ()) -> dict[int, float]:
        """Seed -> a column of a small table, summed over these ``teachers``, all of them unless given."""
        rows: pd.DataFrame = getattr(self, table)
        variant = name.partition(" by ")[0]
        mine = rows.loc[[variant]] if variant in rows.index else rows.iloc[:0]
        mine = mine[mine["teacher"].isin(teachers)] if teachers else mine
        return _two_or_more(mine.dropna(subset=column).groupby("seed")[column].sum(), f"{column} of {variant}")

    def less(self, ours: BySeed, theirs: BySeed, *, level: Level = LEVEL) -> Interval:
        """Ours less theirs."""
        x, y, paired = _samples(ours, theirs)
        if paired:
            return _found(interquartile_mean, x - y, level=level)

        def difference(x: Array, y: Array) -> Array:
            return interquartile_mean(x) - interquartile_mean(y)

        return _found(difference, x, y, level=level)

    def over(self, ours: BySeed, theirs: BySeed, *, level: Level = LEVEL) -> Interval:
        """Ours over theirs."""

        def ratio(x: Array, y: Array) -> Array:
            return interquartile_mean(x) / interquartile_mean(y)

        x, y, paired = _samples(ours, theirs)
        return _found(ratio, x, y, paired=paired, level=level)

    def share(self, parts: BySeed, wholes: BySeed, *, level: Level = LEVEL) -> Interval:
        """All ``parts`` over all ``wholes``, the seeds of both drawn together.

        Raises:
            NotRun: there are none.
        """
        if not sum(wholes.values()):
            raise NotRun("nothing to count")

        def ratio(part: Array, whole: Array) -> Array:
            return np.asarray(part.sum(axis=-1) / np.maximum(whole.sum(axis=-1), 1))

        return _found(ratio, _array(parts), _array(wholes), paired=True, level=level)


def shared(ours: BySeed, theirs: BySeed) -> tuple[dict[int, float], dict[int, float]]:
    """Both, restricted to common seeds.

    Raises:
        NotRun: fewer than two.
    """
    seeds = [seed for seed in ours if seed in theirs]
    if len(seeds) < 2:
        raise NotRun("fewer than two seeds in common")
    return {seed: ours[seed] for seed in seeds}, {seed: theirs[seed] for seed in seeds}


def movements_to_reach(movements: Array, errors: Array, level: Array | float) -> Array:
    """Number of movements at which the error first falls to a level; straight lines between evaluations.

    Args:
        movements: ``(n,)``, increasing.
        errors: ``(..., n)`` m.
        level: ``(...)`` m.

    Returns:
        ``(...)``, at least the first of ``movements``; inf if the level is never reached.
    """
    level = np.asarray(level, dtype=np.float64)[..., None]
    reached = errors <= level
    after = np.clip(reached.argmax(axis=-1, keepdims=True), 1, None)
    high, low = (np.take_along_axis(errors, after - step, axis=-1) for step in (1, 0))
    fall = np.where(high > low, high - low, 1.0)
    share = np.clip((high - level) / fall, 0, 1)  # 0 if the first evaluation is low enough
    found = movements[after - 1] + share * (movements[after] - movements[after - 1])
    return np.where(reached.any(axis=-1), found[..., 0], np.inf)


def _samples(ours: BySeed, theirs: BySeed) -> tuple[Array, Array, bool]:
    """Errors of both, and whether they are paired: on common seeds, or independent where there are none."""
    paired = bool(ours.keys() & theirs.keys())
    if paired:
        ours, theirs = shared(ours, theirs)
    return _array(ours), _array(theirs), paired


def _found(statistic: Callable[..., Array], *samples: Array, level: Level, paired: bool = False) -> Interval:
    if level is None:
        return point(float(statistic(*samples)))
    return interval(statistic, *samples, rng=rng(), paired=paired, level=level)


def _array(values: BySeed) -> Array:
    return np.array([*values.values()])


def _two_or_more(found: pd.Series, what: str) -> dict[int, float]:
    if len(found) < 2:
        raise NotRun(what)
    return {int(seed): float(value) for seed, value in found.items()}
