"""The claims of section 6 of Nguyen & Oudeyer (2014) and those about the forward model, each with its bar.

for verdict in judge(PAPER_CLAIMS, results, "linear"): print(verdict.claim, verdict.verdict)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from judging import (
    FAILS,
    HOLDS,
    LAST,
    LEARNERS,
    OPEN,
    Claim,
    Judge,
    Judged,
    Results,
    all_of,
    at_least,
    at_most,
    below_zero,
    ratio_at_most,
    shared,
)
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import (
    Interval,
    difference_interval,
    improvement_interval,
    interquartile_mean,
    interval,
    metres,
    rng,
    show,
)

OTHERS: Final = tuple(learner for learner in LEARNERS if learner != "sgim-d")
DAMAGE: Final = 0.005  # m; what later movements may cost, a tenth of the error
ROBUST: Final = "SGIM-D − SAGG-RIAC, and SGIM-D − Imitation taught alike, at 5000 < 0"
SIMPLEX: Final = "sgim-d"  # with Nelder & Mead's simplex and no model, what learners with a model are compared with
JUDGED: Final = ("model", "gradient")


def _sagg_riac_beats_random(results: Results) -> Judged:
    difference, ratio = results.difference("sagg-riac", "random"), results.ratio("sagg-riac", "random")
    return f"ratio {show(ratio)}", all_of(below_zero(difference), at_most(ratio, 0.85))


def _imitation_beats_random(results: Results) -> Judged:
    difference, ratio = results.difference("imitation", "random"), results.ratio("imitation", "sagg-riac")
    return f"{show(ratio)} times sagg-riac", below_zero(difference)


def _beats_the_others(errors: Callable[[Results, str], Array]) -> Judge:
    def judged(results: Results) -> Judged:
        ours, theirs = errors(results, "sgim-d"), {other: errors(results, other) for other in OTHERS}
        found = {other: improvement_interval(ours, each, level=results.level) for other, each in theirs.items()}
        return _listed(found), all_of(*(at_least(each, 0.95, lower=0.75) for each in found.values()))

    return judged


def _near_the_noise(results: Results) -> Judged:
    ratio = results.floor_ratio("sgim-d", "sgim-d")
    return f"{show(ratio)} times the noise floor", at_most(ratio, 1.25)


def _fast(results: Results) -> Judged:
    found = results.time_to_reach("sgim-d", "random", at_most=LAST)
    return f"{show(found, '.0f')} movements", at_most(found, np.nextafter(1000, 0))


def _robust_to(teacher: int) -> tuple[Judge, list[tuple[str, str]]]:
    """How it is judged, and the pairs that are compared."""
    taught = "" if teacher == 3 else f"-teacher-{teacher}"
    pairs = [(f"sgim-d{taught}", other) for other in ("sagg-riac", f"imitation{taught}")]

    def judged(results: Results) -> Judged:
        found = {theirs: results.improvement(ours, theirs) for ours, theirs in pairs}
        differences = [results.difference(*pair) for pair in pairs]
        return f"P(improvement) {_listed(found)}", all_of(*map(below_zero, differences))

    return judged, pairs


def _large_space_costs_sagg_riac_more(results: Results) -> Judged:
    names = ("sagg-riac-large", "sagg-riac", "sgim-d-large", "sgim-d")

    def times(*errors: Array) -> Array:
        large, small, our_large, our_small = map(interquartile_mean, errors)
        return (large / small) / (our_large / our_small)

    found = interval(times, *map(results.errors, names), rng=rng(), level=results.level)
    own = results.ratio("sagg-riac-large", "sagg-riac")
    above_one = below_zero(Interval(1 - found.value, 1 - found.high, 1 - found.low))
    return f"SAGG-RIAC's ratio {show(own)}, {show(found)} times SGIM-D's", above_one


def _goals_are_near(results: Results) -> Judged:
    ours, theirs = (results.near_goals(variant) for variant in ("sgim-d-large", "sagg-riac-large"))

    def times(ours: Array, theirs: Array) -> Array:
        """Shares of near goals, all seeds together; half a goal more for theirs, which avoids a division by zero."""
        (our_goals, our_near), (goals, near) = (np.moveaxis(c.sum(axis=-2), -1, 0) for c in (ours, theirs))
        return (our_near / our_goals) / ((near + 0.5) / (goals + 1))

    found = interval(times, ours, theirs, rng=rng(), level=results.level)
    shares = [100 * counts[:, 1].sum() / counts[:, 0].sum() for counts in (ours, theirs)]
    return f"{shares[0]:.1f} % against {shares[1]:.2f} %: {show(found, '.0f')} times", at_least(found, 10)


def _range(results: Results) -> Judged:
    def apart(lower: Interval, upper: Interval) -> str:
        if lower.high < upper.low:
            return HOLDS
        return FAILS if upper.high < lower.low else OPEN

    found = {learner: results.iqm(learner, values="tiles") for learner in ("random", "sagg-riac", "sgim-d")}
    random, sagg_riac, sgim_d = found.values()
    return _listed(found, ".0f"), all_of(apart(random, sagg_riac), apart(sagg_riac, sgim_d))


def _no_late_damage(results: Results) -> Judged:
    late, early = shared(results.at("sgim-d-long", 2 * LAST), results.at("sgim-d-long"))
    found = difference_interval(late, early, rng=rng(), level=results.level)
    return metres(found), at_most(found, DAMAGE)


def _listed(found: Mapping[str, Interval], form: str = ".2f") -> str:
    return "; ".join(f"{variant} {show(each, form)}" for variant, each in found.items())


def _less(text: str, ours: str, theirs: str) -> Claim:
    """The claim that our error at the end is smaller than theirs, paired by seed."""

    def judged(results: Results) -> Judged:
        difference, better = results.difference(ours, theirs), results.improvement(ours, theirs)
        return f"P(improvement) {show(better)}", below_zero(difference)

    return Claim(text, f"{ours} − {theirs} at 5000 < 0", judged, [(ours, theirs)])


PAPER_CLAIMS: Final = (
    Claim(
        "SGIM-D halves Random's error",
        "ratio at 5000 ≤ 0.50, interval up to 0.55",
        ratio_at_most("sgim-d", "random", 0.5, upper=0.55),
        [("sgim-d", "random")],
    ),
    Claim(
        "SAGG-RIAC clearly beats Random",
        "SAGG-RIAC − Random at 5000 < 0, ratio ≤ 0.85",
        _sagg_riac_beats_random,
        [("sagg-riac", "random")],
    ),
    Claim(
        "Imitation beats Random",
        "Imitation − Random at 5000 < 0",
        _imitation_beats_random,
        [("imitation", "random"), ("imitation", "sagg-riac")],
    ),
    Claim(
        "SGIM-D beats every other learner",
        "P(improvement) at 5000 ≥ 0.95 against each, intervals above 0.75",
        _beats_the_others(Results.errors),
        [("sgim-d", other) for other in OTHERS],
    ),
    Claim("... and all along", "the same of the error's mean over life", _beats_the_others(Results.lives)),
    Claim("SGIM-D approaches the noise level", "error at 5000 ≤ 1.25 times its noise floor", _near_the_noise, own=True),
    Claim("SGIM-D is fast from the start", "below Random's error at 5000 in < 1000 movements", _fast),
    Claim("SGIM-D is robust: demonstrator 1, naive", ROBUST, *_robust_to(1)),
    Claim("SGIM-D is robust: demonstrator 2, careful", ROBUST, *_robust_to(2)),
    Claim("SGIM-D is robust: demonstrator 3", ROBUST, *_robust_to(3)),
    Claim(
        "SGIM-D works in a 10⁴ times larger task space",
        "ratio large to small ≤ 1.20",
        ratio_at_most("sgim-d-large", "sgim-d", 1.2),
        [("sgim-d-large", "sgim-d")],
    ),
    Claim(
        "... where SAGG-RIAC loses clearly more",
        "its ratio > SGIM-D's",
        _large_space_costs_sagg_riac_more,
        [("sagg-riac-large", "sagg-riac"), ("sgim-d-large", "sagg-riac-large")],
    ),
    Claim(
        "... because SGIM-D aims where it can reach",
        "goals within 1.5 m: share ≥ 10 times SAGG-RIAC's",
        _goals_are_near,
    ),
    Claim("Range: Random < SAGG-RIAC < SGIM-D", "tiles reached at 5000, intervals apart", _range),
    Claim("No late damage", "error at 10,000 − at 5000 ≤ 0.005 m", _no_late_damage),
    _less("The tree earns its place", "sgim-d", "uniform-goals"),
    _less("... in the large space", "sgim-d-large", "sgim-d-uniform-large"),
    _less("SGIM-D beats the field's standard baseline", "sgim-d", "random-goals-demonstrations"),
    _less("... in the large space, too", "sgim-d-large", "random-goals-demonstrations-large"),
    _less("SGIM-D beats quality diversity that saves effort", "sgim-d", "cma-mae"),
    _less("... also when it is shown the same", "sgim-d", "cma-mae-demonstrations"),
    _less("... and its setting was tuned", "sgim-d", "cma-mae-demonstrations-tuned"),
    _less("Our defaults beat the paper's letter", "sgim-d", "sgim-d-letter"),
    _less(
        "By the paper's eq. (3), too, the tree earns its place in the large space",
        "sgim-d-absolute-large",
        "sgim-d-uniform-large",
    ),
)


def _fewer_movements(name: str, results: Results) -> Judged:
    share = results.time_to_reach(name, SIMPLEX, unit=LAST, at_most=2.0)
    return f"{100 * share.value:.0f} % [{100 * share.low:.0f}, {100 * share.high:.0f}]", at_most(share, 0.6)


def _lower_error(name: str, results: Results) -> Judged:
    found = {when: results.difference(name, SIMPLEX, when) for when in (1000, 2000, LAST)}
    below = [below_zero(each) for each in found.values()]
    verdict = next((each for each in (HOLDS, FAILS) if below.count(each) >= 2), OPEN)
    return "; ".join(f"{when}: {metres(each)}" for when, each in found.items()), verdict


def _below_the_floor(name: str, results: Results) -> Judged:
    ratio = results.floor_ratio(name, SIMPLEX)
    return f"{show(results.iqm(name), '.4f')} m, {show(ratio)} times the floor", at_most(ratio, 1.0)


def _half_on_fifty_joints(name: str, results: Results) -> Judged:
    return ratio_at_most(f"{name}-arm-50", f"{SIMPLEX}-arm-50", 0.5, movements=2000)(results)


# What, the bar, how it is judged, the end of the names of what is compared, and after how many movements.
BARS: Final[tuple[tuple[str, str, Callable[[str, Results], Judged], str | None, int], ...]] = (
    ("fewer movements", "SGIM-D's error at 5000 in ≤ 60 % of the movements", _fewer_movements, "", LAST),
    ("lower error", "difference at 1000, 2000, 5000 < 0 at two of them", _lower_error, "", LAST),
    ("below the noise of typical movements", "error at 5000 ≤ noise floor of SGIM-D", _below_the_floor, "", LAST),
    ("planar arm, 50 joints", "error at 2000 ≤ half of SGIM-D's", _half_on_fifty_joints, "-arm-50", 2000),
)
MODEL_CLAIMS: Final = tuple(
    Claim(
        f"{text}: `{name}`",
        bar,
        partial(judged, name),
        [] if ending is None else [(f"{name}{ending}", f"{SIMPLEX}{ending}")],
        movements,
        own=True,
    )
    for text, bar, judged, ending, movements in BARS
    for name in JUDGED
)
