"""What a report tells of runs: each run is read once and cut down to that; statistics are over the seeds of a variant.

lives = [read_life(path) for path in paths]; variant = Variant("sgim-d", lives); variant.final    # IQM and interval (m)
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.catalogue import ROD
from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.figures.learning import NAMES
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import find_runs, read_run
from sgimd_torch.runs.tasks import arm_demonstrations
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, iqm_interval, mean_over_life, ratio_interval, rng

EARLY: Final = 1000  # movements, of the column beside the last error
GOALS: Final = 100  # the last ones are shown
PLACE: Final = ("seed", "out", "name", "threads", "board")  # options that do not make one learner differ from another
_NEEDED: Final = {"algorithm": str, "seed": int, "movements": int}


@dataclass(frozen=True, eq=False)
class Life:
    """One run: ``movements`` of the ``wanted`` ones, with its ``config``, ``versions`` and ``summary``.

    ``evaluation`` and ``regions`` are as ``read_run`` gives them. ``landed`` ``(n, 2)`` m is where the float did,
    ``goals`` ``(n, 2)`` m the last that the learner chose, ``origins`` how many movements came from where ("" at rest),
    ``shown`` ``(n,)`` the rows of the demonstrations it was given, in order.
    """

    path: Path
    config: dict[str, Any]
    versions: dict[str, Any]
    summary: dict[str, Any]
    movements: int
    evaluation: dict[str, Array]
    regions: dict[str, np.ndarray] | None
    landed: Array
    goals: Array
    origins: Counter[str]
    shown: NDArray[np.int64]

    @property
    def seed(self) -> int:
        """Of its random streams."""
        return int(self.config["seed"])

    @property
    def environment(self) -> str:
        """Where it lived; runs that do not name it lived on the rod."""
        return str(self.config.get("environment", ROD))

    @property
    def wanted(self) -> int:
        """How many movements it is to have."""
        return int(self.config["movements"])

    @property
    def finished(self) -> bool:
        """Whether it came to its end, last evaluation included."""
        return self.summary.get("finished") is True and self.movements >= self.wanted

    def at(self, movements: int, column: str = "mean_error_m") -> float:
        """An entry of evaluation.csv, NaN where there is none."""
        found = self.evaluation[column][self.evaluation["movements"] == movements]
        return float(found[0]) if len(found) else float("nan")

    def seconds(self, part: str) -> float:
        """Spent on "physics", "learner" or "evaluation"; NaN where the summary does not say."""
        value = self.summary.get(f"seconds_{part}")
        return float(value) if isinstance(value, int | float) else float("nan")


def read_life(path: Path) -> Life:
    """A run, finished or not.

    Raises:
        RunError: its files are damaged, or of another kind of run.
    """
    try:
        run = read_run(path)
    except RunError:
        raise
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from error
    for name, kind in _NEEDED.items():
        if type(run.config.get(name)) is not kind:
            raise RunError(f"{path}/config.json must name {name}, got {run.config.get(name)!r}; was it edited?")
    if run.outcomes.shape[1] not in (0, 2):  # 0: the log has not begun
        raise RunError(f"{path} has outcomes of {run.outcomes.shape[1]} dimensions, a report shows those of the plane")
    outcomes, goals = (values.reshape(-1, 2) for values in (run.outcomes, run.goals))
    own = goals[np.isfinite(goals[:, 0]) & (run.origin != "imitate")]
    new = np.append(True, (np.diff(own, axis=0) != 0).any(axis=1))[: len(own)]  # one goal takes several movements
    return Life(
        path=path,
        config=run.config,
        versions=run.versions,
        summary=run.summary,
        movements=len(run.index),
        evaluation=run.evaluation,
        regions=run.regions if run.regions and len(run.regions["movements"]) else None,
        landed=outcomes[np.isfinite(outcomes[:, 0])],
        goals=own[new][-GOALS:].copy(),
        origins=Counter(run.origin.tolist()),
        shown=run.demonstration[run.demonstration >= 0],
    )


def find(place: Path) -> dict[str, list[Path]]:
    """The runs of a run directory, of a variant's folder, or of a folder of variants, by variant, seeds in order.

    A folder called seed-* counts as a run whatever is in it: what is damaged is to be named.

    Raises:
        RunError: there is none, or no such folder.
    """
    if not place.is_dir():
        why = "is a file, not a folder" if place.exists() else "does not exist"
        raise RunError(f"{place} {why}; wanted a run's directory, or the --out of run.py")
    if (place / "config.json").exists():
        return {place.resolve().parent.name: [place]}
    if any(place.glob("seed-*/config.json")):
        return {place.resolve().name: sorted(path for path in place.glob("seed-*") if path.is_dir())}
    names = find_runs(place)
    return {name: sorted(path for path in (place / name).glob("seed-*") if path.is_dir()) for name in names}


class Variant:
    """The runs of one variant, one for each seed.

    Errors are of the finished runs, at the evaluations that all of them have; where none is finished yet, of all that
    were evaluated.

    Args:
        name: of its folder.
        lives: one or more.
    """

    def __init__(self, name: str, lives: Sequence[Life]) -> None:
        self.name = name
        self.lives = sorted(lives, key=lambda life: life.seed)
        evaluated = [life for life in self.lives if len(life.evaluation["movements"])]
        self.finished = [life for life in self.lives if life.finished]
        self.used = [life for life in evaluated if life.finished] or evaluated
        moments = [life.evaluation["movements"] for life in self.used]
        self.evaluated: NDArray[np.int64] = reduce(np.intersect1d, moments or [np.empty(0)]).astype(np.int64)

    @property
    def label(self) -> str:
        """Its name for people."""
        return NAMES.get(self.name, self.name)

    @property
    def algorithm(self) -> str:
        """Who learns."""
        return str(self.lives[0].config["algorithm"])

    @property
    def last(self) -> int:
        """Movements before the last evaluation that all have; 0 if there is none."""
        return int(self.evaluated[-1]) if len(self.evaluated) else 0

    @cached_property
    def errors(self) -> Array:
        """``(n_seeds, n)`` m, at ``evaluated``."""
        rows = [[life.at(movements) for movements in self.evaluated.tolist()] for life in self.used]
        return np.array(rows, dtype=np.float64).reshape(len(self.used), len(self.evaluated))

    @cached_property
    def curve(self) -> Array:
        """``(3, n)`` m: interquartile mean over seeds at each of ``evaluated``, ends of its interval."""
        found = [over_seeds(column) or (np.nan,) * 3 for column in self.errors.T]
        return np.array(found, dtype=np.float64).reshape(-1, 3).T

    @cached_property
    def final(self) -> Interval | None:
        """The last error (m)."""
        return over_seeds(self.errors[:, -1]) if self.last else None

    @cached_property
    def early(self) -> Interval | None:
        """The error (m) after ``EARLY`` movements."""
        return over_seeds(self.errors[:, self.evaluated.tolist().index(EARLY)]) if EARLY in self.evaluated else None

    @cached_property
    def floor(self) -> Interval | None:
        """The noise floor (m) of the last evaluation."""
        return over_seeds(self._floors) if self.last else None

    @cached_property
    def ratio(self) -> Interval | None:
        """The last error over its noise floor."""
        if self.floor is None or self.final is None or not (self._floors > 0).all():
            return None
        if len(self.used) == 1:
            return Interval(*(self.final.value / self.floor.value,) * 3)
        return ratio_interval(self.errors[:, -1], self._floors, rng=rng(), paired=True)

    @cached_property
    def area(self) -> Interval | None:
        """Area under the error curve over its width (m)."""
        if len(self.evaluated) < 2 or not np.isfinite(self.errors).all():
            return None
        return over_seeds(mean_over_life(self.evaluated.astype(np.float64), self.errors))

    @property
    def typical(self) -> Life:
        """The run whose last error is the middle one, of an even number the better; it stands for all in maps."""
        if not self.last:
            return max(self.lives, key=lambda life: life.movements)
        return sorted(self.used, key=lambda life: life.at(self.last))[(len(self.used) - 1) // 2]

    @property
    def _floors(self) -> Array:
        return np.array([life.at(self.last, "noise_floor_m") for life in self.used])


def over_seeds(values: Array) -> Interval | None:
    """Interquartile mean and its 95 % interval; of one seed its value; None where any is missing."""
    if not len(values) or not np.isfinite(values).all():
        return None
    return iqm_interval(values, rng=rng()) if len(values) > 1 else Interval(*map(float, (*values,) * 3))


def demonstrated(lives: Sequence[Life]) -> tuple[Array, str]:
    """``(n, 2)`` m what the runs were shown, each demonstration once, and what is to be said if they cannot be read."""
    rows: dict[tuple[str, str | None, str | None], set[int]] = {}
    for life in lives:
        source = life.environment, life.config.get("demonstrations"), life.config.get("demonstrations_crc32")
        rows.setdefault(source, set()).update(life.shown.tolist())
    outcomes: list[Array] = []
    for (environment, file, checksum), wanted in rows.items():
        path, of_arm = Path(file or SHIPPED), file is None and environment.startswith("planar-arm-")
        try:
            if of_arm:
                recordings = arm_demonstrations(PlanarArm(int(environment[11:])))
            elif wanted and f"{zlib.crc32(path.read_bytes()):08x}" != checksum:
                return np.empty((0, 2)), f"{path} is not what they were shown any more, so that is left out."
            else:
                recordings = load_demonstrations(path, outcome_dim=2) if wanted else []
            outcomes += [recordings[row].outcome for row in sorted(wanted)]
        except (OSError, ValueError, IndexError):
            return np.empty((0, 2)), f"{path}, what they were shown, cannot be read here and is left out."
    return np.array(outcomes, dtype=np.float64).reshape(-1, 2), ""


def differing(configs: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, dict[str, list[Any]]]:
    """Option -> variant -> its values, of the options in which not all runs agree; seed and place do not count.

    Args:
        configs: variant -> the configurations of its runs.
    """
    every = [config for group in configs.values() for config in group]
    names = [name for name in dict.fromkeys(key for config in every for key in config) if name not in PLACE]
    found = {
        name: {variant: _distinct([config.get(name) for config in group]) for variant, group in configs.items()}
        for name in names
    }
    return {name: cells for name, cells in found.items() if len(_distinct([v for c in cells.values() for v in c])) > 1}


def _distinct(values: Sequence[Any]) -> list[Any]:
    return [value for k, value in enumerate(values) if value not in values[:k]]
