"""How a claim is judged: the results, the bar that it has to clear, and one loop for all claims.

A bar counts as cleared only if the whole interval clears it, at the confidence that Holm's method asks for so many
claims. If the interval straddles the bar, or runs are missing, the verdict is "cannot say".
    results = Results.of(Path("results"), ["learners"])
    judge([Claim("half of Random's error", "ratio ≤ 0.50", ratio_at_most("sgim-d", "random", 0.5))], results, "linear")
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from sgimd_torch.runs.config import OWN
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import (
    LEVEL,
    Interval,
    difference_interval,
    holm,
    improvement_interval,
    interquartile_mean,
    interval,
    iqm_interval,
    mean_over_life,
    metres,
    movements_to_reach,
    ratio_interval,
    rng,
    show,
)
from table import read_table

HOLDS: Final = "holds"
FAILS: Final = "does not hold"
OPEN: Final = "cannot say"
FIRST: Final = 250  # movements before the first evaluation
LAST: Final = 5000  # movements in the life of a learner of the paper
LEARNERS: Final = ("random", "sagg-riac", "observation", "imitation", "sgim-d")  # the paper's five
Judged = tuple[str, str]  # our number in words, and the verdict
Judge = Callable[["Results"], Judged]


class NotRun(LookupError):
    """A claim, a table or a figure needs runs or evaluations that are not there; the message names them."""


@dataclass(frozen=True, eq=False)
class Results:
    """The data that claims are judged on: evaluations by one ``answer``, "own" for that of each learner itself.

    Errors are in metres; intervals are over seeds, of confidence ``level``. All methods raise ``NotRun`` if fewer than
    two seeds have what they need; of fewer than `LEAST_SEEDS` there are points, which decide nothing.

    Args:
        rows: error, floor, tiles, claimed and met by answer, variant, movements and seed.
        small: some of goals.csv and asked.csv by name.
    """

    rows: pd.DataFrame
    answer: str = OWN
    small: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    level: float = LEVEL

    @classmethod
    def of(cls, folder: Path, experiments: Collection[str], small: Sequence[str] = ()) -> Results:
        """Those of some experiments, which share no variant.

        Raises:
            ResultsError: a table makes no sense.
        """
        table = read_table(folder)
        table = table[table.experiment.isin([*experiments])]
        both = pd.concat([table, table[table.own == 1].assign(answer=OWN)])
        rows = both.set_index(["answer", "variant", "movements", "seed"])[["error", "floor", "tiles", "claimed", "met"]]
        return cls(rows.astype(float).sort_index(), small={name: read_table(folder, name) for name in small})

    def by(self, answer: str) -> Results:
        """The same with all variants answered by the same inverse model, or by "own"."""
        return replace(self, answer=answer)

    @property
    def seeds(self) -> list[int]:
        """All of them, in order."""
        return sorted(self.rows.index.unique("seed"))

    def known(self, variants: Iterable[str]) -> list[str]:
        """Those that have any rows."""
        return [variant for variant in variants if (self.answer, variant) in self.rows.index]

    def some(self, variant: str, movements: int = LAST, values: str = "error") -> dict[int, float]:
        """Seed -> value of a column, for as many seeds as there are."""
        place = self.answer, variant, movements
        found = self.rows[values].loc[place].dropna() if place in self.rows.index else pd.Series(dtype=float)
        return {int(seed): float(value) for seed, value in found.items()}

    def at(self, variant: str, movements: int = LAST, values: str = "error") -> dict[int, float]:
        """Seed -> value of a column."""
        found = self.some(variant, movements, values)
        if len(found) < 2:
            what = f": {len(found)} seeds with {values} at {movements}" if self.known([variant]) else ""
            raise NotRun(f"{variant}{what}")
        return found

    def errors(self, variant: str, movements: int = LAST) -> Array:
        """``(n_seeds,)`` m."""
        return _array(self.at(variant, movements))

    def curves(self, variant: str) -> tuple[Array, Array]:
        """``(n,)`` movements and ``(n_seeds, n)`` errors, of the seeds that were evaluated at each of them up to the
        paper's 5000; there may be none."""
        if not self.known([variant]):
            raise NotRun(variant)
        table = self.rows["error"].loc[self.answer, variant].unstack("movements")
        whole = table[[when for when in table.columns if when <= LAST]].dropna()
        return whole.columns.to_numpy(np.float64), whole.to_numpy()

    def lives(self, variant: str) -> Array:
        """``(n_seeds,)``, the mean of each error curve over its movements; none of curves that begin late."""
        movements, errors = self._several_curves(variant)
        if movements[0] > FIRST:
            raise NotRun(f"{variant}: no evaluation at {FIRST}")
        return mean_over_life(movements, errors)

    def iqm(self, variant: str, movements: int = LAST, values: str = "error") -> Interval:
        """The interquartile mean over seeds."""
        return iqm_interval(_array(self.at(variant, movements, values)), rng=rng(), level=self.level)

    def pairs(self, ours: str, theirs: str, movements: int = LAST) -> tuple[dict[int, float], dict[int, float]]:
        """Errors of both by seed, for common seeds."""
        return shared(self.at(ours, movements), self.at(theirs, movements))

    def difference(self, ours: str, theirs: str, movements: int = LAST) -> Interval:
        """Ours - theirs, paired by seed."""
        return difference_interval(*self.pairs(ours, theirs, movements), rng=rng(), level=self.level)

    def ratio(self, ours: str, theirs: str, movements: int = LAST) -> Interval:
        """Ours / theirs."""
        errors = self.errors(ours, movements), self.errors(theirs, movements)
        return ratio_interval(*errors, rng=rng(), level=self.level)

    def improvement(self, ours: str, theirs: str, movements: int = LAST) -> Interval:
        """The probability that a run of ours has a smaller error than one of theirs."""
        return improvement_interval(self.errors(ours, movements), self.errors(theirs, movements), level=self.level)

    def floor_ratio(self, ours: str, theirs: str) -> Interval:
        """Our errors / their noise floors, paired by seed."""
        return self.paired_ratio(self.at(ours), self.at(theirs, values="floor"))

    def paired_ratio(self, ours: Mapping[int, float], theirs: Mapping[int, float]) -> Interval:
        """Ours / theirs on common seeds."""
        errors = map(_array, shared(ours, theirs))
        return ratio_interval(*errors, rng=rng(), paired=True, level=self.level)

    def near_goals(self, variant: str) -> Array:
        """``(n_seeds, 2)``: how many goals a run chose for itself, and how many of them can be reached."""
        table = self.small["goals.csv"]
        found = table.loc[table.variant == variant, ["n_goals", "n_near"]].to_numpy(np.float64)
        if len(found) < 2:
            raise NotRun(f"goals of {variant}")
        return found

    def time_to_reach(self, ours: str, theirs: str, *, unit: float = 1.0, at_most: float) -> Interval:
        """When our mean curve falls to the end of theirs, in movements / ``unit``; ``at_most`` if later."""
        movements, curves = self._several_curves(ours)

        def time(curves: Array, errors: Array) -> Array:
            means = interquartile_mean(np.swapaxes(curves, -1, -2))
            return np.minimum(movements_to_reach(movements, means, interquartile_mean(errors)) / unit, at_most)

        return interval(time, curves, self.errors(theirs), rng=rng(), level=self.level)

    def _several_curves(self, variant: str) -> tuple[Array, Array]:
        self.at(variant)
        movements, errors = self.curves(variant)
        if min(errors.shape) < 2:
            raise NotRun(f"{variant}: {len(errors)} whole curves")
        return movements, errors


