"""What each tag of the board means, and the page of charts to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

EVERYWHERE: Final = "everywhere"
# By tag, or by the part of it before the slash.
LEGEND: Final[Mapping[str, str]] = {
    "error/mean": "Distance from a benchmark goal to where its movement landed, mean over the goals, eq. (10).",
    "error/median": "Median of these distances.",
    "error/p90": "Nine in ten of these distances are shorter.",
    "error/failed": "Movements of the evaluation that failed; their goals are missed by their distance from rest.",
    "error/noise_floor": "The part of error/mean that motor noise alone causes.",
    "answers": "error/mean if another inverse model answers, such as linear in all runs: compare learners by it.",
    "met": "Share of the benchmark goals in this place that are met: missed by half the side of a tile or less.",
    "competence": "How well goals in this region went, from 0, reached, to -1, no better than resting: mean of those "
    "it remembers. R is all of C x T, R0 and R1 its two parts, R01 a part of R0; images show where. A name keeps its "
    "meaning for the whole run; another run has other regions. After a cut, the curve is the mean over the parts.",
    "interest": "How fast competence changes in this region, eq. (3); goals are drawn where it is high. After a "
    "cut, the curve is the mean over the goals of the parts.",
    "regions/count": "How many regions the goal model has.",
    "regime": "Share of the last movements that came from global exploration, local optimisation, imitation, babbling "
    "or rest, and of those that failed.",
    "goals/reached_share": "Of the last 50 goals, the share that a movement came within the tolerance of.",
    "goals/missed_by": "Distance from a goal to where its best movement landed, median over the last 50 goals.",
    "teacher/demonstrations": "Demonstrations that the teacher has given so far.",
    "teacher/missed_by": "Distance from a demonstrated outcome to where its imitations landed, mean over the last "
    "movements.",
    "strategy": "Share of the last movements before which the learner asked by this strategy; before the others it did "
    "not ask.",
    "asked/answered": "Requests so far that were answered with a demonstration.",
    "model/relative_error": "Error for exemplars never trained on, over that of always predicting their mean.",
    "model/held_out": "Negative log likelihood of exemplars never trained on; lower is better.",
    "model/steps": "Of the optimiser, at the last refresh.",
    "model/error": "Distance from where the newest movements landed to where the model, before learning them, "
    "predicted that they would.",
    "model/coverage": "Share of the newest movements that landed in the model's 80 % region.",
    "time": "Seconds spent so far: on physics, by the learner and on evaluations. A resumed run shows them from there.",
    "map/competence": "The regions, named like the curves, coloured by the mean competence of the goals they remember.",
    "map/error": "How far from each benchmark goal the movement for it landed at this evaluation.",
    "about": "What this run is, and how to read its board.",
}
COMPETENT: Final = "Where is it competent (half of the goals met, within {near}), and since when?"
# Category -> title of a chart -> its tag, or the part of it before the slash.
CHARTS: Final[Mapping[str, Mapping[str, str]]] = {
    COMPETENT: {"share of goals met": "met"},
    "Does it learn?": {
        "mean error on the benchmark": "error/mean",
        "noise floor: what noise alone makes of it": "error/noise_floor",
        "share of the last 50 goals reached": "goals/reached_share",
    },
    "What did it do, and its teacher?": {
        "interest, everywhere: how fast competence changes": "interest/R",
        "share of movements: searches for its own goals": "regime/local",
        "share of movements: imitations": "regime/imitate",
        "demonstrations so far": "teacher/demonstrations",
        "share of movements before which it asked": "strategy",
        "imitations miss what was shown by": "teacher/missed_by",
    },
    "Does the forward model predict where movements land?": {
        "distance to where they landed": "model/error",
        "share in its 80 % region": "model/coverage",
        "relative error on what it never learns from; 1 is no better than their mean": "model/relative_error",
    },
}


def sentence(tag: str) -> str:
    """What a tag means."""
    return LEGEND.get(tag) or LEGEND[tag.partition("/")[0]]


def charts(tags: Mapping[str, object], near: str) -> dict[str, dict[str, str]]:
    """Category -> title -> tag: the charts that ``tags`` fill; ``near`` is the distance at which goals are met."""
    page: dict[str, dict[str, str]] = {}
    for category, each in CHARTS.items():
        for title, wanted in each.items():
            for tag in tags:
                head, _, tail = tag.partition("/")
                if tag == wanted or head == wanted:
                    name = title if tag == wanted else f"{title}: {tail}"
                    page.setdefault(category.format(near=near), {})[name] = tag
    return page
