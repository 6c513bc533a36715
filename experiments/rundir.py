"""The run directory: what a run leaves on disk, how a stopped run finds it again, and how figures read it.

    config.json      every choice that makes the run
    versions.json    of Python, the libraries and this repository; "before": those of earlier parts of a resumed run
    episodes.csv     the log, append-only, a line for each movement:
                         index, origin ("" at rest), demonstration (its row in the file, when one came just before),
                         context_*, theta_*, goal_*, outcome_*, crc32 of the line before it
    evaluation.csv   movements, mean_error_m, median_error_m, p90_error_m, noise_floor_m
    regions.csv      the interest map at each evaluation, a line for each region, corners in C x T
    summary.json     movements so far, the last evaluation, seconds spent on physics, learning and evaluating
    lock             held by the process that writes

Numbers read back exactly, and no time of day is written: equal seeds make the same csv files, byte for byte. All files
but the log are replaced whole, so that nobody ever reads half of one.
    run = read_run("runs/sgim-d/seed-003"); run.outcomes, run.evaluation["mean_error_m"]
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.regions import Region
from sgimd_torch.session import Recorded
from sgimd_torch.spaces import Array, Episode

EVALUATION = ("movements", "mean_error_m", "median_error_m", "p90_error_m", "noise_floor_m")
_UNFINISHED = ("lock", "versions.json")  # what a run killed before its config.json may have left, besides *.part


class RunError(ValueError):
    """A directory is not what is wanted: of another run, in use, damaged, or of no run at all."""


@dataclass(frozen=True)
class Columns:
    """Of the log: how many of each there are."""

    context_dim: int
    theta_dim: int
    outcome_dim: int

    @property
    def names(self) -> tuple[str, ...]:
        """In order."""
        return (
            *("index", "origin", "demonstration"),
            *(f"context_{k}" for k in range(self.context_dim)),
            *(f"theta_{k}" for k in range(self.theta_dim)),
            *(f"goal_{k}" for k in range(self.outcome_dim)),
            *(f"outcome_{k}" for k in range(self.outcome_dim)),
            "crc32",
        )

    @property
    def header(self) -> bytes:
        """The first line of the log."""
        return ",".join(self.names).encode() + b"\n"

    @classmethod
    def of(cls, header: bytes) -> Columns:
        """Those that a log's first line names.

        Raises:
            RunError: it is not the first line of a log.
        """
        columns = cls(*(header.count(name) for name in (b"context_", b"theta_", b"outcome_")))
        if header != columns.header:
            raise RunError(f"a log begins with the names of its columns, this one with {header[:60]!r}; was it edited?")
        return columns

    def line(self, episode: Episode, demonstration: int | None) -> bytes:
        """One episode; ``demonstration`` is the row of the one that came just before it."""
        move = episode.move
        fields = [str(episode.index), move.origin if move else "", "" if demonstration is None else str(demonstration)]
        fields += _numbers(episode.context, self.context_dim)
        fields += _numbers(move.theta if move else None, self.theta_dim)
        fields += _numbers(move.goal if move else None, self.outcome_dim)
        fields += _numbers(episode.outcome, self.outcome_dim)
        body = ",".join(fields).encode()
        return body + b",%08x\n" % zlib.crc32(body)

    def recorded(self, line: bytes) -> Recorded:
        """What ``session.replay`` needs of a line."""
        fields = line.decode().split(",")
        theta = 3 + self.context_dim
        outcome = theta + self.theta_dim + self.outcome_dim
        if not fields[theta]:
            return Recorded(None, None)
        return Recorded(
            np.array(fields[theta : theta + self.theta_dim], dtype=np.float64),
            np.array(fields[outcome : outcome + self.outcome_dim], dtype=np.float64),
        )

    def whole_lines(self, body: bytes) -> list[bytes]:
        """The lines after the header up to the first that is torn, damaged or out of order."""
        lines: list[bytes] = []
        for line in body.splitlines(keepends=True):
            fields, _, checksum = line.rpartition(b",")
            if checksum != b"%08x\n" % zlib.crc32(fields) or not fields.startswith(b"%d," % len(lines)):
                break
            lines.append(line)
        return lines


class RunDirectory:
    """Where one run is written, from ``begin`` on, by one process at a time; a context manager.

    Args:
        path: made when missing.
        settings: everything that makes the run, as it goes to config.json.
        free: names of settings that may differ when a run is resumed.
        columns: of the log.
        region_dims: dimensions of C x T, where the learner has an interest map; None where it has none.
        versions: what runs it.
        movements: how long the run is to be; the log must not be longer.
        resume: go on with what is there; False refuses a directory that is in use already.

    Attributes:
        lines: of the log, as they were found.
        before: the settings it was started or last resumed with; None for a new run.
        summary: the last one, {} if there is none.
        notes: what a person should know: what was dropped from damaged files, say.

    Raises:
        RunError: it holds a run and ``resume`` is False, or a run with other settings, or something else; or another
            process writes in it.
        OSError: it cannot be written.
    """

    def __init__(
        self,
        path: Path,
        settings: Mapping[str, Any],
        *,
        free: Sequence[str],
        columns: Columns,
        region_dims: int | None,
        versions: dict[str, Any],
        resume: bool,
        movements: int,
    ) -> None:
        self.path, self.columns = path, columns
        self.notes: list[str] = []
        self.lines: list[bytes] = []
        self.summary: dict[str, Any] = {}
        self._pending = bytearray()
        _refuse_foreign(path)
        path.mkdir(parents=True, exist_ok=True)
        self._lock = _lock(path)
        try:
            self.before = self._settings_before(settings, free, resume)
            if self.before is not None:
                versions = self._with_versions_before(versions)
                self.summary = _read_json(path / "summary.json", missing={})
            elif resume:
                self.notes.append(f"{path} holds no run yet: it starts from the beginning")
            self._kept = self._read_log()
            if len(self.lines) > movements:
                raise RunError(f"{path} has {len(self.lines)} movements already, asked for were {movements}")
            self._settings, self._versions = dict(settings), versions
            self._evaluation = _Table(path / "evaluation.csv", EVALUATION, self.notes)
            self._regions = None
            if region_dims is not None:
                self._regions = _Table(path / "regions.csv", _region_columns(region_dims), self.notes)
            self._log: int | None = None
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Flush and let go; a disk that is full is not reported twice."""
        try:
            self.flush()
        except OSError:
            if error is None:
                raise
        finally:
            if self._log is not None:
                os.close(self._log)
            os.close(self._lock)

    def begin(self) -> None:
        """Start to write. Until then what was found stays as it is, so that a replay that fails does no harm."""
        write_json(self.path / "versions.json", self._versions)
        write_json(self.path / "config.json", self._settings)  # from here on it counts as a run
        self._log = os.open(self.path / "episodes.csv", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        os.ftruncate(self._log, self._kept)
        if not self._kept:
            self.append(self.columns.header)
        for table in filter(None, (self._regions, self._evaluation)):
            table.begin()

    def append(self, line: bytes) -> None:
        """One more line for the log, on disk with the next ``flush``."""
        self._pending += line

    def flush(self) -> None:
        """Hand the log to the operating system: a killed process then loses nothing of it."""
        while self._pending and self._log is not None:
            del self._pending[: os.write(self._log, self._pending)]

    def keep_evaluations(self, movements: Iterable[int]) -> None:
        """Drop all evaluations but those after these numbers of ``movements``."""
        wanted = set(movements)
        if self._regions is not None:
            self._regions.keep(wanted)
            wanted &= self._regions.rows.keys()
        self._evaluation.keep(wanted)

    def has_evaluation(self, movements: int) -> bool:
        """Whether the evaluation after ``movements`` has been done."""
        return movements in self._evaluation.rows

    def evaluated(self, movements: int, evaluation: Evaluation, regions: Sequence[Region]) -> None:
        """Keep an evaluation, and the interest map as it was then."""
        if self._regions is not None:
            self._regions.put(movements, [_region_fields(region) for region in regions])
        errors = evaluation.errors
        numbers = [evaluation.mean_error, np.median(errors), np.quantile(errors, 0.9), evaluation.noise_floor]
        self._evaluation.put(movements, [_numbers(np.array(numbers), len(numbers))])

    @property
    def last_evaluation(self) -> dict[str, float]:
        """Its columns, {} before the first."""
        if not self._evaluation.rows:
            return {}
        last = max(self._evaluation.rows)
        return dict(zip(EVALUATION, map(float, self._evaluation.rows[last][0].split(",")), strict=True))

    def summarise(self, **summary: Any) -> None:
        """Replace summary.json."""
        self.summary = summary
        write_json(self.path / "summary.json", summary)

    def _settings_before(self, settings: Mapping[str, Any], free: Sequence[str], resume: bool) -> dict[str, Any] | None:
        before: dict[str, Any] | None = _read_json(self.path / "config.json", missing=None)
        if before is None:
            return None
        if not resume:
            raise RunError(f"{self.path} holds a run already; go on with it by --resume, or choose another --out")
        differ = [
            f"{name} was {before.get(name)}, now {settings.get(name)}"
            for name in dict.fromkeys((*settings, *before))
            if name not in free and before.get(name) != json.loads(json.dumps(settings.get(name)))
        ]
        if differ:
            raise RunError(
                f"{self.path} belongs to another configuration: {'; '.join(differ)}. "
                "Resume it with its own, or give the new variant another --name or --out"
            )
        return before

    def _with_versions_before(self, versions: dict[str, Any]) -> dict[str, Any]:
        old: dict[str, Any] = _read_json(self.path / "versions.json", missing={})
        earlier = old.pop("before", [])
        differ = [name for name in versions if old.get(name) != versions[name]]
        if old and differ:
            changes = ", ".join(f"{name} {old.get(name)} -> {versions[name]}" for name in differ)
            self.notes.append(f"resumed with other versions: {changes}")
            earlier = [*earlier, old]
        return {**versions, "before": earlier} if earlier else versions

    def _read_log(self) -> int:
        """Take over the whole lines; returns how many bytes of the log are whole."""
        path = self.path / "episodes.csv"
        content = path.read_bytes() if path.exists() else b""
        header = self.columns.header
        if content.startswith(header):
            self.lines = self.columns.whole_lines(content[len(header) :])
            kept = len(header) + sum(map(len, self.lines))
        elif header.startswith(content) or not content.strip(b"\0"):
            kept = 0
        else:
            raise RunError(f"{path} does not begin with {header[:40].decode()}...; restore it, or choose another --out")
        if kept < len(content):
            self.notes.append(_dropped(path, content[kept:], f"{len(self.lines)} movements are kept"))
        return kept


class _Table:
    """A small csv file whose first column is the number of movements; once begun, it is replaced at every change."""

    def __init__(self, path: Path, names: Sequence[str], notes: list[str]) -> None:
        self.path = path
        self.header = ",".join(names)
        self.rows: dict[int, list[str]] = {}
        self._begun = False
        if path.exists():
            content = path.read_bytes()
            self.rows, whole = _read_rows(content, self.header)
            if whole < len(content):
                notes.append(_dropped(path, content[whole:], "it will be evaluated again"))

    def begin(self) -> None:
        self._begun = True
        self._write()

    def keep(self, movements: set[int]) -> None:
        self.rows = {key: rows for key, rows in self.rows.items() if key in movements}

    def put(self, movements: int, rows: list[list[str]]) -> None:
        self.rows[movements] = [",".join([str(movements), *fields]) for fields in rows]
        if self._begun:
            self._write()

    def _write(self) -> None:
        lines = [self.header, *(line for key in sorted(self.rows) for line in self.rows[key])]
        write_whole(self.path, "".join(f"{line}\n" for line in lines))


@dataclass(frozen=True, eq=False)
class Run:
    """A run as it was read.

    ``index`` ``(n,)``, ``origin`` ``(n,)`` names, "" at rest, ``demonstration`` ``(n,)`` row of the demonstration just
    before, -1 if there was none; ``contexts``, ``thetas``, ``goals`` and ``outcomes`` ``(n, dim)``, NaN where there was
    none. ``evaluation`` has an array for each column, an entry for each evaluation; ``regions`` likewise, with an entry
    for each region at each evaluation, None for a learner without interest map. ``config``, ``versions``, ``summary``:
    as in their files.
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


def read_run(path: str | os.PathLike[str]) -> Run:
    """What a run has written so far, be it finished, stopped or under way; a torn last line is left out.

    Raises:
        RunError: there is no run at ``path``, or its files are damaged.
    """
    path = Path(path)
    config = _read_json(path / "config.json", missing=None)
    if config is None:
        raise RunError(f"{path} is no run directory, it has no config.json; runs lie in OUT/NAME/seed-000")
    try:
        log = (path / "episodes.csv").read_bytes()
    except FileNotFoundError:
        log = b""
    header, newline, body = log.partition(b"\n")
    columns = Columns.of(header + newline) if newline else Columns(0, 0, 0)
    rows = [line.decode().rstrip("\n").split(",") for line in columns.whole_lines(body)]
    ends = np.cumsum([3, columns.context_dim, columns.theta_dim, columns.outcome_dim, columns.outcome_dim])
    numbers = np.array([[field or "nan" for field in row[3:-1]] for row in rows], dtype=np.float64)
    contexts, thetas, goals, outcomes = np.split(numbers.reshape(len(rows), ends[-1] - 3), ends[1:-1] - 3, axis=1)
    return Run(
        path=path,
        config=config,
        versions=_read_json(path / "versions.json", missing={}),
        summary=_read_json(path / "summary.json", missing={}),
        index=np.arange(len(rows)),
        origin=np.array([row[1] for row in rows], dtype=np.str_),
        demonstration=np.array([int(row[2] or -1) for row in rows], dtype=np.int64),
        contexts=contexts,
        thetas=thetas,
        goals=goals,
        outcomes=outcomes,
        evaluation=_read_table(path / "evaluation.csv", EVALUATION) or {name: np.empty(0) for name in EVALUATION},
        regions=_read_table(path / "regions.csv", None),
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


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Replace a json file; NaN becomes null, since json has none."""
    finite = {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in content.items()}
    write_whole(path, json.dumps(finite, indent=2, allow_nan=False) + "\n")


def write_whole(path: Path, content: str) -> None:
    """Replace a file; ``path`` holds the old content or all of the new, also after a power cut."""
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("w", encoding="utf-8", newline="") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _numbers(values: Array | None, dim: int) -> list[str]:
    return [""] * dim if values is None else [repr(value) for value in values.tolist()]


def _region_columns(dims: int) -> tuple[str, ...]:
    corners = [f"{corner}_{k}" for corner in ("low", "high") for k in range(dims)]
    return ("movements", "path", *corners, "attempts", "goals", "competence", "interest")


def _region_fields(region: Region) -> list[str]:
    n = len(region.competences)
    competence = float(region.competences.mean()) if n else math.nan
    corners = _numbers(region.low, len(region.low)) + _numbers(region.high, len(region.high))
    return [region.path, *corners, str(region.attempts), str(n), repr(competence), repr(region.interest())]


def _read_rows(content: bytes, header: str) -> tuple[dict[int, list[str]], int]:
    """Rows by number of movements, and how many bytes they make; what follows the first damaged line is left out."""
    lines = content.splitlines(keepends=True)
    if not lines or lines[0] != f"{header}\n".encode():
        return {}, 0
    groups: dict[int, list[str]] = {}
    for line in lines[1:]:
        fields = line.decode(errors="replace").removesuffix("\n").split(",")
        if not line.endswith(b"\n") or len(fields) != header.count(",") + 1 or not all(map(_is_value, fields)):
            break
        groups.setdefault(int(fields[0]), []).append(",".join(fields))
    if header.startswith("movements,path,"):
        groups = {movements: rows for movements, rows in groups.items() if _is_whole_tree(rows)}
    kept = sum(len(row) + 1 for rows in groups.values() for row in rows)
    return groups, len(lines[0]) + kept


def _is_value(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return bool(field) and field[0] == "R" and set(field[1:]) <= {"0", "1"}
    return True


def _is_whole_tree(rows: list[str]) -> bool:
    """Whether the regions are all leaves of one tree: each cut halves what its leaves count for."""
    return sum(0.5 ** (len(row.split(",")[1]) - 1) for row in rows) == 1


def _read_table(path: Path, names: Sequence[str] | None) -> dict[str, np.ndarray] | None:
    if not path.exists():
        return None
    content = path.read_bytes()
    header = content.partition(b"\n")[0].decode(errors="replace") if names is None else ",".join(names)
    groups, _ = _read_rows(content, header)
    columns = header.split(",")
    rows = [row.split(",") for group in groups.values() for row in group]
    table = np.array(rows, dtype=np.str_).reshape(len(rows), len(columns))
    return {
        name: table[:, k] if name == "path" else table[:, k].astype(np.int64 if name in _WHOLE else np.float64)
        for k, name in enumerate(columns)
    }


_WHOLE = ("movements", "attempts", "goals")


def _dropped(path: Path, tail: bytes, outlook: str) -> str:
    n_lines = len(tail.splitlines())
    return f"{path}: dropped {len(tail)} bytes in {n_lines} line(s), torn or damaged; {outlook}"


def _read_json(path: Path, *, missing: Any) -> Any:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return missing
    except NotADirectoryError:
        return missing
    except ValueError as error:
        raise RunError(f"{path} cannot be read ({error}); was it edited, or the disk full?") from error
    if not isinstance(content, dict):
        raise RunError(f"{path} must hold a json object, got {type(content).__name__}; was it edited?")
    return content


def _refuse_foreign(path: Path) -> None:
    if not path.exists() or (path / "config.json").exists():
        return
    if not path.is_dir():
        raise RunError(f"{path} is a file, not a run directory; choose another --out")
    foreign = [entry for entry in sorted(os.listdir(path)) if entry not in _UNFINISHED and not entry.endswith(".part")]
    if foreign:
        raise RunError(f"{path} holds {', '.join(foreign[:3])} but no run (no config.json); choose another --out")


def _lock(path: Path) -> int:
    lock = os.open(path / "lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise RunError(f"{path} is in use by another process; wait for it, or choose another --out") from None
    return lock
