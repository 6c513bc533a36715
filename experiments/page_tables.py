"""The tables of the pages of results, in Markdown: of verdicts, variants, settings, answers, suite, teachers, rivals.

print(verdicts_table("claim", judge(PAPER_CLAIMS, results, "linear")))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from asking_claims import ON_TOSS
from judging import LAST, NotRun, Results, Verdict
from learning_claims import TIMES
from sgimd_torch.views.statistics import Interval, interquartile_mean, point, ratio_interval, rng, show
from sgimd_torch.views.suite import RANDOM, TASKS, UNIFORM, titled
from table import ResultsError, read_table
from variants import EVERYWHERE, EXPERIMENTS, HALVES, LEARNING, ROBOTS, SUITED, TAUGHT_ALIKE, TEACHERS, UNTAUGHT

Cell = Callable[[str], str]  # the text of a variant in a column of a table; raises NotRun if there is none
Ratios = Mapping[tuple[str, str], Mapping[str, Interval]]  # ours and theirs -> setting -> our error over theirs
# The standard baseline as it is, and answered like the others.
SUITE_COLUMNS: Final = ((UNIFORM, "nearest"), *((name, "process") for name in SUITED if name != RANDOM))
SETTINGS: Final = (*ROBOTS, *TEACHERS)
EVERYBODY: Final = (*UNTAUGHT, *TAUGHT_ALIKE)
# What has the idea against what lacks it: without a teacher, and with one.
IDEAS: Final = {
    "Choosing goals by interest": (("sagg-riac", "sagg-riac-uniform"), ("sgim-d", "sgim-d-uniform")),
    "Practice in the place of goal babbling": (("practice", "sagg-riac"), ("practice-taught", "sgim-d")),
    "Being shown": (("sgim-d", "sagg-riac"), ("practice-taught", "practice")),
    "The forward model": (("sagg-riac-model", "sagg-riac"), ("sgim-d-model", "sgim-d")),
    "Choosing goals in the place of movements": (("sagg-riac", "random"),),
    "Interest and simplex in the place of uniform goals and noise": (
        ("sagg-riac", "uniform"),
        ("sgim-d", "uniform-taught"),
    ),
}
DEFAULT: Final = "default"  # setting of a rival
FIRST_ROUND: Final = (1000, 1001)  # seeds of all settings of rivals


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; "Not run." without rows."""
    if not rows:
        return "Not run."
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def variants_table(names: Sequence[str], columns: Mapping[str, Cell]) -> str:
    """One row for each variant, with a dash for what was not run."""
    cells = [[_or_dash(partial(cell, name)) for cell in columns.values()] for name in names]
    return markdown([*columns], cells)


def verdicts_table(what: str, verdicts: Sequence[Verdict]) -> str:
    """One row for each claim; ``what`` heads the first column."""
    cells = [
        (
            *(row.claim, row.bar, row.number, row.effect),
            f"**{row.verdict}**" + (f" (alone: {row.alone})" if row.alone != row.verdict else ""),
        )
        for row in verdicts
    ]
    return markdown((what, "bar", "our number [95 % interval]", "difference [95 % interval]", "verdict"), cells)


def said_table(said: pd.DataFrame, verdicts: Sequence[Verdict]) -> str:
    """One row for each claim of an earlier version: what it said, and what is said now, bold where a verdict changed.

    Raises:
        ResultsError: a claim is not judged any more.
    """
    now = {row.claim: row for row in verdicts}
    if lost := {*said.claim} - now.keys():
        raise ResultsError(f"said.csv has {', '.join(sorted(lost))}, which is not judged any more; was it renamed?")
    cells = [
        (claim, number, verdict, now[claim].number, _bold(now[claim].verdict, now[claim].verdict != verdict))
        for claim, number, verdict in said.itertuples(index=False)
    ]
    return markdown(("claim", "we said", "verdict then", "now we say", "verdict now"), cells)


def answers_rows(results: Results) -> list[list[str]]:
    """For each memory of the rod the error of `process` over that of the nearest and of `LocallyLinear`."""

    def ratio(variant: str, other: str, when: int) -> str:
        ours, theirs = (interquartile_mean(results.by(each).errors(variant, when)) for each in ("process", other))
        return show(point(float(ours / theirs)))

    return [
        [
            f"`{variant.removesuffix('.rod')}`",
            f"`{other}`",
            *(_or_dash(partial(ratio, variant, other, when)) for when in (*TIMES, LAST)),
        ]
        for variant in LEARNING
        for other in ("nearest", "linear")
    ]


def suite_rows(results: Results, at: int) -> list[list[str]]:
    """A row for each task: how many seeds all have, the error of random movements answered by the nearest neighbour,
    then that of ``SUITE_COLUMNS`` in it. At the end the interquartile mean over tasks."""
    nearest = results.by("nearest")
    lines, means = [], {each: list[float]() for each in SUITE_COLUMNS}
    for task in TASKS:
        random = f"{RANDOM}.{task}"
        cells, seeds = [_or_dash(lambda random=random: show(nearest.iqm(random, at), ".3f"))], set[int]()  # type: ignore[misc]
        for name, answer in SUITE_COLUMNS:
            try:
                errors = results.by(answer).errors(f"{name}.{task}", at), nearest.errors(random, at)
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


