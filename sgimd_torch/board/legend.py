"""The meaning of each tag of the board."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

# Meanings by tag, or by the part of the tag before the slash. UNIT is replaced by the unit of T, such as " (m)".
LEGEND: Final[Mapping[str, str]] = {
    "error/mean": "Mean distance UNIT, over the benchmark goals, from a goal to the outcome of the movement for it, "
    "eq. (10).",
    "error/median": "Median distance UNIT from a benchmark goal to the outcome of the movement for it.",
    "error/p90": "90th percentile of the distance UNIT from a benchmark goal to the outcome of the movement for it.",
    "error/failed": "Number of movements of the evaluation that failed. A failed movement counts as rest.",
    "error": "Mean error UNIT with the inverse model that the tag names, in place of the learner's own, if "
    "--evaluated-by adds one. It compares what the learners remember, whatever their inverse models are.",
    "competence": "Mean competence of the answers of an evaluation, eq. (7), by tile of T and over all goals: 0 is "
    "a goal that is met, -1 an outcome no better than rest. Tiles, 4 x 4 over the first two dimensions of T, are "
    "the same for all learners, so the one that errs less has the higher curves. If nothing is evaluated, the nearest "
    "outcome so far stands for the answer.",
    "regions/count": "Number of regions of the goal model; map/regions and map/interest show them.",
    "regions/competence": "Mean competence of the goals that the regions remember, as the learner judges it. It "
    "compares no learners, because each chooses its goals.",
    "regions/interest": "Mean interest, eq. (3), over the goals that the regions remember.",
    "outcomes/coverage": "Share of the benchmark goals with an outcome of a movement so far within half the side of a "
    "benchmark tile.",
    "outcomes": "Outcomes UNIT since the last point, in one dimension of T.",
    "failed/movements": "Number of movements so far that failed; about/failures has the reasons.",
    "kind": "Share of each kind of movement since the last point: global exploration, local optimisation, imitation, "
    "babbling, rest, or failed movements.",
    "goals/met": "Share of the benchmark goals whose error is at most half the side of a benchmark tile.",
    "goals/reached": "Share of the last 50 goals of the learner that a movement reached within the tolerance.",
    "goals/missed_by": "Median over the last 50 goals of the learner of the distance UNIT from a goal to its nearest "
    "outcome. Global exploration does not count.",
    "goals": "Goals UNIT of the learner's own since the last point, in one dimension of T.",
    "teacher/demonstrations": "Number of demonstrations so far.",
    "teacher/replies": "Number of requests so far that a teacher replied to with a demonstration.",
    "teacher/missed_by": "Mean distance UNIT from a demonstrated outcome to the outcomes of its imitations, since the "
    "last point.",
    "strategy": "Share of the movements since the last point before which the learner asked by this strategy.",
    "model/relative_error": "Prediction error for exemplars that training left out, divided by the error of predicting "
    "their mean outcome. A useless model has 1.",
    "model/held_out": "Negative log likelihood of exemplars that training left out; lower is better.",
    "model/training_loss": "Negative log likelihood of as many exemplars that it was trained on.",
    "model/gradient_norm": "Length of the gradient in the last step of the optimiser.",
    "model/learning_rate": "Learning rate of the optimiser.",
    "model/steps": "Steps of the optimiser at the last refresh.",
    "model/error": "Mean distance UNIT from the newest outcomes to their predictions before training on them.",
    "model/coverage": "Share of the newest outcomes that lie in the 80 % regions of their predictions.",
    "time/training_step": "Time (s) of a step of the optimiser, at the last refresh of the forward model.",
    "time": "Time (s) spent so far, by part of the run. Replayed movements have no times.",
    "map/regions": "Regions of the goal model, coloured by the mean competence of the goals they remember.",
    "map/interest": "Regions of the goal model, coloured by interest, eq. (3): more goals are drawn where it is high.",
    "map/error": "Benchmark goals, coloured by their error at this evaluation. The logarithmic scale depends on T "
    "alone, so runs can be compared. Crosses are outcomes of demonstrations. If T has one "
    "dimension, errors over goals.",
}


def meaning_of(tag: str, unit: str) -> str:
    """The meaning of a tag, with the ``unit`` of T; "" stands for no unit."""
    return in_unit(LEGEND.get(tag) or LEGEND[tag.partition("/")[0]], unit)


def as_markdown(unit: str) -> str:
    """The meaning of all tags, in Markdown; a list, because TensorBoard would break the tags of a table."""
    lines = [f"- **{tag}{'' if '/' in tag else '/...'}** {meaning}" for tag, meaning in LEGEND.items()]
    return in_unit("Steps are movements.\n\n" + "\n".join(lines), unit)


def in_unit(text: str, unit: str) -> str:
    """A text of ``LEGEND`` with the ``unit`` of T in place of UNIT; "" stands for no unit."""
    return text.replace(" UNIT", f" ({unit})" if unit else "")
