"""The paper's claims, each with the bar that it has to clear, our number, and whether it holds.

Section 6 of Nguyen & Oudeyer (2014). A bar counts as cleared only if the whole 95 % interval clears it; when the
interval straddles the bar, or runs are missing, nothing can be said.   for row in judge(evidence): row.verdict
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from evidence import Evidence, NotRun, metres, rng, shared, show
from read_results import LAST
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import (
    Interval,
    difference_interval,
    improvement_interval,
    interquartile_mean,
    interval,
    iqm_interval,
    mean_over_life,
    movements_to_reach,
    ratio_interval,
)

HOLDS: Final = "holds"
FAILS: Final = "does not hold"
OPEN: Final = "cannot say"
OTHERS: Final = ("random", "sagg-riac", "observation", "imitation")
ROBUST: Final = "SGIM-D − SAGG-RIAC, and SGIM-D − Imitation taught alike, at 5000 < 0"
Judged = tuple[str, str]  # our number in words, and the verdict


class Row(NamedTuple):
    """One line of the table of claims."""

    claim: str
    bar: str
    number: str
    verdict: str


def at_most(found: Interval, bar: float, upper: float | None = None) -> str:
    """Is it ``bar`` or less? ``upper``: how far the interval may reach, the bar itself unless told otherwise."""
    if found.value <= bar and found.high <= (bar if upper is None else upper):
        return HOLDS
    return FAILS if found.low > bar else OPEN


def at_least(found: Interval, bar: float) -> str:
    """Is it ``bar`` or more?"""
    return at_most(Interval(-found.value, -found.high, -found.low), -bar)


def below_zero(found: Interval) -> str:
    """Do ours err less, for certain?"""
    if found.high < 0:
        return HOLDS
    return FAILS if found.low > 0 else OPEN


def all_of(*verdicts: str) -> str:
    """One that fails fails all; else one that is open leaves all open."""
    return next((verdict for verdict in (FAILS, OPEN) if verdict in verdicts), HOLDS)


def _halves(e: Evidence) -> Judged:
    ratio = ratio_interval(e.errors("sgim-d"), e.errors("random"), rng=rng())
    return f"ratio {show(ratio)}", at_most(ratio, 0.5, upper=0.55)


def _sagg_riac_beats_random(e: Evidence) -> Judged:
    difference = e.difference("sagg-riac", "random")
    ratio = ratio_interval(e.errors("sagg-riac"), e.errors("random"), rng=rng())
    return f"{metres(difference)}; ratio {show(ratio)}", all_of(below_zero(difference), at_most(ratio, 0.85))


def _imitation_beats_random(e: Evidence) -> Judged:
    difference = e.difference("imitation", "random")
    ratio = ratio_interval(e.errors("imitation"), e.errors("sagg-riac"), rng=rng())
    return f"{metres(difference)}; {show(ratio)} times sagg-riac", below_zero(difference)


def _improves_at_the_end(e: Evidence) -> Judged:
    found = {o: improvement_interval(e.errors("sgim-d"), e.errors(o), rng=rng()) for o in OTHERS}
    return _listed(found), all_of(*(at_least(each, 0.95) for each in found.values()))


def _improves_over_life(e: Evidence) -> Judged:
    lives = {variant: mean_over_life(*e.curves(variant)) for variant in ("sgim-d", *OTHERS)}
    found = {o: improvement_interval(lives["sgim-d"], lives[o], rng=rng()) for o in OTHERS}
    return _listed(found), all_of(*(at_least(each, 0.95) for each in found.values()))


def _near_the_noise(e: Evidence) -> Judged:
    errors, floors = shared(e.at("sgim-d"), e.at("sgim-d", values="floors"))
    ratio = ratio_interval(np.array(list(errors.values())), np.array(list(floors.values())), rng=rng(), paired=True)
    return f"{show(ratio)} times the noise floor", at_most(ratio, 1.25)


def _fast(e: Evidence) -> Judged:
    movements, curves = e.curves("sgim-d")

    def until(curves: Array, random: Array) -> Array:
        """When the interquartile mean of the curves passes that of Random's errors; the last evaluation if never."""
        mean = interquartile_mean(np.swapaxes(curves, -1, -2))
        return np.minimum(movements_to_reach(movements, mean, interquartile_mean(random)), movements[-1])

    found = interval(until, curves, e.errors("random"), rng=rng())
    return f"{show(found, '.0f')} movements", at_most(found, np.nextafter(1000, 0))


def _robust_to(teacher: int) -> Callable[[Evidence], Judged]:
    taught = "" if teacher == 3 else f"-teacher-{teacher}"

    def judged(e: Evidence) -> Judged:
        against = ("sagg-riac", f"imitation{taught}")
        found = {other: e.difference(f"sgim-d{taught}", other) for other in against}
        numbers = "; ".join(f"{other} {metres(each)}" for other, each in found.items())
        return numbers, all_of(*map(below_zero, found.values()))

    return judged


def _large_space_costs_little(e: Evidence) -> Judged:
    ratio = ratio_interval(e.errors("sgim-d-large"), e.errors("sgim-d"), rng=rng())
    return f"ratio {show(ratio)}", at_most(ratio, 1.2)


