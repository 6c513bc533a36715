"""From episodes, regions and evaluations to named numbers, the curves of a board.

Interest and competence by region are those of section 3.2.1 of Nguyen & Oudeyer (2014). Reads public attributes only.
    behaviour = Behaviour(); behaviour.episode(episode); behaviour.curves(); of_regions(interest_map.regions)
"""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sgimd_torch.board.legend import EVERYWHERE
from sgimd_torch.evaluation import Evaluation
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box, Episode, check_vector

DEPTH: Final = 3  # of the tree of regions: so many levels below the root have curves of their own, 15 at most
PLACES: Final = 8  # at most, that have curves of their own: 2 x 2 in the plane
_RECENT: Final = 50  # goals


class Grid:
    """``box`` cut into cells of equal size; ``names`` tell their bounds, such as "x -1..0, y 0..1"."""

    def __init__(self, box: Box) -> None:
        self.box = box
        self.per_side = max(1, int(PLACES ** (1 / max(1, box.dim)) + 1e-9))
        axes = box.names or [f"outcome_{k}" for k in range(box.dim)]
        edges = np.linspace(box.low, box.high, self.per_side + 1).T
        bounds = [
            [f"{axis} {low:.3g}..{high:.3g}" for low, high in itertools.pairwise(sides)]
            for axis, sides in zip(axes, edges, strict=True)
        ]
        self.names = [", ".join(cell) for cell in itertools.product(*bounds)]

    def means(self, points: Array, values: Array) -> dict[str, float]:
        """The mean of the ``values`` ``(n,)`` at ``points`` ``(n, dim)`` in each cell that has some, by its name.

        Raises:
            ValueError: points of another dimension, or not finite.
        """
        points = check_vector("points", points, self.box.dim, "is the grid a part of another task space?")
        inside = self.box.contains(points)
        scaled = (points[inside] - self.box.low) / self.box.sides * self.per_side
        steps = np.minimum(scaled.astype(np.int64), self.per_side - 1)  # the far border belongs to the last cell
        cells = np.ravel_multi_index(tuple(steps.T), (self.per_side,) * self.box.dim)
        return {self.names[k]: float(values[inside][cells == k].mean()) for k in np.unique(cells).tolist()}


class Behaviour:
    """What the learner and its teachers do. ``tolerance`` is the distance (m) at which a goal counts as reached."""

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self._since: Counter[str] = Counter()  # movements of each regime and strategy since the last point, by tag
        self._imitated: list[float] = []  # m, since the last point
        self._goal: Array | None = None
        self._missed_by: deque[float] = deque(maxlen=_RECENT)  # m, the best for each goal pursued
        self._demonstrations = self._answered = 0

    def episode(self, episode: Episode) -> None:
        """Count a movement."""
        move = episode.move
        self._demonstrations += episode.demonstration is not None
        regime = "failed" if episode.failed else "rest" if move is None else move.origin
        self._since[f"regime/{regime}"] += 1
        if episode.request is not None:
            self._answered += episode.reply == "shown"
            self._since[f"strategy/{episode.request.strategy}"] += 1
        if move is None or move.goal is None or episode.outcome is None:
            return
        distance = float(np.linalg.norm(episode.outcome - move.goal))
        begins = self._goal is None or episode.demonstration is not None or not np.array_equal(move.goal, self._goal)
        self._goal = move.goal
        if move.origin == "imitate":
            self._imitated.append(distance)
        elif begins:
            self._missed_by.append(distance)
        else:
            self._missed_by[-1] = min(distance, self._missed_by[-1])

    def curves(self) -> dict[str, float]:
        """Regimes, goals and demonstrations; shares and means are those since the last call."""
        total = sum(n for tag, n in self._since.items() if tag.startswith("regime/"))
        values = {tag: n / total for tag, n in self._since.items()}
        self._since = Counter(dict.fromkeys(self._since, 0))  # a regime that was seen once keeps its curve
        values["teacher/demonstrations"] = self._demonstrations
        if any(tag.startswith("strategy/") for tag in values):
            values["asked/answered"] = self._answered
        if self._imitated:
            values["teacher/missed_by"] = float(np.mean(self._imitated))
            self._imitated.clear()
        if self._missed_by:
            missed_by = np.array(self._missed_by)
            values["goals/reached_share"] = float((missed_by <= self.tolerance).mean())
            values["goals/missed_by"] = float(np.median(missed_by))
        return values


class Competent:
    """Which goals of a benchmark are met, everywhere and by place.

    Args:
        goals: ``(n, outcome_dim)`` m of the benchmark.
        near: distance (m) at which one counts as met.
        space: T.
    """

    def __init__(self, goals: Array, near: float, space: Box) -> None:
        self._goals, self.near, self._places = goals, near, Grid(cells_of(space, goals))

    def curves(self, found: Evaluation) -> dict[str, float]:
        """Of an evaluation: errors, and the share of the goals that are met."""
        met = (found.errors <= self.near).astype(np.float64)
        return {
            "error/mean": found.mean_error,
            "error/median": float(np.median(found.errors)),
            "error/p90": float(np.quantile(found.errors, 0.9)),
            "error/noise_floor": found.noise_floor,
            **({"error/failed": float(found.failed.sum())} if found.failed.any() else {}),
            f"met/{EVERYWHERE}": float(met.mean()),
            **{f"met/{name}": share for name, share in self._places.means(self._goals, met).items()},
        }


def cells_of(space: Box, goals: Array) -> Box:
    """The part of T that is cut into cells: where the benchmark's ``goals`` ``(n, outcome_dim)`` lie, rounded outwards.

    So runs on one benchmark have the same cells, however large their T is.
    """
    sides = np.ptp(goals, axis=0)
    step = 10 ** np.floor(np.log10(np.where(sides > 0, sides, space.sides))) / 2
    low = space.clip(np.floor(goals.min(axis=0) / step) * step + 0.0)  # no -0 in the names of cells
    high = space.clip(np.ceil(goals.max(axis=0) / step) * step + 0.0)
    return replace(space, low=np.where(low < high, low, space.low), high=np.where(low < high, high, space.high))


def of_regions(regions: Sequence[Region]) -> dict[str, float]:
    """Competence and interest by region, from the leaves of the tree; nothing for a learner that has no regions."""
    values: dict[str, float] = {"regions/count": len(regions)} if regions else {}
    for path, below in branches(regions, DEPTH).items():
        competence, interest, goals = summary(below)
        if goals:
            values |= {f"competence/{path}": competence, f"interest/{path}": interest}
    return values


def summary(leaves: Sequence[Region]) -> tuple[float, float, int]:
    """Mean competence, mean interest and number of the goals that some regions remember; NaN if there are none."""
    counts = [len(region.goals) for region in leaves]
    if not any(counts):
        return float("nan"), float("nan"), 0
    competences = np.concatenate([region.competences for region in leaves])
    interest = np.average([region.interest() for region in leaves], weights=counts)
    return float(competences.mean()), float(interest), sum(counts)


def branches(regions: Sequence[Region], depth: int) -> Mapping[str, list[Region]]:
    """The leaves below each node of the tree down to ``depth``, by the node's path, sorted.

    The cells of a `ProgressGrid`, such as "R.3.7", all lie below "R" and nothing else.
    """
    found: dict[str, list[Region]] = {}
    for region in regions:
        path = region.path.partition(".")[0]
        for length in range(1, min(len(path), depth + 1) + 1):
            found.setdefault(path[:length], []).append(region)
    return dict(sorted(found.items()))
