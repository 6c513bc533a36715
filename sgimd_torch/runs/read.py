"""Reading run directories: everything that a run has written, as arrays. Figures and tables are made from this alone.

run = read_run("runs/sgim-d/seed-003"); run.outcomes, run.evaluation["mean_error_m"]    # log.py explains the files
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.files import checksum
from sgimd_torch.runs.config import FILES, OWN, PLACE, Config
from sgimd_torch.runs.log import Columns, RunError, read_json
from sgimd_torch.runs.tables import EVALUATION, SMALL, small_table
from sgimd_torch.spaces import Array

NO_EVALUATION: Final = {name: np.empty(0) for name in EVALUATION}
LONGEST_LINE: Final = 1 << 16  # bytes, of a log


@dataclass(frozen=True, eq=False)
class Run:
    """A run as it was read.

    ``index`` ``(n,)``, ``origin`` ``(n,)`` names, "" at rest, ``demonstration`` ``(n,)`` row of the demonstration just
    before, -1 if there was none; ``contexts``, ``thetas``, ``goals`` and ``outcomes`` ``(n, dim)``, NaN where there was
    none. ``answers`` has, for each answer, an array for each column of evaluation.csv, an entry for each evaluation;
    ``by_context`` likewise, with an entry for each part of C and each answer, None without contexts; ``regions``
    likewise, with an entry for each region at each evaluation, None for a goal model without regions;
    ``predictions`` and ``refreshes`` likewise, None without a forward model; ``requests`` with an entry for each
    request, None if there was none. ``config``, ``versions``, ``summary``: as in their files.

    ``damage``: file name -> number of its first bad line, where reading ended, such as ``{"evaluation.csv": 3}``; the
    names of the columns are line 1. ``unchecked``: names of the files without checksums, which an earlier version
    wrote: in them, a changed number is noticed only if it is impossible.
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
    answers: dict[str, dict[str, Array]]
    regions: dict[str, np.ndarray] | None
    predictions: dict[str, np.ndarray] | None = None
    refreshes: dict[str, np.ndarray] | None = None
    by_context: dict[str, np.ndarray] | None = None
    requests: dict[str, np.ndarray] | None = None
    damage: dict[str, int] = field(default_factory=dict)
    unchecked: tuple[str, ...] = ()

    @property
    def evaluation(self) -> dict[str, Array]:
        """The evaluations of the run's own answers."""
        return self.answers[OWN]

    def at(self, movements: int, column: str = "mean_error_m", answer: str = OWN) -> float:
        """An entry of evaluation.csv, NaN if there is none."""
        evaluation = self.answers.get(answer, NO_EVALUATION)
        found = evaluation[column][evaluation["movements"] == movements]
        return float(found[0]) if len(found) else float("nan")

    def chosen_goals(self) -> Array:
        """``(n, outcome_dim)``, the goals that the learner chose itself, in order, each once even if it took several
        movements. The goals of imitation are the teacher's, so they are left out."""
        own = self.goals[np.isfinite(self.goals).all(axis=1) & (self.origin != "imitate")]
        new = (np.diff(own, axis=0, prepend=np.nan) != 0).any(axis=1)
        return own[new]


def points_of(requests: Mapping[str, np.ndarray], part: str, dim: int) -> Array:
    """``(n, dim)`` the outcomes that were "wanted" or "got"; contexts come before them in the table."""
    names = [name for name in requests if name.startswith(f"{part}_")][-dim:]
    return np.stack([requests[name] for name in names], axis=1)


