"""One table with the results of runs: error, noise floor and costs of each variant, over its seeds.

It takes a folder with run directories, OUT/NAME/seed-000, or one variant's, OUT/NAME. Variants are compared after the
last number of movements at which all finished runs were evaluated, or after --at. The worst comes first. Errors and
noise floors are means over seeds, ± the standard deviation; with fewer than 5 seeds there is none, and a note. They are
in the unit of T. "by linear" is the error if LocallyLinear answers, whatever inverse model the run has.
Costs are milliseconds for each movement. Runs that were not evaluated there are left out, and named below the table.

With --baseline there is a column more: error minus that of the baseline, paired by seed, interquartile mean over the
seeds that both have; with five seeds or more, its bootstrap interval of 95 % in brackets. Below 0 is better.

With --episodes it prints all movements of one run instead, as csv: a line for each, numbers that read back exactly.

  sgimd table runs
  sgimd table study --at 2000                      such as while runs are under way
  sgimd table study --baseline goals=interest-map  what the others are compared with
  sgimd table runs/sgim-d/seed-003 --episodes > movements.csv

Exit code: 0 a table was printed, 2 there is nothing to show.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.record import RunError
from sgimd_torch.runs.process import printable, say
from sgimd_torch.runs.read import Run, read_run
from sgimd_torch.spaces import Array
from sgimd_torch.views.comparison import baseline_of, compare
from sgimd_torch.views.statistics import LEAST_SEEDS, show
from sgimd_torch.views.text_table import print_table
from sgimd_torch.views.variants import Variant, best_first, read, unit_of

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
    found = read(options.runs)
    at = options.at or _last_common([run for runs in found.values() for run in runs if run.summary["finished"]])
    every = best_first(Variant(name, runs, at) for name, runs in found.items())
    variants = [variant for variant in every if variant.used][::-1]
    left_out = [
        f"{run.path} was not evaluated after {at} movements, it has {len(run.index)} of {run.config['movements']}"
        for variant in every
        for run in variant.runs
        if run not in variant.used
    ]
    if not variants:
        raise RunError("\n".join(["there is nothing to compare; is --at another number of movements?", *left_out]))
    unit = unit_of(variants)
    errors = (f"error at {EARLY}", unit(f"at {at}"), "by linear", "noise floor")
    table: list[tuple[str, ...]] = [
        ("variant", "seeds", *errors, "physics (ms)", "learning (ms)"),
        *map(_row, variants),
    ]
    if options.baseline is not None:
        baseline = baseline_of(variants, options.baseline)
        minus = {each.variant: show(each.found, "+.4f") for each in compare(variants, baseline)}
        further = [f"minus {options.baseline}", *(minus.get(variant, "-") for variant in variants)]
        table = [(*cells, cell) for cells, cell in zip(table, further, strict=True)]
    print_table(table)
    if few := [f"{variant.name} ({len(variant.used)})" for variant in variants if variant.few]:
        say(f"fewer than {LEAST_SEEDS} seeds, too few for a verdict or a deviation: {', '.join(few)}")
    say(*(f"left out: {reason}" for reason in left_out))
    return 0


def _last_common(runs: Sequence[Run]) -> int:
    """The most movements after which all of these runs were evaluated; 0 without runs.

    Raises:
        RunError: there is no such number.
    """
    moments = [set(run.answers["own"]["movements"].tolist()) for run in runs]
    common = set.intersection(*moments) if moments else {0}
    if not common:
        if not any(moments):
            raise RunError("no finished run was evaluated; were they made with --evaluate-at '[]'?")
        raise RunError("finished runs were never evaluated after the same number of movements; --at chooses one")
    return int(max(common))


def _row(variant: Variant) -> tuple[str, ...]:
    errors = variant.values(variant.last)
    milliseconds = 1e3 / np.mean([run.summary["movements"] for run in variant.used])
    return (
        variant.name,
        str(len(errors)),
        _mean(variant.values(EARLY)),
        _mean(errors) + ("" if variant.few else f" ± {errors.std(ddof=1):.3f}"),
        _mean(variant.values(variant.last, answer="linear")),
        _mean(variant.values(variant.last, "noise_floor")),
        *(f"{milliseconds * variant.seconds(part):.2f}" for part in ("physics", "learner")),
    )


def _mean(lengths: Array) -> str:
    return f"{lengths.mean():.3f}" if np.isfinite(lengths.mean()) else "-"


def print_episodes(run: Run) -> None:
    """All movements of a run as csv; what there was not, such as a goal when babbling, is an empty field."""
    parts = {"context": run.contexts, "theta": run.thetas, "goal": run.goals, "outcome": run.outcomes}
    names = [f"{name}_{k}" for name, values in parts.items() for k in range(values.shape[1])]
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["movement", "origin", "demonstration", *names])
    numbers = np.concatenate(list(parts.values()), axis=1).tolist()
    for index, origin, shown, row in zip(run.index, run.origin, run.demonstration, numbers, strict=True):
        cells = ["" if np.isnan(number) else repr(number) for number in row]
        writer.writerow([index, printable(origin), shown if shown >= 0 else "", *cells])
