"""Read the record of a run as arrays. Figures, reports and tables get all their data from here.

run = read_run("runs/sgim-d/seed-003"); run.outcomes, run.evaluation["mean_error"]    # docs/runs.md explains the tables
"""

from __future__ import annotations

import os
import re
import sys
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.evaluation import OwnGoals
from sgimd_torch.files import checksum
from sgimd_torch.learner.events import Kind
from sgimd_torch.options.config import OWN, Config
from sgimd_torch.record import DERIVED, Record, RunError
from sgimd_torch.record.layout import layout
from sgimd_torch.rooms import absent, rooms
from sgimd_torch.runs.directory import (
    OF_MODEL,
    RUN_FILE,
    changed_settings,
    code_of,
    not_compared,
    with_found_earlier,
)
from sgimd_torch.spaces import Array, Box, Demonstration
from sgimd_torch.texts import as_spans, numbers_in

Columns = dict[str, np.ndarray]
"""Columns of a table by name, with an entry for each row."""


@dataclass(frozen=True, eq=False)
class Run:
    """A run as far as it is recorded: finished, stopped or still running. It has n movements, rests included.

    Attributes:
        path: directory of the run.
        config: options by name.
        versions, files, words, folder: entries of the table ``about``, see docs/runs.md.
        robot: name of the environment's class.
        tolerance: distance, in the unit of T, at which a goal of the learner counts as met.
        spaces: boxes C, Pi and T, by the names "contexts", "policies" and "outcomes".
        summary: numbers of "movements" and of "failed" movements, whether the run is "finished", why it "ended_early",
            and seconds by part.
        changes: descriptions of the changes of the robot that the learner noticed.
        remarks: sentences of listeners, such as what the latest outcomes tell of the robot.
        robots, rooms: number of robots that moved at once, and names of the rooms whose words the settings have.
        index: ``(n,)`` numbers of the movements, from 0.
        origin: ``(n,)`` origin of each movement, such as "local" or "imitate"; "" for a rest.
        demonstration: ``(n,)`` indices in ``demonstrations`` of what was shown just before each movement; -1: nothing.
        failed, forgotten: ``(n,)``, whether each movement failed, or was taken back.
        contexts, thetas, goals, outcomes: ``(n, dim)`` vectors of each movement; NaN stands for none, and for the
            outcome of a movement that was taken back.
        evaluations: columns of the table ``evaluations``, by inverse model.
        errors: columns of the errors at all goals in all evaluations.
        benchmark: ``(n_goals, outcome_dim)`` benchmark goals.
        demonstrations: each demonstration that was shown, once.
        regions: columns of the goal model's regions at all evaluations, None for a goal model without regions.
        predictions, refreshes: columns of a forward model, None for a run without a forward model.
        requests: columns of the requests to teachers, None for a run without requests: ``index`` of the next movement,
            ``teacher``, ``strategy``, ``reply``, ``shown`` (index in ``demonstrations``, -1 for none), and ``wanted_0``
            and so on, the requested point in C x T.
    """

    path: Path
    config: dict[str, Any]
    versions: dict[str, Any]
    files: dict[str, Any]
    robot: str
    words: list[str]
    spaces: dict[str, Box]
    summary: dict[str, Any]
    changes: list[str]
    index: NDArray[np.int64]
    origin: NDArray[np.str_]
    demonstration: NDArray[np.int64]
    contexts: Array
    thetas: Array
    goals: Array
    outcomes: Array
    evaluations: dict[str, Columns]
    errors: Columns = field(default_factory=dict)
    benchmark: Array = field(default_factory=lambda: np.empty((0, 0)))
    demonstrations: list[Demonstration] = field(default_factory=list)
    regions: Columns | None = None
    predictions: Columns | None = None
    refreshes: Columns | None = None
    requests: Columns | None = None
    failed: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    forgotten: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    tolerance: float = float("nan")
    folder: str = ""
    remarks: list[str] = field(default_factory=list)
    robots: int = 1
    rooms: list[str] = field(default_factory=list)

    @property
    def evaluation(self) -> dict[str, Array]:
        """Columns of the evaluations of the run's own inverse model."""
        return self.evaluations[OWN]

    def at(self, movements: int, column: str = "mean_error") -> float:
        """One number of the evaluation after ``movements`` movements, NaN if there is no such evaluation."""
        values = self.evaluation[column][self.evaluation["movements"] == movements]
        return float(values[0]) if len(values) else float("nan")

    def missed_by(self, movements: int) -> tuple[Array, Array]:
        """Errors ``(n_goals,)`` of an evaluation, and those that the learner expected; NaN: it did not say."""
        now = (self.errors["movements"] == movements) & (self.errors["inverse"] == OWN)
        return self.errors["error"][now], self.errors["expected"][now]

    def own_goals(self) -> OwnGoals:
        """How nearly the learner met the goals that it chose.

        Imitations, global exploration, which does not aim at its goal, and failed movements are left out.
        """
        own_goals = OwnGoals(self.robots)
        own = (
            np.isfinite(self.goals[:, 0])
            & np.isfinite(self.outcomes[:, 0])
            & ~np.isin(self.origin, ("imitate", "global"))
        )
        outcomes = self.spaces["outcomes"].unwrapped(self.outcomes, self.goals)
        for row in np.flatnonzero(own).tolist():
            own_goals.add(row, self.goals[row], outcomes[row])
        return own_goals

    def chosen_goals(self) -> Array:
        """``(n, outcome_dim)`` goals that the learner chose, in order; a goal of successive movements is listed once.

        Goals of imitations are left out, as a teacher chose them.
        """
        own = self.goals[np.isfinite(self.goals).all(axis=1) & (self.origin != "imitate")]
        new = (np.diff(own, axis=0, prepend=np.nan) != 0).any(axis=1)
        return own[new]