def read_run(path: str | os.PathLike[str]) -> Run:
    """What a run has written so far: finished, stopped or still running. An incomplete last line is left out.

    A damaged file is read up to its first bad line, see ``damage``.

    Raises:
        RunError: there is no run at ``path``, or one of its files cannot be read at all.
    """
    path = Path(path)
    config = read_json(path / "config.json", missing=None)
    if config is None:
        raise RunError(f"{path} is no run directory, it has no config.json; runs are in OUT/NAME/seed-000")
    try:
        columns = Columns.of(path)
        log = columns.table(path)
        small = [small_table(path / name) for name in SMALL if os.path.lexists(path / name)]
        found = {table.path.name: table.read() for table in (log, *small)}
        rows = found[log.path.name].rows
        demonstration = np.array([int(row[2] or -1) for row in rows], dtype=np.int64)
        contexts, thetas, goals, outcomes = columns.split(rows)
        arrays = {table.path.name: table.arrays(found[table.path.name]) for table in small}
    except OSError as error:
        raise RunError(f"{error.filename} cannot be read: {error.strerror}") from error
    except RunError:
        raise
    except (ValueError, OverflowError) as error:  # an edited line with a new checksum
        raise RunError(
            f"{path} has a table that holds what no run writes ({str(error)[:100]}); was it edited?"
        ) from error
    return Run(
        path=path,
        config=config,
        versions=read_json(path / "versions.json", missing={}),
        summary=read_json(path / "summary.json", missing={}),
        index=np.arange(len(rows)),
        origin=np.array([row[1] for row in rows], dtype=np.str_),
        demonstration=demonstration,
        contexts=contexts,
        thetas=thetas,
        goals=goals,
        outcomes=outcomes,
        answers=_by_answer(arrays.get("evaluation.csv", NO_EVALUATION)),
        regions=arrays.get("regions.csv"),
        predictions=arrays.get("predictions.csv"),
        refreshes=arrays.get("refreshes.csv"),
        by_context=arrays.get("by_context.csv"),
        requests=arrays.get("requests.csv"),
        damage={name: table.damage for name, table in found.items() if table.damage is not None},
        unchecked=tuple(name for name, table in found.items() if not table.checked),
    )


def config_of(run: Run) -> Config:
    """The configuration of a run.

    Raises:
        RunError: it makes no sense today.
    """
    try:
        return Config.from_settings(run.config)
    except (TypeError, ValueError) as error:
        raise RunError(f"{run.path}/config.json does not describe a run of this version: {error}") from error


def find_runs(place: str | os.PathLike[str]) -> dict[str, list[Path]]:
    """The runs of a run directory, of a variant's folder, or of a folder of variants, by variant, seeds in order.

    Raises:
        RunError: there is none, or no such folder.
    """
    place, found = Path(place), dict[str, list[Path]]()
    for pattern in ("", "seed-*/", "*/seed-*/"):
        for config in sorted(place.glob(f"{pattern}config.json")):
            found.setdefault(variant_of(config.parent), []).append(config.parent)
    if not found:
        why = "holds no runs" if place.is_dir() else "is a file, not a folder" if place.exists() else "does not exist"
        raise RunError(f"{place} {why}; runs are in OUT/NAME/seed-000")
    return found


def variant_of(path: Path) -> str:
    """The name of the folder that the run directory at ``path`` lies in."""
    return Path(os.path.abspath(path)).parent.name


def finished(config: Config) -> bool:
    """Whether this run is on disk with these options, undamaged to its last movement and its last evaluation."""
    path = config.directory
    try:
        summary, settings = (read_json(path / name, missing={}) for name in ("summary.json", "config.json"))
        if not summary.get("finished") or movements_on_disk(path) != config.movements:
            return False
        run = read_run(path)
        whole = len(run.index) == config.movements and not run.damage
        last = [run.answers.get(answer, {}).get("movements", ()) for answer in config.answered]
        evaluated = not config.evaluations or all(config.movements in movements for movements in last)
        found, wanted = Config.from_settings(settings).settings, config.settings
        same = {name: found[name] for name in found if name not in PLACE} == {
            name: wanted[name] for name in wanted if name not in PLACE
        }
        files = [(name, getattr(config, name)) for name in FILES]
        return (whole and evaluated and same) and all(
            file is None or settings.get(f"{name}_crc32") in (None, checksum(file)) for name, file in files
        )
    except (ValueError, OSError):  # of another version, or unreadable: the run says so when it is resumed
        return False


def _by_answer(columns: dict[str, Any]) -> dict[str, dict[str, Array]]:
    """The rows of evaluation.csv, apart for each answer; the run's own answers are always there."""
    words = columns["answer"]
    return {
        word: {name: values[words == word] for name, values in columns.items() if name != "answer"}
        for word in dict.fromkeys((OWN, *words.tolist()))
    }


def movements_on_disk(path: Path) -> int:
    """How many movements the log of a run directory holds, by the index of its last whole line."""
    try:
        with (path / "episodes.csv").open("rb") as log:
            log.seek(max(0, log.seek(0, os.SEEK_END) - LONGEST_LINE))
            last = log.read().rpartition(b"\n")[0].rpartition(b"\n")[2]
    except OSError:
        return 0
    index = last.partition(b",")[0]
    return int(index) + 1 if index.isdigit() else 0
