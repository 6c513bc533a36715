"""What the learners that ask have to show: when, how few, whom, where, at which cost; and how each bar is judged.

    asking = read_asking(Path("results")); judge(ASKING_CLAIMS, asking)
All are answered by `process`, whatever they explored with. Seeds are paired.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from judging import Claim, Judged, NotRun, Results, all_of, at_least, at_most, below_zero, shared
from read_results import LAST, read_asked, read_contexts, read_results
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


def read_asking(folder: Path) -> Results:
    """The results in asking.csv, with the requests in asked.csv.

    Raises:
        ResultsError: there is no such table, or a line of it makes no sense.
    """
    path = folder / "asking.csv"
    return Results(read_results(path), same=read_results(path, "process"), asked=read_asked(folder / "asked.csv"))


def counts(results: Results, variant: str, what: str, teachers: Sequence[str] = ()) -> dict[int, float]:
    """Seed -> requests of a kind, see `Asked`, to these ``teachers``, all unless given.

    Raises:
        NotRun: fewer than 2 seeds.
    """
    found = {
        seed: sum(float(getattr(each, what)) for name, each in by_teacher.items() if not teachers or name in teachers)
        for seed, by_teacher in sorted(results.asked.get(variant, {}).items())
    }
    if len(found) < 2:
        raise NotRun(f"requests of {variant}")
    return found


def difference_at(
    ours: str, theirs: str, times: Sequence[int], most_shown: float = np.inf
) -> Callable[[Results], Judged]:
    """Judges whether our error is smaller than theirs at each time, with at most so many demonstrations."""

    def judged(results: Results) -> Judged:
        found = {when: results.difference(ours, theirs, when) for when in times}
        said = ", ".join(f"{metres(each)} at {when}" for when, each in found.items())
        return _with_shown(results, ours, said, all_of(*map(below_zero, found.values())), most_shown)

    return judged


def no_more_than(ours: str, theirs: str, most_shown: float = np.inf) -> Callable[[Results], Judged]:
    """Judges whether our error at the end is at most theirs, with at most so many demonstrations."""

    def judged(results: Results) -> Judged:
        found = results.difference(ours, theirs)
        return _with_shown(results, ours, metres(found), at_most(found, 0.0), most_shown)

    return judged


def share_of(results: Results, parts: Mapping[int, float], wholes: Mapping[int, float]) -> Interval:
    """All ``parts`` over all ``wholes``, seeds drawn together.

    Raises:
        NotRun: there are none.
    """
    if not sum(wholes.values()):
        raise NotRun("no requests to count")

    def share(part: Array, whole: Array) -> Array:
        found: Array = part.sum(axis=-1) / np.maximum(whole.sum(axis=-1), 1)
        return found

    samples = (np.array(list(each.values())) for each in (parts, wholes))
    return interval(share, *samples, rng=rng(), paired=True, level=results.level)


def _like_the_best(results: Results) -> Judged:
    best = min(SINGLE, key=lambda name: results.iqm(name).value)
    ratio = results.ratio("sgim-acts-four", best)
    return f"{show(ratio)} times the error of {best}", at_most(ratio, 1.05)


def _seldom_wrong(results: Results) -> Judged:
    wrong, late = (counts(results, "sgim-acts-four", "late", of) for of in ((WRONG,), FOUR))
    found = share_of(results, wrong, late)
    return f"{_percent(found)} of {sum(late.values()):.0f} late requests", at_most(found, 0.1)


def _in_their_half(results: Results) -> Judged:
    own, late = (counts(results, "sgim-acts-halves", what, HALVES) for what in ("late_own", "late"))
    found = share_of(results, own, late)
    return f"{_percent(found)} of {sum(late.values()):.0f} late requests", at_least(found, 0.8)


def _asks_less(results: Results) -> Judged:
    found = _paired(results, *shared(counts(results, DEAR, "shown"), counts(results, IM, "shown")))
    dear, cheap = (interquartile_mean(np.array([*counts(results, name, "shown").values()])) for name in (DEAR, IM))
    return f"{dear:.0f} demonstrations rather than {cheap:.0f}", below_zero(found)


def _less_at_equal_cost(results: Results) -> Judged:
    """SGIM-D at the movement at which it has cost as much, on straight lines between its evaluations."""
    ours, shown = shared(results.at(DEAR), counts(results, DEAR, "shown"))
    curve = results.variants[SGIM_D] if results.at(SGIM_D) else None
    theirs: dict[int, float] = {}
    for seed, demonstrations in shown.items():
        points = sorted((at, row.errors) for (each, at), row in curve.rows.items() if each == seed) if curve else []
        if points:
            same = (LAST + COST * demonstrations) / (1 + COST / EVERY)
            when, errors = np.array(points).T
            theirs[seed] = float(np.interp(same, when, errors))
    found = _paired(results, *shared(ours, theirs))
    return metres(found), below_zero(found)


def _in_strong_wind(results: Results) -> Judged:
    strong, weak = (counts(results, "sgim-im-toss", what) for what in ("strong", "weak"))
    found = _paired(results, weak, strong)
    said = f"{sum(strong.values()):.0f} requests in a strong wind, {sum(weak.values()):.0f} in a weak one"
    return said, below_zero(found)


ASKING_CLAIMS: Final = (
    Claim(
        "When: SGIM-IM errs less than SGIM-D early",
        "difference at 1000 < 0, with at most 127 demonstrations",
        difference_at(IM, SGIM_D, (1000,), MOST),
        [(IM, SGIM_D)],
        1000,
    ),
    Claim(
        "... and late no more than SGIM-D that was shown all at the start",
        "difference at 5000 ≤ 0, with at most 127 demonstrations",
        no_more_than(IM, AT_START, MOST),
        [(IM, AT_START)],
    ),
    Claim(
        "... nor than practice that was shown all at the start",
        "the same; ours, not asked for",
        no_more_than(IM, AT_ONCE, MOST),
        [(IM, AT_ONCE)],
    ),
    Claim(
        "How few: with half of the demonstrations it errs no more than SGIM-D",
        "difference at 5000 ≤ 0, with at most 83 demonstrations",
        no_more_than(CHEAP, SGIM_D, 83),
        [(CHEAP, SGIM_D)],
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
    Claim(
        "Against information: asking by progress errs less than asking by the entropy of a process",
        "difference at 1000 and 5000 < 0, whatever it is",
        difference_at(IM, "sgim-eer", (1000, LAST)),
        [(IM, "sgim-eer")],
    ),
    Claim(
        "... and than by that of a mixture",
        "difference at 1000 and 5000 < 0, whatever it is",
        difference_at(IM, "sgim-eer-mixture", (1000, LAST)),
        [(IM, "sgim-eer-mixture")],
    ),
    Claim(
        "Contexts: it learns to use the wind, and errs less than who does not feel it",
        "difference on the toss at 1000 and 2000 < 0",
        difference_at(ON_TOSS[1], BLIND, (1000, 2000)),
        [(ON_TOSS[1], BLIND)],
        2000,
    ),
    Claim(
        "... and less than without a teacher",
        "difference on the toss at 1000 and 2000 < 0",
        difference_at(ON_TOSS[1], ON_TOSS[0], (1000, 2000)),
        [(ON_TOSS[1], ON_TOSS[0])],
        2000,
    ),
    Claim(
        "... and asks more in a strong wind than in a weak one",
        "requests in the outer third > in the inner third",
        _in_strong_wind,
    ),
)


def teachers_rows(results: Results) -> list[list[str]]:
    """Requests to each teacher, means over seeds: variant, teacher, all, answered, late, late in their own half."""
    rows = []
    for variant, by_seed in results.asked.items():
        for teacher in dict.fromkeys(name for each in by_seed.values() for name in each):
            found = [each[teacher] for each in by_seed.values() if teacher in each]
            means = [float(np.mean([getattr(each, what) for each in found])) for what in ("requests", "shown", "late")]
            own = float(np.mean([each.late_own for each in found]))
            rows.append(
                [f"`{variant}`", teacher, *(f"{mean:.1f}" for mean in means), f"{own:.1f}" if teacher in HALVES else ""]
            )
    return rows


def contexts_rows(folder: Path, at: int = 2000) -> list[list[str]]:
    """The error (m) by third of the wind, by `process`, interquartile means over seeds; none without a table."""
    found = read_contexts(folder / "contexts.csv")
    rows = []
    for variant in ON_TOSS:
        parts = {
            part: errors
            for (name, when, answer, part), errors in found.items()
            if (name, when, answer) == (variant, at, "process")
        }
        rows += [
            [f"`{variant}`", f"{low:.3g} to {high:.3g}", f"{interquartile_mean(np.array([*errors.values()])):.4f}"]
            for (low, high), errors in sorted(parts.items())
        ]
    return rows


def _with_shown(results: Results, variant: str, said: str, verdict: str, most: float) -> Judged:
    if most == np.inf:
        return said, verdict
    shown = max(counts(results, variant, "shown").values())
    return f"{said}, {shown:.0f} demonstrations at most", all_of(verdict, at_most(Interval(shown, shown, shown), most))


def _paired(results: Results, ours: Mapping[int, float], theirs: Mapping[int, float]) -> Interval:
    return difference_interval(ours, theirs, rng=rng(), level=results.level)


def _percent(found: Interval) -> str:
    return show(Interval(*(100 * each for each in found)), ".0f", "%")
