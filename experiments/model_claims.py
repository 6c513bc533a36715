"""What the forward model had to show, and did it? Tables of results/FORWARD_MODEL.md; the prose around them stays.

Each table replaces what stands between its two marker lines:

  <!-- bars -->            each bar, the number of every variant judged by it, a verdict   <!-- end of bars -->
  <!-- forward-model -->   all variants on the rod: errors, difference to the plain one    <!-- end of forward-model -->
  <!-- planar-arm-7 -->    the same on the arm of 7 joints                                 <!-- end of planar-arm-7 -->
  <!-- planar-arm-50 -->   and on that of 50                                               <!-- end of planar-arm-50 -->

How honest the predicted spread is comes from the table that model_figures.py leaves (--table). What a model costs does
not stand in files: scripts/bench_forward_model.py measures it.

Example:
  python experiments/model_claims.py --results results/forward_model.csv --table results/model/table.csv
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import numpy as np

from evidence import Evidence, NotRun, metres, rng, shared, show
from judgements import FAILS, HOLDS, OPEN, Judged, Row, at_least, at_most, below_zero
from pages import count_verdicts, markdown, read_page, verdicts_table, write_page
from read_results import LAST, Evaluated, ResultsError, read_results
from sgimd_torch.runs.process import telling_errors, with_streams
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import (
    difference_interval,
    improvement_interval,
    interquartile_mean,
    interval,
    iqm_interval,
    movements_to_reach,
    ratio_interval,
)
from variants import ARMS, EXPERIMENTS

SIMPLEX: Final = "sgim-d"  # with Nelder & Mead's simplex and no model, what everything is measured against
JUDGED: Final = ("model", "gradient")
ROD: Final = "forward-model"
TIMES: Final = {ROD: (500, 1000, 2000, LAST), **dict.fromkeys(ARMS, (250, 500, 1000, 2000))}
EMPTY: Final = "# The forward model\n" + "".join(
    f"\n<!-- {name} -->\n<!-- end of {name} -->\n" for name in ("bars", *TIMES)
)


def _fewer_movements(name: str) -> Callable[[Evidence], Judged]:
    def judged(e: Evidence) -> Judged:
        movements, curves = e.curves(name)

        def share(curves: Array, simplex: Array) -> Array:
            """Of the movements that the simplex had: those until the model's mean curve is as low as its last error."""
            mean = interquartile_mean(np.swapaxes(curves, -1, -2))
            return np.minimum(movements_to_reach(movements, mean, interquartile_mean(simplex)) / LAST, 2.0)

        found = interval(share, curves, e.errors(SIMPLEX), rng=rng())
        return f"{100 * found.value:.0f} % [{100 * found.low:.0f}, {100 * found.high:.0f}]", at_most(found, 0.6)

    return judged


def _lower_error(name: str) -> Callable[[Evidence], Judged]:
    def judged(e: Evidence) -> Judged:
        found = {
            when: difference_interval(*shared(e.at(name, when), e.at(SIMPLEX, when)), rng=rng())
            for when in (1000, 2000, LAST)
        }
        below = [below_zero(each) for each in found.values()]
        verdict = next((each for each in (HOLDS, FAILS) if below.count(each) >= 2), OPEN)
        return "; ".join(f"{when}: {metres(each)}" for when, each in found.items()), verdict

    return judged


def _below_the_floor(name: str) -> Callable[[Evidence], Judged]:
    def judged(e: Evidence) -> Judged:
        errors, floors = shared(e.at(name), e.at(SIMPLEX, values="floors"))
        values = (np.array(list(column.values())) for column in (errors, floors))
        found = ratio_interval(*values, rng=rng(), paired=True)
        error = iqm_interval(e.errors(name), rng=rng())
        return f"{show(error, '.4f')} m, {show(found)} times the floor", at_most(found, 1.0)

    return judged


def _half_on_fifty_joints(name: str) -> Callable[[Evidence], Judged]:
    def judged(e: Evidence) -> Judged:
        found = ratio_interval(e.errors(f"{name}-arm-50", 2000), e.errors(f"{SIMPLEX}-arm-50", 2000), rng=rng())
        return f"ratio {show(found)}", at_most(found, 0.5)

    return judged


BARS: Final = (
    ("fewer movements", "SGIM-D's error at 5000 in ≤ 60 % of the movements", _fewer_movements),
    ("lower error", "difference at 1000, 2000, 5000 < 0 at two of them", _lower_error),
    ("below the noise of typical movements", "error at 5000 ≤ noise floor of SGIM-D", _below_the_floor),
    ("planar arm, 50 joints", "error at 2000 ≤ half of SGIM-D's", _half_on_fifty_joints),
)


