"""The tables of the pages of results, in Markdown, and the numbers that their prose quotes.

    Tables(found).rod(); Prose(found).error("sgim-d")
What was not run is left out of the tables and noted in ``missing``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from claimed import TIMES, paper
from evidence import LAST, Evidence, Measure, NotRun
from judging import MISSING, Claim, Verdict, judge
from sgimd_torch.views.statistics import interquartile_mean, show
from sgimd_torch.views.suite import RANDOM, UNIFORM, titled
from table import read_table
from variants import ARMS, EXPERIMENTS, REFINING, ROBOTS, SPARSE, SUITE, TEACHERS, ladder

SETTINGS: Final = (*ROBOTS, *TEACHERS)
VARIANTS: Final = {name for variants in EXPERIMENTS.values() for name in variants}
DEFAULT: Final = "default"  # setting of a rival
# Rivals by schedule: no teacher; one demonstration every 30 movements, ten imitations each; all at the start, once.
RIVALS: Final[Mapping[str, tuple[str, str, str]]] = {
    "practice": ("practice.rod", "practice-taught-every-30.rod", "practice-taught.rod"),
    "SAGG-RIAC; SGIM-D": ("sagg-riac.rod", "sgim-d.rod", "sgim-d-once.rod"),
    "the standard baseline": (f"{UNIFORM}.rod", "uniform-nearest-taught.rod", "uniform-nearest-taught-once.rod"),
    "CMA-MAE": ("cma-mae.rod", "cma-mae-taught.rod", "cma-mae-taught-once.rod"),
    "MAP-Elites": ("map-elites.rod", "map-elites-taught.rod", "map-elites-taught-once.rod"),
    "Random; Imitation": (f"{RANDOM}.rod", "imitation.rod", ""),
    "isoline*": ("isoline", "isoline-demonstrations", ""),
    "CMA-ME*": ("cma-me", "cma-me-demonstrations", ""),
    "demonstrations and noise*": ("", "demonstrations-noise", ""),
    "CMA-ME, CMA-MAE, tuned*": ("cma-me-tuned", "cma-mae-demonstrations-tuned", ""),
    "MAP-Elites, tuned*": ("map-elites-tuned", "", ""),
    "Random, from the middle": ("middle-random.rod", "", ""),
    "MAP-Elites, from the middle": ("middle-map-elites.rod", "", ""),
    "Goal babbling from home": ("home-babbling.rod", "", ""),
}
# From random movements to practice, each step added to the one before; then the same teacher for all.
GAIN: Final[Mapping[str, str]] = {
    "random movements": RANDOM,
    "the standard baseline": UNIFORM,
    "... begun in the middle": "middle",
    "... with `process`": "middle-process",
    "... with its noise": "practice-uniform",
    "... and goals by interest": "practice-interest",
    "... or within reach: `practice`": "practice",
}
TAUGHT: Final[Mapping[str, str]] = {
    "the standard baseline, every 30": "uniform-nearest-taught",
    "SGIM-D, every 30": "sgim-d",
    "`practice`, every 30": "practice-taught-every-30",
    "the standard baseline, at the start": "uniform-nearest-taught-once",
    "SGIM-D, at the start": "sgim-d-once",
    "`practice`, at the start": "practice-taught",
}
# What has the idea against what lacks it: without a teacher, and with one.
IDEAS: Final = {
    "interest in the place of uniform goals": (("sagg-riac", "sagg-riac-uniform"), ("sgim-d", "sgim-d-uniform")),
    "practice in the place of goal babbling": (("practice", "sagg-riac"), ("practice-taught", "sgim-d")),
    "being shown": (("sgim-d", "sagg-riac"), ("practice-taught", "practice")),
    "a forward model": (("sagg-riac-model", "sagg-riac"), ("sgim-d-model", "sgim-d")),
    "goals in the place of movements": (("sagg-riac", "random"),),
    "interest and simplex in the place of the standard baseline": (
        ("sagg-riac", "uniform"),
        ("sgim-d", "uniform-taught"),
    ),
}


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; "Not run." without rows."""
    if not rows:
        return "Not run."
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


