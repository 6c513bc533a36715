"""One table with the results of runs: error, noise floor and costs of each variant, over its seeds.

It takes a folder with run directories, OUT/NAME/seed-000, or one variant's, OUT/NAME. Variants are compared after the
last number of movements at which all finished runs were evaluated, or after --at. The worst comes first. Errors and
noise floors are means over seeds in metres, ± the standard deviation; with fewer than 5 seeds there is none, and a
note. "by linear" is the error if LocallyLinear answers, whatever inverse model the run has: compare learners by it.
Costs are milliseconds for each movement. Runs that are damaged, not finished or not evaluated there are left out, and
named below the table.

With --baseline there is a column more: error minus that of the baseline, paired by seed, interquartile mean over the
seeds that both have; with five seeds or more, its bootstrap interval of 95 % in brackets. Below 0 is better.

  sgimd table runs
  sgimd table study --at 2000                      also with unfinished runs that were evaluated there
  sgimd table study --baseline goals=interest-map  what the others are compared with

Exit code: 0 a table was printed, 2 there is nothing to show.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.catalogue import did_you_mean
from sgimd_torch.runs.config import OWN
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import say
from sgimd_torch.runs.read import Run, find_runs, read_run, variant_of
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import LEAST_SEEDS, common_differences, over_seeds, show

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
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, the worst variant first; the exit code, 0.

    Raises:
        ValueError: there is nothing to show.
    """
    options = parser().parse_args(argv)
    runs, left_out = _readable(options.runs)
    at = options.at
    if at is None:
        left_out += [_unfinished(run) for run in runs if not run.summary.get("finished")]
        runs = [run for run in runs if run.summary.get("finished")]
        common = set.intersection(*map(_evaluated, runs)) if runs else set[int]()
        if runs and not common:
            raise RunError("finished runs were never evaluated after the same number of movements; --at chooses one")
        at = max(common, default=0)
    left_out += [f"{run.path} was not evaluated after {at} movements" for run in runs if at not in _evaluated(run)]
    variants: dict[str, list[Run]] = {}
    for run in runs:
        if at in _evaluated(run):
            variants.setdefault(variant_of(run.path), []).append(run)
    if not variants:
        raise RunError("\n".join(["there is nothing to compare; is --at another number of movements?", *left_out]))
    errors = (f"error at {EARLY}", f"at {at} (m)", "by linear (m)", "noise floor (m)")
    heads = ("variant", "seeds", *errors, "physics (ms)", "learning (ms)")
    worst_first = sorted(variants.items(), key=lambda variant: -_at(variant[1], at).mean())
    table = [heads, *(_row(name, theirs, at) for name, theirs in worst_first)]
    if options.baseline is not None:
        baseline = variants[known(options.baseline, variants)]
        further = [f"minus {options.baseline} (m)", *(_minus(theirs, baseline, at) for _, theirs in worst_first)]
        table = [(*cells, cell) for cells, cell in zip(table, further, strict=True)]
    widths = [max(map(len, cells)) for cells in zip(*table, strict=True)]
    for cells in table:
        print("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip(), flush=True)
    few = [f"{name} ({len(theirs)})" for name, theirs in worst_first if len(theirs) < LEAST_SEEDS]
    if few:
        say(f"fewer than {LEAST_SEEDS} seeds, too few for a verdict or a deviation: {', '.join(few)}")
    say(*(f"left out: {reason}" for reason in left_out))
    return 0


def known(baseline: str, variants: Collection[str]) -> str:
    """The ``baseline``, which has to be one of the variants with errors to compare.

    Raises:
        ValueError: it is not; they are named.
    """
    if baseline not in variants:
        names = f"{', '.join(sorted(variants))}{did_you_mean(baseline, variants)}"
        raise ValueError(f"--baseline must be a variant with errors to compare, got {baseline!r}; these are {names}")
    return baseline


def _readable(out: Path) -> tuple[list[Run], list[str]]:
    """The runs below ``out``, and what is wrong with those that are damaged."""
    runs, wrong = [], []
    for path in itertools.chain.from_iterable(find_runs(out).values()):
        try:
            run = read_run(path)
            _milliseconds(run, "physics")
            if run.damage:
                raise RunError("; ".join(f"{path}/{name} is damaged at line {n}" for name, n in run.damage.items()))
            runs.append(run)
        except RunError as error:
            wrong.append(str(error))
    return runs, wrong


def _row(name: str, runs: Sequence[Run], at: int) -> tuple[str, ...]:
    errors = _at(runs, at)
    return (
        name,
        str(len(runs)),
        _metres(_at(runs, EARLY)),
        f"{errors.mean():.3f}" + (f" ± {errors.std(ddof=1):.3f}" if len(runs) >= LEAST_SEEDS else ""),
        _metres(_at(runs, at, "mean_error_m", "linear")),
        _metres(_at(runs, at, "noise_floor_m")),
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
    return set(run.evaluation["movements"].astype(int).tolist())


def _at(runs: Sequence[Run], movements: int, column: str = "mean_error_m", answer: str = OWN) -> Array:
    """``(n_runs,)`` see ``Run.at``."""
    return np.array([run.at(movements, column, answer) for run in runs])


def _milliseconds(run: Run, part: str) -> float:
    """Mean milliseconds for one movement.

    Raises:
        RunError: the run's summary is missing or damaged.
    """
    try:
        return 1e3 * float(run.summary[f"seconds_{part}"] / run.summary["movements"])
    except (KeyError, TypeError, ZeroDivisionError) as error:
        raise RunError(f"{run.path}: its summary.json is missing or damaged; --resume writes it again") from error


def _unfinished(run: Run) -> str:
    return f"{run.path} is not finished: {len(run.index)} of {run.config.get('movements')} movements; --resume goes on"
