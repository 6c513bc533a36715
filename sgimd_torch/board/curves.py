"""The curves of a board: numbers by tag, computed from episodes, evaluations and regions.

behaviour = Behaviour(space, 0.02); behaviour.episode(episode); behaviour.curves(); region_curves(interest_map.regions)
places = Places(benchmark, problem); places.add(outcomes); places.curves(evaluation.errors)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.evaluation import Benchmark, Evaluation, OwnGoals
from sgimd_torch.goals.regions import Region
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box, Episode

TILES: Final = 4  # number of tiles of T along each of its first two dimensions


class Behaviour:
    """Curves of what the learner and its teachers do.

    Args:
        space: T.
        tolerance: distance, in the unit of T, at which a goal counts as reached.
        at_once: number of robots that move at once.

    Attributes:
        goals, outcomes: goals of the learner's own, each once, and outcomes, since the last ``curves``.
        shown: outcomes of all demonstrations so far.
        failures: number of failed movements so far, by reason.
    """

    def __init__(self, space: Box, tolerance: float, at_once: int = 1) -> None:
        self._space, self.tolerance, self.own, self._movements = space, tolerance, OwnGoals(at_once), 0
        self.goals, self.outcomes, self.shown = dict[bytes, Array](), list[Array](), list[Array]()
        self.failures: Counter[str] = Counter()
        self._since: Counter[str] = Counter()  # number of movements since the last point, by tag
        self._imitated: list[float] = []  # distances missed by imitations since the last point
        self._answered = 0

    def episode(self, episode: Episode) -> None:
        """Count a movement."""
        move, outcome, self._movements = episode.move, episode.outcome, episode.index + 1
        if episode.demonstration is not None:
            self.shown.append(episode.demonstration.outcome)
        if episode.failed:
            self.failures[episode.failed] += 1
        kind = "failed" if episode.failed else "rest" if move is None else move.origin
        self._since[f"kind/{kind}"] += 1
        if episode.request is not None:
            self._answered += episode.reply == "shown"
            self._since[f"strategy/{episode.request.strategy}"] += 1
        if outcome is not None:
            self.outcomes.append(outcome)
        if move is None or move.goal is None:
            return
        if move.origin != "imitate":
            self.goals[move.goal.tobytes()] = move.goal
        if outcome is not None and move.origin == "imitate":
            self._imitated.append(float(self._space.distance(outcome, move.goal)))
        elif outcome is not None and move.origin != "global":
            self.own.add(episode.index, move.goal, self._space.unwrapped(outcome, move.goal))

    def curves(self) -> dict[str, float]:
        """Values of the curves by tag: shares and means since the last call, counts since the first movement."""
        total = sum(n for tag, n in self._since.items() if tag.startswith("kind/"))
        values = {tag: n / total for tag, n in self._since.items()}
        self._since = Counter(dict.fromkeys(self._since, 0))  # known tags keep their curves, at 0
        self.goals.clear()
        self.outcomes.clear()
        if self.failures:
            values["failed/movements"] = self.failures.total()
        if self.shown:
            values["teacher/demonstrations"] = len(self.shown)
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


class Places:
    """Competence by tile of T, and coverage of T, both at the goals of a benchmark: the same for all learners.

    Args:
        benchmark: goals of the evaluations.
        problem: problem of the learner, whose T, rest and tolerance are read.

    Attributes:
        missed: ``(n,)``, distance from each goal to the nearest outcome so far.
    """

    def __init__(self, benchmark: Benchmark, problem: Problem) -> None:
        self._distance = problem.outcomes.distance
        self._goals, self._near = benchmark.goals, benchmark.side / 2
        self._far = np.maximum(problem.outcomes.distance(benchmark.goals, problem.rest), problem.tolerance)
        self._tiles = tiles_of(benchmark.goals, problem.outcomes)
        self.missed = np.full(len(benchmark.goals), np.inf)

    def add(self, outcomes: Sequence[Array]) -> None:
        """Note new outcomes."""
        for outcome in outcomes:
            self.missed = np.minimum(self.missed, self._distance(self._goals, outcome))

    @property
    def coverage(self) -> float:
        """Share of the goals with an outcome as near as a goal has to be to count as met."""
        return float((self.missed <= self._near).mean())

    def curves(self, missed: Array) -> dict[str, float]:
        """Mean competence, eq. (7), by tile and of all goals, where the goals are ``missed`` ``(n,)`` by so much."""
        competences = -np.minimum(1.0, missed / self._far)
        values = {f"competence/{place}": float(competences[inside].mean()) for place, inside in self._tiles.items()}
        return {"competence/mean": float(competences.mean()), **values}


def tiles_of(goals: Array, box: Box) -> dict[str, NDArray[np.bool_]]:
    """The ``goals`` ``(n, outcome_dim)`` in each tile of T, masks ``(n,)``, by the place of the tile, such as
    "x -1..0, y 0..1". Tiles divide the first two dimensions of T, ``box``; those without goals are left out."""
    cells = np.clip(np.floor((goals - box.low) / box.sides * TILES), 0, TILES - 1)[:, :2]
    masks = {}
    for cell in np.unique(cells, axis=0):
        lows = box.low[:2] + cell / TILES * box.sides[:2]
        highs = lows + box.sides[:2] / TILES
        names = box.names or [f"outcome {k}" for k in range(box.dim)]
        place = ", ".join(f"{name} {a:.4g}..{b:.4g}" for name, a, b in zip(names, lows, highs, strict=False))
        masks[place] = (cells == cell).all(axis=1)
    return masks


def evaluation_curves(evaluation: Evaluation, near: float) -> dict[str, float]:
    """Values of the curves of an evaluation by tag; a goal with an error of at most ``near`` counts as met."""
    return {
        "error/mean": evaluation.mean_error,
        "error/median": float(np.median(evaluation.errors)),
        "error/p90": float(np.quantile(evaluation.errors, 0.9)),
        **({"error/failed": float(evaluation.failed.sum())} if evaluation.failed.any() else {}),
        "goals/met": float((evaluation.errors <= near).mean()),
    }


def region_curves(regions: Sequence[Region]) -> dict[str, float]:
    """Number of regions, by tag, and the means of competence and interest over the goals that they remember."""
    n = np.array([len(region.goals) for region in regions])
    if not n.any():
        return {}
    competence = sum(region.competences.sum() for region in regions) / n.sum()
    interest = n @ [region.interest() for region in regions] / n.sum()
    return {"regions/count": len(regions), "regions/competence": competence, "regions/interest": float(interest)}
