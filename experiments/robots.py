"""Robots that nobody tuned on, and robots that change: statistics and claims from their tables of results.

    harmful(evidence, "practice", 250); judge(any_robot(evidence)); judge(changes(evidence))
On random robots, the sample is the robots.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Final

import numpy as np
import pandas as pd
from scipy import stats

from changing import AFTER, ANEW, ARM, BEGUN, BLIND, GOES_ON, PARTIAL, ROBOTS, SIMULATOR, WRONG, after
from evidence import Evidence, Level, NotRun, Statistic
from judging import Claim, Part, at_least, at_most
from model_files import FILES, REFUSED, RIGHT, WARNED
from page_tables import MISSING_CELL, Page, markdown
from random_robots import BASELINE, COUNTS, LEARNERS, RANDOM
from sgimd_torch.extras.table.names import NAMES
from sgimd_torch.extras.table.statistics import LEVEL, Interval, bootstrap_rng, interval
from sgimd_torch.spaces import Array

COMPARED: Final = tuple(name for name in LEARNERS if name != RANDOM)
HARMFUL: Final = 1.02  # times the error of random movements; a larger error counts as harm
MEANS: Final = dict(
    zip(COUNTS, (0.72, 0.52, 0.35, 0.30, 0.28), strict=True)
)  # bars of errors over those of random ones


def errors(evidence: Evidence, at: int) -> pd.DataFrame:
    """Errors after ``at`` movements, geometric means over seeds: a row for each robot that all learners have learnt.

    Raises:
        NotRun: there are fewer than two such robots.
    """
    rows = evidence.robots[evidence.robots["movements"] == at]
    logs = rows.assign(error=np.log(rows["error"])).pivot_table("error", "number", "learner")
    table: pd.DataFrame = np.exp(logs.reindex(columns=[*LEARNERS]).dropna())
    if len(table) < 2:
        raise NotRun(f"random robots at {at}")
    return table


def share(which: pd.Series, *, level: Level = LEVEL) -> Interval:
    """The share of robots for which ``which`` is true, with Wilson's interval."""
    if level is None:
        return Interval(float(which.mean()))
    between = stats.binomtest(int(which.sum()), len(which)).proportion_ci(level, "wilson")
    return Interval(float(which.mean()), between.low, between.high)


def best(evidence: Evidence, name: str, at: int, *, level: Level = LEVEL) -> Interval:
    """The share of robots on which a learner has the smallest error."""
    return share(errors(evidence, at).idxmin(axis=1) == name, level=level)


def over(evidence: Evidence, ours: str, theirs: str, at: int, *, level: Level = LEVEL) -> Interval:
    """The geometric mean over robots of our error divided by theirs."""
    table = errors(evidence, at)
    return geometric_mean(table[ours] / table[theirs], level=level)


def geometric_mean(ratios: pd.Series, *, level: Level = LEVEL) -> Interval:
    """The geometric mean over robots, with its interval."""
    logs = np.log(ratios.to_numpy())
    if level is None:
        return Interval(float(np.exp(logs.mean())))
    return interval(lambda drawn: np.exp(drawn.mean(axis=-1)), logs, rng=bootstrap_rng(), level=level)


def any_robot(evidence: Evidence) -> list[Claim]:
    """Claims about `practice` on random robots."""

    def less(theirs: str) -> list[Part]:
        return [at_most(1, over, evidence, "practice", theirs, at, name=f"at {at}") for at in COUNTS]

    seldom = [at_most(0.03, clearly_harmed, evidence, at, margin=0.1, name=f"at {at}") for at in COUNTS]
    means = [at_most(bar, over, evidence, "practice", RANDOM, at, name=f"at {at}") for at, bar in MEANS.items()]
    listed = ", ".join(f"{bar:.2f}" for bar in MEANS.values())
    return [
        Claim("`practice` clearly harms on at most 0.03 of the robots at each count, interval up to 0.13", seldom),
        Claim(f"... errs in the mean at most {listed} times as much as random movements", means),
        Claim("... less than SAGG-RIAC at each: ratio ≤ 1", less("sagg-riac")),
        Claim("... than the standard baseline", less(BASELINE)),
        Claim("... than with goals by interest", less("practice-interest")),
    ]


def table(page: Page) -> str:
    """The geometric mean of each learner's errors over those of random movements, and the largest ratio."""
    rows = []
    try:
        for name in COMPARED:
            ratios = [table[name] / table[RANDOM] for table in (errors(page.evidence, at) for at in COUNTS)]
            rows.append([NAMES[name], *(f"{np.exp(np.log(ratio).mean()):.2f}, {ratio.max():.1f}" for ratio in ratios)])
    except NotRun as missing:
        page.missing.append(str(missing))
    return markdown(("mean, worst", *map(str, COUNTS)), rows)


