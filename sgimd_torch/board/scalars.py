"""From episodes, regions and evaluations to named numbers: the curves that a board shows, and what each of them means.

Interest and competence by region are those of section 3.2.1 of Nguyen & Oudeyer (2014). Reads public attributes only.
    curves = Curves(environment.outcomes); curves.episode(episode); curves.of_regions(interest_map.regions)
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box, Episode, check_vector

# By tag, or by the part of it before the slash.
LEGEND: Final = {
    "error/mean": "Distance (m) from a benchmark goal to where its movement landed, mean over the goals, eq. (10).",
    "error/median": "Median of these distances (m).",
    "error/p90": "Nine in ten of these distances are shorter (m).",
    "error/noise_floor": "The part of error/mean that motor noise alone causes (m).",
    "competence": "How well goals in this region went, from 0, reached, to -1, no better than resting: mean of those "
    "it remembers. R is all of C x T, R0 and R1 its two parts, R01 a part of R0; images show where. A name keeps its "
    "meaning for the whole run; another run has other regions. After a cut, the curve is the mean over the parts.",
    "interest": "How fast competence changes in this region, eq. (3); goals are drawn where it is high. After a "
    "cut, the curve is the mean over the goals of the parts.",
    "region_goals": "Goals met in this region, demonstrated ones too, since its parts were cut.",
    "region_reached": "Share of the goals remembered in this region that a movement came within the tolerance of.",
    "region_size": "This region's share of C x T, once.",
    "grid_competence": "Mean competence of the remembered goals in one cell of a grid that is the same in all "
    "runs on one benchmark.",
    "grid_error": "Mean error (m) over the benchmark goals in one cell of this grid.",
    "grid_met": "Share of the benchmark goals in one cell of this grid that were met: missed by half the side of a "
    "tile of the benchmark or less.",
    "met": "The same share in larger cells, and everywhere. Read off where the robot is competent, and since when.",
    "regions/count": "How many regions the goal model has.",
    "regions": "Over all regions, also those too small for curves of their own: 10 %, half or 90 % lie below this.",
    "regime": "Share of the last movements that came from global exploration, local optimisation, imitation, babbling "
    "or rest.",
    "goals/attempted": "Goals that the learner has pursued so far, without imitation.",
    "goals/reached": "Those goals that a movement came within the tolerance of.",
    "goals/reached_share": "Of the last 50 goals, the share that a movement came within the tolerance of.",
    "goals/missed_by": "Distance (m) from a goal to where its best movement landed, median over the last 50 goals.",
    "teacher/demonstrations": "Demonstrations that the teacher has given so far.",
    "strategy": "Share of the last movements before which the learner asked by this strategy; before the others it did "
    "not ask.",
    "asked": "Of its last requests, the share for a goal in this place.",
    "asked/answered": "Requests so far that were answered with a demonstration.",
    "teacher/missed_by": "Distance (m) from a demonstrated outcome to where its imitations landed, mean over the last "
    "movements.",
}
Charts = Mapping[str, Mapping[tuple[str, str], str]]
"""Category -> (what a run must have for this chart, "" for all; title of the chart) -> tag, as a regular expression."""
EVERYWHERE: Final = "everywhere"
COMPETENT: Final = "Where is it competent (half of the goals met, within {near:.2g} m), and since when?"
_LAYOUT: Final[Charts] = {
    "Does it learn?": {
        ("", "mean error on the benchmark (m)"): "error/mean",
        ("repeats", "noise floor: what noise alone makes of it (m)"): "error/noise_floor",
        ("goals", "share of the last 50 goals reached"): "goals/reached_share",
    },
    "What did it do, and its teacher?": {
        ("regions", "interest, everywhere: how fast competence changes"): "interest/R",
        ("goals", "share of movements: searches for its own goals"): "regime/local",
        ("imitates", "share of movements: imitations"): "regime/imitate",
        ("teacher", "demonstrations so far"): "teacher/demonstrations",
        ("asks", "share of movements before which it asked, by strategy"): "strategy/.*",
        ("imitates", "imitations miss what was shown by (m)"): "teacher/missed_by",
    },
}
ALL: Final = frozenset({"repeats", "goals", "regions", "teacher", "imitates"})
MET: Final = 0.5  # share of the goals of a cell from which on a learner counts as competent there
METRICS: Final = ("error/mean", "error/noise_floor", "competence/R", "goals/reached_share")  # that summarise a run
_RECENT: Final = 50  # goals
MOST_PLACES: Final = 8  # that have charts of their own on the first page: 2 x 2 in the plane


class Grid:
    """``box`` cut into cells of equal size, at ``most`` 16: 4 x 4 in the plane.

    ``names`` tell each cell's bounds, such as "x -1..-0.5, y 0..0.5".
    """

    def __init__(self, box: Box, most: int = 16) -> None:
        self.box = box
        self.per_side = max(1, int(most ** (1 / max(1, box.dim)) + 1e-9))
        axes = "xy" if box.dim == 2 else [f"outcome_{k}" for k in range(box.dim)]
        edges = np.linspace(box.low, box.high, self.per_side + 1).T
        bounds = [
            [f"{axis} {low:.3g}..{high:.3g}" for low, high in itertools.pairwise(sides)]
            for axis, sides in zip(axes, edges, strict=True)
        ]
        self.names = [", ".join(cell) for cell in itertools.product(*bounds)]

    def sums(self, points: Array, values: Array) -> tuple[Array, Array]:
        """``(n_cells,)`` twice: how many of the ``points`` ``(n, dim)`` lie in each cell, the sums of their values.

        Raises:
            ValueError: points of another dimension, or not finite.
        """
        points = check_vector("points", points, self.box.dim, "is the grid a part of another task space?")
        inside = self.box.contains(points)
        scaled = (points[inside] - self.box.low) / self.box.sides * self.per_side
        steps = np.minimum(scaled.astype(np.int64), self.per_side - 1)  # the far border belongs to the last cell
        cells = np.ravel_multi_index(tuple(steps.T), (self.per_side,) * self.box.dim)
        n = len(self.names)
        ones = np.ones(len(cells))
        counts, totals = (np.bincount(cells, weights, minlength=n) for weights in (ones, values[inside]))
        return counts.astype(np.float64), totals.astype(np.float64)

    def means(self, counts: Array, sums: Array) -> dict[str, float]:
        """The mean of each cell that is not empty, by its name."""
        return {self.names[k]: float(sums[k] / counts[k]) for k in np.flatnonzero(counts)}

    def means_of(self, points: Array, values: Array) -> dict[str, float]:
        """The mean of the ``values`` ``(n,)`` at ``points`` ``(n, dim)`` in each cell that has some, by its name."""
        return self.means(*self.sums(points, values))


class Curves:
    """Counts what happens in one run.

    ``shares`` are those of the benchmark's goals that were met at the last evaluation, by cell of the ``grid``;
    ``since`` is for each cell where half of them or more are met now the number of movements from which on this was so.

    Args:
        grid: the part of T that is cut into cells.
        tolerance: distance (m) at which a goal counts as reached.
        near: distance (m) at which a goal of the benchmark counts as met.
        depth: regions have curves of their own down to this level of the tree: at most ``2 ** (depth + 1) - 1``.
    """

    def __init__(self, grid: Box, *, tolerance: float = 0.02, near: float = 0.05, depth: int = 3) -> None:
        self.grid, self.places = Grid(grid), Grid(grid, MOST_PLACES)
        self.tolerance, self.near, self.depth = tolerance, near, depth
        self.shares: dict[str, float] = {}
        self.since: dict[str, int] = {}
        self._origins: dict[str, int] = {}  # since the last point
        self._imitated: list[float] = []  # m, since the last point
        self._demonstrations = 0
        self._strategies: dict[str, int] = {}  # requests by each, since the last point
        self._wanted: list[Array] = []  # goals asked for, since the last point
        self._answered = 0
        self._goal: Array | None = None
        self._missed_by: list[float] = []  # m, one for each goal pursued
        self._reached: dict[bytes, bool] = {}  # by goal
        self._leaves: dict[Region, _Leaf] = {}
        self._sized: set[str] = set()

    def episode(self, episode: Episode) -> None:
        """Count a movement."""
        move = episode.move
        self._demonstrations += episode.demonstration is not None
        if episode.request is not None:
            self._wanted.append(episode.request.goal)
            self._answered += episode.reply == "shown"
            self._strategies[episode.request.strategy] = self._strategies.get(episode.request.strategy, 0) + 1
        origin = "rest" if move is None else move.origin
        self._origins[origin] = self._origins.get(origin, 0) + 1
        if move is None or move.goal is None or episode.outcome is None:
            return
        distance = float(np.linalg.norm(episode.outcome - move.goal))
        begins = self._goal is None or episode.demonstration is not None or not np.array_equal(move.goal, self._goal)
        self._goal, key = move.goal, move.goal.tobytes()
        self._reached[key] = distance <= self.tolerance or (not begins and self._reached[key])
        if origin == "imitate":
            self._imitated.append(distance)
        elif begins:
            self._missed_by.append(distance)
        else:
            self._missed_by[-1] = min(distance, self._missed_by[-1])

    def of_behaviour(self) -> dict[str, float]:
        """Regimes, goals and demonstrations; shares and means are those since the last call."""
        total = sum(self._origins.values())
        values = {f"regime/{origin}": n / total for origin, n in self._origins.items()}
        self._origins = dict.fromkeys(self._origins, 0)  # a regime that was seen once keeps its curve
        values |= {f"strategy/{strategy}": n / total for strategy, n in self._strategies.items()}
        self._strategies = dict.fromkeys(self._strategies, 0)
        if self._wanted:
            counts, _ = self.places.sums(np.array(self._wanted), np.zeros(len(self._wanted)))
            values |= {f"asked/{self.places.names[k]}": n / len(self._wanted) for k, n in enumerate(counts.tolist())}
            values["asked/answered"] = self._answered
            self._wanted.clear()
        values["teacher/demonstrations"] = self._demonstrations
        if self._imitated:
            values["teacher/missed_by"] = float(np.mean(self._imitated))
            self._imitated.clear()
        if self._missed_by:
            missed_by = np.array(self._missed_by)
            values["goals/attempted"] = len(missed_by)
            values["goals/reached"] = int((missed_by <= self.tolerance).sum())
            values["goals/reached_share"] = float((missed_by[-_RECENT:] <= self.tolerance).mean())
            values["goals/missed_by"] = float(np.median(missed_by[-_RECENT:]))
        return values

    def of_regions(self, regions: Sequence[Region]) -> dict[str, float]:
        """Competence, interest, attempts, goals reached and size by region, from the leaves of the tree."""
        # A Region never changes, so most are known from the last call.
        self._leaves = {region: self._leaves.get(region) or self._leaf(region) for region in regions}
        space = sum(leaf.volume for leaf in self._leaves.values())
        values: dict[str, float] = {}
        for path, below in branches(regions, self.depth).items():
            leaves = [self._leaves[region] for region in below]
            goals = sum(leaf.goals for leaf in leaves)
            if goals:
                values[f"competence/{path}"] = sum(leaf.competence for leaf in leaves) / goals
                values[f"interest/{path}"] = sum(leaf.interest * leaf.goals for leaf in leaves) / goals
                values[f"region_reached/{path}"] = sum(leaf.reached for leaf in leaves) / goals
            values[f"region_goals/{path}"] = sum(leaf.attempts for leaf in leaves)
            if path not in self._sized:
                self._sized.add(path)
                values[f"region_size/{path}"] = sum(leaf.volume for leaf in leaves) / space
        found = list(self._leaves.values())
        values["regions/count"] = len(found)
        for what, numbers in {
            "competence": [leaf.competence / leaf.goals for leaf in found if leaf.goals],
            "interest": [leaf.interest for leaf in found],
        }.items():
            if numbers:
                quantiles = np.quantile(numbers, (0.1, 0.5, 0.9))
                values |= {f"regions/{what}_p{p}": float(q) for p, q in zip((10, 50, 90), quantiles, strict=True)}
        counts, sums = (sum(arrays) for arrays in zip(*(leaf.cells for leaf in found), strict=True))
        return values | {f"grid_competence/{name}": mean for name, mean in self.grid.means(counts, sums).items()}

    def of_evaluation(self, goals: Array, errors: Array, noise_floor: float) -> dict[str, float]:
        """The error on the benchmark; ``goals`` ``(n, outcome_dim)``, ``errors`` ``(n,)`` and ``noise_floor`` in m."""
        values = {
            "error/mean": float(errors.mean()),
            "error/median": float(np.median(errors)),
            "error/p90": float(np.quantile(errors, 0.9)),
            "error/noise_floor": noise_floor,
        }
        met = (errors <= self.near).astype(np.float64)
        values[f"met/{EVERYWHERE}"] = float(met.mean())
        cut = {"grid_error": (self.grid, errors), "grid_met": (self.grid, met), "met": (self.places, met)}
        for family, (grid, each) in cut.items():
            values |= {f"{family}/{name}": mean for name, mean in grid.means_of(goals, each).items()}
        return values

    def evaluated(self, movements: int, values: Mapping[str, float]) -> None:
        """Note where it is competent after these ``movements``, from the ``values`` of an evaluation by tag, also one
        that an earlier part of the run has made."""
        self.shares = {tag.partition("/")[2]: share for tag, share in values.items() if tag.startswith("grid_met/")}
        self.since = {name: self.since.get(name, movements) for name, share in self.shares.items() if share >= MET}

    def _leaf(self, region: Region) -> _Leaf:
        return _Leaf(
            goals=len(region.goals),
            competence=float(region.competences.sum()),
            interest=region.interest(),
            attempts=region.attempts,
            reached=sum(self._reached.get(goal.tobytes(), False) for goal in region.goals),
            volume=float((region.high - region.low).prod()),
            cells=self.grid.sums(region.goals, region.competences),
        )


class _Leaf(NamedTuple):
    """What a region adds to the curves: sums over its ``goals`` goals, ``cells`` those of ``Grid.sums``."""

    goals: int
    competence: float
    interest: float
    attempts: int
    reached: int
    volume: float
    cells: tuple[Array, Array]


def layout_of(
    places: Sequence[str], near: float, has: Collection[str] = ALL, more: Charts | None = None
) -> dict[str, dict[str, str]]:
    """The page of charts to begin with: category -> chart -> tag, as a regular expression.

    Args:
        places: those that have goals of the benchmark, by name.
        near: distance (m) at which these count as met.
        has: what the run has, of ``ALL``, and "asks"; charts that would stay empty are left out.
        more: charts of your own.
    """
    met = {f"share of goals met {EVERYWHERE}": f"met/{EVERYWHERE}"}
    if len(places) > 1:
        met |= {f"share met at {name}": re.escape(f"met/{name}") for name in places}
    charts = {
        category: {chart: tag for (need, chart), tag in each.items() if not need or need in has}
        for category, each in {**_LAYOUT, **(more or {})}.items()
    }
    return {COMPETENT.format(near=near): met, **{category: each for category, each in charts.items() if each}}


def branches(regions: Sequence[Region], depth: int) -> dict[str, list[Region]]:
    """The leaves below each node of the tree down to ``depth``, by the node's path, sorted.

    The cells of a `ProgressGrid`, such as "R.3.7", all lie below "R" and nothing else.
    """
    found: dict[str, list[Region]] = {}
    for region in regions:
        path = region.path.partition(".")[0]
        for length in range(1, min(len(path), depth + 1) + 1):
            found.setdefault(path[:length], []).append(region)
    return dict(sorted(found.items()))