def read_run(path: str | os.PathLike[str]) -> Run:
    """The run in a directory, as far as it is recorded.

    Args:
        path: directory of the run.

    Raises:
        RunError: there is no run at ``path``, or its record is damaged.
    """
    path = Path(path)
    if not (path / RUN_FILE).exists():
        raise RunError(f"{path} holds no run; runs are in OUT/NAME/seed-000 and have a file {RUN_FILE}")
    with Record(path / RUN_FILE) as record:
        about = record.about
        if "settings" not in about:
            raise RunError(f"{path / RUN_FILE} is a life that save_life wrote, not a run")
        settings = about["settings"]
        seed = re.fullmatch(r"seed-(\d+)", path.resolve().name)
        if seed is not None and int(seed[1]) != settings["seed"]:
            raise RunError(f"{path} holds a run of seed {settings['seed']}; was it copied from another run?")
        demonstrations = record.demonstrations()
        arrays, requests = _lived(record)
        derived: dict[str, Any] = {table: _columns(record, table) for table in DERIVED}
        n = record.movements
    numbers = np.flatnonzero(arrays["forgotten"]).tolist()
    forgotten = [f"taken back: movement {as_spans(numbers)}"] if numbers else []
    evaluated = derived["evaluations"]["movements"]
    is_empty = not demonstrations and not np.isfinite(arrays["outcomes"]).any()  # an empty memory is not evaluated
    with record.translated_errors():
        end, why = about["ended_early"] or [settings["movements"], ""]
        finished = n == end and (settings["evaluate_at"] == [] or n in evaluated or is_empty)
        return Run(
            path=path,
            config=settings,
            versions=about["versions"],
            files=about["files"],
            robot=about["robot"],
            words=about["words"],
            folder=about.get("folder", ""),
            remarks=[text for found in about.get("remarks", {}).values() for text in found.values()] + forgotten,
            robots=about.get("robots", 1),
            rooms=about.get("rooms", []),
            tolerance=about.get("tolerance", float("nan")),
            spaces={name: Box(*box) for name, box in about["spaces"].items()},
            summary={
                "movements": n,
                "failed": int(arrays["failed"].sum()),
                "finished": bool(finished),
                "ended_early": why,
                **about.get("seconds", {}),
            },
            **arrays,
            evaluations=_by_inverse(derived["evaluations"]),
            errors=derived["errors"],
            benchmark=np.stack(list(derived["goals"].values())[1:], axis=1),
            demonstrations=demonstrations,
            requests=requests,
            **{table: derived[table] for table in ("regions", *OF_MODEL) if min(map(len, derived[table].values()))},
        )


