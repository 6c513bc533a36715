"""What the learners that ask have to show: when, how few, whom, where, at which cost; and how each bar is judged.

    results = Results.of(Path("results"), ["asking"], ["asked.csv"]); judge(ASKING_CLAIMS, results, "process")
All are answered by `process`, whatever they explored with. Seeds are paired.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from judging import LAST, Claim, Judged, NotRun, Results, all_of, at_least, at_most, below_zero, shared
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, difference_interval, interquartile_mean, interval, metres, rng, show
from variants import FOUR, HALVES

IM, CHEAP, DEAR = "sgim-im", "sgim-im-83", "sgim-im-cost-10"
SGIM_D, AT_START, AT_ONCE = "taught-every-30", "taught-at-start", "taught-at-start-once"
SINGLE: Final = tuple(f"sgim-acts-{number}" for number in (1, 2, 3))
ON_TOSS: Final = ("alone-toss", "sgim-im-toss")
BLIND: Final = "alone-toss-blind"  # does not feel the wind
EVERY, COST = 30, 10  # movements from one demonstration to the next of SGIM-D; what a demonstration costs
MOST: Final = 127  # demonstrations that there are
WRONG: Final = "mislabelling"


def counts(results: Results, variant: str, what: str, teachers: Sequence[str] = ()) -> dict[int, float]:
    """Seed -> requests of a kind, a column of asked.csv, to these ``teachers``, all unless given.

    Raises:
        NotRun: fewer than 2 seeds.
    """
    table = results.small["asked.csv"]
    mine = table[(table.variant == variant) & (table.teacher.isin(teachers) | (len(teachers) == 0))]
    found = mine.groupby("seed")[what].sum()
    if len(found) < 2:
        raise NotRun(f"requests of {variant}")
    return {int(seed): float(count) for seed, count in found.items()}


def _less(
    text: str, ours: str, theirs: str, times: tuple[int, ...], more: str = "", most_shown: float = np.inf
) -> Claim:
    """The claim that our error is smaller than theirs at each time, with at most so many demonstrations."""

    def judged(results: Results) -> Judged:
        found = {when: results.difference(ours, theirs, when) for when in times}
        said = ", ".join(f"{metres(each)} at {when}" for when, each in found.items())
        return _with_shown(results, ours, said, all_of(*map(below_zero, found.values())), most_shown)

    on = "on the toss " if "toss" in ours else ""
    bar = f"difference {on}at {' and '.join(map(str, times))} < 0{more}"
    return Claim(text, bar, judged, [(ours, theirs)], times[-1])


def _no_more(text: str, bar: str, ours: str, theirs: str, most_shown: float = np.inf) -> Claim:
    """The claim that our error at the end is at most theirs, with at most so many demonstrations."""

    def judged(results: Results) -> Judged:
        found = results.difference(ours, theirs)
        return _with_shown(results, ours, metres(found), at_most(found, 0.0), most_shown)

    return Claim(text, bar, judged, [(ours, theirs)])


def _share_of(results: Results, parts: Mapping[int, float], wholes: Mapping[int, float]) -> tuple[str, Interval]:
    """All ``parts`` over all ``wholes``, seeds drawn together, in words and in numbers.

    Raises:
        NotRun: there are none.
    """
    if not sum(wholes.values()):
        raise NotRun("no requests to count")

    def share(part: Array, whole: Array) -> Array:
        found: Array = part.sum(axis=-1) / np.maximum(whole.sum(axis=-1), 1)
        return found

    samples = (np.array(list(each.values())) for each in (parts, wholes))
    found = interval(share, *samples, rng=rng(), paired=True, level=results.level)
    percent = show(Interval(*(100 * each for each in found)), ".0f", "%")
    return f"{percent} of {sum(wholes.values()):.0f} late requests", found


def _like_the_best(results: Results) -> Judged:
    best = min(SINGLE, key=lambda name: results.iqm(name).value)
    ratio = results.ratio("sgim-acts-four", best)
    return f"{show(ratio)} times the error of {best}", at_most(ratio, 1.05)


def _seldom_wrong(results: Results) -> Judged:
    said, found = _share_of(results, *(counts(results, "sgim-acts-four", "late", of) for of in ((WRONG,), FOUR)))
    return said, at_most(found, 0.1)


def _in_their_half(results: Results) -> Judged:
    own, late = (counts(results, "sgim-acts-halves", what, HALVES) for what in ("late_own", "late"))
    said, found = _share_of(results, own, late)
    return said, at_least(found, 0.8)


def _asks_less(results: Results) -> Judged:
    found = _paired(results, *shared(counts(results, DEAR, "shown"), counts(results, IM, "shown")))
    dear, cheap = (interquartile_mean(np.array([*counts(results, name, "shown").values()])) for name in (DEAR, IM))
    return f"{dear:.0f} demonstrations rather than {cheap:.0f}", below_zero(found)


def _less_at_equal_cost(results: Results) -> Judged:
    """SGIM-D at the movement at which it has cost as much, on straight lines between its evaluations."""
    ours, shown = shared(results.at(DEAR), counts(results, DEAR, "shown"))
    curves = results.rows["error"].loc[results.answer, SGIM_D].unstack("seed") if results.at(SGIM_D) else None
    theirs: dict[int, float] = {}
    for seed, demonstrations in shown.items():
        if curves is not None and seed in curves:
            curve = curves[seed].dropna()
            same = (LAST + COST * demonstrations) / (1 + COST / EVERY)
            theirs[seed] = float(np.interp(same, curve.index.to_numpy(np.float64), curve.to_numpy()))
    found = _paired(results, *shared(ours, theirs))
    return metres(found), below_zero(found)


def _in_strong_wind(results: Results) -> Judged:
    strong, weak = (counts(results, "sgim-im-toss", what) for what in ("strong", "weak"))
    found = _paired(results, weak, strong)
    said = f"{sum(strong.values()):.0f} requests in a strong wind, {sum(weak.values()):.0f} in a weak one"
    return said, below_zero(found)


def _with_shown(results: Results, variant: str, said: str, verdict: str, most: float) -> Judged:
    if most == np.inf:
        return said, verdict
    shown = max(counts(results, variant, "shown").values())
    return f"{said}, {shown:.0f} demonstrations at most", all_of(verdict, at_most(Interval(shown, shown, shown), most))


def _paired(results: Results, ours: Mapping[int, float], theirs: Mapping[int, float]) -> Interval:
    return difference_interval(ours, theirs, rng=rng(), level=results.level)


ASKING_CLAIMS: Final = (
    _less(
        "When: SGIM-IM errs less than SGIM-D early",
        *(IM, SGIM_D, (1000,), ", with at most 127 demonstrations", MOST),
    ),
    _no_more(
        "... and late no more than SGIM-D that was shown all at the start",
        "difference at 5000 ≤ 0, with at most 127 demonstrations",
        *(IM, AT_START, MOST),
    ),
    _no_more(
        "... nor than practice that was shown all at the start", "the same; ours, not asked for", IM, AT_ONCE, MOST
    ),
    _no_more(
        "How few: with half of the demonstrations it errs no more than SGIM-D",
        "difference at 5000 ≤ 0, with at most 83 demonstrations",
        *(CHEAP, SGIM_D, 83),
    ),
    Claim(
        "Whom: of four teachers, one of them mislabelling, SGIM-ACTS learns as from the best one alone",
        "ratio ≤ 1.05 at 5000",
        _like_the_best,
        [("sgim-acts-four", single) for single in SINGLE],
    ),
    Claim("... and leaves who mislabels alone", "≤ 10 % of the requests after 1000", _seldom_wrong),
    Claim(
        "Where: of two teachers who cover a half each, it asks in their own half",
        "≥ 80 % of the requests after 1000",
        _in_their_half,
    ),
    Claim("Cost: when a demonstration costs ten movements, it asks less", "difference < 0", _asks_less),
    Claim(
        "... and errs less than SGIM-D at equal total cost",
        "difference < 0, to SGIM-D when it has cost as much",
        _less_at_equal_cost,
        [(DEAR, SGIM_D)],
    ),
    _less(
        "Against information: asking by progress errs less than asking by the entropy of a process",
        *(IM, "sgim-eer", (1000, LAST), ", whatever it is"),
    ),
    _less(
        "Contexts: it learns to use the wind, and errs less than who does not feel it",
        *(ON_TOSS[1], BLIND, (1000, 2000)),
    ),
    _less("... and less than without a teacher", ON_TOSS[1], ON_TOSS[0], (1000, 2000)),
    Claim(
        "... and asks more in a strong wind than in a weak one",
        "requests in the outer third > in the inner third",
        _in_strong_wind,
    ),
)