@cache
def judged(evidence: Evidence, at: int) -> pd.DataFrame:
    """`practice` and random movements, compared by robot over seeds.

    Columns: ``ratio``, of their errors on common seeds (geometric mean); ``harmed``, whether `practice` clearly errs
    more than ``HARMFUL`` times as much; ``equal``, whether this is so of two halves of the lives of random movements.

    Raises:
        NotRun: there is no robot with lives enough.
    """
    rows, robots = evidence.robots[evidence.robots["movements"] == at], {}
    for number, lives in rows[rows["learner"].isin(("practice", RANDOM))].groupby("number"):
        logs = np.log(
            lives.pivot(index="seed", columns="learner", values="error").reindex(columns=["practice", RANDOM])
        )
        both, random = logs.dropna(), logs[RANDOM].dropna().to_numpy()
        ours, theirs = both["practice"].to_numpy(), both[RANDOM].to_numpy()
        if len(ours) > 1 and (half := len(random) // 2) > 1:
            ratio, equal = np.exp(ours.mean() - theirs.mean()), (random[half:], random[:half])
            robots[number] = ratio, clearly_larger(ours, theirs), clearly_larger(*equal)
    if not robots:
        raise NotRun(f"several lives on random robots at {at}")
    return pd.DataFrame.from_dict(robots, orient="index", columns=["ratio", "harmed", "equal"])


def clearly_larger(ours: Array, theirs: Array) -> bool:
    """Whether our log errors are above theirs by more than ``HARMFUL``, by Welch's one-sided test (p < .05)."""
    test = stats.ttest_ind(ours, theirs + np.log(HARMFUL), equal_var=False, alternative="greater")
    return bool(test.pvalue < 0.05)


def times_random(evidence: Evidence, at: int, *, level: Level = LEVEL) -> Interval:
    """The geometric mean over robots of the error of `practice` divided by that of random movements."""
    return geometric_mean(judged(evidence, at)["ratio"], level=level)


def clearly_harmed(evidence: Evidence, at: int, column: str = "harmed", *, level: Level = LEVEL) -> Interval:
    """The share of robots on which `practice` clearly errs more than random movements; "equal": two equal learners."""
    return share(judged(evidence, at)[column], level=level)


def fair(page: Page) -> str:
    """`practice` over random movements, both answered by `process`, five lives a robot."""
    try:
        worst = [judged(page.evidence, at)["ratio"].max() for at in COUNTS]
    except NotRun as missing:
        page.missing.append(str(missing))
        return "Not run."

    def row(statistic: Statistic, *of: object, form: str) -> list[str]:
        return [page.cell(statistic, page.evidence, at, *of, form=form, between=True) for at in COUNTS]

    rows = [
        ["geometric mean [95 %]", *row(times_random, form=".2f")],
        ["worst robot", *(f"{ratio:.2f}" for ratio in worst)],
        ["**clearly harmed robots**", *row(clearly_harmed, form=".0%")],
        ["... by one of two equal learners", *row(clearly_harmed, "equal", form=".0%")],
    ]
    return markdown(("over random movements", *map(str, COUNTS)), rows)


def lived(evidence: Evidence) -> str:
    """The numbers of the random robots: ``500 to 559``."""
    numbers = np.unique(evidence.robots["number"])
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1) if len(numbers) else []
    return " and ".join(f"{part[0]} to {part[-1]}" for part in parts) or MISSING_CELL


def alarms(page: Page) -> str:
    """How many lives on random robots, which do not change, noticed a change: ``2 of 240``."""
    rows = page.evidence.robots.dropna(subset="noticed")
    last = rows[(rows["movements"] == COUNTS[-1]) & (~rows["learner"].isin((BASELINE, RANDOM)))]
    return f"{(last['noticed'] > 0).sum()} of {len(last)}"


def after_change(
    evidence: Evidence, robot: str, change: str, learner: str, at: int, column: str = "error"
) -> pd.Series:
    """Errors, or another column, by seed, ``at`` movements after a change.

    Raises:
        NotRun: fewer than two seeds were run.
    """
    place = (robot, change, learner, at)
    if place not in evidence.changes.index or len(values := evidence.changes.loc[place, column]) < 2:
        raise NotRun(f"{learner} after {change} of {robot} at {at}")
    return values


def learnt_models(evidence: Evidence) -> pd.DataFrame:
    """The rows of the model files that `practice` has learnt, with its error over that of random movements.

    Raises:
        NotRun: there is none.
    """
    rows = evidence.models.dropna(subset="ratio")
    if rows.empty:
        raise NotRun("model files")
    return rows


def times_random_on_models(evidence: Evidence, *, level: Level = LEVEL) -> Interval:
    """The geometric mean over model files of the error of `practice` divided by that of random movements."""
    return geometric_mean(learnt_models(evidence)["ratio"], level=level)