def _lived(record: Record) -> tuple[dict[str, Any], Columns | None]:
    """Movements as arrays by attribute of `Run`, and requests as columns or None."""
    c, p, t = record.dims
    origins, demonstration, cells, requests = list[str](), array("q"), array("d"), list[dict[str, Any]]()
    changes, failed, forgotten = list[str](), list[bool](), list[int]()
    lessons = dict[int, int]()  # lessons by number of the next movement of the robot that was shown them
    for _, kind, origin, *vectors, lesson, who, strategy, reply, robot, _ in record.rows("events"):
        if lesson is not None:
            lessons[len(origins) + robot] = lesson
            if requests and requests[-1]["reply"] == "shown" and requests[-1]["shown"] < 0:
                requests[-1]["shown"] = lesson
        elif kind == Kind.ASKED and who is not None:
            asked = {"index": len(origins) + robot, "teacher": who, "strategy": strategy, "reply": reply, "shown": -1}
            wanted = enumerate((*vectors[:c], *vectors[c + p : c + p + t]))
            requests.append(asked | {f"wanted_{k}": value for k, value in wanted})
        elif kind == Kind.CHANGED:
            changes.append(reply)
        elif kind == Kind.FORGOTTEN:  # changes were looked for again
            forgotten, changes = forgotten + numbers_in(reply), []
        elif kind in (Kind.MOVED, Kind.RESTED, Kind.FAILED):
            failed.append(kind == Kind.FAILED)
            demonstration.append(lessons.pop(len(origins), -1))
            origins.append(origin or "")
            cells.extend(np.nan if value is None else value for value in vectors)
    n = len(origins)
    vectors_of = np.split(np.array(cells).reshape(n, c + p + 2 * t), (c, c + p, c + p + t), axis=1)
    arrays: dict[str, Any] = {"changes": changes, "failed": np.array(failed, np.bool_), "index": np.arange(n)}
    arrays |= {"origin": np.array(origins, np.str_), "demonstration": np.array(demonstration, np.int64)}
    arrays |= dict(zip(("contexts", "thetas", "goals", "outcomes"), vectors_of, strict=True))
    arrays["forgotten"] = np.isin(arrays["index"], forgotten)
    arrays["outcomes"][forgotten] = np.nan
    columns = {name: np.array([request[name] for request in requests]) for name in requests[0]} if requests else None
    return arrays, columns


def _columns(record: Record, table: str) -> Columns:
    rows, declared = list(record.rows(table)), (column.split() for column in layout(record.dims)[table][:-1])
    return {name: np.array([row[k] for row in rows], dtype=_KINDS[kind]) for k, (name, kind) in enumerate(declared)}


_KINDS: Final = {"TEXT": np.str_, "INTEGER": np.int64, "REAL": np.float64}  # NULL becomes NaN


def config_of(run: Run, *, trust: bool = False) -> Config:
    """The settings of a run, from which its parts can be built again.

    Args:
        run: result of ``read_run``.
        trust: whether to execute the user's code that the settings name as ``package.module:attribute``.

    Raises:
        RunError: the settings name code of the user and ``trust`` is false, or are those of another version.
    """
    if lost := [room for room in run.rooms if room not in rooms()]:
        raise RunError(f"{run.path} cannot be opened: {absent(lost[0])}")
    code = code_of(run.config)
    if code and not trust:
        raise RunError(
            f"{run.path} names code outside this library, {', '.join(code)}; read it, then execute it with --trust"
        )
    try:
        if code and run.folder not in sys.path:
            sys.path.append(run.folder)
        return Config.from_settings(run.config, Path(run.folder))
    except (TypeError, ValueError) as error:
        told = f"the settings of {run.path}, by sgimd_torch {run.versions.get('sgimd_torch')},"
        raise RunError(f"{told} do not describe a run of this version: {error}") from error


def find_runs(folder: str | os.PathLike[str]) -> dict[str, list[Path]]:
    """Run directories of each variant, by name of the variant, in the order of their seeds.

    Args:
        folder: directory of a run, folder of a variant, or folder of variants.

    Raises:
        RunError: there are no runs, or no such folder.
    """
    folder, paths = Path(folder), dict[str, list[Path]]()
    for pattern in ("", "seed-*/", "*/seed-*/"):
        for file in sorted(folder.glob(pattern + RUN_FILE)):
            paths.setdefault(Path(os.path.abspath(file)).parent.parent.name, []).append(file.parent)
    if not paths:
        why = "holds no runs" if folder.is_dir() else "is a file, not a folder" if folder.exists() else "does not exist"
        raise RunError(f"{folder} {why}; runs are in OUT/NAME/seed-000")
    return paths


def finished(config: Config) -> bool:
    """Whether an undamaged run with these settings is on disk, complete with its last evaluation."""
    try:
        run, wanted = read_run(config.directory), with_found_earlier(config).settings
        others = {*changed_settings(run.config, wanted, run.folder)} - not_compared()
        files = {name: config.values.get(name.removesuffix("_crc32")) for name in run.files}
        return bool(run.summary["finished"] and not others) and all(
            path is None or not path.exists() or run.files[name] in (None, checksum(path))
            for name, path in files.items()
        )
    except (ValueError, OSError):  # another version, or unreadable; --resume will give the reason
        return False


def movements_on_disk(path: Path) -> int:
    """Number of movements in the record of a run directory."""
    try:
        with Record(path / RUN_FILE) as record:
            return record.movements
    except RunError:
        return 0


def _by_inverse(columns: Columns) -> dict[str, Columns]:
    """The evaluations of each inverse model, by its name; the run's own inverse model is always there, as ``OWN``."""
    words = columns["inverse"]
    return {
        word: {name: values[words == word] for name, values in columns.items() if name != "inverse"}
        for word in dict.fromkeys((OWN, *words.tolist()))
    }
