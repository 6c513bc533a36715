"""What each tag of the board means."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

# Meanings by tag, or by the part of the tag before the slash. UNIT is replaced by the unit of T, such as " (m)".
LEGEND: Final[Mapping[str, str]] = {
    "error/mean": "Mean distance UNIT, over the benchmark goals, from a goal to the outcome of the movement for it, "
    "eq. (10).",
    "error/median": "Median distance UNIT from a benchmark goal to the outcome of the movement for it.",
    "error/p90": "90th percentile of the distances UNIT from the benchmark goals to their outcomes.",
    "error/failed": "Movements of the evaluation that failed. The error is then the distance from goal to rest.",
    "error/noise_floor": "Part UNIT of error/mean that motor noise alone makes.",
    "error": "Mean error UNIT if another inverse model answers. All runs have by_linear, so this curve compares "
    "learners without the influence of their inverse models.",
    "competence": "Mean competence of the goals that a region remembers: 0 is met, -1 no better than rest. R is all of "
    "C x T, R0 and R1 are its two parts, R01 is a part of R0; map/competence shows them. Other runs have other "
    "regions. After a cut of the region, the curve is the mean over the goals of its parts.",
    "interest": "Recent change of competence in a region, eq. (3). The learner draws more goals where interest is "
    "high. After a cut of the region, the curve is the mean over the goals of its parts.",
    "regions": "Number of regions of the goal model.",
    "regime": "Share of the last movements by origin: global exploration, local optimisation, imitation, babbling or "
    "rest; failed is the share of movements that failed.",
    "goals/met": "Share of the benchmark goals that are met: their error is half the side of a tile or less.",
    "goals/reached": "Share of the last 50 goals that a movement reached within the tolerance.",
    "goals/missed_by": "Distance UNIT from a goal to its nearest outcome, median over the last 50 goals.",
    "teacher/demonstrations": "Number of demonstrations so far.",
    "teacher/replies": "Number of requests so far that a teacher replied to with a demonstration.",
    "teacher/missed_by": "Distance UNIT from a demonstrated outcome to the outcome of an imitation, mean over the last "
    "imitations.",
    "strategy": "Share of the last movements before which the learner asked by this strategy.",
    "model/relative_error": "Error for exemplars that training left out, relative to the error of always predicting "
    "their mean; 1 is no better than that.",
    "model/held_out": "Negative log likelihood of exemplars that training left out; lower is better.",
    "model/steps": "Steps of the optimiser at the last refresh.",
    "model/error": "Mean distance UNIT from the newest outcomes to what the model predicted before it learnt them.",
    "model/coverage": "Share of the newest outcomes in the 80 % region of their prediction.",
    "time": "Time (s) spent so far, by part of the run. Replayed movements have no times.",
    "map/competence": "Regions, named as in the curves, coloured by the mean competence of the goals they remember.",
    "map/error": "Benchmark goals, coloured by their error at this evaluation.",
}


def sentence(tag: str, unit: str) -> str:
    """The meaning of a tag, with the ``unit`` of T; "" stands for no unit."""
    return in_unit(LEGEND.get(tag) or LEGEND[tag.partition("/")[0]], unit)


def page(unit: str) -> str:
    """The meaning of all tags, in markdown. A list, because TensorBoard breaks tags in a table in the middle."""
    lines = [f"- **{tag}{'' if '/' in tag else '/...'}** {meaning}" for tag, meaning in LEGEND.items()]
    return in_unit("Steps are movements.\n\n" + "\n".join(lines), unit)


def in_unit(text: str, unit: str) -> str:
    """A text of this file, with the ``unit`` of T; "" stands for no unit."""
    return text.replace(" UNIT", f" ({unit})" if unit else "")