def shared(ours: Mapping[int, float], theirs: Mapping[int, float]) -> tuple[dict[int, float], dict[int, float]]:
    """Both, restricted to common seeds.

    Raises:
        NotRun: fewer than two.
    """
    seeds = [seed for seed in ours if seed in theirs]
    if len(seeds) < 2:
        raise NotRun("fewer than two seeds in common")
    return {seed: ours[seed] for seed in seeds}, {seed: theirs[seed] for seed in seeds}


class Claim(NamedTuple):
    """A claim.

    ``text`` and its ``bar`` in words; ``judged`` returns our number in words and the verdict; ``pairs`` of variants
    whose difference at ``movements`` is its effect in metres; ``own``: each variant answers by its own inverse model,
    otherwise all by the same one.
    """

    text: str
    bar: str
    judged: Judge
    pairs: Sequence[tuple[str, str]] = ()
    movements: int = LAST
    own: bool = False


class Verdict(NamedTuple):
    """One line of a table of verdicts; ``effect`` in metres, with its interval; ``alone``: were it the only claim."""

    claim: str
    bar: str
    number: str
    effect: str
    verdict: str
    alone: str


def judge(claims: Iterable[Claim], results: Results, answer: str) -> list[Verdict]:
    """All claims in order, together, by Holm's method: were each claim one interval, the chance that any verdict is
    wrong would be 5 % at most. Of several intervals the worst decides. Intervals of few seeds are too narrow: where n
    paired differences all have one sign, their bootstrap interval excludes 0 at any level, however strict, and by
    chance alone they have one sign with probability 2^(1 - n).
    "Cannot say" if something was not run, or with fewer than `LEAST_SEEDS`, or if only a single claim could be so sure.

    Args:
        claims: each with a text of its own.
        results: of all variants that they name.
        answer: the inverse model that answers for all, unless a claim is about their own.

    Raises:
        ValueError: errors that have no ratio, such as 0.
    """
    seen = {claim.text: claim for claim in claims}

    def judged(text: str, level: float = LEVEL) -> Judged:
        claim = seen[text]
        try:
            return claim.judged(replace(results, answer=OWN if claim.own else answer, level=level))
        except NotRun as missing:
            return f"not run: {missing}", OPEN

    alone = {text: judged(text) for text in seen}
    standing = holm(seen, lambda text, level: alone[text][1] != OPEN and judged(text, level)[1] != OPEN)
    return [
        Verdict(
            claim.text,
            claim.bar,
            alone[claim.text][0],
            _effect(claim, results.by(OWN if claim.own else answer)),
            alone[claim.text][1] if claim.text in standing else OPEN,
            alone[claim.text][1],
        )
        for claim in seen.values()
    ]


