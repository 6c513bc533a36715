"""Reading runs: everything that a run has recorded, as arrays. Figures, reports and tables are made from this alone.

run = read_run("runs/sgim-d/seed-003"); run.outcomes, run.evaluation["mean_error"]    # docs/runs.md explains the tables
"""

from __future__ import annotations

import os
import re
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.files import checksum
from sgimd_torch.learner.events import Kind
from sgimd_torch.record import DERIVED, Record, RunError, layout
from sgimd_torch.runs.config import FILES, OWN, PLACE, Config, code_of
from sgimd_torch.runs.directory import FILE
from sgimd_torch.spaces import Array, Box, Demonstration

Columns = dict[str, np.ndarray]
"""By name; an entry for each row."""


@dataclass(frozen=True, eq=False)
class Run:
    """A run as it was recorded so far: finished, stopped or under way.

    ``index`` ``(n,)``, ``origin`` ``(n,)`` names, "" at rest, ``demonstration`` ``(n,)`` which of ``demonstrations``
    came just before, -1 if there was none; ``contexts``, ``thetas``, ``goals`` and ``outcomes`` ``(n, dim)``, NaN where
    there was none: a movement that failed has a theta and no outcome. ``answers`` has, for each answer, the columns of
    its evaluations; ``errors`` those of every goal at every evaluation, ``benchmark`` ``(n_goals, outcome_dim)`` the
    goals; ``regions`` those of the goal model at every evaluation, None for a goal model without regions;
    ``predictions`` and ``refreshes`` those of a forward model, None without one; ``requests`` what was asked for, None
    if nothing was: ``index`` of the next movement, ``teacher``, ``strategy``, ``reply``, ``shown`` (row of the
    demonstration, -1 for none) and ``wanted_0`` and so on, a point of C x T. ``config``: all options by name;
    ``robot``: the class of the environment; ``spaces``: its contexts, policies and outcomes; ``summary``: movements,
    how many ``failed``, whether it is finished, and seconds.
    """

    path: Path
    config: dict[str, Any]
    versions: dict[str, Any]
    files: dict[str, Any]
    robot: str
    words: list[str]
    spaces: dict[str, Box]
    summary: dict[str, Any]
    index: NDArray[np.int64]
    origin: NDArray[np.str_]
    demonstration: NDArray[np.int64]
    contexts: Array
    thetas: Array
    goals: Array
    outcomes: Array
    answers: dict[str, Columns]
    errors: Columns = field(default_factory=dict)
    benchmark: Array = field(default_factory=lambda: np.empty((0, 0)))
    demonstrations: list[Demonstration] = field(default_factory=list)
    regions: Columns | None = None
    predictions: Columns | None = None
    refreshes: Columns | None = None
    requests: Columns | None = None

    @property
    def evaluation(self) -> dict[str, Array]:
        """The evaluations of the run's own answers."""
        return self.answers[OWN]

    def at(self, movements: int, column: str = "mean_error", answer: str = OWN) -> float:
        """An entry of an evaluation, NaN if there is none."""
        evaluation = self.answers.get(answer)
        if evaluation is None:
            return float("nan")
        found = evaluation[column][evaluation["movements"] == movements]
        return float(found[0]) if len(found) else float("nan")

    def missed_by(self, movements: int, answer: str = OWN) -> tuple[Array, Array]:
        """The errors ``(n_goals,)`` of ``benchmark`` at an evaluation, and the contexts ``(n_goals, context_dim)``."""
        now = (self.errors["movements"] == movements) & (self.errors["answer"] == answer)
        contexts = [self.errors[f"context_{k}"][now] for k in range(self.spaces["contexts"].dim)]
        return self.errors["error"][now], np.array(contexts).T.reshape(int(now.sum()), -1)

    def chosen_goals(self) -> Array:
        """``(n, outcome_dim)``, the goals that the learner chose itself, in order, each once even if it took several
        movements. The goals of imitation are the teacher's, so they are left out."""
        own = self.goals[np.isfinite(self.goals).all(axis=1) & (self.origin != "imitate")]
        new = (np.diff(own, axis=0, prepend=np.nan) != 0).any(axis=1)
        return own[new]


def read_run(path: str | os.PathLike[str]) -> Run:
    """What a run has recorded so far.

    Args:
        path: of the run's folder.

    Raises:
        RunError: there is no run at ``path``, or it is damaged.
    """
    path = Path(path)
    if not (path / FILE).exists():
        raise RunError(f"{path} holds no run; runs are in OUT/NAME/seed-000 and have a file {FILE}")
    with Record(path / FILE) as record:
        about = record.about
        if "settings" not in about:
            raise RunError(f"{path / FILE} is a life that Learner.save wrote, not a run")
        settings = about["settings"]
        seed = re.fullmatch(r"seed-(\d+)", path.resolve().name)
        if seed is not None and int(seed[1]) != settings["seed"]:
            raise RunError(f"{path} holds a run of seed {settings['seed']}; was it copied from another one?")
        shown = record.demonstrations()
        arrays, requests, failed = _lived(record)
        found: dict[str, Columns] = {table: _columns(record, table) for table in DERIVED}
        n = record.movements
    evaluated = found["evaluations"]["movements"]
    nothing = not shown and not np.isfinite(arrays["outcomes"]).any()  # to infer a movement from
    finished = n == settings["movements"] and (settings["evaluate_at"] == [] or n in evaluated or nothing)
    return Run(
        path=path,
        config=settings,
        versions=about["versions"],
        files=about["files"],
        robot=about["robot"],
        words=about["words"],
        spaces={name: Box(*box) for name, box in about["spaces"].items()},
        summary={"movements": n, "failed": failed, "finished": bool(finished), **about.get("seconds", {})},
        **arrays,
        answers=_by_answer(found["evaluations"]),
        errors=found["errors"],
        benchmark=np.stack(list(found["goals"].values())[1:], axis=1),
        demonstrations=shown,
        regions=_if_any(found["regions"]),
        predictions=_if_any(found["predictions"]),
        refreshes=_if_any(found["refreshes"]),
        requests=requests,
    )