@dataclass
class Tables:
    """The tables of one page; the names of what was not run gather in ``missing``, verdicts in ``verdicts``."""

    found: Evidence
    folder: Path
    missing: list[str] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)

    def claims(self, claims: Callable[[Evidence], Sequence[Claim]]) -> str:
        """A row for each claim that was run."""
        return markdown(("claim", "number [95 %]", "verdict"), [
            (each.claim, each.number, f"**{each.verdict}**") for each in self.judged(claims(self.found))
        ])  # fmt: skip

    def paper(self) -> str:
        """A row for each of the paper's claims, to the letter and ours, all judged together."""
        letter, ours = paper(self.found, letter=True), paper(self.found, letter=False)
        verdicts = self.judged([*letter, *ours], keep=True)
        cells = [
            (our.text, *(f"**{each.verdict}** {each.number}".strip() for each in (theirs, mine)), our.note)
            for our, theirs, mine in zip(ours, verdicts, verdicts[len(ours) :], strict=False)
        ]
        return markdown(("claim", "to the letter, by eq. (9)", "our SGIM-D, by `process`", "in a sentence"), cells)

    def judged(self, claims: Sequence[Claim], *, keep: bool = False) -> list[Verdict]:
        """Verdicts; ``keep`` those that were not run, too."""
        verdicts = judge(claims)
        self.missing += [each.claim for each in verdicts if each.verdict == MISSING]
        self.verdicts += (run := [each for each in verdicts if each.verdict != MISSING])
        return verdicts if keep else run

    def cell(self, measure: Measure, *of: object, form: str = ".3f", between: bool = False) -> str:
        """A number, with its interval ``between``, or a dash."""
        try:
            found = measure(*of) if between else measure(*of, level=None)
        except NotRun as missing:
            self.missing.append(str(missing))
            return "–"
        return show(found, form).replace("-", "−")

    def errors(self, name: str, times: Sequence[int], form: str = ".3f", *, between: bool = False) -> list[str]:
        """A cell for each time."""
        return [self.cell(self.found.error, name, at, form=form, between=between) for at in times]

    def rivals(self) -> str:
        """Errors at 1000 and 5000, each rival by each schedule."""
        rows = [
            [label, *("–" if not name else ", ".join(self.errors(name, (1000, LAST))) for name in names)]
            for label, names in RIVALS.items()
        ]
        head = ("learner", "no teacher", "one every 30, ten imitations each", "all at the start, once each")
        return markdown(head, _run(rows))

    def answers(self) -> str:
        """Errors at 5000 by three answers."""
        names = ("practice-taught", "practice-uniform", "sgim-d", "uniform-nearest-taught", "cma-mae", "cma-mae-taught")
        rows = [
            [f"`{name}`", *(self.cell(self.found.error, f"{name}.rod by {answer}") for answer in by)]
            for by in [("nearest", "linear", "process")]
            for name in names
        ]
        return markdown(("memory of", "nearest", "`LocallyLinear`", "`process`"), _run(rows))

    def suite(self, at: int = 1000) -> str:
        """Errors over those of random movements on each task, then their interquartile mean over tasks."""
        learners, every = ("practice", UNIFORM, "map-elites"), (*SUITE, *SPARSE)
        known = {name: [task for task in every if f"{name}.{task}" in VARIANTS] for name in learners}
        rows = [
            [titled(task), *(self.cell(self.found.ratio, f"{name}.{task}", f"{RANDOM}.{task}", at, form=".2f")
                             if task in known[name] else "–" for name in learners)]
            for task in every
        ]  # fmt: skip
        rows.append(["mean over tasks", *(self._over_tasks(name, known[name], at) for name in learners)])
        return markdown(("task", *learners), _run(rows))

    def gain(self) -> str:
        """What each step from random movements to practice brings; then learners with the same teacher."""
        rows = [
            [step, *self.errors(f"{name}.rod", (1000,), between=True), *self.errors(f"{name}.rod", (LAST,)),
             self._over_tasks(name, [*SUITE], 1000) if all(f"{name}.{task}" in VARIANTS for task in SUITE) else ""]
            for step, name in {**GAIN, **TAUGHT}.items()
        ]  # fmt: skip
        return markdown(("step", "rod, 1000 (m)", "rod, 5000 (m)", "suite, 1000"), _run(rows))

    def changes(self) -> str:
        """SGIM-D with one change: what it adds to the error."""
        rows = [
            [f"`{name}`", self.cell(self.found.difference, name, "sgim-d", form="+.4f", between=True)]
            for experiment in ("ablations", "teaching")
            for name in EXPERIMENTS[experiment]
        ]
        return markdown(("change", "difference to SGIM-D at 5000 (m)"), _run(rows))

    def steps(self) -> str:
        """The ladder from the letter to our defaults, in the small and in the large T."""
        rows = [
            [f"`{name}`", self.cell(self.found.error, f"{name}{self._own(name)}"),
             *(self.cell(self.found.error, each) for each in (name, large))]
            for name, large in zip(ladder(), ladder("-large"), strict=True)
        ]  # fmt: skip
        return markdown(("step", "T, by its own answer", "T, by `process`", "large T, by `process`"), _run(rows))

    def models(self) -> str:
        """Learners with and without a forward model: errors (m) by their own answer, at the end by `process`, too."""
        ends = {"": (1000, LAST), **{f"-{arm.removeprefix('planar-')}": (2000,) for arm in ARMS}}
        rows = []
        for name, line in REFINING.items():
            by = " by model-alone" if line.get("inverse") == "model-alone" else ""
            found = [self.errors(f"{name}{ending}{by}", times, ".4f") for ending, times in ends.items()]
            rows.append([f"`{name}`", *chain(*found), *self.errors(name, (LAST,), ".4f")])
        head = ("learner", "rod, 1000", "rod, 5000", "arm of 7, 2000", "arm of 50, 2000", "rod, 5000, by `process`")
        return markdown(head, _run(rows))

    def asking(self) -> str:
        """Learners that ask, and those they are compared with: errors on the rod, demonstrations that were shown."""
        names = [
            name for name in EXPERIMENTS["asking"] if "toss" not in name and name != "sgim-acts-3"
        ]  # it is sgim-im
        rows = [
            [f"`{name}`", *self.errors(name, (1000, LAST)), self._shown(name)] for name in sorted(names, key=self._last)
        ]
        return markdown(("learner", "1000", "5000", "shown"), _run(rows))

    def settings(self, at: int = 2000) -> str:
        """The error with an idea over that without it, in each setting; bold where its interval excludes 1."""

        def cell(ours: str, theirs: str, setting: str) -> str:
            names = [f"{name}@{setting}" for name in (ours, theirs)]
            if not any(name in EXPERIMENTS["settings"] for name in names):
                return "–"
            first, second = (
                (name if name in EXPERIMENTS["settings"] else f"{name.partition('@')[0]}@as-it-is")
                + " by model" * ("-model@" in name)
                for name in names
            )
            try:
                ratio = self.found.ratio(first, second, at)
            except NotRun as missing:
                self.missing.append(str(missing))
                return "–"
            return f"**{show(ratio)}**" if ratio.low > 1 or ratio.high < 1 else show(ratio)

        rows = [
            [f"{idea}: `{ours}`", *(cell(ours, theirs, setting) for setting in SETTINGS)]
            for idea, pairs in IDEAS.items()
            for ours, theirs in pairs
        ]
        return markdown(("idea", *SETTINGS), _run(rows))

    def swimmer(self) -> str:
        """Each learner on the swimmer."""
        rows = [
            [f"`{name.removesuffix('-swimmer')}`", *self.errors(name, TIMES, between=True)]
            for name in EXPERIMENTS["swimmer"]
        ]
        return markdown(("explored by", *map(str, TIMES)), _run(rows))

    def by_hand(self) -> str:
        """Each learner alone, with lessons by hand and with shipped demonstrations."""
        rows = [[f"`{name}`", *self.errors(name, (300, 500, 1000), between=True)] for name in EXPERIMENTS["by-hand"]]
        return markdown(("learner", "300", "500", "1000"), _run(rows))

    def tuned(self) -> str:
        """For each rival its default and the best setting of the first round, both with errors of all their seeds."""
        table = read_table(self.folder, "rivals.csv")
        at_end = table[table.movements == LAST]
        first = at_end[at_end.seed < 1002].groupby(["rival", "setting"])[["linear", "process"]].mean().mean(axis=1)
        later = at_end[at_end.seed >= 1002].groupby(["rival", "setting"])["process"].mean()
        means = at_end[at_end.seed < 1002].groupby(["rival", "setting"])["process"].mean()
        rows = []
        for rival in dict.fromkeys(table.rival):
            best = str(first.loc[rival].idxmin())
            for setting in dict.fromkeys((DEFAULT, best)):
                place = (rival, setting)
                again = f"{later.loc[place]:.4f}" if place in later.index else "–"
                rows.append([f"`{rival}`", f"`{setting}`", f"{means.loc[place]:.4f}", again])
        return markdown(("rival", "setting", "first seeds", "later seeds"), rows)

    def _last(self, name: str) -> float:
        """Its error at the end, to sort by."""
        with suppress(NotRun):
            return self.found.error(name, level=None).value
        return np.inf

    def _own(self, name: str) -> str:
        return " by paper" if name.endswith("letter") else " by linear" if name.startswith("ladder") else ""

    def _over_tasks(self, name: str, tasks: Sequence[str], at: int) -> str:
        names = [[f"{each}.{task}" for task in tasks] for each in (name, RANDOM)]
        return self.cell(self.found.over_tasks, *names, at, form=".2f")

    def _shown(self, name: str) -> str:
        if not name.startswith("sgim"):
            return "0" if name == "alone" else "all"
        counts = self.found.counts("asked", name, "shown")
        return f"{interquartile_mean(np.array([*counts.values()])):.0f}"


