"""A table of the results of runs: error, noise floor and time of each variant, over its seeds.

RUNS is a folder of variants (OUT), of one variant (OUT/NAME), or of one run (OUT/NAME/seed-000). Variants are compared
after --at movements; the default is the last number of movements at which all finished runs were evaluated. Runs
without this evaluation are left out, and named below the table. The worst variant comes first.

An error is the mean distance to the goals of the evaluation, in the unit of T; beside it is the median over the goals,
which a few goals missed by far do not move. All numbers are interquartile means over seeds, as in a report. With 5
seeds or more, the brackets have the 95 % bootstrap interval. Times are milliseconds per movement.

If no run was evaluated, the table shows how nearly the learners met the last 50 goals that they chose themselves: the
median distance, the share met within the tolerance, and the share of all movements that failed.

--baseline adds a column: the error minus that of the baseline, over common seeds. A number below 0 is better.

  sgimd table runs
  sgimd table study --at 2000                      before all runs are finished
  sgimd table study --baseline goals=interest-map  with differences from this variant
  sgimd table study --format csv                   with all digits, and columns for the intervals

Exit code: 0 a table was printed, 2 there is nothing to show.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.extras.table.results import Column, print_csv, print_table, results
from sgimd_torch.extras.table.statistics import LEAST_SEEDS
from sgimd_torch.extras.table.variants import (
    Variant,
    baseline_of,
    best_first,
    compare,
    differing,
    read_runs,
    unalike,
    unit_of,
)
from sgimd_torch.record import RunError
from sgimd_torch.runs.directory import may_change
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import parser_of
from sgimd_torch.runs.read import Run


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd table``."""
    parser = parser_of("table", __doc__)
    parser.add_argument("runs", type=Path, metavar="RUNS", help="folder of a run, of a variant or of several variants")
    parser.add_argument("--at", type=int, metavar="MOVEMENTS", help="number of movements at which to compare")
    parser.add_argument("--baseline", metavar="NAME", help="variant to compare the others with, seed by seed")
    forms = "form of the table (default: %(default)s)"
    parser.add_argument("--format", choices=("text", "csv"), default="text", help=forms)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, the worst variant first, and return the exit code 0.

    Raises:
        ValueError: there is nothing to show, or a run is damaged.
    """
    options = parser().parse_args(argv)
    variant_runs = read_runs(options.runs)
    runs = [run for seeds in variant_runs.values() for run in seeds]
    evaluated = options.at or options.baseline or any(len(run.evaluation["movements"]) for run in runs)
    at = options.at or (_last_common([run for run in runs if run.summary["finished"]]) if evaluated else None)
    every = best_first(Variant(name, seeds, at) for name, seeds in variant_runs.items())
    variants = [variant for variant in every if variant.used or not evaluated][::-1]
    left_out = [
        f"{run.path} was not evaluated after {at} movements, it has {len(run.index)} of {run.config['movements']}"
        for variant in every
        for run in variant.runs
        if evaluated and run not in variant.used
    ]
    if not variants:
        raise RunError("\n".join(["there is nothing to compare; is --at a number that was evaluated?", *left_out]))
    columns = results(variants)
    if options.baseline is not None:
        baseline = baseline_of(variants, options.baseline)
        minus = {comparison.variant: comparison.difference for comparison in compare(variants, baseline)}
        head = unit_of(variants)(f"minus {options.baseline}")
        columns.append(Column(head, [minus.get(variant) for variant in variants], "+.4f"))
    names = [variant.name for variant in variants]
    if options.format == "csv":
        parts = [part for column in columns for part in column.parts()]
        print_csv(zip(["variant", *names], *parts, strict=True))
    else:
        cells = ([column.head, *column.texts()] for column in columns)
        print_table(list(zip(["variant", *names], *cells, strict=True)))
    say(*unalike(variants))
    if few := [f"{variant.name} ({len(variant.used or variant.runs)})" for variant in variants if variant.few]:
        say(f"fewer than {LEAST_SEEDS} seeds, too few for an interval: {', '.join(few)}")
    for variant in variants:
        if others := [option for option in differing([variant]) if option not in may_change()]:
            say(f"{variant.name}: its seeds differ in {', '.join(others)}; were two studies given one --name?")
    say(*(f"{run.path}: {remark}" for run in runs for remark in run.remarks))
    say(*(f"left out: {reason}" for reason in left_out))
    return 0


def _last_common(runs: Sequence[Run]) -> int:
    """The largest number of movements at which all of these runs were evaluated; 0 without runs.

    Raises:
        RunError: no evaluation is common to all runs.
    """
    moments = [set(run.evaluations["own"]["movements"].tolist()) for run in runs]
    common = set.intersection(*moments) if moments else {0}
    if not common:
        if not any(moments):
            raise RunError("no finished run was evaluated; were they made with --evaluate-at '[]'?")
        raise RunError("finished runs were never evaluated after the same number of movements; choose one with --at")
    return int(max(common))