def _effect(claim: Claim, results: Results) -> str:
    """Differences of errors in metres, ours minus theirs."""
    found = {}
    for ours, theirs in claim.pairs:
        try:
            found[f"{ours} − {theirs}"] = metres(results.difference(ours, theirs, claim.movements), "+.3f")
        except NotRun:
            continue
    return "; ".join(f"{names}: {each}" for names, each in found.items())


def at_most(found: Interval, bar: float, upper: float | None = None) -> str:
    """Is it ``bar`` or less? ``upper``: how far the interval may reach, the bar itself unless given."""
    if found.value <= bar and found.high <= (bar if upper is None else upper):
        return HOLDS
    return FAILS if found.low > bar else OPEN


def at_least(found: Interval, bar: float, lower: float | None = None) -> str:
    """Is it ``bar`` or more? ``lower``: how far down the interval may reach, the bar itself unless given."""
    upper = None if lower is None else -lower
    return at_most(Interval(-found.value, -found.high, -found.low), -bar, upper)


def below_zero(found: Interval) -> str:
    """Is the error of ours smaller, for certain?"""
    if found.high < 0:
        return HOLDS
    return FAILS if found.low > 0 else OPEN


def all_of(*verdicts: str) -> str:
    """Fails if any fails; else open if any is open."""
    return next((verdict for verdict in (FAILS, OPEN) if verdict in verdicts), HOLDS)


def ratio_at_most(ours: str, theirs: str, bar: float, *, upper: float | None = None, movements: int = LAST) -> Judge:
    """Judges our error over theirs; ``upper`` as in ``at_most``."""

    def judged(results: Results) -> Judged:
        ratio = results.ratio(ours, theirs, movements)
        return f"ratio {show(ratio)}", at_most(ratio, bar, upper)

    return judged


def _array(values: Mapping[int, float]) -> Array:
    return np.array([*values.values()])
