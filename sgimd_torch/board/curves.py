"""The curves of a board: numbers by tag, computed from episodes, evaluations and regions.

Section 3.2.1 of Nguyen & Oudeyer (2014) defines interest and competence of a region.
    behaviour = Behaviour(0.02); behaviour.episode(episode); behaviour.curves(); region_curves(interest_map.regions)
    own = OwnRegions(problem); own.follow(behaviour); region_curves(own.regions)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from sgimd_torch.evaluation import Evaluation, OwnGoals
from sgimd_torch.goals.regions import Region, Tiling, absolute_progress, interest_of
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Episode

DEPTH: Final = 3  # levels of the tree of regions, below its root, that have curves; so at most 15 regions have them
MOST: Final = 40  # largest number of goals in an own region; with more, it is cut, or forgets the oldest quarter
INTEREST: Final = partial(interest_of, window=24, progress=absolute_progress)  # eq. (3), of own regions


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


class OwnRegions:
    """Regions of C x T for a learner whose goal model has none, such as practice; the board makes them for its own use.

    They tile C x T and remember their latest goals. They are those of section 3.2.1, eqs. (3) and (7), but cut at
    medians. Nothing is drawn at random.

    Args:
        problem: problem of the learner, whose spaces, rest and tolerance are read.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem, self._whole = problem, Tiling(problem, INTEREST, modes=(0, 1, 0), near=1)
        self._n_added, self.regions = 0, list[Region]()  # no regions before the first goal

    def follow(self, behaviour: Behaviour) -> None:
        """Add the new goals of a learner, but not yet the last ones, which may still be pursued."""
        new = slice(self._n_added, len(behaviour.points) - behaviour.own.at_once)
        if new.start >= new.stop:
            return
        self._n_added, problem, box = new.stop, self._problem, self._whole.box
        contexts, goals = map(np.array, zip(*behaviour.points[new], strict=True))
        points, missed_by = np.hstack((contexts, goals)), np.array(behaviour.own.missed[new])
        far = np.linalg.norm(goals - problem.rest, axis=1)
        competences = -np.minimum(1.0, missed_by / np.maximum(far, problem.tolerance))  # eq. (7)
        points = np.clip(points, box.low, np.nextafter(box.high, box.low))  # goals outside T count at its border
        leaves = []
        for region in self.regions or self._whole.regions:
            inside = ((region.low <= points) & (points < region.high)).all(axis=1)
            if n := int(inside.sum()):
                region = region.extend(points[inside], competences[inside], np.zeros(n), np.full(n, "autonomous"))
            leaves += self._cut(region)
        self.regions = leaves

    def _cut(self, region: Region) -> list[Region]:
        """The parts of a region, cut at the median of its goals along the axis in which they differ most."""
        if len(region.points) <= MOST:
            return [region]
        if len(region.path) <= DEPTH:
            cuts = np.median(region.points, axis=0)
            spread = region.points.std(axis=0) / self._whole.box.sides * (region.points < cuts).any(axis=0)
            axis = int(spread.argmax())
            if spread[axis]:
                return [part for half in region.split(axis, float(cuts[axis])) for part in self._cut(half)]
        return [region.keep(slice(-MOST * 3 // 4, None))]
