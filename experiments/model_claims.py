"""The claims about the forward model in results/FORWARD_MODEL.md, for each of the judged variants.

How honest the predicted spread is comes from the table that model_figures.py makes. The cost of a model is in no table:
scripts/bench_run.py measures it.    for verdict in judge(MODEL_CLAIMS, results): print(verdict.verdict)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from judging import (
    FAILS,
    HOLDS,
    OPEN,
    Claim,
    Judged,
    NotRun,
    Results,
    all_of,
    at_least,
    at_most,
    below_zero,
    ratio_at_most,
)
from read_results import LAST
from sgimd_torch.views.statistics import iqm_interval, metres, rng, show

SIMPLEX: Final = "sgim-d"  # with Nelder & Mead's simplex and no model, what the others are compared with
JUDGED: Final = ("model", "gradient")


def _fewer_movements(name: str) -> Callable[[Results], Judged]:
    def judged(results: Results) -> Judged:
        share = results.time_to_reach(name, SIMPLEX, unit=LAST, at_most=2.0)
        return f"{100 * share.value:.0f} % [{100 * share.low:.0f}, {100 * share.high:.0f}]", at_most(share, 0.6)

    return judged


def _lower_error(name: str) -> Callable[[Results], Judged]:
    def judged(results: Results) -> Judged:
        found = {when: results.difference(name, SIMPLEX, when) for when in (1000, 2000, LAST)}
        below = [below_zero(each) for each in found.values()]
        verdict = next((each for each in (HOLDS, FAILS) if below.count(each) >= 2), OPEN)
        return "; ".join(f"{when}: {metres(each)}" for when, each in found.items()), verdict

    return judged


def _below_the_floor(name: str) -> Callable[[Results], Judged]:
    def judged(results: Results) -> Judged:
        ratio = results.floor_ratio(name, SIMPLEX)
        return f"{show(results.iqm(name), '.4f')} m, {show(ratio)} times the floor", at_most(ratio, 1.0)

    return judged


def _half_on_fifty_joints(name: str) -> Callable[[Results], Judged]:
    return ratio_at_most(f"{name}-arm-50", f"{SIMPLEX}-arm-50", 0.5, movements=2000)


def _calibrated(name: str, *, region: int, least: float, most: float) -> Callable[[Results], Judged]:
    """Judges the share of outcomes in the model's regions of so many percent."""

    def judged(results: Results) -> Judged:
        shares = results.coverages.get(name, {}).get(region, np.empty(0))
        if len(shares) < 2:
            raise NotRun(f"{name} in the table of model_figures.py")
        found = iqm_interval(shares, rng=rng(), level=results.level)
        number = f"{show(found)}, single runs {shares.min():.2f} to {shares.max():.2f}"
        return number, all_of(at_least(found, least), at_most(found, most))

    return judged


Bar = tuple[str, str, Callable[[str], Callable[[Results], Judged]]]
BARS: Final[tuple[Bar, ...]] = (
    ("fewer movements", "SGIM-D's error at 5000 in ≤ 60 % of the movements", _fewer_movements),
    ("lower error", "difference at 1000, 2000, 5000 < 0 at two of them", _lower_error),
    ("below the noise of typical movements", "error at 5000 ≤ noise floor of SGIM-D", _below_the_floor),
    ("planar arm, 50 joints", "error at 2000 ≤ half of SGIM-D's", _half_on_fifty_joints),
    *(
        (
            f"calibration, {region} %",
            f"{region} % regions hold {100 * least:.0f} to {100 * most:.0f} % from 2000 movements on",
            partial(_calibrated, region=region, least=least, most=most),
        )
        for region, least, most in ((50, 0.4, 0.6), (80, 0.7, 0.9), (95, 0.91, 0.99))
    ),
)
COMPARED: Final = {"planar arm, 50 joints": ("-arm-50", 2000)}  # how names end there, and when
MODEL_CLAIMS: Final = tuple(
    Claim(
        f"{text}: `{name}`",
        bar,
        judge(name),
        [] if "calibration" in text else [(f"{name}{ending}", f"{SIMPLEX}{ending}")],
        movements,
        own=True,
    )
    for text, bar, judge in BARS
    for name in JUDGED
    for ending, movements in [COMPARED.get(text, ("", LAST))]
)