def judge(evidence: Evidence, coverages: Mapping[str, Array]) -> list[Row]:
    """Every bar for every variant in ``JUDGED``; "cannot say" where something was not run.

    Args:
        coverages: variant -> ``(n_seeds,)``, the share of outcomes in 80 % regions from 2000 movements on.
    """
    rows = []
    for claim, bar, judging in BARS:
        for name in JUDGED:
            try:
                number, verdict = judging(name)(evidence)
            except NotRun as missing:
                number, verdict = str(missing), OPEN
            rows.append(Row(f"{claim}: `{name}`", bar, number, verdict))
    return rows + [_calibrated(name, coverages.get(name, np.empty(0))) for name in JUDGED]


def _calibrated(name: str, coverages: Array) -> Row:
    claim, bar = f"calibration: `{name}`", "80 % regions hold 70 to 90 % from 2000 movements on"
    if len(coverages) < 2:
        return Row(claim, bar, f"not run: {name} in the table of model_figures.py", OPEN)
    found = iqm_interval(coverages, rng=rng())
    verdicts = at_least(found, 0.7), at_most(found, 0.9)
    number = f"{show(found)}, single runs {coverages.min():.2f} to {coverages.max():.2f}"
    return Row(claim, bar, number, next((verdict for verdict in verdicts if verdict != HOLDS), HOLDS))


def variants_table(evidence: Evidence, experiment: str) -> str:
    """One line for each variant of an experiment; a difference below 0 says that it errs less than the same learner
    without model and with the simplex."""
    times = TIMES[experiment]
    variants = [evidence.results[name] for name in EXPERIMENTS[experiment] if name in evidence.results]
    head = ("variant", "seeds", *(f"error at {when} (m)" for when in times))
    last = f"at {times[-1]}"
    columns = (*head, f"difference to the plain learner {last} (m)", "plain better, probability")
    return markdown(columns, [_line(variant, evidence, times) for variant in variants])


def _line(variant: Evaluated, evidence: Evidence, times: Sequence[int]) -> list[str]:
    name, last = variant.variant, times[-1]
    arm = next((f"-{arm.removeprefix('planar-')}" for arm in ARMS if variant.experiment == arm), "")
    learner = next((each for each in ("sagg-riac", "imitation") if name.startswith(each)), SIMPLEX)
    plain = f"{learner}{arm}"

    def told(tell: Callable[[], str]) -> str:
        try:
            return tell()
        except NotRun:
            return "-"

    def difference() -> str:
        pairs = shared(evidence.at(name, last), evidence.at(plain, last))
        return metres(difference_interval(*pairs, rng=rng())).removesuffix(" m")

    def improvement() -> str:
        return show(improvement_interval(evidence.errors(plain, last), evidence.errors(name, last), rng=rng()))

    def error(when: int) -> str:
        return show(iqm_interval(evidence.errors(name, when), rng=rng()), ".4f")

    errors = [told(lambda when=when: error(when)) for when in times]  # type: ignore[misc]
    compared = ["", ""] if name == plain else [told(difference), told(improvement)]
    return [name, str(len(variant.at(last))), *errors, *compared]


def read_coverages(path: Path) -> dict[str, Array]:
    """Variant -> ``(n_seeds,)`` from the table of model_figures.py; {} without file.

    Raises:
        ResultsError: it is not such a table.
    """
    if not path.exists():
        return {}
    found: dict[str, list[float]] = {}
    try:
        for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
            value = float(row["inside_80_late"])
            if not math.isnan(value):
                found.setdefault(row["run"].split("/")[0], []).append(value)
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{path} is no table of model_figures.py: {error}; was it edited?") from error
    return {name: np.array(values) for name, values in found.items()}


@telling_errors
def main(argv: Sequence[str] | None = None) -> int:
    """Write the tables; the exit code is 2 when the results or the file make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, path, what in (
        ("results", "results/forward_model.csv", "the table of compare.py"),
        ("table", "results/model/table.csv", "the table of model_figures.py"),
        ("out", "results/FORWARD_MODEL.md", "the page"),
    ):
        parser.add_argument(f"--{name}", type=Path, default=Path(path), help=f"{what} (default: %(default)s)")
    options = parser.parse_args(argv)
    evidence = Evidence(read_results(options.results), {})
    rows = judge(evidence, read_coverages(options.table))
    tables = {experiment: variants_table(evidence, experiment) for experiment in TIMES}
    tables["bars"] = verdicts_table("what", rows)
    write_page(options.out, read_page(options.out, EMPTY), tables)
    print(f"{options.out}: {len(rows)} bars, of which {count_verdicts(rows)}")
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
