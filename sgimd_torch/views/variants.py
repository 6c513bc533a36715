"""Variants of a study: the runs of each over its seeds, and statistics over them. Reports and tables show these.

variants = read(Path("runs")); variants[0].last_error    # interquartile mean and interval (m)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property, reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from sgimd_torch.figures.names import label
from sgimd_torch.runs.read import Run, find_runs, read_run
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import LEAST_SEEDS, Interval, over_seeds


def read(place: Path) -> dict[str, list[Run]]:
    """All runs at a place by variant, without their thetas.

    Raises:
        RunError: there is none, or a run is damaged.
    """
    runs: dict[str, list[Run]] = {}
    found = [(name, path) for name, paths in find_runs(place).items() for path in paths]
    for name, path in tqdm(found, "reading", unit="", delay=1.0, disable=None):
        run = replace(read_run(path), thetas=np.empty((0, 0)))  # they would fill the memory, and are not shown
        runs.setdefault(name, []).append(run)
    return runs


def best_first(variants: Iterable[Variant]) -> list[Variant]:
    """By their last error; those without one come last."""
    return sorted(variants, key=lambda v: (v.last_error.value if v.last_error else np.inf, v.name))


def unit_of(variants: Sequence[Variant]) -> Callable[[str], str]:
    """Names a quantity, with the unit of their outcomes if all have the same."""
    first = variants[0].space
    same = all(variant.space.unit == first.unit for variant in variants)
    return first.in_unit if same else lambda quantity: f"{quantity} (unit of T)"


class Variant:
    """The runs of one variant, one for each seed.

    Errors are of the finished runs, at the evaluations that all of them have; if none is finished yet, of all that
    were evaluated.

    Args:
        name: of its folder.
        runs: one or more.
        at: the movements after which it is compared, and errors are of all runs that were evaluated there; None for
            the last evaluation.
    """

    def __init__(self, name: str, runs: Sequence[Run], at: int | None = None) -> None:
        self.name, self.label = name, label(name)
        self.runs = sorted(runs, key=lambda run: int(run.config["seed"]))
        self.algorithm = str(self.runs[0].config["algorithm"])
        self.environment, self.space = str(self.runs[0].config["environment"]), self.runs[0].spaces["outcomes"]
        evaluated = [run for run in self.runs if len(run.answers["own"]["movements"])]
        if at is None:
            self.used = [run for run in evaluated if run.summary["finished"]] or evaluated
        else:
            self.used = [run for run in evaluated if at in run.answers["own"]["movements"]]
        moments = [run.answers["own"]["movements"] for run in self.used]
        self.evaluated: NDArray[np.int64] = reduce(np.intersect1d, moments or [np.empty(0)]).astype(np.int64)
        self.last = at or (int(self.evaluated[-1]) if len(self.evaluated) else 0)  # movements before the last one

    def values(self, movements: int, column: str = "mean_error", answer: str = "own") -> Array:
        """``(n_seeds,)`` a column of the evaluations; NaN where there is none."""
        return np.array([run.at(movements, column, answer) for run in self.used], dtype=np.float64)

    def at(self, movements: int, column: str = "mean_error", answer: str = "own") -> Interval | None:
        """The same over its seeds; None where one of them has no value."""
        return over_seeds(self.values(movements, column, answer))

    @property
    def few(self) -> bool:
        """Whether there are too few seeds for intervals."""
        return len(self.used) < LEAST_SEEDS

    @cached_property
    def errors(self) -> Array:
        """``(n_seeds, n)`` m, at ``evaluated``."""
        return self._over_time("mean_error")

    @cached_property
    def floors(self) -> Array:
        """``(n_seeds, n)`` m the noise floors, at ``evaluated``; NaN where they were not measured."""
        return self._over_time("noise_floor")

    @cached_property
    def curve(self) -> Array:
        """``(3, n)`` m: interquartile mean over seeds at each of ``evaluated``, ends of its interval."""
        found = [over_seeds(column) or (np.nan,) * 3 for column in self.errors.T]
        return np.array(found, dtype=np.float64).reshape(-1, 3).T

    @cached_property
    def last_error(self) -> Interval | None:
        """The error (m) at the last evaluation that all have."""
        return self.at(self.last)

    @cached_property
    def landed(self) -> Array:
        """``(n, outcome_dim)`` m where movements of all its runs ended."""
        outcomes = np.concatenate([run.outcomes for run in self.runs])
        return outcomes[np.isfinite(outcomes).all(axis=1)]

    @cached_property
    def demonstrated(self) -> Array:
        """``(n, outcome_dim)`` m the outcomes of what its runs were shown."""
        shown = [each.outcome for run in self.runs for each in run.demonstrations]
        return np.array(shown, dtype=np.float64).reshape(len(shown), self.landed.shape[1])

    @cached_property
    def misses(self) -> tuple[Array, Array]:
        """Goals ``(n, outcome_dim)`` of the last evaluation, and their errors ``(n,)``, means over the seeds that have
        the same goals."""
        goals = self.typical.benchmark
        errors = [run.missed_by(self.last)[0] for run in self.used if np.array_equal(run.benchmark, goals)]
        return goals, np.mean(errors, axis=0)

    @property
    def typical(self) -> Run:
        """The run with the median last error (the better of two); maps show this one."""
        if not self.last:
            return max(self.runs, key=lambda run: len(run.index))
        return sorted(self.used, key=lambda run: run.at(self.last))[(len(self.used) - 1) // 2]

    def seconds(self, part: str) -> float:
        """Mean over its runs of what was spent on "physics", "learner" or "evaluation"."""
        return float(np.mean([run.summary[f"seconds_{part}"] for run in self.used or self.runs]))

    def _over_time(self, column: str) -> Array:
        columns = [self.values(movements, column) for movements in self.evaluated.tolist()]
        return np.array(columns, dtype=np.float64).reshape(len(self.evaluated), len(self.used)).T
