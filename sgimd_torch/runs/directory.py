"""Writing a run directory: refuse what is not this run, keep what is undamaged, go on from there.

with RunDirectory(build(config), resume=False) as directory: directory.begin(); directory.log.append(line); ...
``log.py`` explains the files.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any, Final, Self

import sgimd_torch
from sgimd_torch.catalogue import source
from sgimd_torch.files import checksum, lock, make_folder, write_bytes, write_json
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.config import EVALUATES, ON_RESUME, Config, plain
from sgimd_torch.runs.evaluations import Evaluations
from sgimd_torch.runs.log import Columns, RunError, read_json

_SOURCE: Final = "source of "  # in versions.json, before the word that names a thing of a user's own
_UNFINISHED = ("lock", "versions.json")  # what a run killed before its config.json may have left, besides *.part
# Files count by their content, of which a checksum is recorded; a benchmark may be another one when a run is resumed.
MAY_CHANGE: Final = (*ON_RESUME, "benchmark_crc32")
LIBRARIES: Final = {"numpy": "numpy", "scipy": "scipy", "faiss": "faiss-cpu", "mujoco": "mujoco"}
FORWARD: Final = ("torch", "lightning", "safetensors")  # of runs with a forward model
EVALUATION_SETTINGS: Final = (*EVALUATES, "benchmark_crc32")  # all evaluations of a run share these


class RunDirectory:
    """Where one run is written, from ``begin`` on, by one process at a time; a context manager.

    Of the evaluations of an earlier part it keeps those that the whole run would have.

    Args:
        parts: of the run; its configuration says where the directory is.
        resume: go on with what is there; False refuses a directory that is in use already.
        accept_loss: go on even if the log lacks movements that summary.json counts: they are made again.

    Attributes:
        columns, log: the columns of the log, and its table.
        lines: of the log, as they were found.
        summary: the last one, {} if there is none.
        evaluations: those found, and where new ones go.
        notes: messages for the user, such as what was dropped from damaged files.

    Raises:
        RunError: it holds a run and ``resume`` is False, or a run with other settings, or something else; or its log
            lacks movements, or has more than the run is to have; or another process writes in it.
        OSError: it cannot be written.
    """

    def __init__(self, parts: RunParts, *, resume: bool, accept_loss: bool = False) -> None:
        config, robot = parts.config, parts.environment
        self.path = path = config.directory
        self.columns = Columns(robot.contexts.dim, robot.policies.dim, robot.outcomes.dim)
        self.log = self.columns.table(path)
        self.notes: list[str] = []
        self.summary: dict[str, Any] = {}
        self._settings: dict[str, Any] = {**config.settings, **plain(parts.data)}
        self._versions = {**versions(forward=parts.model is not None), **sources(config)}
        _refuse_foreign(path)
        make_folder(path)
        try:
            self._lock = lock(path / "lock")
        except BlockingIOError:
            raise RunError(f"{path} is in use by another process; wait for it, or choose another --out") from None
        try:
            before = self._settings_before(resume)
            if before is not None:
                self._keep_versions_before()
                self.summary = self._summary_before()
            elif resume:
                self.notes.append(f"{path} holds no run yet: it starts from the beginning")
            self._copy = self._read_log(accept_loss)
            if len(self.lines) > config.movements:
                raise RunError(f"{path} has {len(self.lines)} movements already, {config.movements} were asked for")
            region_dims = len(parts.regions[0].low) if parts.regions else None
            self.evaluations = Evaluations(path, robot.contexts, region_dims, self.notes)
            alike = before is not None and all(before.get(name) == self._settings[name] for name in EVALUATION_SETTINGS)
            kept = [n for n in config.evaluations if alike and n <= len(self.lines)]
            self.evaluations.keep(kept, config.answered)
            for partial in (*path.glob("*.json*.part"), *path.glob("*.csv*.part")):  # of a process that was killed
                partial.unlink()
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._lock)

    def begin(self) -> None:
        """Start to write. Until then what was found stays as it is, so that a replay that fails does no harm."""
        write_json(self.path / "versions.json", self._versions)
        write_json(self.path / "config.json", self._settings)  # from here on it counts as a run
        if self._copy is not None:
            write_bytes(self._copy, self.log.path.read_bytes())
        if self._lost:  # the loss is accepted once
            self.summarise(**{**self.summary, "movements": len(self.lines), "finished": False})
        self.log.begin(self._kept)
        self.log.flush()
        self.evaluations.begin()

    def summarise(self, **summary: Any) -> None:
        """Replace summary.json, once the log is on the disk: it must not count movements that the log lacks."""
        self.log.flush(sync=True)
        self.summary = summary
        write_json(self.path / "summary.json", summary)

    def _settings_before(self, resume: bool) -> dict[str, Any] | None:
        """Those that it was started or last resumed with; None for a new run."""
        settings = self._settings
        before: dict[str, Any] | None = read_json(self.path / "config.json", missing=None)
        if before is None:
            return None
        if not resume:
            raise RunError(f"{self.path} holds a run already; go on with it by --resume, or choose another --out")
        differ = [
            f"{name} was {before.get(name)}, now {settings.get(name)}"
            for name in dict.fromkeys((*settings, *before))
            if name not in MAY_CHANGE and before.get(name) != settings.get(name)
        ]
        if differ:
            raise RunError(
                f"{self.path} belongs to another configuration: {'; '.join(differ)}. "
                "Resume it with its own, or give the new variant another --name or --out"
            )
        return before

    def _keep_versions_before(self) -> None:
        """Other versions that an earlier part ran with."""
        old = self._read_or_note("versions.json")
        earlier = old.pop("before", [])
        if not isinstance(earlier, list):
            earlier = []
        unknown = {name: now for name, now in self._versions.items() if name in FORWARD}  # earlier versions left it out
        differ = [name for name, now in self._versions.items() if {**unknown, **old}.get(name) != now]
        if old and differ:
            changes = ", ".join(f"{name} {old.get(name)} -> {self._versions[name]}" for name in differ)
            self.notes += [f"resumed with other versions: {changes}", *changed_sources(old, self._versions)]
            earlier = [*earlier, old]
        if earlier:
            self._versions["before"] = earlier

    def _summary_before(self) -> dict[str, Any]:
        summary = self._read_or_note("summary.json")
        kinds = {name: (int, float) for name in summary if name.startswith("seconds_")} | {"movements": (int,)}
        wrong = [name for name, kind in kinds.items() if type(summary.get(name, 0)) not in kind]
        if wrong:
            self.notes.append(f"{self.path}/summary.json: {', '.join(wrong)} must be numbers; it counts as missing")
        return {} if wrong else summary

    def _read_or_note(self, name: str) -> dict[str, Any]:
        """A file that a run can go on without: if it is damaged, it counts as missing."""
        try:
            found: dict[str, Any] = read_json(self.path / name, missing={})
        except RunError as error:
            self.notes.append(f"{error}; it counts as missing")
            return {}
        return found

    def _read_log(self, accept_loss: bool) -> Path | None:
        """Take over the undamaged lines; returns where to keep a copy of the log, None if nothing was lost."""
        log, found = self.log.path, self.log.read()
        begins_otherwise = found.bad == 1 and not self.log.header.startswith(found.tail) and found.tail.strip(b"\0")
        if begins_otherwise or not found.checked:
            start = self.log.header[:40].decode()
            raise RunError(f"{log} does not begin with {start}...; restore it, or choose another --out")
        self.lines, self._kept, n = found.lines, found.size, len(found.lines)
        self._lost = max(0, self.summary.get("movements", 0) - n)
        damaged = found.damage is not None
        if self._lost and not accept_loss:
            raise RunError(
                f"{log} holds {n} movements{f', line {found.bad} is damaged' if damaged else ''}, but summary.json "
                f"counts {n + self._lost}; was it cut, emptied or deleted? Restore it, or make the {self._lost} "
                "missing ones again with --accept-loss, which keeps a copy of what is there"
            )
        self.notes += self.log.notes(found, f"{n} movements are kept")
        if self._lost:
            self.notes.append(f"{log} lacks {self._lost} movements: {n} are kept, the others will be made again")
        if not damaged and not (self._lost and os.path.lexists(log)):
            return None
        copies = (log.with_name(f"{log.name}.lost-{k}") for k in count())
        copy = next(path for path in copies if not os.path.lexists(path))
        self.notes.append(f"{log} as it was found is kept as {copy}")
        return copy


def _refuse_foreign(path: Path) -> None:
    if not path.exists() or (path / "config.json").exists():
        return
    if not path.is_dir():
        raise RunError(f"{path} is a file, not a run directory; choose another --out")
    foreign = [entry for entry in sorted(os.listdir(path)) if entry not in _UNFINISHED and not entry.endswith(".part")]
    if foreign:
        raise RunError(f"{path} holds {', '.join(foreign[:3])} but no run (no config.json); choose another --out")


def sources(config: Config) -> dict[str, str]:
    """The file of each thing of a user's own in a run, and its checksum, such as "toss.py, crc32 8f0a1b2c"."""
    found = {}
    for word in config.own:
        if (file := source(word)) is not None:
            depth = word.partition(":")[0].count(".") + 1 + (file.stem == "__init__")
            found[f"{_SOURCE}{word}"] = f"{Path(*file.parts[-depth:]).as_posix()}, crc32 {checksum(file)}"
    return found