def models(page: Page) -> str:
    """What came of model files that nobody made for this library."""
    table = page.evidence.models
    try:
        learnt = learnt_models(page.evidence)
    except NotRun as missing:
        page.missing.append(str(missing))
        return "Not run."
    expected = {(file.path, file.outcome, file.options): file.expected for file in FILES}
    rows = table.to_dict("records")
    right = sum(
        row["told"] == RIGHT if words == RIGHT else words in row["words"]
        for row in rows
        if (words := expected.get((row["file"], row["outcome"], row["options"])))
    )
    packages = dict.fromkeys(f"{row['file'].partition('/')[0]} {row['version']}" for row in rows)
    counts = [f"{(table['told'] == word).sum()} {word}" for word in (RIGHT, WARNED, REFUSED)]
    mean = page.cell(times_random_on_models, page.evidence, form=".2f")
    return (
        f"`sgimd check` on {len(rows)} places in {table['file'].nunique()} unchanged files of {', '.join(packages)}: "
        f"{', '.join(counts)}, of these {right} as we expected from reading them ([rows](model_files.csv)). After 500 "
        "movements, at goals that postures reach if the joints alone say where the place is, or else all over T, "
        f"`practice` errs {mean} times as much as random movements in the mean of {len(learnt)}, worse by its interval "
        f"on {(learnt['low'] > 1).sum()}."
    )


def seeds(evidence: Evidence) -> str:
    """The seeds of the lives on robots that change: ``240 to 245``."""
    made = evidence.changes.index.get_level_values("seed")
    return f"{made.min()} to {made.max()}" if len(made) else MISSING_CELL


def over_anew(
    evidence: Evidence,
    robot: str,
    change: str,
    at: int,
    learner: str = GOES_ON,
    other: str = ANEW,
    *,
    level: Level = LEVEL,
) -> Interval:
    """The error after a change divided by that of a learner that starts anew, or of an ``other`` one."""
    return evidence.over(*(after_change(evidence, robot, change, name, at) for name in (learner, other)), level=level)


def mean_over_anew(evidence: Evidence, robot: str, at: int, *, level: Level = LEVEL) -> Interval:
    """The geometric mean of the error over that of starting anew, over partial changes; the sample is the seeds."""
    ratios = [
        after_change(evidence, robot, change, GOES_ON, at) / after_change(evidence, robot, change, ANEW, at)
        for change in PARTIAL
    ]
    return geometric_mean(np.exp(np.log(pd.concat(ratios, axis=1).dropna()).mean(axis=1)), level=level)


def noticed(evidence: Evidence, *robots: str, level: Level = LEVEL) -> Interval:
    """The share of lives with a partial change that have noticed it at their end."""
    numbers = [
        after_change(evidence, robot, change, GOES_ON, after(robot)[-1], "noticed")
        for robot, change in product(robots, PARTIAL)
    ]
    return share(pd.concat(numbers) > 0, level=level)


def changed(page: Page) -> str:
    """`mean_over_anew` of each robot, and the share of these changes that was noticed."""
    rows = []
    for robot in ROBOTS:
        means = [
            page.cell(mean_over_anew, page.evidence, robot, at, form=".2f") if at in after(robot) else ""
            for at in AFTER
        ]
        rows.append([robot, *means, page.cell(noticed, page.evidence, robot, form=".0%")])
    return markdown(("robot", *map(str, AFTER), "noticed"), rows)


def changes(evidence: Evidence) -> list[Claim]:
    """Claims about `practice` on robots that change, and about beginning with a simulator."""

    def parts(bar: float, *names: str, other: str = ANEW) -> list[Part]:
        return [
            at_most(bar, over_anew, evidence, robot, change, at, GOES_ON, other, name=f"{change}, {robot}, {at}")
            for robot, change in product(ROBOTS, names)
            for at in after(robot)
        ]

    def begun(bar: float, learner: str, *times: int) -> list[Part]:
        return [at_most(bar, over_anew, evidence, ARM, SIMULATOR, at, learner, name=f"at {at}") for at in times]

    return [
        Claim("The mean of all but mirrored and noise, at 100 to 1000: ratios to starting anew ≤ 1.08",
              [at_most(1.08, mean_over_anew, evidence, robot, at, name=f"{robot}, {at}")
               for robot in ROBOTS for at in after(robot)]),
        Claim("... the worst of them: ≤ 1.35", parts(1.35, *PARTIAL)),
        Claim("These changes are noticed: ≥ 0.95 of lives",
              [at_least(0.95, noticed, evidence, *ROBOTS)]),
        Claim("Noise: never worse than a learner that notices nothing: ratios ≤ 1.05",
              parts(1.05, "noise", other=BLIND)),
        Claim("Simulator: half the error at 50, 100: ratios ≤ 0.50", begun(0.5, GOES_ON, *BEGUN[:2])),
        Claim("... never worse, nor with a wrong, mirrored one: ratios ≤ 1.03",
              [*begun(1.03, GOES_ON, *BEGUN), *begun(1.03, WRONG, *BEGUN)]),
    ]  # fmt: skip
