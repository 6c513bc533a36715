"""The data of a report: each run is read once; statistics are over the seeds of a variant.

variants, unread = read(find(Path("runs"))); variants[0].last_error    # interquartile mean and interval (m)
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, reduce
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from sgimd_torch.catalogue import CATALOGUE, ROD
from sgimd_torch.figures.learning import NAMES
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.config import OWN, Config
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run, find_runs, read_run
from sgimd_torch.runs.tasks import demonstrations_of
from sgimd_torch.spaces import Array
from sgimd_torch.teachers.by_hand import FOLDER, read_lessons
from sgimd_torch.views.statistics import (
    LEAST_SEEDS,
    Interval,
    interquartile_mean,
    mean_over_life,
    over_seeds,
    point,
    ratio_interval,
    rng,
)

NOISELESS: Final = 1e-9  # m; a lower noise floor is rounding, so errors are not divided by it
_NEEDED: Final = {"algorithm": str, "seed": int, "movements": int}

Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Life(Run):
    """A run, with what a report needs; contexts and thetas, most of the log, are left out."""

    @property
    def seed(self) -> int:
        """The seed of its random streams."""
        return int(self.config["seed"])

    @property
    def environment(self) -> str:
        """Its environment; runs that do not name one used the rod."""
        return str(self.config.get("environment", ROD))

    @property
    def state(self) -> str:
        """``finished``, ``not finished``, or where it is damaged."""
        if self.damage:
            return "; ".join(f"{name} is damaged at line {line}" for name, line in self.damage.items())
        ended = self.summary.get("finished") is True and len(self.index) >= self.config["movements"]
        return "finished" if ended else "not finished"

    @property
    def evaluated(self) -> int:
        """Movements before its last evaluation, 0 if there was none."""
        return int(self.evaluation["movements"][-1]) if len(self.evaluation["movements"]) else 0

    @property
    def landed(self) -> Array:
        """``(n, outcome_dim)`` m where movements ended."""
        return self.outcomes[np.isfinite(self.outcomes).all(axis=1)]

    @property
    def shown(self) -> NDArray[np.int64]:
        """``(n,)`` the rows of the demonstrations it was given, in order."""
        return self.demonstration[self.demonstration >= 0]

    @cached_property
    def by_hand(self) -> dict[int, Array]:
        """``(outcome_dim,)`` m of each lesson that a person gave, by the movement that it came before.

        Raises:
            ValueError, OSError: the file of one is damaged, or cannot be read.
        """
        lessons = read_lessons(self.path / FOLDER)
        return {each.index: each.demonstration.outcome for each in lessons if each.index < len(self.index)}

    @property
    def answered(self) -> dict[int, Array]:
        """Movement -> the outcome ``(outcome_dim,)`` m of the demonstration that it had asked for."""
        found: dict[int, Array] = {}
        for k, reply in enumerate(self.requests["reply"].tolist() if self.requests else ()):
            if self.requests and reply == "shown" and len(self.index):
                got = [self.requests[name][k] for name in self.requests if name.startswith("got_")]
                found[int(self.requests["index"][k])] = np.array(got[-self.outcomes.shape[1] :])
        return found

    @property
    def has_map(self) -> bool:
        """Whether there is an interest map to draw."""
        sides = sum(name.startswith("low_") for name in self.regions or ())  # of contexts, then of outcomes
        return bool(self.regions and len(self.regions["movements"])) and 0 < self.outcomes.shape[1] <= sides

    def in_contexts(self, movements: int) -> dict[str, float]:
        """The mean error (m) of its own answers in each part of C, by the part in words; {} without contexts."""
        if self.by_context is None:
            return {}
        names = ("movements", "answer", "context", "low", "high", "mean_error_m")
        rows = zip(*(self.by_context[name].tolist() for name in names), strict=True)
        return {
            f"context {context}: {low:.3g} to {high:.3g}": error
            for when, answer, context, low, high, error in rows
            if (when, answer) == (movements, OWN)
        }

    def seconds(self, part: str) -> float:
        """Spent on "physics", "learner" or "evaluation"; NaN if the summary does not have it."""
        value = self.summary.get(f"seconds_{part}")
        return float(value) if isinstance(value, int | float) else float("nan")


def read_life(path: Path) -> Life:
    """A run, whatever its state.

    Raises:
        RunError: it cannot be read, or is not a run of this library.
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
    whole, nothing = vars(run), np.empty((0, 0))  # the arrays are views of one large array; copies free it
    plane = {name: whole[name].copy() for name in ("goals", "outcomes")}
    return Life(**{**whole, "contexts": nothing, "thetas": nothing, **plane})


def find(place: Path) -> dict[str, list[Path]]:
    """As `find_runs`; next to a run, every folder called seed-* counts as a run, so that damaged ones are named.

    Raises:
        RunError: see `find_runs`.
    """
    found = find_runs(place)
    if [place] in found.values():
        return found
    folders = {name: runs[0].parent for name, runs in found.items()}
    return {name: sorted(path for path in folder.glob("seed-*") if path.is_dir()) for name, folder in folders.items()}


def read(found: Mapping[str, Sequence[Path]]) -> tuple[list[Variant], list[str]]:
    """The variants, the one with the smallest error first, and a line for each run that cannot be read.

    Raises:
        RunError: none can be read.
    """
    lives: dict[str, list[Life]] = {}
    unread = []
    for name, path in counted("reading", [(name, path) for name, paths in found.items() for path in paths]):
        try:
            lives.setdefault(name, []).append(read_life(path))
        except RunError as error:
            unread.append(str(error))
    variants = [Variant(name, each) for name, each in lives.items() if each]
    if not variants:
        more = f", and {len(unread) - 1} more" if len(unread) > 1 else ""
        raise RunError(f"no run can be read: {unread[0]}{more}")
    return sorted(variants, key=lambda v: (v.last_error.value if v.last_error else np.inf, v.name)), unread


