"""Beyond the setting that defaults were tuned on: the error of each learner in each, and where each idea pays.

    results = read_settings(Path("results")); print(where_it_pays(ratios(results)))
A learner with a forward model is answered by the model, all others by `process`, whatever they explored with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np

from judging import NotRun, Results, shared
from learning_claims import shown
from read_results import read_results
from sgimd_torch.views.statistics import Interval, ratio_interval, rng, show
from variants import EVERYWHERE, EXPERIMENTS, ROBOTS, TAUGHT_ALIKE, TEACHERS, UNTAUGHT

Pair = tuple[str, str]  # ours and theirs
SETTINGS: Final = (*ROBOTS, *TEACHERS)
EVERYBODY: Final = (*UNTAUGHT, *TAUGHT_ALIKE)
LAST_HERE: Final[int] = EVERYWHERE["movements"]
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


def read_settings(folder: Path) -> Results:
    """The results in settings.csv, each variant by the answer that it is judged by.

    Raises:
        ResultsError: there is no such table, or a line of it makes no sense.
    """
    own, process = (read_results(folder / "settings.csv", answer) for answer in ("own", "process"))
    return Results({name: own[name] if "-model@" in name else each for name, each in process.items()})


def settings_rows(results: Results, at: int) -> list[list[str]]:
    """A row for each learner, its errors (m) in each setting; a dash where it is the same as in `as-it-is`."""
    return [
        [f"`{name}`", *(shown(partial(results.iqm, f"{name}@{setting}", at), ".3f") for setting in SETTINGS)]
        for name in EVERYBODY
    ]


def ratios(results: Results, at: int = LAST_HERE) -> dict[Pair, dict[str, Interval]]:
    """By pair of `IDEAS` and by setting, our error over theirs.

    There is none where one of them was not run, or where the setting changes nothing for either.
    """
    found: dict[Pair, dict[str, Interval]] = {pair: {} for pairs in IDEAS.values() for pair in pairs}
    for pair, setting in product(found, SETTINGS):
        if any(f"{name}@{setting}" in EXPERIMENTS["settings"] for name in pair):
            with suppress(NotRun):
                found[pair][setting] = _ratio(results, pair, setting, at)
    return found


def ideas_rows(found: Mapping[Pair, Mapping[str, Interval]]) -> list[list[str]]:
    """A row for each comparison of `ratios`, a cell for each setting, bold where its interval excludes 1."""

    def cell(ratio: Interval | None) -> str:
        if ratio is None:
            return "-"
        return f"**{show(ratio)}**" if _sign(ratio) else show(ratio)

    return [
        [idea, f"`{ours}` / `{theirs}`", *(cell(found[ours, theirs].get(setting)) for setting in SETTINGS)]
        for idea, pairs in IDEAS.items()
        for ours, theirs in pairs
    ]


def where_it_pays(found: Mapping[Pair, Mapping[str, Interval]]) -> str:
    """A line for each idea: the settings in which it lowers the error, and those in which it raises it."""
    lines = []
    for idea, pairs in IDEAS.items():
        signs = [
            (ours, setting, _sign(each)) for ours, theirs in pairs for setting, each in found[ours, theirs].items()
        ]
        pays, costs = (_listed([each[:2] for each in signs if each[2] == wanted]) for wanted in (-1, 1))
        lines.append(f"- **{idea}** seems to pay: {pays}. It seems to cost: {costs}.")
    return "\n".join(lines)


def _listed(found: Sequence[tuple[str, str]]) -> str:
    by_learner: dict[str, list[str]] = {}
    for ours, setting in found:
        by_learner.setdefault(ours, []).append(setting)
    return "; ".join(f"`{ours}` in {', '.join(settings)}" for ours, settings in by_learner.items()) or "nowhere"


def _sign(ratio: Interval) -> int:
    """-1 below 1 for certain, 1 above it, 0 neither."""
    return int(ratio.low > 1) - int(ratio.high < 1)


def _ratio(results: Results, pair: Pair, setting: str, at: int) -> Interval:
    """Of the errors of ours and theirs, paired by seed. A learner without a teacher is the same under every teacher."""
    names = (f"{name}@{setting}" for name in pair)
    first, second = (results.at(name if name in EXPERIMENTS["settings"] else _as_it_is(name), at) for name in names)
    ours, theirs = (np.array([*errors.values()]) for errors in shared(first, second))
    return ratio_interval(ours, theirs, rng=rng(), paired=True)


def _as_it_is(name: str) -> str:
    return f"{name.partition('@')[0]}@as-it-is"
