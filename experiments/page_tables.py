"""The tables of the pages of results, in Markdown, and the numbers quoted in the text of these pages.

page = Page(evidence, Path("results")); page.suite(); page.error("sgim-d")
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Final

import pandas as pd

from claimed import SUITE, on, paper
from evidence import LAST, Evidence, NotRun, Statistic
from judging import MISSING, Claim, Verdict, judge
from others import KNOWS, OURS, PROGRAMS
from others import TABLE as OTHERS
from refinement import ROBOTS, SEARCHES, TABLE
from sgimd_torch.extras.table.statistics import interquartile_mean, interval_text
from suite import TASKS, UNIFORM, titled
from table import LEARNING, read_table
from variants import ARMS, EXPERIMENTS, VARIANTS

MISSING_CELL: Final = "–"
# Steps from random movements to the algorithm practice, each added to the step before.
GAIN: Final[Mapping[str, str]] = {
    "random movements": "random",
    "the standard baseline": UNIFORM,
    "... begun in the middle": "middle",
    "... with `process`": "middle-process",
    "... and goals within reach: `practice`": "practice",
    "... but first movements uniform": "practice-wide",
    "... but with goals by interest": "practice-interest",
}


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of the rows that have a number; the text "Not run." if no row has a number."""
    known = [row for row in rows if any(cell not in (MISSING_CELL, "") for cell in row[1:])]
    if not known:
        return "Not run."
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in known)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


