"""The curves of a board: numbers by tag, computed from episodes, evaluations and regions.

Section 3.2.1 of Nguyen & Oudeyer (2014) defines interest and competence of a region.
    behaviour = Behaviour(0.02); behaviour.episode(episode); behaviour.curves(); region_curves(interest_map.regions)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sgimd_torch.evaluation import Evaluation, OwnGoals
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Episode

DEPTH: Final = 3  # levels of the tree of regions, below its root, that have curves; so at most 15 regions have them


class Behaviour:
    """Curves of what the learner and its teachers do.

    Args:
        tolerance: distance, in the unit of T, at which a goal counts as reached.
        at_once: number of robots that move at once.
    """

    def __init__(self, tolerance: float, at_once: int = 1) -> None:
        self.tolerance, self.own, self._movements = tolerance, OwnGoals(at_once), 0
        self.points: list[tuple[Array, Array]] = []  # context and goal, for each goal of ``own``
        self._since: Counter[str] = Counter()  # number of movements since the last point, by tag
        self._imitated: list[float] = []  # distances missed by imitations since the last point
        self._demonstrations = self._answered = 0

    def episode(self, episode: Episode) -> None:
        """Count a movement."""
        move, self._movements = episode.move, episode.index + 1
        self._demonstrations += episode.demonstration is not None
        kind = "failed" if episode.failed else "rest" if move is None else move.origin
        self._since[f"kind/{kind}"] += 1
        if episode.request is not None:
            self._answered += episode.reply == "shown"
            self._since[f"strategy/{episode.request.strategy}"] += 1
        if move is None or move.goal is None or episode.outcome is None:
            return
        if move.origin == "imitate":
            self._imitated.append(float(np.linalg.norm(episode.outcome - move.goal)))
        elif move.origin != "global":
            self.own.add(episode.index, move.goal, episode.outcome)
            if len(self.points) < len(self.own.missed):
                self.points.append((episode.context, move.goal))

    def curves(self) -> dict[str, float]:
        """Values of the curves by tag: shares and means since the last call, counts since the first movement."""
        total = sum(n for tag, n in self._since.items() if tag.startswith("kind/"))
        values = {tag: n / total for tag, n in self._since.items()}
        self._since = Counter(dict.fromkeys(self._since, 0))  # known tags keep their curves, at 0
        values["teacher/demonstrations"] = self._demonstrations
        if any(tag.startswith("strategy/") for tag in values):
            values["teacher/replies"] = self._answered
        if self._imitated:
            values["teacher/missed_by"] = float(np.mean(self._imitated))
            self._imitated.clear()
        missed_by = self.own.recent_misses(self._movements)
        if len(missed_by):
            values["goals/reached"] = float((missed_by <= self.tolerance).mean())
            values["goals/missed_by"] = float(np.median(missed_by))
        return values


def evaluation_curves(evaluation: Evaluation, near: float) -> dict[str, float]:
    """Values of the curves of an evaluation by tag; a goal with an error of at most ``near`` counts as met."""
    return {
        "error/mean": evaluation.mean_error,
        "error/median": float(np.median(evaluation.errors)),
        "error/p90": float(np.quantile(evaluation.errors, 0.9)),
        "error/noise_floor": evaluation.noise_floor,
        **({"error/failed": float(evaluation.failed.sum())} if evaluation.failed.any() else {}),
        "goals/met": float((evaluation.errors <= near).mean()),
    }


def region_curves(regions: Sequence[Region]) -> dict[str, float]:
    """Mean competence and mean interest, by tag, of each node of the tree whose leaves are ``regions``.

    The means are over the remembered goals of all leaves below the node. A node without goals has no curve.
    """
    values: dict[str, float] = {"regions/count": len(regions)} if regions else {}
    goals = {region: len(region.competences) for region in regions}
    sums = {region: np.array([region.competences.sum(), goals[region] * region.interest()]) for region in regions}
    for path, leaves in branches(regions).items():
        if n := sum(goals[region] for region in leaves):
            competence, interest = sum((sums[region] for region in leaves), np.zeros(2)).tolist()
            values[f"competence/{path}"], values[f"interest/{path}"] = competence / n, interest / n
    return values


def branches(regions: Sequence[Region]) -> Mapping[str, list[Region]]:
    """The leaves below each node of the tree of regions, by the path of the node; deepest nodes are at level ``DEPTH``.

    Cells that never split, such as "R.3.7", form no tree: "R" is their only node.
    """
    leaves_below: dict[str, list[Region]] = {}
    for region in regions:
        path = region.path.partition(".")[0]
        for length in range(1, min(len(path), DEPTH + 1) + 1):
            leaves_below.setdefault(path[:length], []).append(region)
    return dict(sorted(leaves_below.items()))
