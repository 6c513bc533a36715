"""A table of the results of runs: error, noise floor and time of each variant, over its seeds.

RUNS is a folder of variants (OUT), of one variant (OUT/NAME), or of one run (OUT/NAME/seed-000). Variants are compared
after --at movements; the default is the last number of movements at which all finished runs were evaluated. Runs
without this evaluation are left out, and named below the table. The worst variant comes first.

Errors and noise floors are means over seeds, in the unit of T. With 5 seeds or more, the number after ± is the standard
deviation of the errors over seeds. Times are milliseconds per movement.

--baseline adds a column: the error minus that of the baseline, as interquartile mean over common seeds.
With 5 seeds or more, the brackets have its 95 % bootstrap interval. A number below 0 is better than the baseline.

  sgimd table runs
  sgimd table study --at 2000                      before all runs are finished
  sgimd table study --baseline goals=interest-map  with differences from this variant

Exit code: 0 a table was printed, 2 there is nothing to show.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.record import RunError
from sgimd_torch.runs.process import parser_of, say
from sgimd_torch.runs.read import Run
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import LEAST_SEEDS, show
from sgimd_torch.views.text_table import print_table
from sgimd_torch.views.variants import EARLY, Variant, baseline_of, best_first, compare, read, unit_of


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd table``."""
    parser = parser_of("table", __doc__)
    parser.add_argument("runs", type=Path, metavar="RUNS", help="folder of a run, of a variant or of several variants")
    parser.add_argument("--at", type=int, metavar="MOVEMENTS", help="number of movements at which to compare")
    parser.add_argument("--baseline", metavar="NAME", help="variant to compare the others with, seed by seed")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, the worst variant first, and return the exit code 0.

    Raises:
        ValueError: there is nothing to show, or a run is damaged.
    """
    options = parser().parse_args(argv)
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
        raise RunError("\n".join(["there is nothing to compare; is --at a number that was evaluated?", *left_out]))
    unit = unit_of(variants)
    errors = (f"error at {EARLY}", unit(f"at {at}"), "noise floor")
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
        say(f"fewer than {LEAST_SEEDS} seeds, too few for an interval or a deviation: {', '.join(few)}")
    say(*(f"left out: {reason}" for reason in left_out))
    return 0


def _last_common(runs: Sequence[Run]) -> int:
    """The largest number of movements at which all of these runs were evaluated; 0 without runs.

    Raises:
        RunError: no evaluation is common to all runs.
    """
    moments = [set(run.answers["own"]["movements"].tolist()) for run in runs]
    common = set.intersection(*moments) if moments else {0}
    if not common:
        if not any(moments):
            raise RunError("no finished run was evaluated; were they made with --evaluate-at '[]'?")
        raise RunError("finished runs were never evaluated after the same number of movements; choose one with --at")
    return int(max(common))


def _row(variant: Variant) -> tuple[str, ...]:
    errors = variant.values(variant.last)
    milliseconds = 1e3 / np.mean([run.summary["movements"] for run in variant.used])
    return (
        variant.name,
        str(len(errors)),
        _mean(variant.values(EARLY)),
        _mean(errors) + ("" if variant.few else f" ± {errors.std(ddof=1):.3f}"),
        _mean(variant.values(variant.last, "noise_floor")),
        *(f"{milliseconds * variant.seconds(part):.2f}" for part in ("physics", "learner")),
    )


def _mean(lengths: Array) -> str:
    return f"{lengths.mean():.3f}" if np.isfinite(lengths.mean()) else "-"