@dataclass
class Page:
    """The tables and numbers of one page. Numbers are those after ``at`` movements; a number without runs is a dash.

    Args:
        evidence: evidence of the experiments.
        folder: folder of the tables of results.
        missing: names of claims and numbers without runs; the page adds to this list while it is made.
    """

    evidence: Evidence
    folder: Path
    missing: list[str] = field(default_factory=list)

    def error(self, name: str, at: int = LAST, form: str = ".3f", *, between: bool = False) -> str:
        """The error (m), with its interval if ``between``."""
        return self.cell(self.evidence.error, name, at, form=form, between=between)

    def errors(self, name: str, times: Sequence[int], form: str = ".3f") -> list[str]:
        """The errors after each number of movements."""
        return [self.error(name, at, form) for at in times]

    def less(self, ours: str, theirs: str, at: int = LAST, form: str = ".3f") -> str:
        """Their error minus ours (m), with the interval of this difference."""
        return self.cell(self.evidence.difference, theirs, ours, at, form=form, between=True)

    def seeds(self, name: str) -> str:
        """The seeds whose runs have ended: ``240 to 259``."""
        try:
            seeds = self.evidence.at(name, max(VARIANTS[name]["evaluate_at"])).index
        except NotRun:
            return MISSING_CELL
        return f"{seeds.min()} to {seeds.max()}"

    def older(self, *groups: str) -> str:
        """A sentence that names the groups with rows that an earlier version has made; or nothing."""
        learning = {
            "robots": self.evidence.robots["learning"],
            "changes": self.evidence.changes["learning"],
            "others": self.lives_of_others["learning"],
            **{name: self.evidence.of_variants(variants) for name, variants in EXPERIMENTS.items()},
        }
        older = [f"`{name}`" for name in groups if (learning[name] != LEARNING).any()]
        return f"**{', '.join(older)}: made by an earlier version, wholly or in part.**" if older else ""

    def ratio(self, ours: str, theirs: str, at: int = LAST) -> str:
        """Our error divided by theirs, with the interval of this ratio."""
        return self.cell(self.evidence.ratio, ours, theirs, at, form=".2f", between=True)

    def near(self, name: str) -> str:
        """The share of chosen goals that can be reached, over the goals of all seeds: ``43.4 %``."""
        return self.cell(self.evidence.near_share, name, form=".1%")

    def cell(self, statistic: Statistic, *of: object, form: str = ".3f", between: bool = False) -> str:
        """A number, with its interval if ``between``."""
        try:
            number = statistic(*of) if between else statistic(*of, level=None)
        except NotRun as missing:
            self.missing.append(str(missing))
            return MISSING_CELL
        return interval_text(number, form).replace("-", "−").replace("%", " %")

    def claims(self, claims: Callable[[Evidence], Sequence[Claim]]) -> str:
        """A table with a row for each claim that has runs."""
        verdicts = [verdict for verdict in self.judged(claims(self.evidence)) if verdict.verdict != MISSING]
        rows = [(verdict.claim, verdict.number, f"**{verdict.verdict}**") for verdict in verdicts]
        return markdown(("claim", "number [95 %]", "verdict"), rows)

    def paper(self) -> str:
        """A row for each claim of the paper, with two verdicts: on learners by the letter of the paper, and on ours."""
        letter, ours = paper(self.evidence, letter=True), paper(self.evidence, letter=False)
        verdicts = self.judged([*letter, *ours])
        cells = [
            (our.text, *(f"**{verdict.verdict}** {verdict.number}".strip() for verdict in (theirs, mine)), our.note)
            for our, theirs, mine in zip(ours, verdicts, verdicts[len(ours) :], strict=False)
        ]
        return markdown(("claim", "to the letter, by eq. (9)", "our SGIM-D, by `process`", "in a sentence"), cells)

    def judged(self, claims: Sequence[Claim]) -> list[Verdict]:
        """A verdict on each claim."""
        verdicts = judge(claims)
        self.missing += [verdict.claim for verdict in verdicts if verdict.verdict == MISSING]
        return verdicts

    def rival(self, *names: str) -> str:
        """Cells of a row: errors of each learner after 1000 and 5000 movements; a learner without a name is a dash."""
        return " | ".join(", ".join(self.errors(name, (1000, LAST))) if name else MISSING_CELL for name in names)

    def suite(self, at: int = 1000) -> str:
        """Errors divided by the error of random movements: on each task, and as interquartile mean over tasks."""
        learners = ("practice", UNIFORM)
        tasks = {**{titled(task): [task] for task in TASKS}, "mean over tasks": [*TASKS]}
        rows = [[title, *(self._over_tasks(name, of, at) for name in learners)] for title, of in tasks.items()]
        return markdown(("task", *learners), rows)

    def gain(self) -> str:
        """Errors at each step from random movements to practice."""
        rows = []
        for step, name in GAIN.items():
            on_suite = all(on(name, task) in VARIANTS for task in SUITE)
            mean = self._over_tasks(name, SUITE, 1000) if on_suite else ""
            rows.append([step, self.error(name, 1000, between=True), self.error(name), mean])
        return markdown(("step", "rod, 1000 (m)", "rod, 5000 (m)", "suite, 1000"), rows)

    def models(self) -> str:
        """Errors (m) of SGIM-D with and without a forward model; in the last column `process` answers for all."""
        rows = []
        for name, by in (("sgim-d", ""), ("sgim-d-model", " by model"), ("sgim-d-model-alone", " by model-alone")):
            arms = [f"{name}.{arm}{by}" for arm in ARMS]
            cells = [self.error(variant, 2000, ".4f") if f"{name}.{ARMS[0]}" in VARIANTS else "–" for variant in arms]
            rows.append(
                [f"`{name}`", *self.errors(f"{name}{by}", (1000, LAST), ".4f"), *cells, self.error(name, form=".4f")]
            )
        head = ("learner", "rod, 1000", "rod, 5000", "arm of 7, 2000", "arm of 50, 2000", "rod, 5000, by `process`")
        return markdown(head, rows)

    def refinement(self) -> str:
        """Cost and error of the searches, at equal movements and at equal time; errors over those of the first one."""
        table = read_table(self.folder, TABLE).set_index("seed")
        rows = []
        for robot, search in product(ROBOTS, SEARCHES):
            usual, life = (table[(table.robot == robot) & (table.search == name)] for name in (SEARCHES[0], search))
            if life.empty:
                self.missing.append(f"{search} on {robot}")
                continue
            columns = life.error, 1000 * life.seconds / life.movements, life.movements_then, life.error_then
            error, ms, movements, error_then = map(interquartile_mean, columns)
            first, over, over_then = robot, f"{error:.3g}", f"{error_then:.3g}"
            if search != SEARCHES[0]:
                first = ""
                over = self.cell(self.evidence.over, life.error, usual.error, form=".2f", between=True)
                over_then = self.cell(self.evidence.over, life.error_then, usual.error_then, form=".2f", between=True)
            rows.append([first, f"`{search}`", over, f"{ms:.1f}", f"{movements:.0f}", over_then])
        head = ("robot", "search", "error, equal movements", "ms", "movements, equal time", "error, equal time")
        return markdown(head, rows)

    @cached_property
    def lives_of_others(self) -> pd.DataFrame:
        """The table of other people's programs."""
        return read_table(self.folder, OTHERS)

    def other(self, robot: str, name: str, at: int, *columns: str, form: str = ".3f") -> str:
        """Numbers of a program on a robot, such as errors of its own answers, "error", and of ours, "ours"."""
        table = self.lives_of_others
        lives = table[(table.robot == robot) & (table.learner == name) & (table.movements == at)]
        numbers = [f"{interquartile_mean(lives[column]):{form}}" for column in columns if len(lives)]
        return ", ".join(numbers) or MISSING_CELL

    def others(self, *counts: int, columns: Sequence[str] = ("error", "ours"), form: str = ".3f") -> str:
        """Numbers of other people's programs: errors by their own answers and by `process`, or times."""
        own = [column for column in columns if column != "ours"]  # all that practice has: its answers are by `process`
        of = {name: own if name == OURS else columns for name in PROGRAMS if name != KNOWS}
        rows = [
            [f"{robot}, {at}", *(self.other(robot, name, at, *of[name], form=form) for name in of)]
            for robot, at in product(dict.fromkeys(self.lives_of_others.robot), counts)
        ]
        return markdown(("robot, movements", *(f"`{name}`" for name in of)), rows)

    def asking(self) -> str:
        """Errors on the rod, and numbers of demonstrations, of learners that ask and of others; the best come first."""
        names = [name for name in EXPERIMENTS["asking"] if "toss" not in name]
        rows = []
        for name in sorted(
            ["practice", "practice-taught", "sgim-d", *names], key=lambda name: self.error(name, LAST, ".9f")
        ):
            demonstrations = "0" if name == "practice" else "all"
            if name.startswith(("sgim-im", "sgim-acts")):
                demonstrations = self.cell(self.evidence.count, "asked", name, "shown", form=".0f")
            rows.append([f"`{name}`", *self.errors(name, (1000, LAST)), demonstrations])
        return markdown(("learner", "1000", "5000", "shown"), rows)

    def _over_tasks(self, name: str, tasks: Sequence[str], at: int) -> str:
        names = [[on(learner, task) for task in tasks] for learner in (name, "random")]
        return self.cell(self.evidence.over_tasks, *names, at, form=".2f")