def settings_rows(results: Results, at: int) -> list[list[str]]:
    """A row for each learner, its errors (m) in each setting; a dash where it is the same as in `as-it-is`."""

    def error(name: str) -> str:
        return show(_in_settings(results, name).iqm(name, at), ".3f")

    return [
        [f"`{name}`", *(_or_dash(partial(error, f"{name}@{setting}")) for setting in SETTINGS)] for name in EVERYBODY
    ]


def ratios(results: Results) -> Ratios:
    """By pair of `IDEAS` and by setting, our error over theirs at the end, paired by seed.

    There is none where one of them was not run, or where the setting changes nothing for either. A learner without a
    teacher is the same under every teacher.
    """
    at: int = EVERYWHERE["movements"]

    def errors(learner: str, setting: str) -> dict[int, float]:
        name = f"{learner}@{setting}" if f"{learner}@{setting}" in EXPERIMENTS["settings"] else f"{learner}@as-it-is"
        return _in_settings(results, name).at(name, at)

    found: dict[tuple[str, str], dict[str, Interval]] = {pair: {} for pairs in IDEAS.values() for pair in pairs}
    for (ours, theirs), setting in product(found, SETTINGS):
        if any(f"{name}@{setting}" in EXPERIMENTS["settings"] for name in (ours, theirs)):
            with suppress(NotRun):
                found[ours, theirs][setting] = results.paired_ratio(errors(ours, setting), errors(theirs, setting))
    return found


def ideas_rows(found: Ratios) -> list[list[str]]:
    """A row for each comparison of `ratios`, a cell for each setting, bold where its interval excludes 1."""
    return [
        [
            *(idea, f"`{ours}` / `{theirs}`"),
            *(
                _bold(show(ratio), _sign(ratio) != 0) if (ratio := found[ours, theirs].get(setting)) else "-"
                for setting in SETTINGS
            ),
        ]
        for idea, pairs in IDEAS.items()
        for ours, theirs in pairs
    ]


def where_it_pays(found: Ratios) -> str:
    """A line for each idea: the settings in which it lowers the error, and those in which it raises it."""

    def listed(pairs: Sequence[tuple[str, str]], sign: int) -> str:
        by_learner = {
            ours: [setting for setting, each in found[ours, theirs].items() if _sign(each) == sign]
            for ours, theirs in pairs
        }
        return "; ".join(f"`{ours}` in {', '.join(each)}" for ours, each in by_learner.items() if each) or "nowhere"

    return "\n".join(
        f"- **{idea}** seems to pay: {listed(pairs, -1)}. It seems to cost: {listed(pairs, 1)}."
        for idea, pairs in IDEAS.items()
    )


def teachers_rows(asked: pd.DataFrame) -> list[list[str]]:
    """Requests to each teacher, means over seeds: variant, teacher, all, answered, late, late in their own half."""
    means = asked.groupby(["variant", "teacher"], sort=False)[["requests", "shown", "late", "late_own"]].mean()
    order = [*EXPERIMENTS["asking"]]
    return [
        [f"`{variant}`", teacher, *(f"{mean:.1f}" for mean in row[:3]), f"{row[3]:.1f}" if teacher in HALVES else ""]
        for (variant, teacher), *row in sorted(means.itertuples(name=None), key=lambda row: order.index(row[0][0]))
    ]


def contexts_rows(parts: pd.DataFrame) -> list[list[str]]:
    """The error (m) by third of the wind at the end, interquartile means over seeds; none without a table."""
    found = parts.groupby(["variant", "low", "high"])["error"].apply(interquartile_mean)
    return [
        [f"`{variant}`", f"{low:.3g} to {high:.3g}", f"{error:.4f}"]
        for name in ON_TOSS
        for (variant, low, high), error in found.items()
        if variant == name
    ]


def rivals_rows(folder: Path) -> list[list[str]]:
    """A row for each setting of each rival, the best of the first round first, the default bold: its errors (m) early
    and late in the first round, and late on the seeds that the best got afterwards."""
    table = read_table(folder, "rivals.csv")
    table["round"] = np.where(table.seed.isin(FIRST_ROUND), 1, 2)
    means = table.groupby(["round", "movements", "rival", "setting"])[["linear", "process"]].mean()

    def cells(*place: object) -> list[str]:
        return [f"{error:.4f}" for error in means.loc[place]] if place in means.index else ["-", "-"]

    first = means.loc[1, LAST].sum(axis=1).sort_values(kind="stable") if len(means) else means
    return [
        [
            f"`{rival}`",
            _bold(setting, True) if setting == DEFAULT else f"`{setting}`",
            *(cell for part in ((1, 1000), (1, LAST), (2, LAST)) for cell in cells(*part, rival, setting)),
        ]
        for rival in dict.fromkeys(table.rival)
        for each, setting in first.index
        if each == rival
    ]


def _in_settings(results: Results, name: str) -> Results:
    """A learner with a forward model is answered by the model, all others by `process`."""
    return results.by("own" if "-model@" in name else "process")


def _or_dash(cell: Callable[[], str]) -> str:
    try:
        return cell()
    except NotRun:
        return "-"


def _bold(text: str, when: bool) -> str:
    return f"**{text}**" if when else text


def _sign(ratio: Interval) -> int:
    """-1 below 1 for certain, 1 above it, 0 neither."""
    return int(ratio.low > 1) - int(ratio.high < 1)