def _if_any(columns: Columns) -> Columns | None:
    return columns if len(next(iter(columns.values()))) else None


def _lived(record: Record) -> tuple[dict[str, Any], Columns | None, int]:
    """The movements as arrays; requests, None if there was none; how many movements have failed."""
    c, p, t = record.dims
    origins, shown, cells, requests = list[str](), array("q"), array("d"), list[dict[str, Any]]()
    last, failed = -1, 0
    for _, kind, origin, *vectors, lesson, who, strategy, reply in record.rows("events"):
        if lesson is not None:
            last = lesson
            if requests and requests[-1]["reply"] == "shown" and requests[-1]["shown"] < 0:
                requests[-1]["shown"] = lesson
        elif kind == Kind.ASKED and who is not None:
            asked = {"index": len(origins), "teacher": who, "strategy": strategy, "reply": reply, "shown": -1}
            wanted = enumerate((*vectors[:c], *vectors[c + p : c + p + t]))
            requests.append(asked | {f"wanted_{k}": value for k, value in wanted})
        elif kind in (Kind.MOVED, Kind.RESTED, Kind.FAILED):
            failed += kind == Kind.FAILED
            origins.append(origin or "")
            shown.append(last)
            last = -1
            cells.extend(np.nan if value is None else value for value in vectors)
    n = len(origins)
    vectors_of = np.split(np.array(cells).reshape(n, c + p + 2 * t), (c, c + p, c + p + t), axis=1)
    found = {"index": np.arange(n), "origin": np.array(origins, np.str_), "demonstration": np.array(shown, np.int64)}
    found |= dict(zip(("contexts", "thetas", "goals", "outcomes"), vectors_of, strict=True))
    columns = {name: np.array([each[name] for each in requests]) for name in requests[0]} if requests else None
    return found, columns, failed


def _columns(record: Record, table: str) -> Columns:
    rows, declared = list(record.rows(table)), (column.split() for column in layout(record.dims)[table][:-1])
    return {name: np.array([row[k] for row in rows], dtype=_KINDS[kind]) for k, (name, kind) in enumerate(declared)}


_KINDS: Final = {"TEXT": np.str_, "INTEGER": np.int64, "REAL": np.float64}  # NULL is NaN


def config_of(run: Run, *, trust: bool = False) -> Config:
    """What made a run, to build its parts again.

    Args:
        run: as read.
        trust: whether code that its settings name, ``package.module:attribute``, may be imported and executed.

    Raises:
        RunError: its settings name such code and are not trusted, or do not describe a run of this version.
    """
    code = [] if trust else code_of(run.config)
    if code:
        raise RunError(f"{run.path} names code of its own, {', '.join(code)}; look at it, then execute it with --trust")
    try:
        return Config.from_settings(run.config)
    except (TypeError, ValueError) as error:
        raise RunError(f"the settings of {run.path} do not describe a run of this version: {error}") from error


def find_runs(place: str | os.PathLike[str]) -> dict[str, list[Path]]:
    """The runs of a run directory, of a variant's folder, or of a folder of variants, by variant, seeds in order.

    Raises:
        RunError: there is none, or no such folder.
    """
    place, found = Path(place), dict[str, list[Path]]()
    for pattern in ("", "seed-*/", "*/seed-*/"):
        for config in sorted(place.glob(f"{pattern}run.sqlite")):
            found.setdefault(variant_of(config.parent), []).append(config.parent)
    if not found:
        why = "holds no runs" if place.is_dir() else "is a file, not a folder" if place.exists() else "does not exist"
        raise RunError(f"{place} {why}; runs are in OUT/NAME/seed-000")
    return found


def variant_of(path: Path) -> str:
    """The name of the folder that the run directory at ``path`` lies in."""
    return Path(os.path.abspath(path)).parent.name


def finished(config: Config) -> bool:
    """Whether this run is on disk with these options, whole, to its last movement and its last evaluation."""
    try:
        run = read_run(config.directory)
        found, wanted = run.config, config.settings
        same = all(found.get(name) == wanted.get(name) for name in found.keys() | wanted.keys() if name not in PLACE)
        files = [(name, getattr(config, name)) for name in FILES]
        return bool(run.summary["finished"] and same) and all(
            file is None or run.files.get(f"{name}_crc32") in (None, checksum(file)) for name, file in files
        )
    except (ValueError, OSError):  # of another version, or unreadable: the run says so when it is resumed
        return False


def movements_on_disk(path: Path) -> int:
    """How many movements the record of a run directory holds."""
    try:
        with Record(path / FILE) as record:
            return record.movements
    except RunError:
        return 0


def _by_answer(columns: Columns) -> dict[str, Columns]:
    """The evaluations, apart for each answer; the run's own answers are always there."""
    words = columns["answer"]
    return {
        word: {name: values[words == word] for name, values in columns.items() if name != "answer"}
        for word in dict.fromkeys((OWN, *words.tolist()))
    }
