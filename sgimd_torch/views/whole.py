"""The runs of today by the names that the record will give them. This file goes when ``runs/read.py`` has them.

Then its importers take ``Run``, ``read_run`` and ``find_runs`` from ``sgimd_torch.runs.read``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.runs import read
from sgimd_torch.runs.build import build
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import config_of as config_of_today
from sgimd_torch.runs.read import find_runs as find_runs
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.teachers.by_hand import FOLDER, read_lessons

Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Run:
    """See ``Run`` of ``runs/read.py``."""

    path: Path
    config: dict[str, Any]
    versions: dict[str, Any]
    files: dict[str, Any]
    summary: dict[str, Any]
    index: NDArray[np.int64]
    origin: NDArray[np.str_]
    demonstration: NDArray[np.int64]
    contexts: Array
    thetas: Array
    goals: Array
    outcomes: Array
    demonstrations: list[Demonstration]
    answers: dict[str, Columns]
    regions: Columns | None = None
    predictions: Columns | None = None
    refreshes: Columns | None = None
    requests: Columns | None = None
    by_context: Columns | None = None

    def at(self, movements: int, column: str = "mean_error", answer: str = "own") -> float:
        """See ``runs/read.py``."""
        evaluation = self.answers.get(answer)
        if evaluation is None:
            return float("nan")
        found = evaluation[column][evaluation["movements"] == movements]
        return float(found[0]) if len(found) else float("nan")

    def chosen_goals(self) -> Array:
        """See ``runs/read.py``."""
        own = self.goals[np.isfinite(self.goals).all(axis=1) & (self.origin != "imitate")]
        return own[(np.diff(own, axis=0, prepend=np.nan) != 0).any(axis=1)]


def read_run(path: Path) -> Run:
    """A whole run.

    Raises:
        RunError: there is none, or it is damaged.
    """
    found = read.read_run(path)
    if found.damage or not found.summary:
        raise RunError(f"{path} is damaged: {found.damage or 'summary.json'}")
    shown: list[Demonstration] = []
    rows = np.full(len(found.index), -1)
    places: dict[Any, int] = {}
    given = (found.demonstration >= 0).any()
    parts = build(read.config_of(found)) if given else None
    asked = {} if found.requests is None else dict(zip(found.requests["index"], range(len(found.index)), strict=False))
    lessons = {each.index: each.demonstration for each in read_lessons(Path(path) / FOLDER)}
    for index in range(len(found.index)):
        row: int = found.demonstration[index]
        key: Any = None
        each: Demonstration | None = None
        if index in lessons:
            key, each = ("hand", index), lessons[index]
        elif found.requests is not None and index in asked and found.requests["reply"][asked[index]] == "shown":
            names = [name for name in found.requests if name.startswith("got_")][-found.outcomes.shape[1] :]
            got = np.array([found.requests[name][asked[index]] for name in names])
            key, each = tuple(got), Demonstration(np.zeros(0), np.zeros(2), np.zeros((2, 1)), got)
        elif row >= 0 and parts is not None:
            key, each = int(row), parts.demonstrations[row]
        if key is not None and each is not None:
            if key not in places:
                places[key] = len(shown)
                shown.append(each)
            rows[index] = places[key]
    fields = {
        name: getattr(found, name) for name in Run.__dataclass_fields__ if name not in ("demonstrations", "files")
    }
    fields |= {name: _named(fields[name]) for name in ("regions", "requests", "by_context")}
    files = {name: value for name, value in found.config.items() if name.endswith("_crc32")}
    fields["config"] = {name: value for name, value in found.config.items() if name not in files}
    fields["answers"] = {answer: _named(columns) for answer, columns in found.answers.items()}
    return Run(**{**fields, "demonstration": rows, "demonstrations": shown, "files": files})


def config_of(run: Run) -> Any:
    """See ``runs/read.py``."""
    return config_of_today(run)  # type: ignore[arg-type]


def _named(columns: Columns | None) -> Columns | None:
    return columns and {
        "part" if name == "context" else name.removesuffix("_m"): column for name, column in columns.items()
    }