def stale(config: Config) -> list[str]:
    """The same notes for a run on disk; none if what made it is as it was, or cannot be read."""
    try:
        before: dict[str, Any] = read_json(config.directory / "versions.json", missing={})
    except RunError:  # the run itself says so when it is resumed
        return []
    return changed_sources(before, sources(config))


def changed_sources(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """A note for each file of a user's own that is another one than ``before``, of two versions.json."""
    changed = {name: str(was) for name, was in before.items() if name.startswith(_SOURCE) and now.get(name, was) != was}
    return [
        f"{was.partition(',')[0]} has changed since this run was made ({was} -> {now[name]}): what is recorded was "
        f"made by the earlier {name.removeprefix(_SOURCE)}, only new movements and evaluations are by this one"
        for name, was in changed.items()
    ]


def versions(*, forward: bool) -> dict[str, Any]:
    """What runs here; ``commit`` is None outside a git repository and ends in "-dirty" when files were changed.

    Args:
        forward: also of the libraries of a forward model, which a run without one does not need.
    """
    packages = LIBRARIES | (dict(zip(FORWARD, FORWARD, strict=True)) if forward else {})
    here = str(Path(__file__).parent)
    describe = ["git", "-C", here, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        commit = subprocess.run(describe, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        commit = None
    return {
        "python": platform.python_version(),
        **{name: importlib.metadata.version(package) for name, package in packages.items()},
        "sgimd_torch": sgimd_torch.__version__,
        "platform": platform.platform(),
        "commit": commit,
    }