def _large_space_costs_sagg_riac_more(e: Evidence) -> Judged:
    names = ("sagg-riac-large", "sagg-riac", "sgim-d-large", "sgim-d")

    def times(*errors: Array) -> Array:
        large, small, our_large, our_small = map(interquartile_mean, errors)
        return (large / small) / (our_large / our_small)

    found = interval(times, *map(e.errors, names), rng=rng())
    own = ratio_interval(e.errors(names[0]), e.errors(names[1]), rng=rng())
    return f"SAGG-RIAC's ratio {show(own)}, {show(found)} times SGIM-D's", _above(found, 1.0)


def _goals_are_near(e: Evidence) -> Judged:
    for variant in ("sgim-d-large", "sagg-riac-large"):
        if len(e.goals.get(variant, ())) < 2:
            raise NotRun(f"not run: goals of {variant}")

    def times(ours: Array, theirs: Array) -> Array:
        """Shares of near goals, all seeds together; half a goal more for theirs, lest one divides by none at all."""
        (our_goals, our_near), (goals, near) = (np.moveaxis(c.sum(axis=-2), -1, 0) for c in (ours, theirs))
        return (our_near / our_goals) / ((near + 0.5) / (goals + 1))

    ours, theirs = e.goals["sgim-d-large"], e.goals["sagg-riac-large"]
    found = interval(times, ours, theirs, rng=rng())
    shares = [100 * counts[:, 1].sum() / counts[:, 0].sum() for counts in (ours, theirs)]
    return f"{shares[0]:.1f} % against {shares[1]:.2f} %: {show(found, '.0f')} times", at_least(found, 10)


def _range(e: Evidence) -> Judged:
    found = {
        variant: iqm_interval(np.array(list(e.at(variant, values="tiles").values())), rng=rng())
        for variant in ("random", "sagg-riac", "sgim-d")
    }
    random, sagg_riac, sgim_d = found.values()
    verdict = all_of(_apart(random, sagg_riac), _apart(sagg_riac, sgim_d))
    return _listed(found, ".0f"), verdict


def _no_late_damage(e: Evidence) -> Judged:
    late, early = shared(e.at("sgim-d-long", 2 * LAST), e.at("sgim-d-long"))
    found = difference_interval(late, early, rng=rng())
    return metres(found), FAILS if found.low > 0 else HOLDS


def _tree(ours: str, uniform: str) -> Callable[[Evidence], Judged]:
    def judged(e: Evidence) -> Judged:
        found = e.difference(ours, uniform)
        return metres(found), below_zero(found)

    return judged


def _above(found: Interval, bar: float) -> str:
    return below_zero(Interval(bar - found.value, bar - found.high, bar - found.low))


def _apart(lower: Interval, upper: Interval) -> str:
    if lower.high < upper.low:
        return HOLDS
    return FAILS if upper.high < lower.low else OPEN


def _listed(found: Mapping[str, Interval], form: str = ".2f") -> str:
    return "; ".join(f"{variant} {show(each, form)}" for variant, each in found.items())


CLAIMS: Final[tuple[tuple[str, str, Callable[[Evidence], Judged]], ...]] = (
    ("SGIM-D halves Random's error", "ratio at 5000 ≤ 0.50, interval up to 0.55", _halves),
    ("SAGG-RIAC clearly beats Random", "SAGG-RIAC − Random at 5000 < 0, ratio ≤ 0.85", _sagg_riac_beats_random),
    ("Imitation beats Random", "Imitation − Random at 5000 < 0", _imitation_beats_random),
    (
        "SGIM-D beats every other learner",
        "P(improvement) at 5000 ≥ 0.95 against each",
        _improves_at_the_end,
    ),
    ("... and all along", "the same of the error's mean over life", _improves_over_life),
    ("SGIM-D approaches the noise level", "error at 5000 ≤ 1.25 times its noise floor", _near_the_noise),
    ("SGIM-D is fast from the start", "below Random's error at 5000 in < 1000 movements", _fast),
    ("SGIM-D is robust: demonstrator 1, naive", ROBUST, _robust_to(1)),
    ("SGIM-D is robust: demonstrator 2, careful", ROBUST, _robust_to(2)),
    ("SGIM-D is robust: demonstrator 3", ROBUST, _robust_to(3)),
    ("SGIM-D works in a 10⁴ times larger task space", "ratio large to small ≤ 1.20", _large_space_costs_little),
    ("... where SAGG-RIAC loses clearly more", "its ratio > SGIM-D's", _large_space_costs_sagg_riac_more),
    (
        "... because SGIM-D aims where it can reach",
        "goals within 1.5 m: share ≥ 10 times SAGG-RIAC's",
        _goals_are_near,
    ),
    ("Range: Random < SAGG-RIAC < SGIM-D", "tiles reached at 5000, intervals apart", _range),
    ("No late damage", "error at 10,000 − at 5000: interval not wholly above 0", _no_late_damage),
    ("The tree earns its place", "SGIM-D − uniform goals at 5000 < 0", _tree("sgim-d", "uniform-goals")),
    ("... in the large space", "SGIM-D − uniform goals at 5000 < 0", _tree("sgim-d-large", "sgim-d-uniform-large")),
)


def judge(evidence: Evidence) -> list[Row]:
    """All claims, in the paper's order; "cannot say" where something was not run.

    Raises:
        ValueError: errors that no ratio can be made of, such as 0.
    """
    return [Row(claim, bar, *_judged(judged, evidence)) for claim, bar, judged in CLAIMS]


def _judged(judged: Callable[[Evidence], Judged], evidence: Evidence) -> Judged:
    try:
        return judged(evidence)
    except NotRun as missing:
        return str(missing), OPEN
