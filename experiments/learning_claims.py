"""What the learners from few movements have to show on the rod, and how each bar is judged.

    rod = read_learning(Path("results/learning.csv")); judge(LEARNING_CLAIMS, rod["judged"])
All are answered by `process`, whatever they explored with, unless a table says so. The suite is in suite_claims.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from judging import Claim, Judged, NotRun, Results, all_of, at_most, below_zero
from read_results import LAST, read_results
from sgimd_torch.views.statistics import Interval, interquartile_mean, metres, point, show
from variants import LEARNING, PROVED

BEST, ALONE, IMITATION = "practice-taught.rod", "practice.rod", "imitation.rod"
TIMES: Final = (250, 500, 1000, 2000)
TAUGHT_RIVALS: Final = tuple(
    f"{name}.rod" for name in ("cma-mae-taught", "cma-mae-taught-once", "map-elites-taught", "uniform-nearest-taught")
)


def read_learning(path: Path) -> dict[str, Results]:
    """The results in learning.csv by answer, and "judged": claims compare all answered by `process`.

    Raises:
        ResultsError: there is no such table, or a line of it makes no sense.
    """
    found = {answer: read_results(path, answer) for answer in PROVED}
    judged = Results(found["own"], same=found["process"])
    return {"judged": judged, **{answer: Results(each) for answer, each in found.items()}}


def at_most_after(variant: str, bars: Mapping[int, float]) -> Callable[[Results], Judged]:
    """Judges the error (m) after so many movements."""

    def judged(results: Results) -> Judged:
        found = {when: results.iqm(variant, when) for when in bars}
        number = ", ".join(f"{show(each, '.4f')} at {when}" for when, each in found.items())
        return number, all_of(*(at_most(found[when], bar) for when, bar in bars.items()))

    return judged


def below(ours: str, theirs: tuple[str, ...], times: tuple[int, ...]) -> Callable[[Results], Judged]:
    """Judges whether our error is smaller than each of theirs at each time, paired by seed."""

    def judged(results: Results) -> Judged:
        found = {(name, when): results.difference(ours, name, when) for name in theirs for when in times}
        least = max(found, key=lambda each: found[each].value)
        said = f"the closest: {least[0].removesuffix('.rod')} at {least[1]}, {metres(found[least])}"
        return said, all_of(*map(below_zero, found.values()))

    return judged


def ratios_at_most(ours: str, theirs: str, bar: float, times: tuple[int, ...]) -> Callable[[Results], Judged]:
    """Judges our error over theirs at each time."""

    def judged(results: Results) -> Judged:
        return _at_most_each({when: results.ratio(ours, theirs, when) for when in times}, bar)

    return judged


def _model_over_process(results: Results) -> Judged:
    """The imitation learner's own answer has a model, that of `process` has none; the memory is the same."""
    return _at_most_each({when: results.over_alike(IMITATION, when) for when in (*TIMES, LAST)}, 1.03)


def _at_most_each(ratios: Mapping[int, Interval], bar: float) -> Judged:
    number = ", ".join(f"{show(each)} at {when}" for when, each in ratios.items())
    return number, all_of(*(at_most(each, bar) for each in ratios.values()))


def _near_the_floor(results: Results) -> Judged:
    ratio = results.floor_ratio(BEST, BEST)
    return f"{show(ratio)} times the floor", at_most(ratio, 1.03)


LEARNING_CLAIMS: Final = (
    Claim(
        "Our best learner needs few movements",
        "≤ 0.105, 0.070, 0.046 m after 250, 500, 1000",
        at_most_after(BEST, {250: 0.105, 500: 0.070, 1000: 0.046}),
    ),
    Claim("... and errs little in the end", "≤ 0.0325 m after 5000", at_most_after(BEST, {LAST: 0.0325})),
    Claim("... as little as noise allows", "≤ 1.03 times its noise floor after 5000", _near_the_floor, own=True),
    Claim(
        "All that without torch",
        "≤ 0.058 and 0.037 m after 1000 and 5000",
        at_most_after(BEST, {1000: 0.058, LAST: 0.037}),
    ),
    Claim(
        "Without a teacher it errs less than CMA-MAE",
        "difference after 1000, 2000, 5000 < 0",
        below(ALONE, ("cma-mae.rod",), (1000, 2000, LAST)),
        [(ALONE, "cma-mae.rod")],
    ),
    Claim(
        "With one, less than every rival that is shown the same",
        "difference after 500, 1000, 5000 < 0",
        below(BEST, TAUGHT_RIVALS, (500, 1000, LAST)),
        [(BEST, rival) for rival in TAUGHT_RIVALS],
    ),
    Claim(
        "It errs less than SGIM-D",
        "difference after 500, 1000, 5000 < 0",
        below(BEST, ("sgim-d.rod",), (500, 1000, LAST)),
        [(BEST, "sgim-d.rod")],
    ),
    Claim(
        "Curiosity pays in the small space",
        "SGIM-D − SGIM-D with uniform goals at 5000 < 0",
        below("sgim-d.rod", ("sgim-d-uniform.rod",), (LAST,)),
        [("sgim-d.rod", "sgim-d-uniform.rod")],
    ),
    Claim(
        "A teacher who shows one corner only does no harm",
        "≤ 1.03 times the error without a teacher, after 250 to 5000",
        ratios_at_most("practice-corner.rod", ALONE, 1.03, (*TIMES, LAST)),
        [("practice-corner.rod", ALONE)],
    ),
    Claim(
        "Nor does one who mislabels all, after 1000",
        "≤ 1.03 times the error without a teacher, after 1000 to 5000",
        ratios_at_most("practice-shuffled.rod", ALONE, 1.03, (1000, 2000, LAST)),
        [("practice-shuffled.rod", ALONE)],
    ),
    Claim(
        "... nor before",
        "≤ 1.03 times the error without a teacher, after 250 and 500",
        ratios_at_most("practice-shuffled.rod", ALONE, 1.03, (250, 500)),
    ),
    Claim(
        "A forward model does an imitation learner no harm",
        "≤ 1.03 times the error of `process` on the same memory, after 250 to 5000",
        _model_over_process,
        own=True,
    ),
    Claim(
        "SGIM-D errs less than the field's standard baseline that is shown the same",
        "difference after 5000 < 0; ours, not asked for",
        below("sgim-d.rod", ("uniform-nearest-taught.rod",), (LAST,)),
        [("sgim-d.rod", "uniform-nearest-taught.rod")],
    ),
)


def answers_rows(by_answer: Mapping[str, Results]) -> list[list[str]]:
    """For each memory of the rod the error of `process` over that of the nearest and of `LocallyLinear`."""

    def ratio(variant: str, other: str, when: int) -> Interval:
        ours, theirs = (interquartile_mean(by_answer[name].errors(variant, when)) for name in ("process", other))
        return point(float(ours / theirs))

    return [
        [
            f"`{variant.removesuffix('.rod')}`",
            f"`{other}`",
            *(shown(partial(ratio, variant, other, when)) for when in (*TIMES, LAST)),
        ]
        for variant in LEARNING
        for other in ("nearest", "linear")
    ]


def shown(number: Callable[[], Interval], form: str = ".2f") -> str:
    """A number in words, a dash if it was not run."""
    try:
        return show(number(), form)
    except NotRun:
        return "-"
