"""Variants of a study: their statistics over seeds, and their comparison, for tables and reports.

variants = best_first(Variant(name, runs) for name, runs in read_runs(Path("study")).items())
chosen = baseline_of(variants, "random"); [(row.variant.label, row.verdict) for row in compare(variants, chosen)]
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from sgimd_torch.evaluation import RECENT, OwnGoals
from sgimd_torch.extras.table.names import label
from sgimd_torch.extras.table.statistics import LEAST_SEEDS, Interval, common_differences, over_seeds
from sgimd_torch.runs.directory import RUN_FILE, not_compared
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.read import Run, find_runs, read_run
from sgimd_torch.spaces import Array
from sgimd_torch.texts import unknown_name_error

EARLY: Final = 1000  # number of movements after which tables show an early error
POINTS: Final = 40  # largest number of points of a curve of own goals
USUAL: Final = "sgim-d"  # name of the default baseline


def read_runs(folder: Path) -> dict[str, list[Run]]:
    """All runs below a folder, by name of the variant, without their thetas; folders without a run are reported.

    Raises:
        RunError: there are no runs, or one is damaged.
    """
    runs: dict[str, list[Run]] = {}
    found = [(name, path) for name, paths in find_runs(folder).items() for path in paths]
    for below in sorted([*folder.glob("seed-*/"), *folder.glob("*/seed-*/")]):
        if not os.path.isfile(below / RUN_FILE):
            say(f"left out: {below} has no {RUN_FILE} that can be read")
    for name, path in tqdm(found, "reading", unit="", delay=1.0, disable=None):
        run = replace(read_run(path), thetas=np.empty((0, 0)))  # thetas need much memory, and no view shows them
        runs.setdefault(name, []).append(run)
    return runs


def best_first(variants: Iterable[Variant]) -> list[Variant]:
    """Variants in the order of their last errors in each unit, the smallest first; those without an error come last."""
    return sorted(
        variants, key=lambda v: (not v.last_error, v.space.unit, v.last_error.value if v.last_error else 0.0, v.name)
    )


def unalike(variants: Sequence[Variant]) -> list[str]:
    """A sentence if the errors of variants have different units."""
    names: dict[str, list[str]] = {}
    for variant in variants:
        names.setdefault(variant.space.unit or "no unit", []).append(variant.label)
    told = "; ".join(f"{', '.join(labels)} in {unit}" for unit, labels in names.items())
    return [f"Errors have different units, so they cannot be compared: {told}"] if len(names) > 1 else []


def unit_of(variants: Sequence[Variant]) -> Callable[[str], str]:
    """A function that adds the unit of T to the name of a quantity, or "unit of T" if units of variants differ."""
    first = variants[0].space
    same = all(variant.space.unit == first.unit for variant in variants)
    return first.in_unit if same else lambda quantity: f"{quantity} (unit of T)"


def differing(variants: Sequence[Variant]) -> dict[str, list[str]]:
    """Settings in which runs differ, except the seed and the folders, with the values of each variant as text."""
    values_of = {}
    for name in dict.fromkeys(name for variant in variants for run in variant.runs for name in run.config):
        values = [dict.fromkeys(text_of(run.config.get(name)) for run in variant.runs) for variant in variants]
        if name not in not_compared() and len(set().union(*values)) > 1:
            values_of[name] = [" or ".join(texts) for texts in values]
    return values_of


def text_of(value: Any) -> str:
    """A value of a setting or version as text, a dash for None."""
    return "–" if value is None else value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


class Variant:
    """The runs of one variant, one for each seed.

    Statistics use the finished runs, or all evaluated runs if none is finished, at their common evaluations.

    Args:
        name: name of the variant's folder.
        runs: runs of the variant, at least one.
        at: number of movements at which variants are compared; statistics then use all runs with an evaluation there.
            None for the last common evaluation.
    """

    def __init__(self, name: str, runs: Sequence[Run], at: int | None = None) -> None:
        self.name, self.label = name, label(name)
        self.runs = sorted(runs, key=lambda run: int(run.config["seed"]))
        self.algorithm = str(self.runs[0].config["algorithm"])
        self.environment, self.space = str(self.runs[0].config["environment"]), self.runs[0].spaces["outcomes"]
        evaluated = [run for run in self.runs if len(run.evaluations["own"]["movements"])]  # by the run's own inverse
        if at is None:
            self.used = [run for run in evaluated if run.summary["finished"]] or evaluated
        else:
            self.used = [run for run in evaluated if at in run.evaluations["own"]["movements"]]
        moments = [run.evaluations["own"]["movements"] for run in self.used]
        self.evaluated_at: NDArray[np.int64] = reduce(np.intersect1d, moments or [np.empty(0)]).astype(np.int64)
        last = int(self.evaluated_at[-1]) if len(self.evaluated_at) else 0
        self.compared_at = last if at is None else at  # number of movements; 0: no evaluation

    def values(self, movements: int, column: str = "mean_error") -> Array:
        """``(n_seeds,)`` values of a column of the evaluations after ``movements`` movements; NaN: no evaluation."""
        return np.array([run.at(movements, column) for run in self.used], dtype=np.float64)

    def at(self, movements: int, column: str = "mean_error") -> Interval | None:
        """Interquartile mean of ``values`` with its bootstrap interval of 95 %; None if a value is missing."""
        return over_seeds(self.values(movements, column))

    @property
    def few(self) -> bool:
        """Whether the variant has too few seeds for intervals."""
        return len(self.used or self.runs) < LEAST_SEEDS

    @cached_property
    def errors(self) -> Array:
        """``(n_seeds, n)`` in the unit of T, errors at ``evaluated_at``."""
        return self._over_time("mean_error")

    @cached_property
    def floors(self) -> Array:
        """``(n_seeds, n)`` in the unit of T, parts of the errors that noise alone makes; NaN where not measured."""
        return self._over_time("noise_floor")

    @cached_property
    def curve(self) -> Array:
        """``(3, n)``: interquartile mean of errors over seeds at ``evaluated_at``, and both ends of its interval."""
        numbers = [over_seeds(column) or (np.nan,) * 3 for column in self.errors.T]
        return np.array(numbers, dtype=np.float64).reshape(-1, 3).T

    @cached_property
    def last_error(self) -> Interval | None:
        """The error at the evaluation where variants are compared, ``compared_at``."""
        return self.at(self.compared_at)

    @cached_property
    def own_goals(self) -> OwnCurve:
        """How nearly the learners met their own goals; of all runs, up to the length of the shortest."""
        length = min(len(run.index) for run in self.runs)
        movements = np.unique(np.linspace(0, length, POINTS + 1).astype(np.int64))
        goals = [run.own_goals() for run in self.runs]
        curves = [
            [_own_after(run, own, until) for until in movements.tolist()]
            for run, own in zip(self.runs, goals, strict=True)
        ]
        return OwnCurve(movements, *np.array(curves, dtype=np.float64).transpose(2, 0, 1))

    @property
    def failed(self) -> Array:
        """``(n_seeds,)``, shares of all movements of a run that failed."""
        return np.array([run.summary["failed"] / max(run.summary["movements"], 1) for run in self.runs])

    @cached_property
    def landed(self) -> Array:
        """``(n, outcome_dim)``, outcomes of all movements in all runs."""
        outcomes = np.concatenate([run.outcomes for run in self.runs])
        return outcomes[np.isfinite(outcomes).all(axis=1)]

    @cached_property
    def demonstrated(self) -> Array:
        """``(n, outcome_dim)``, outcomes of the demonstrations shown in all runs."""
        outcomes = [demonstration.outcome for run in self.runs for demonstration in run.demonstrations]
        return np.array(outcomes, dtype=np.float64).reshape(len(outcomes), self.landed.shape[1])

    @cached_property
    def misses(self) -> tuple[Array, Array, Array]:
        """Goals ``(n, outcome_dim)`` of the last evaluation, their errors ``(n,)``, and those that the learners
        expected, NaN if they did not say; all are means over seeds."""
        goals = self.typical.benchmark
        both = [run.missed_by(self.compared_at) for run in self.used if np.array_equal(run.benchmark, goals)]
        errors, expected = np.mean(both, axis=0)
        return goals, errors, expected

    @property
    def expects(self) -> bool:
        """Whether the learners said at the last evaluation which errors they expected."""
        return bool(self.compared_at) and bool(np.isfinite(self.misses[2]).all())

    @property
    def typical(self) -> Run:
        """The run with the median last error, or the better of two such runs; figures of a single run show it."""
        if not self.compared_at:
            return max(self.runs, key=lambda run: len(run.index))
        return sorted(self.used, key=lambda run: run.at(self.compared_at))[(len(self.used) - 1) // 2]

    def seconds(self, part: str) -> float:
        """Seconds that a movement took of a ``part``, "physics" or "learner": the mean over all movements of all runs.

        The time of "physics" is that of the robot.
        """
        runs = [run.summary for run in self.used or self.runs]
        return sum(run[f"seconds_{part}"] for run in runs) / max(sum(run["movements"] for run in runs), 1)

    def _over_time(self, column: str) -> Array:
        columns = [self.values(movements, column) for movements in self.evaluated_at.tolist()]
        return np.array(columns, dtype=np.float64).reshape(len(self.evaluated_at), len(self.used)).T


@dataclass(frozen=True, eq=False)
class OwnCurve:
    """Results at the learners' own goals over time; NaN before the first goal.

    Args:
        movements: ``(n,)``, numbers of movements, from 0.
        missed: ``(n_seeds, n)``, median distances missed at the last ``RECENT`` goals before, in the unit of T.
        met: ``(n_seeds, n)``, shares of these goals that were met within the tolerance of the run.
        failed: ``(n_seeds, n)``, shares of the last ``RECENT`` movements that failed.
    """

    movements: NDArray[np.int64]
    missed: Array
    met: Array
    failed: Array

    @property
    def last_missed(self) -> Interval | None:
        """Median distance missed at the last ``RECENT`` goals; None if a learner chose no goal."""
        return over_seeds(self.missed[:, -1])

    @property
    def last_met(self) -> Interval | None:
        """Share of the last ``RECENT`` goals that was met; None if a learner chose no goal."""
        return over_seeds(self.met[:, -1])


@dataclass(frozen=True, eq=False)
class Comparison:
    """The last error of a variant minus that of the baseline.

    Args:
        variant: variant that is compared with the baseline.
        differences: ``(n_seeds,)`` in the unit of T, one for each common seed.
        difference: interquartile mean of the differences, with its interval.
    """

    variant: Variant
    differences: Array
    difference: Interval

    @property
    def verdict(self) -> str:
        """Verdict by the position of the interval relative to 0, or a text that there are too few seeds."""
        if len(self.differences) < LEAST_SEEDS:
            return f"fewer than {LEAST_SEEDS} common seeds"
        return "better" if self.difference.high < 0 else "worse" if self.difference.low > 0 else "not told apart"


def _own_after(run: Run, goals: OwnGoals, until: int) -> list[float]:
    """Median distance missed, share met and share failed of the last ``RECENT`` before ``until``; NaN for none."""
    missed, failed = goals.recent_misses(until), run.failed[max(0, until - RECENT) : until]
    means = (np.median, missed), (np.mean, missed <= run.tolerance), (np.mean, failed)
    return [float(mean(values)) if len(values) else np.nan for mean, values in means]


def baseline_of(variants: Sequence[Variant], name: str | None = None) -> Variant | None:
    """The variant ``name``. Without a name: SGIM-D if it has errors, else the first variant with errors, else None.

    Raises:
        ValueError: no variant with errors has this name.
    """
    by_name = {variant.name: variant for variant in variants if variant.last_error}
    if name is None:
        return by_name.get(USUAL) or next(iter(by_name.values()), None)
    if name not in by_name:
        raise unknown_name_error("--baseline (a variant with errors)", name, sorted(by_name))
    return by_name[name]


def compare(variants: Sequence[Variant], baseline: Variant | None) -> list[Comparison]:
    """Comparisons of variants with the baseline: those that share seeds, last number of movements and unit with it."""
    if baseline is None:
        return []
    theirs, at = _last_errors(baseline), baseline.compared_at
    others = [variant for variant in variants if variant is not baseline and variant.compared_at == at]
    others = [variant for variant in others if variant.space.unit == baseline.space.unit]
    pairs = [(variant, common_differences(_last_errors(variant), theirs)) for variant in others]
    return [
        Comparison(variant, differences, mean) for variant, differences in pairs if (mean := over_seeds(differences))
    ]


def _last_errors(variant: Variant) -> dict[int, float]:
    return {int(run.config["seed"]): run.at(variant.compared_at) for run in variant.used}
