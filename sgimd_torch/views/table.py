"""One table with the results of runs: error, noise floor and costs of each variant, over its seeds.

It takes a folder with run directories, OUT/NAME/seed-000, or one variant's, OUT/NAME. Variants are compared after the
last number of movements at which all finished runs were evaluated, or after --at. The worst comes first. Errors and
noise floors are means over seeds in metres, ± the standard deviation; with fewer than 5 seeds there is none, and a
note. "by linear" is the error if LocallyLinear answers, whatever inverse model the run has: compare learners by it.
Costs are milliseconds for each movement. Runs that are not finished or not evaluated there are left out, and named
below the table.

With --baseline there is a column more: error minus that of the baseline, paired by seed, interquartile mean over the
seeds that both have; with five seeds or more, its bootstrap interval of 95 % in brackets. Below 0 is better.

With --episodes it prints all movements of one run instead, as csv: a line for each, numbers that read back exactly.

  sgimd table runs
  sgimd table study --at 2000                      also with unfinished runs that were evaluated there
  sgimd table study --baseline goals=interest-map  what the others are compared with
  sgimd table runs/sgim-d/seed-003 --episodes > movements.csv

Exit code: 0 a table was printed, 2 there is nothing to show.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.catalogue import did_you_mean
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import say
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import LEAST_SEEDS, common_differences, over_seeds, show
from sgimd_torch.views.text_table import print_table
from sgimd_torch.views.whole import Run, find_runs, read_run

EARLY: Final = 1000  # movements, for a column of its own


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd table``."""
    parser = argparse.ArgumentParser(
        prog="sgimd table",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("runs", type=Path, help="a run's directory, a variant's folder, or an --out of runs")
    parser.add_argument("--at", type=int, metavar="MOVEMENTS", help="compare after this number of movements")
    parser.add_argument("--baseline", metavar="NAME", help="variant that the others are compared with, seed by seed")
    parser.add_argument("--episodes", action="store_true", help="all movements of one run, as csv")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, the worst variant first; the exit code, 0.

    Raises:
        ValueError: there is nothing to show, or a run is damaged.
    """
    options = parser().parse_args(argv)
    if options.episodes:
        print_episodes(read_run(options.runs))
        return 0
    found = {name: [read_run(path) for path in paths] for name, paths in find_runs(options.runs).items()}
    runs = [run for theirs in found.values() for run in theirs]
    at = options.at
    if at is None:
        ended = [_evaluated(run) for run in runs if run.summary["finished"]]
        common = set.intersection(*ended) if ended else set[int]()
        if ended and not common:
            raise RunError("finished runs were never evaluated after the same number of movements; --at chooses one")
        at = max(common, default=0)
    why = {run.path: _left_out(run, at, unfinished=options.at is not None) for run in runs}
    variants = {name: [run for run in theirs if not why[run.path]] for name, theirs in found.items()}
    variants = {name: theirs for name, theirs in variants.items() if theirs}
    left_out = [reason for reason in why.values() if reason]
    if not variants:
        raise RunError("\n".join(["there is nothing to compare; is --at another number of movements?", *left_out]))
    worst_first = sorted(variants.items(), key=lambda variant: -_at(variant[1], at).mean())
    errors = (f"error at {EARLY}", f"at {at} (m)", "by linear (m)", "noise floor (m)")
    heads: tuple[str, ...] = ("variant", "seeds", *errors, "physics (ms)", "learning (ms)")
    table = [heads, *(_row(name, theirs, at) for name, theirs in worst_first)]
    if options.baseline is not None:
        baseline = variants[known(options.baseline, variants)]
        further = [f"minus {options.baseline} (m)", *(_minus(theirs, baseline, at) for _, theirs in worst_first)]
        table = [(*cells, cell) for cells, cell in zip(table, further, strict=True)]
    print_table(table)
    few = [f"{name} ({len(theirs)})" for name, theirs in worst_first if len(theirs) < LEAST_SEEDS]
    if few:
        say(f"fewer than {LEAST_SEEDS} seeds, too few for a verdict or a deviation: {', '.join(few)}")
    say(*(f"left out: {reason}" for reason in left_out))
    return 0


def print_episodes(run: Run) -> None:
    """All movements of a run as csv; what there was not, such as a goal when babbling, is an empty field."""
    parts = {"context": run.contexts, "theta": run.thetas, "goal": run.goals, "outcome": run.outcomes}
    names = [f"{name}_{k}" for name, values in parts.items() for k in range(values.shape[1])]
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["movement", "origin", "demonstration", *names])
    numbers = np.concatenate(list(parts.values()), axis=1).tolist()
    for index, origin, shown, row in zip(run.index, run.origin, run.demonstration, numbers, strict=True):
        cells = ["" if np.isnan(number) else repr(number) for number in row]
        writer.writerow([index, origin, shown if shown >= 0 else "", *cells])


def known(baseline: str, variants: Collection[str]) -> str:
    """The ``baseline``, which has to be one of the variants with errors to compare.

    Raises:
        ValueError: it is not; they are named.
    """
    if baseline not in variants:
        names = f"{', '.join(sorted(variants))}{did_you_mean(baseline, variants)}"
        raise ValueError(f"--baseline must be a variant with errors to compare, got {baseline!r}; these are {names}")
    return baseline


def _left_out(run: Run, at: int, *, unfinished: bool) -> str:
    """Why a run is not in the table; "" if it is. Those not finished are in it only if ``unfinished`` ones count."""
    if not run.summary["finished"] and not unfinished:
        return f"{run.path} is not finished: {len(run.index)} of {run.config['movements']} movements; --resume goes on"
    return "" if at in _evaluated(run) else f"{run.path} was not evaluated after {at} movements"


def _row(name: str, runs: Sequence[Run], at: int) -> tuple[str, ...]:
    errors = _at(runs, at)
    return (
        name,
        str(len(runs)),
        _metres(_at(runs, EARLY)),
        f"{errors.mean():.3f}" + (f" ± {errors.std(ddof=1):.3f}" if len(runs) >= LEAST_SEEDS else ""),
        _metres(_at(runs, at, "mean_error", "linear")),
        _metres(_at(runs, at, "noise_floor")),
        *(f"{np.mean([_milliseconds(run, part) for run in runs]):.2f}" for part in ("physics", "learner")),
    )


def _minus(ours: Sequence[Run], theirs: Sequence[Run], at: int) -> str:
    """Our errors minus theirs, over the seeds that both have."""
    errors = ({run.config["seed"]: run.at(at) for run in runs} for runs in (ours, theirs))
    found = None if ours is theirs else over_seeds(common_differences(*errors))
    return "-" if found is None else show(found, "+.4f")


def _metres(lengths: Array) -> str:
    return f"{lengths.mean():.3f}" if np.isfinite(lengths.mean()) else "-"


def _evaluated(run: Run) -> set[int]:
    """The numbers of movements after which it was evaluated."""
    return set(run.answers["own"]["movements"].astype(int).tolist())


def _at(runs: Sequence[Run], movements: int, column: str = "mean_error", answer: str = "own") -> Array:
    """``(n_runs,)`` see ``Run.at``."""
    return np.array([run.at(movements, column, answer) for run in runs])


def _milliseconds(run: Run, part: str) -> float:
    """Mean milliseconds for one movement."""
    return 1e3 * run.summary[f"seconds_{part}"] / run.summary["movements"]
