"""What learners from few movements have to show, on the rod and on the suite, and how each bar is judged.

    results = Results.of(Path("results"), ["learning", "suite"]); judge(LEARNING_CLAIMS, results, "process")
All are answered by `process`, whatever they explored with. On the suite errors are ratios: to those of random movements
answered by the nearest exemplar, or of the field's standard baseline, which answers by the nearest, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

import numpy as np

from judging import FAILS, HOLDS, LAST, OPEN, Claim, Judge, Judged, Results, all_of, at_most, below_zero
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, interquartile_mean, interval, metres, ratio_interval, rng, show
from sgimd_torch.views.suite import RANDOM, TASKS, UNIFORM
from variants import EXPERIMENTS, SUITED

BEST, ALONE, IMITATION = "practice-taught.rod", "practice.rod", "imitation.rod"
TIMES: Final = (250, 500, 1000, 2000)
TAUGHT_RIVALS: Final = tuple(
    f"{name}.rod" for name in ("cma-mae-taught", "cma-mae-taught-once", "map-elites-taught", "uniform-nearest-taught")
)
OURS, RIVALS = "practice", ("cma-mae", "map-elites")
SURE: Final = 5.0


def _at_most_after(variant: str, bars: Mapping[int, float]) -> Judge:
    """Judges the error (m) after so many movements."""

    def judged(results: Results) -> Judged:
        found = {when: results.iqm(variant, when) for when in bars}
        number = ", ".join(f"{show(each, '.4f')} at {when}" for when, each in found.items())
        return number, all_of(*(at_most(found[when], bar) for when, bar in bars.items()))

    return judged


def _below(ours: str, theirs: tuple[str, ...], times: tuple[int, ...]) -> Judge:
    """Judges whether our error is smaller than each of theirs at each time, paired by seed."""

    def judged(results: Results) -> Judged:
        found = {(name, when): results.difference(ours, name, when) for name in theirs for when in times}
        least = max(found, key=lambda each: found[each].value)
        said = f"the closest: {least[0].removesuffix('.rod')} at {least[1]}, {metres(found[least])}"
        return said, all_of(*map(below_zero, found.values()))

    return judged


def _ratios_at_most(ours: str, theirs: str, bar: float, times: tuple[int, ...]) -> Judge:
    """Judges our error over theirs at each time."""

    def judged(results: Results) -> Judged:
        return _at_most_each({when: results.ratio(ours, theirs, when) for when in times}, bar)

    return judged


def _model_over_process(results: Results) -> Judged:
    """The imitation learner's own answer has a model, that of `process` has none; the memory is the same."""
    process = results.by("process")
    found = {
        when: results.paired_ratio(results.at(IMITATION, when), process.at(IMITATION, when)) for when in (*TIMES, LAST)
    }
    return _at_most_each(found, 1.03)


def _at_most_each(ratios: Mapping[int, Interval], bar: float) -> Judged:
    number = ", ".join(f"{show(each)} at {when}" for when, each in ratios.items())
    return number, all_of(*(at_most(each, bar) for each in ratios.values()))


def _near_the_floor(results: Results) -> Judged:
    ratio = results.floor_ratio(BEST, BEST)
    return f"{show(ratio)} times the floor", at_most(ratio, 1.03)


def _less(text: str, bar: str, ours: str, theirs: tuple[str, ...], times: tuple[int, ...]) -> Claim:
    return Claim(text, bar, _below(ours, theirs, times), [(ours, each) for each in theirs])


