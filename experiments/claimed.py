"""The claims of each page of results, each with its bar: first the claims of the paper, then ours.

for verdict in judge(paper(evidence, letter=True)): print(verdict.claim, verdict.verdict)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pandas as pd

from evidence import LAST, Evidence, Level, shared
from judging import Claim, Part, at_least, at_most
from sgimd_torch.extras.table.statistics import LEVEL, Interval
from suite import TASKS, UNIFORM
from variants import ARMS, FOUR, HALVES, ROD, SPARSE

TIMES: Final = (250, 500, 1000, 2000)
WHOLE: Final = (*TIMES, LAST)
SUITE: Final = tuple(task for task in TASKS if task not in SPARSE)
EVERY: Final = 30  # number of movements between two demonstrations of SGIM-D
COST: Final = 10  # cost of a demonstration, in movements


def on(name: str, task: str) -> str:
    """The variant of a learner on a task of the suite."""
    return name if task == ROD else f"{name}.{task}"


def less(evidence: Evidence, ours: str, theirs: str, *times: int, name: str = "") -> list[Part]:
    """Parts of a claim, one for each number of movements in ``times``: our error is smaller than theirs."""
    names = {at: f"{name} at {at}".strip() if len(times) > 1 else name for at in times or (LAST,)}
    return [at_most(0.0, evidence.difference, ours, theirs, at, name=label, form="+.4f") for at, label in names.items()]


def times_as_much(evidence: Evidence, bar: float, ours: str, theirs: str, *times: int) -> list[Part]:
    """Parts of a claim, one for each number of movements in ``times``: our error is at most ``bar`` times theirs."""
    return [at_most(bar, evidence.ratio, ours, theirs, at, name=f"at {at}") for at in times]


def paper(evidence: Evidence, *, letter: bool) -> list[Claim]:
    """Claims of section 6 of the paper, on learners by the ``letter`` of the paper, or else on our learners.

    For learners by the letter, eq. (9) answers. Unless a claim says otherwise, it is about 5000 movements, with a
    demonstration of demonstrator 3 every 30 movements.
    """

    def our(algorithm: str, where: str = "") -> str:
        return f"{algorithm}-letter{where} by paper" if letter else f"{algorithm}{where}"

    def earlier(*, level: Level = LEVEL) -> Interval:
        return evidence.less(evidence.at(sgim_d, 1000), evidence.at(random), level=level)

    random, sgim_d, sagg_riac = our("random"), our("sgim-d"), our("sagg-riac")
    imitation, observation = our("imitation"), our("observation")
    others = {"Random": random, "SAGG-RIAC": sagg_riac, "Observation": observation, "Imitation": imitation}
    best = [part for name, other in others.items() for part in less(evidence, sgim_d, other, name=name)]
    taught = [
        part
        for number, where in ((1, "-teacher-1"), (2, "-teacher-2"), (3, ""))
        for name, other in (("SAGG-RIAC", sagg_riac), ("Imitation", our("imitation", where)))
        for part in less(evidence, our("sgim-d", where), other, name=f"{name}, demonstrator {number}")
    ]
    large, sagg_riac_large = our("sgim-d", "-large"), our("sagg-riac", "-large")
    return [
        Claim("Observation has the largest error: Random − Observation < 0", less(evidence, random, observation),
              "Watching alone teaches least."),
        Claim("The error of SAGG-RIAC is clearly smaller than that of Random: ratio ≤ 0.85",
              [at_most(0.85, evidence.ratio, sagg_riac, random)], "Choosing goals reduces the error."),
        Claim("... from the beginning: difference < 0 at 250, 500, 1000",
              less(evidence, sagg_riac, random, 250, 500, 1000), "At first SAGG-RIAC has tried only few goals."),
        Claim("The error of Imitation is smaller than that of Random: difference < 0",
              less(evidence, imitation, random),
              "Demonstrations reduce the error."),
        Claim("... about as large as that of SAGG-RIAC: ratio 0.80 to 1.25",
              [at_most(1.25, evidence.ratio, imitation, sagg_riac),
               at_least(0.8, evidence.ratio, imitation, sagg_riac)],
              "Either alone helps about as much."),
        Claim("... and varies less over seeds: ratio of variances ≤ 0.50",
              [at_most(0.5, evidence.variance_ratio, imitation, sagg_riac)], "A teacher makes seeds more alike."),
        Claim("SGIM-D has the smallest error: four differences < 0", best, "It has, either way."),
        Claim("SGIM-D halves the error of Random: ratio ≤ 0.50, interval up to 0.55",
              [at_most(0.5, evidence.ratio, sgim_d, random, margin=0.05)], "The answers of eq. (9) are coarse."),
        Claim("... its error comes near its noise floor: ratio ≤ 1.25",
              [at_most(1.25, evidence.over_floor, sgim_d, sgim_d)],
              "A part of the error comes from the inverse model."),
        Claim("... after 1000 movements its error is smaller than the last one of Random: difference < 0",
              [at_most(0, earlier, form="+.4f")],
              "Teaching helps early."),
        Claim("SAGG-RIAC reaches more benchmark tiles than Random",
              [at_least(0, evidence.more_tiles, sagg_riac, random, form="+.0f")], "Goals widen the reached part of T."),
        Claim("... and SGIM-D more than SAGG-RIAC", [at_least(0, evidence.more_tiles, sgim_d, sagg_riac, form="+.0f")],
              "No difference was found."),
        Claim("With each of three demonstrators, the error of SGIM-D is smaller than those of SAGG-RIAC and Imitation: "
              "six differences < 0", taught, "With the careful demonstrator 2, Imitation is as good."),
        Claim("Demonstrator 3 is better for SGIM-D than 2, and 2 is better than 1: two differences < 0",
              [*less(evidence, sgim_d, our("sgim-d", "-teacher-2"), name="3 and 2"),
               *less(evidence, our("sgim-d", "-teacher-2"), our("sgim-d", "-teacher-1"), name="2 and 1")],
              "By `process` structured demonstrations help most, careful ones second."),
        Claim("Demonstrators 1 and 2 are better for Observation than 3: two differences < 0",
              [part for number in (1, 2)
               for part in less(evidence, our("observation", f"-teacher-{number}"), observation,
                                name=f"{number} and 3")],
              "By eq. (9) only demonstrator 2 is better."),
        Claim("T 10⁴ times larger: the error of SAGG-RIAC is still smaller than that of Random",
              less(evidence, sagg_riac_large, random), "Nearly all goals of SAGG-RIAC are out of reach."),
        Claim("... the error of SAGG-RIAC grows more than that of SGIM-D: ratio of ratios > 1",
              [at_least(1.0, evidence.growth_ratio, (sagg_riac, sagg_riac_large), (sgim_d, large))],
              "The teacher shows SGIM-D the part within reach."),
        Claim("... the error of SGIM-D is little larger than in the small T: ratio ≤ 1.20",
              [at_most(1.2, evidence.ratio, large, sgim_d)], "The error is a tenth to a third larger."),
        Claim("... and smaller than those of SAGG-RIAC and Random: two differences < 0",
              [*less(evidence, large, sagg_riac_large, name="SAGG-RIAC"),
               *less(evidence, large, random, name="Random")],
              "The error is much smaller."),
        Claim("... because SGIM-D chooses goals within reach: share of such goals ≥ 10 times that of SAGG-RIAC",
              [at_least(10, evidence.near_ratio, large, sagg_riac_large, form=".0f")],
              "Teacher and interest together find what can be reached."),
    ]  # fmt: skip


def learning(evidence: Evidence) -> list[Claim]:
    """Claims on learning from few movements, first on the rod, then on the suite."""
    taught, alone = "practice-taught", "practice"
    rivals = ("sgim-d", "cma-mae-taught", "map-elites-taught", "uniform-nearest-taught")
    tasks = [(task, at) for task in TASKS for at in TIMES]

    def small(name: str, bars: Mapping[int, float]) -> list[Part]:
        return [at_most(bar, evidence.error, name, at, name=f"at {at}", form=".4f") for at, bar in bars.items()]

    def on_each_task(theirs: str, bar: float) -> list[Part]:
        return [
            at_most(bar, evidence.ratio, on(alone, task), on(theirs, task), at, name=f"{task} at {at}")
            for task, at in tasks
        ]

    return [
        Claim("`practice` has a small error on the rod: ≤ 0.075, 0.052, 0.0445 m at 250, 1000, 5000",
              small(alone, {250: 0.075, 1000: 0.052, LAST: 0.0445})),
        Claim("... taught, ≤ 0.040, 0.0345 m at 1000, 5000", small(taught, {1000: 0.040, LAST: 0.0345})),
        Claim("... smaller than SGIM-D and three rivals if all get all demonstrations at the start: < 0 at 250, 500, "
              "1000, 5000", [part for name in rivals for part in less(evidence, taught, f"{name}-once",
                                                                    250, 500, 1000, LAST, name=name)]),
        Claim("`practice`, without a teacher, has a smaller error than CMA-MAE: < 0 at 1000, 2000, 5000",
              less(evidence, alone, "cma-mae", 1000, 2000, LAST)),
        Claim("... hardly a larger error in a T with sides 100 times longer: ≤ 1.15 times, 500 to 2000",
              times_as_much(evidence, 1.15, "practice.rod-large", alone, *TIMES[1:])),
        Claim("... on `puck` and `fetch` a smaller error than SAGG-RIAC and the standard baseline: < 0 at 2000",
              [part for task in SPARSE for name in ("sagg-riac", UNIFORM)
               for part in less(evidence, f"practice.{task}", f"{name}.{task}", 2000, name=f"{name}, {task}")]),
        Claim("Suite: `practice` never has a larger error than random movements: ≤ 1.02 times, 250 to 2000",
              on_each_task("random", 1.02)),
        Claim("... nor than the standard baseline: ≤ 1.05 times", on_each_task(UNIFORM, 1.05)),
        Claim("... without `puck` and `fetch`, a smaller error than the standard baseline: mean ratio ≤ 0.75 at 1000",
              [at_most(0.75, evidence.over_tasks,
                       *([on(name, task) for task in SUITE] for name in (alone, UNIFORM)), 1000)]),
    ]  # fmt: skip


def curiosity(evidence: Evidence) -> list[Claim]:
    """Claims on what interest gains over uniform goals."""
    return [
        Claim("Interest in the small T, nearly all within reach: SGIM-D − SGIM-D with uniform goals < 0",
              less(evidence, "sgim-d", "sgim-d-uniform")),
        Claim("Interest in the large T, by our definition: the same difference < 0",
              less(evidence, "sgim-d-large", "sgim-d-uniform-large")),
        Claim("... by the paper's eq. (3): the same difference < 0",
              less(evidence, "sgim-d-absolute-large", "sgim-d-uniform-large")),
        Claim("Interest instead of goals within reach in `practice`: < 0 at 1000, 5000",
              less(evidence, "practice-interest", "practice", 1000, LAST)),
    ]  # fmt: skip


def model(evidence: Evidence) -> list[Claim]:
    """Claims on SGIM-D with a forward model instead of `process`: one proves itself first, one answers untested."""
    proved, untested, plain = "sgim-d-model by model", "sgim-d-model-alone by model-alone", "sgim-d"
    on_arms = [
        at_most(1.03, evidence.ratio, f"sgim-d-model.{arm} by model", f"sgim-d.{arm}", at, name=f"{arm} at {at}")
        for arm in ARMS
        for at in TIMES
    ]
    return [
        Claim("`--inverse model`: the error of SGIM-D is ≤ 0.055, 0.042, 0.0365 m at 1000, 2000, 5000",
              [at_most(bar, evidence.error, proved, at, name=f"at {at}", form=".4f")
               for at, bar in ((1000, 0.055), (2000, 0.042), (LAST, 0.0365))]),
        Claim("... never much larger than with `process`: ≤ 1.03 times, on the rod at 250 to 5000, on arms of 7 and 50 "
              "joints at 250 to 2000", [*times_as_much(evidence, 1.03, proved, plain, *WHOLE), *on_arms]),
        Claim("A model that answers untested has a smaller error than SGIM-D: < 0 at 1000, 2000, 5000",
              less(evidence, untested, plain, 1000, 2000, LAST)),
    ]  # fmt: skip


def asking(evidence: Evidence) -> list[Claim]:
    """Claims on learners that ask: when, how often, whom and where they ask, and at which cost."""
    im, dear, sgim_d = "sgim-im", "sgim-im-cost-10", "sgim-d"

    def asked(name: str, what: str, teachers: Sequence[str] = ()) -> pd.Series:
        return evidence.counts("asked", name, what, teachers)

    def late(name: str, what: str, of: Sequence[str], among: Sequence[str], *, level: Level = LEVEL) -> Interval:
        return evidence.share(asked(name, what, of), asked(name, "late", among), level=level)

    def at_equal_cost(*, level: Level = LEVEL) -> Interval:
        """Our error minus that of SGIM-D at equal cost; errors of SGIM-D are interpolated between its evaluations."""
        ours, replies = shared(evidence.at(dear), asked(dear, "shown"))
        costs, curve = shared((LAST + COST * replies) / (1 + COST / EVERY), evidence.curve(sgim_d))
        theirs = pd.Series({seed: np.interp(costs[seed], curve.columns, curve.loc[seed]) for seed in costs.index})
        return evidence.less(ours, theirs, level=level)

    return [
        Claim("When to ask: SGIM-IM has a smaller error than SGIM-D with a demonstration every 30: < 0 at 1000",
              less(evidence, im, sgim_d, 1000)),
        Claim("... no larger error than SGIM-D with all 127 demonstrations at the start: ≤ 0 at 5000",
              less(evidence, im, "sgim-d-initial")),
        Claim("Whom to ask: SGIM-ACTS learns from four teachers, one of whom mislabels, as well as from each of the "
              "other three alone: ratios ≤ 1.05",
              [at_most(1.05, evidence.ratio, "sgim-acts-four", name, name=f"teacher {k}")
               for k, name in enumerate(("sgim-acts-1", "sgim-acts-2", im), 1)]),  # teacher 3 is that of SGIM-IM
        Claim("... and seldom asks the teacher who mislabels: ≤ 10 % of the requests after 1000",
              [at_most(0.1, late, "sgim-acts-four", "late", ("mislabelling",), FOUR)]),
        Claim("Where to ask: if two teachers know one half of T each, ≥ 80 % of the requests after 1000 are for the "
              "teacher's own half", [at_least(0.8, late, "sgim-acts-halves", "late_own", HALVES, HALVES)]),
        Claim("Cost: if a demonstration costs ten movements, SGIM-IM has a smaller error than SGIM-D at equal total "
              "cost", [at_most(0, at_equal_cost, form="+.4f")]),
        Claim("Contexts: on the toss SGIM-IM has a smaller error than a learner to which the wind is hidden: < 0 at "
              "1000, 2000", less(evidence, "sgim-im.toss", "practice.toss-blind", 1000, 2000)),
    ]  # fmt: skip