def counted(what: str, items: Sequence[Item]) -> Iterable[Item]:
    """``items``, with a progress bar if it takes long."""
    interval = 0.2 if sys.stderr.isatty() else 10.0
    return tqdm(items, what, unit="", delay=1.0, mininterval=interval, disable=len(items) < 2)


class Variant:
    """The runs of one variant, one for each seed.

    Errors are of the finished runs, at the evaluations that all of them have; if none is finished yet, of all that
    were evaluated. Damaged runs are left out.

    Args:
        name: of its folder.
        lives: one or more.
    """

    def __init__(self, name: str, lives: Sequence[Life]) -> None:
        self.name = name
        self.label = NAMES.get(name) or name
        self.lives = sorted(lives, key=lambda life: life.seed)
        self.algorithm = str(self.lives[0].config["algorithm"])
        evaluated = [life for life in self.lives if life.evaluated and not life.damage]
        self.used = [life for life in evaluated if life.state == "finished"] or evaluated
        moments = [life.evaluation["movements"] for life in self.used]
        self.evaluated: NDArray[np.int64] = reduce(np.intersect1d, moments or [np.empty(0)]).astype(np.int64)
        self.last = int(self.evaluated[-1]) if len(self.evaluated) else 0  # movements before the last one

    def at(self, movements: int, column: str = "mean_error_m", answer: str = OWN) -> Interval | None:
        """A column of evaluation.csv over its seeds; None where one of them has no value."""
        return over_seeds(np.array([life.at(movements, column, answer) for life in self.used]))

    @property
    def few(self) -> bool:
        """Whether there are too few seeds for intervals."""
        return len(self.used) < LEAST_SEEDS

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
    def last_error(self) -> Interval | None:
        """The error (m) at the last evaluation that all have."""
        return self.at(self.last)

    @cached_property
    def landed(self) -> Array:
        """``(n, outcome_dim)`` m where movements of all its runs ended."""
        dim = self.typical.landed.shape[1]
        return np.concatenate([life.landed for life in self.lives if life.landed.shape[1] == dim])

    @property
    def ratio(self) -> Interval | None:
        """The last error over its noise floor; None where the robot moves without noise."""
        floors = np.array([life.at(self.last, "noise_floor_m") for life in self.used])
        if not self.last_error or not over_seeds(floors) or floors.min() < NOISELESS:
            return None
        if self.few:
            return point(float(interquartile_mean(self.errors[:, -1]) / interquartile_mean(floors)))
        return ratio_interval(self.errors[:, -1], floors, rng=rng(), paired=True)

    @property
    def area(self) -> Interval | None:
        """Area under the error curve over its width (m)."""
        if len(self.evaluated) < 2 or not np.isfinite(self.errors).all():
            return None
        return over_seeds(mean_over_life(self.evaluated.astype(np.float64), self.errors))

    @property
    def typical(self) -> Life:
        """The run with the median last error (the better of two); maps show this one."""
        if not self.last:
            return max(self.lives, key=lambda life: len(life.index))
        return sorted(self.used, key=lambda life: life.at(self.last))[(len(self.used) - 1) // 2]


def demonstrated(lives: Sequence[Life]) -> tuple[Array, str]:
    """``(n, outcome_dim)`` m what the runs were shown, each demonstration once; and a message if that is not known."""
    try:
        by_hand = {id(life): life.by_hand for life in lives if len(life.landed)}
    except (OSError, ValueError) as error:
        return np.empty((0, 2)), f"What they were shown is left out: {error}."
    for life in lives:
        by_hand.setdefault(id(life), {}).update(life.answered)
    rows = {
        (life.environment, *(str(life.config.get(f"demonstrations{which}")) for which in ("", "_crc32")), row)
        for life in lives
        for index, row in enumerate(life.demonstration.tolist())
        if row >= 0 and index not in by_hand.get(id(life), {index: None})
    }
    try:
        outcomes = [_recorded(environment, *file)[row] for environment, *file, row in sorted(rows)]
        outcomes += [outcome for lessons in by_hand.values() for outcome in lessons.values()]
    except (OSError, ValueError, IndexError) as error:
        return np.empty((0, 2)), f"What they were shown is left out: {error}."
    return np.array(outcomes, dtype=np.float64).reshape(len(outcomes), -1 if outcomes else 0), ""


def taught_by_hand(lives: Sequence[Life]) -> list[str]:
    """A sentence for each run that a person taught."""
    found = []
    for life in lives:
        try:
            before = ", ".join(map(str, life.by_hand))
        except (OSError, ValueError) as error:
            before = f"unknown ones: {error}"
        if before:
            n = before.count(",") + 1
            found.append(f"Seed {life.seed} was given {n} lesson{'s' * (n > 1)} by hand, before movements {before}.")
    return found


@cache
def _recorded(environment: str, file: str, checksum: str) -> list[Array]:
    """Outcomes of the demonstrations in a ``file``, "None" for the environment's own."""
    if environment not in CATALOGUE["environment"]:  # what a config.json names is not executed
        raise ValueError(f"they are not known without running {environment}")
    path = None if file == "None" else Path(file)
    found, _, now = demonstrations_of(task_of(Config(parts={"environment": environment})), path)
    if str(now) != checksum:
        raise ValueError(f"the demonstrations of {environment} have changed")
    return [demonstration.outcome for demonstration in found]