LEARNING_CLAIMS: Final = (
    Claim(
        "Our best learner needs few movements",
        "≤ 0.105, 0.070, 0.046 m after 250, 500, 1000",
        _at_most_after(BEST, {250: 0.105, 500: 0.070, 1000: 0.046}),
    ),
    Claim("... and errs little in the end", "≤ 0.0325 m after 5000", _at_most_after(BEST, {LAST: 0.0325})),
    Claim("... as little as noise allows", "≤ 1.03 times its noise floor after 5000", _near_the_floor, own=True),
    Claim(
        "All that without torch",
        "≤ 0.058 and 0.037 m after 1000 and 5000",
        _at_most_after(BEST, {1000: 0.058, LAST: 0.037}),
    ),
    _less(
        "Without a teacher it errs less than CMA-MAE",
        "difference after 1000, 2000, 5000 < 0",
        *(ALONE, ("cma-mae.rod",), (1000, 2000, LAST)),
    ),
    _less(
        "With one, less than every rival that is shown the same",
        "difference after 500, 1000, 5000 < 0",
        *(BEST, TAUGHT_RIVALS, (500, 1000, LAST)),
    ),
    _less(
        "It errs less than SGIM-D",
        "difference after 500, 1000, 5000 < 0",
        *(BEST, ("sgim-d.rod",), (500, 1000, LAST)),
    ),
    _less(
        "Curiosity pays in the small space",
        "SGIM-D − SGIM-D with uniform goals at 5000 < 0",
        *("sgim-d.rod", ("sgim-d-uniform.rod",), (LAST,)),
    ),
    Claim(
        "A teacher who shows one corner only does no harm",
        "≤ 1.03 times the error without a teacher, after 250 to 5000",
        _ratios_at_most("practice-corner.rod", ALONE, 1.03, (*TIMES, LAST)),
        [("practice-corner.rod", ALONE)],
    ),
    Claim(
        "Nor does one who mislabels all, after 1000",
        "≤ 1.03 times the error without a teacher, after 1000 to 5000",
        _ratios_at_most("practice-shuffled.rod", ALONE, 1.03, (1000, 2000, LAST)),
        [("practice-shuffled.rod", ALONE)],
    ),
    Claim(
        "... nor before",
        "≤ 1.03 times the error without a teacher, after 250 and 500",
        _ratios_at_most("practice-shuffled.rod", ALONE, 1.03, (250, 500)),
    ),
    Claim(
        "A forward model does an imitation learner no harm",
        "≤ 1.03 times the error of `process` on the same memory, after 250 to 5000",
        _model_over_process,
        own=True,
    ),
    _less(
        "SGIM-D errs less than the field's standard baseline that is shown the same",
        "difference after 5000 < 0; ours, not asked for",
        *("sgim-d.rod", ("uniform-nearest-taught.rod",), (LAST,)),
    ),
)


def _on_each_task(theirs: str, bar: float, results: Results) -> Judged:
    """Practice answered by `process` over another that answers by the nearest."""
    pairs = {
        (task, at): (results.errors(f"{OURS}.{task}", at), results.by("nearest").errors(f"{theirs}.{task}", at))
        for task in TASKS
        for at in TIMES
    }
    return _all_at_most(pairs, bar, results, paired=False)


def _on_each_memory(other: str, results: Results) -> Judged:
    names = (*EXPERIMENTS["suite"], *(f"{name}.rod" for name in SUITED))
    pairs = {
        (f"memory of {name}", at): (results.errors(name, at), results.by(other).errors(name, at))
        for name in names
        for at in TIMES
    }
    return _all_at_most(pairs, 1.02, results, paired=True)


def _all_at_most(
    pairs: Mapping[tuple[str, int], tuple[Array, Array]], bar: float, results: Results, *, paired: bool
) -> Judged:
    """Are all ratios at most ``bar``? One that stays below it by `SURE` standard errors needs no interval."""

    def value(pair: tuple[Array, Array]) -> float:
        return float(interquartile_mean(pair[0]) / interquartile_mean(pair[1]))

    def reaches(pair: tuple[Array, Array]) -> float:
        logs = [np.log(errors) for errors in pair]
        samples = [logs[0] - logs[1]] if paired else logs
        error = np.sqrt(sum(sample.var(ddof=1) / len(sample) for sample in samples))
        return value(pair) * float(np.exp(SURE * error))

    largest = sorted(pairs, key=lambda each: value(pairs[each]), reverse=True)
    largest = [each for each in largest if reaches(pairs[each]) > bar] or largest[:1]
    found = {each: ratio_interval(*pairs[each], rng=rng(), paired=paired, level=results.level) for each in largest}
    name, at = max(found, key=lambda each: found[each].value)
    over = sum(value(pair) > bar for pair in pairs.values())
    number = f"at most {show(found[name, at])}, {name} at {at}; above the bar {over} of {len(pairs)}"
    return number, all_of(*(at_most(each, bar) for each in found.values()))