def _run(rows: Sequence[Sequence[str]]) -> list[Sequence[str]]:
    """Those that have a number."""
    return [row for row in rows if any(cell not in ("–", "") for cell in row[1:])]


@dataclass(frozen=True)
class Prose:
    """The numbers that prose quotes, "(not run)" where rows are missing; ``at`` is a number of movements."""

    found: Evidence

    def error(self, name: str, at: int = LAST, form: str = ".3f") -> str:
        """The error (m)."""
        return _quoted(lambda: f"{self.found.error(name, at, level=None).value:{form}}")

    def interval(self, name: str, at: int = LAST, form: str = ".3f") -> str:
        """The same with its interval."""
        return _quoted(lambda: show(self.found.error(name, at), form))

    def less(self, ours: str, theirs: str, at: int = LAST, form: str = ".3f") -> str:
        """How much less ours errs (m), with its interval."""
        return _quoted(lambda: show(self.found.difference(theirs, ours, at), form).replace("-", "−"))

    def ratio(self, ours: str, theirs: str, at: int = LAST) -> str:
        """Our error over theirs, with its interval."""
        return _quoted(lambda: show(self.found.ratio(ours, theirs, at)))

    def over_floor(self, name: str) -> str:
        """The error over its noise floor, with its interval."""
        return _quoted(lambda: show(self.found.over_floor(name, name)))

    def near(self, name: str) -> str:
        """The share of the goals chosen by all seeds together that can be reached: ``43.4 %``."""

        def share() -> str:
            chosen, near = self.found.near_goals(name).sum(axis=0)
            return f"{100 * near / chosen:.1f} %"

        return _quoted(share)


def _quoted(number: Callable[[], str]) -> str:
    try:
        return number()
    except NotRun:
        return "(not run)"
