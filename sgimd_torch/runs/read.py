"""Reading run directories: everything that a run has written, as arrays. Figures and tables are made from this alone.

run = read_run("runs/sgim-d/seed-003"); run.outcomes, run.evaluation["mean_error_m"]    # log.py explains the files
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.runs.log import Columns, RunError, read_json
from sgimd_torch.runs.tables import EVALUATION, SMALL, small_table
from sgimd_torch.spaces import Array


@dataclass(frozen=True, eq=False)
class Run:
    """A run as it was read.

    ``index`` ``(n,)``, ``origin`` ``(n,)`` names, "" at rest, ``demonstration`` ``(n,)`` row of the demonstration just
    before, -1 if there was none; ``contexts``, ``thetas``, ``goals`` and ``outcomes`` ``(n, dim)``, NaN where there was
    none. ``evaluation`` has an array for each column, an entry for each evaluation; ``regions`` likewise, with an entry
    for each region at each evaluation, None for a goal model without regions; ``predictions`` and ``refreshes``
    likewise, None without a forward model. ``config``, ``versions``, ``summary``: as in their files.

    ``damage``: file name -> number of its first bad line, where reading ended, such as ``{"evaluation.csv": 3}``; the
    names of the columns are line 1. ``unchecked``: names of the files without checksums, which an earlier version
    wrote: in them, a changed number is noticed only if it cannot be.
    """

    path: Path
    config: dict[str, Any]
    versions: dict[str, Any]
    summary: dict[str, Any]
    index: NDArray[np.int64]
    origin: NDArray[np.str_]
    demonstration: NDArray[np.int64]
    contexts: Array
    thetas: Array
    goals: Array
    outcomes: Array
    evaluation: dict[str, Array]
    regions: dict[str, np.ndarray] | None
    predictions: dict[str, np.ndarray] | None = None
    refreshes: dict[str, np.ndarray] | None = None
    damage: dict[str, int] = field(default_factory=dict)
    unchecked: tuple[str, ...] = ()

    def chosen_goals(self) -> Array:
        """``(n, outcome_dim)``, the goals that the learner set itself, in order, each once though it takes several
        movements; those of imitation are the teacher's."""
        own = self.goals[np.isfinite(self.goals).all(axis=1) & (self.origin != "imitate")]
        new = (np.diff(own, axis=0, prepend=np.nan) != 0).any(axis=1)
        return own[new]


def read_run(path: str | os.PathLike[str]) -> Run:
    """What a run has written so far, be it finished, stopped or under way; a torn last line is left out.

    A file that is damaged is read up to there, and ``damage`` says where.

    Raises:
        RunError: there is no run at ``path``, or one of its files cannot be read at all.
    """
    path = Path(path)
    config = read_json(path / "config.json", missing=None)
    if config is None:
        raise RunError(f"{path} is no run directory, it has no config.json; runs lie in OUT/NAME/seed-000")
    try:
        columns = Columns.of(path)
        log = columns.table(path)
        small = [small_table(path / name) for name in SMALL if os.path.lexists(path / name)]
        found = {table.path.name: table.read() for table in (log, *small)}
    except OSError as error:
        raise RunError(f"{error.filename} cannot be read: {error.strerror}") from error
    rows = found[log.path.name].rows
    arrays = {table.path.name: table.arrays(found[table.path.name]) for table in small}
    contexts, thetas, goals, outcomes = columns.split(rows)
    return Run(
        path=path,
        config=config,
        versions=read_json(path / "versions.json", missing={}),
        summary=read_json(path / "summary.json", missing={}),
        index=np.arange(len(rows)),
        origin=np.array([row[1] for row in rows], dtype=np.str_),
        demonstration=np.array([int(row[2] or -1) for row in rows], dtype=np.int64),
        contexts=contexts,
        thetas=thetas,
        goals=goals,
        outcomes=outcomes,
        evaluation=arrays.get("evaluation.csv", {name: np.empty(0) for name in EVALUATION}),
        regions=arrays.get("regions.csv"),
        predictions=arrays.get("predictions.csv"),
        refreshes=arrays.get("refreshes.csv"),
        damage={name: table.damage for name, table in found.items() if table.damage is not None},
        unchecked=tuple(name for name, table in found.items() if not table.checked),
    )


def find_runs(out: str | os.PathLike[str]) -> dict[str, list[Path]]:
    """Run directories below ``out``, by name, seeds in order.

    Raises:
        RunError: there is none.
    """
    found: dict[str, list[Path]] = {}
    for config in sorted(Path(out).glob("*/seed-*/config.json")):
        found.setdefault(config.parent.parent.name, []).append(config.parent)
    if not found:
        raise RunError(f"{out} holds no runs; they lie in OUT/NAME/seed-000")
    return found