def _over_tasks(theirs: tuple[tuple[str, str, int], ...], bar: float, results: Results) -> Judged:
    """The interquartile mean over tasks of our error / theirs, each (learner, its answer, movements)."""
    found = {}
    for name, answer, at in theirs:
        tasks = [task for task in TASKS if f"{name}.{task}" in EXPERIMENTS["suite"] or task == "rod"]
        ours = [results.errors(f"{OURS}.{task}", at) for task in tasks]
        others = [results.by(answer).errors(f"{name}.{task}", at) for task in tasks]

        def ratios(*drawn: Array, n: int = len(tasks)) -> Array:
            each = [interquartile_mean(x) / interquartile_mean(y) for x, y in zip(drawn[:n], drawn[n:], strict=True)]
            return interquartile_mean(np.stack(each, axis=-1))

        found[name, at] = interval(ratios, *ours, *others, rng=rng(), level=results.level)
    number = ", ".join(f"{show(each)} of {name} at {at}" for (name, at), each in found.items())
    return number, all_of(*(at_most(each, bar) for each in found.values()))


def _more_data(results: Results) -> Judged:
    """Fails where the error has grown beyond its interval; open where it may have grown."""
    found = {
        task: results.paired_ratio(results.at(f"{OURS}.{task}", 2000), results.at(f"{OURS}.{task}", 500))
        for task in TASKS
    }
    most = max(found, key=lambda task: found[task].value)
    verdicts = (FAILS if each.low > 1 else OPEN if each.value > 1 else HOLDS for each in found.values())
    return f"at most {show(found[most])} times, {most}", all_of(*verdicts)


SUITE_CLAIMS: Final = (
    Claim(
        "Never harmful: practice against random movements",
        "≤ 1.02 times on each task, after 250, 500, 1000, 2000",
        partial(_on_each_task, RANDOM, 1.02),
    ),
    Claim(
        "... and against the standard baseline",
        "≤ 1.05 times on each task, after 250, 500, 1000, 2000",
        partial(_on_each_task, UNIFORM, 1.05),
    ),
    Claim(
        "Better than the standard baseline",
        "interquartile mean over tasks ≤ 0.75 after 1000",
        partial(_over_tasks, ((UNIFORM, "nearest", 1000),), 0.75),
    ),
    Claim(
        "... also where the baseline, too, is answered by `process`",
        "the same; ours, not asked for",
        partial(_over_tasks, ((UNIFORM, "process", 1000),), 0.75),
    ),
    Claim(
        "Better than CMA-MAE and MAP-Elites",
        "interquartile mean over tasks < 1 after 500, 1000, 2000",
        partial(_over_tasks, tuple((rival, "process", at) for rival in RIVALS for at in (500, 1000, 2000)), 1.0),
    ),
    Claim("More data never hurts", "no task with more error after 2000 than after 500", _more_data),
    Claim(
        "An answer that has to prove itself is no worse than the nearest",
        "≤ 1.02 times on each memory of the suite, after 250 to 2000",
        partial(_on_each_memory, "nearest"),
    ),
    Claim(
        "... nor than `LocallyLinear`",
        "≤ 1.02 times on each memory of the suite, after 250 to 2000",
        partial(_on_each_memory, "linear"),
    ),
)
