"""What a learner that nobody tunes for your robot has to show on the suite, and how each bar is judged.

    suite = read_suite(Path("results")); judge(suite_claims(suite), suite["process"])
Errors are ratios, to those of random movements answered by the nearest exemplar, or of the field's standard baseline,
which answers by the nearest, too. All others are answered by `process`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from judging import FAILS, HOLDS, OPEN, Claim, Judged, NotRun, Results, all_of, at_most, shared
from learning_claims import TIMES, read_learning, shown
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import interquartile_mean, interval, ratio_interval, rng, show
from sgimd_torch.views.suite import RANDOM, TASKS, UNIFORM, titled
from variants import EXPERIMENTS, PROVED, SUITED

Suite = Mapping[str, Results]
OURS, RIVALS = "practice", ("cma-mae", "map-elites")
# The standard baseline as it is, and answered like the others.
SUITE_COLUMNS: Final = (
    (UNIFORM, "nearest"),
    *((name, "process") for name in SUITED if name != RANDOM),
)
SURE: Final = 5.0


def read_suite(folder: Path) -> dict[str, Results]:
    """The results by answer: of suite.csv, and the rod's, which are in learning.csv.

    Raises:
        ResultsError: there is no such table, or a line of it makes no sense.
    """
    suite, rod = (read_learning(folder / f"{name}.csv") for name in ("suite", "learning"))
    on_rod = {f"{name}.rod" for name in SUITED}
    return {
        answer: Results({**suite[answer].variants, **{k: v for k, v in rod[answer].variants.items() if k in on_rod}})
        for answer in PROVED
    }


def suite_claims(suite: Suite) -> list[Claim]:
    """The bars. Each is judged at the level of the results that it is given, on these."""

    def claim(text: str, bar: str, judged: Callable[[Suite], Judged]) -> Claim:
        def at_level(results: Results) -> Judged:
            return judged({answer: replace(each, level=results.level) for answer, each in suite.items()})

        return Claim(text, bar, at_level, own=True)

    return [
        claim(
            "Never harmful: practice against random movements",
            "≤ 1.02 times on each task, after 250, 500, 1000, 2000",
            partial(_on_each_task, RANDOM, 1.02),
        ),
        claim(
            "... and against the standard baseline",
            "≤ 1.05 times on each task, after 250, 500, 1000, 2000",
            partial(_on_each_task, UNIFORM, 1.05),
        ),
        claim(
            "Better than the standard baseline",
            "interquartile mean over tasks ≤ 0.75 after 1000",
            partial(_over_tasks, ((UNIFORM, "nearest", 1000),), 0.75),
        ),
        claim(
            "... also where the baseline, too, is answered by `process`",
            "the same; ours, not asked for",
            partial(_over_tasks, ((UNIFORM, "process", 1000),), 0.75),
        ),
        claim(
            "Better than CMA-MAE and MAP-Elites",
            "interquartile mean over tasks < 1 after 500, 1000, 2000",
            partial(_over_tasks, tuple((rival, "process", at) for rival in RIVALS for at in (500, 1000, 2000)), 1.0),
        ),
        claim("More data never hurts", "no task with more error after 2000 than after 500", _more_data),
        claim(
            "An answer that has to prove itself is no worse than the nearest",
            "≤ 1.02 times on each memory of the suite, after 250 to 2000",
            partial(_on_each_memory, "nearest"),
        ),
        claim(
            "... nor than `LocallyLinear`",
            "≤ 1.02 times on each memory of the suite, after 250 to 2000",
            partial(_on_each_memory, "linear"),
        ),
    ]


def _on_each_task(theirs: str, bar: float, suite: Suite) -> Judged:
    """Practice answered by `process` over another that answers by the nearest."""
    pairs = {
        (task, at): (
            suite["process"].errors(f"{OURS}.{task}", at),
            suite["nearest"].errors(f"{theirs}.{task}", at),
        )
        for task in TASKS
        for at in TIMES
    }
    return _all_at_most(pairs, bar, suite, paired=False)


def _on_each_memory(other: str, suite: Suite) -> Judged:
    pairs = {}
    for name in (*EXPERIMENTS["suite"], *(f"{name}.rod" for name in SUITED)):
        for at in TIMES:
            pairs[f"memory of {name}", at] = suite["process"].errors(name, at), suite[other].errors(name, at)
    return _all_at_most(pairs, 1.02, suite, paired=True)


def _all_at_most(
    pairs: Mapping[tuple[str, int], tuple[Array, Array]], bar: float, suite: Suite, *, paired: bool
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
    level = suite["process"].level
    found = {each: ratio_interval(*pairs[each], rng=rng(), paired=paired, level=level) for each in largest}
    name, at = max(found, key=lambda each: found[each].value)
    over = sum(value(pair) > bar for pair in pairs.values())
    number = f"at most {show(found[name, at])}, {name} at {at}; above the bar {over} of {len(pairs)}"
    return number, all_of(*(at_most(each, bar) for each in found.values()))


def _over_tasks(theirs: tuple[tuple[str, str, int], ...], bar: float, suite: Suite) -> Judged:
    """The interquartile mean over tasks of our error / theirs, each (learner, its answer, movements)."""
    found = {}
    for name, answer, at in theirs:
        tasks = [task for task in TASKS if f"{name}.{task}" in EXPERIMENTS["suite"] or task == "rod"]
        ours = [suite["process"].errors(f"{OURS}.{task}", at) for task in tasks]
        others = [suite[answer].errors(f"{name}.{task}", at) for task in tasks]

        def ratios(*drawn: Array, n: int = len(tasks)) -> Array:
            each = [interquartile_mean(x) / interquartile_mean(y) for x, y in zip(drawn[:n], drawn[n:], strict=True)]
            return interquartile_mean(np.stack(each, axis=-1))

        found[name, at] = interval(ratios, *ours, *others, rng=rng(), level=suite["process"].level)
    number = ", ".join(f"{show(each)} of {name} at {at}" for (name, at), each in found.items())
    return number, all_of(*(at_most(each, bar) for each in found.values()))


def _more_data(suite: Suite) -> Judged:
    """Fails where the error has grown beyond its interval; open where it may have grown."""
    found = {}
    for task in TASKS:
        found_at = {at: suite["process"].at(f"{OURS}.{task}", at) for at in (500, 2000)}
        early, late = shared(found_at[500], found_at[2000])
        errors = np.array([*late.values()]), np.array([*early.values()])
        found[task] = ratio_interval(*errors, rng=rng(), paired=True, level=suite["process"].level)
    most = max(found, key=lambda task: found[task].value)
    verdicts = (FAILS if each.low > 1 else OPEN if each.value > 1 else HOLDS for each in found.values())
    return f"at most {show(found[most])} times, {most}", all_of(*verdicts)


def suite_rows(suite: Mapping[str, Results], at: int) -> list[list[str]]:
    """A row for each task: how many seeds all have, the error of random movements answered by the nearest neighbour,
    then that of ``SUITE_COLUMNS`` in it. At the end the interquartile mean over tasks."""
    lines, means = [], {each: list[float]() for each in SUITE_COLUMNS}
    for task in TASKS:
        random = partial(suite["nearest"].iqm, f"{RANDOM}.{task}", at)
        cells, seeds = [shown(random, ".3f")], set[int]()
        for name, answer in SUITE_COLUMNS:
            try:
                errors = suite[answer].errors(f"{name}.{task}", at), suite["nearest"].errors(f"{RANDOM}.{task}", at)
            except NotRun:
                cells.append("-")
                continue
            found = ratio_interval(*errors, rng=rng())
            means[name, answer].append(found.value)
            cells.append(show(found))
            seeds |= {len(each) for each in errors}
        lines.append([titled(task), str(min(seeds, default=0)), *cells])
    over = [f"{interquartile_mean(np.array(each)):.2f}" if each else "-" for each in means.values()]
    return [*lines, ["interquartile mean over tasks", "", "", *over]]
