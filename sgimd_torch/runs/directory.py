"""Writing a run directory: refuse what is not this run, keep what is undamaged, go on from there.

with RunDirectory(path, settings, ...) as directory: directory.begin(); directory.log.append(line); ...
``log.py`` explains the files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from sgimd_torch.files import lock, make_folder, write_bytes, write_json
from sgimd_torch.runs.config import before_there_was_a_choice
from sgimd_torch.runs.evaluations import Evaluations
from sgimd_torch.runs.log import Columns, RunError, read_json

_UNFINISHED = ("lock", "versions.json")  # what a run killed before its config.json may have left, besides *.part


class RunDirectory:
    """Where one run is written, from ``begin`` on, by one process at a time; a context manager.

    Args:
        path: made when missing.
        settings: everything that makes the run, as it goes to config.json.
        free: names of settings that may differ when a run is resumed.
        columns: of the log.
        region_dims: dimensions of C x T, where the goal model has regions; None where it has none.
        versions: of Python, the libraries and this repository.
        movements: how long the run is to be; the log must not be longer.
        resume: go on with what is there; False refuses a directory that is in use already.
        accept_loss: go on even if the log lacks movements that summary.json counts: they are made again.

    Attributes:
        log: its table.
        lines: of the log, as they were found.
        before: the settings it was started or last resumed with; None for a new run.
        summary: the last one, {} if there is none.
        evaluations: those found, and where new ones go.
        notes: messages for the user, such as what was dropped from damaged files.

    Raises:
        RunError: it holds a run and ``resume`` is False, or a run with other settings, or something else; or its log
            lacks movements; or another process writes in it.
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
        accept_loss: bool = False,
    ) -> None:
        self.path, self.columns, self.log = path, columns, columns.table(path)
        self.notes: list[str] = []
        self.summary: dict[str, Any] = {}
        _refuse_foreign(path)
        make_folder(path)
        try:
            self._lock = lock(path / "lock")
        except BlockingIOError:
            raise RunError(f"{path} is in use by another process; wait for it, or choose another --out") from None
        try:
            self.before = self._settings_before(settings, free, resume)
            if self.before is not None:
                versions = self._with_versions_before(versions)
                self.summary = self._summary_before()
            elif resume:
                self.notes.append(f"{path} holds no run yet: it starts from the beginning")
            self._copy = self._read_log(accept_loss)
            if len(self.lines) > movements:
                raise RunError(f"{path} has {len(self.lines)} movements already, {movements} were asked for")
            self._settings, self._versions = dict(settings), versions
            self.evaluations = Evaluations(path, region_dims, self.notes)
            for partial in (*path.glob("*.json*.part"), *path.glob("*.csv*.part")):  # of a process that was killed
                partial.unlink()
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Flush and release the lock; a full disk is not reported twice."""
        try:
            self.log.flush()
        except OSError:
            if error is None:
                raise
        finally:
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

    def _settings_before(self, settings: Mapping[str, Any], free: Sequence[str], resume: bool) -> dict[str, Any] | None:
        before: dict[str, Any] | None = read_json(self.path / "config.json", missing=None)
        if before is None:
            return None
        if not resume:
            raise RunError(f"{self.path} holds a run already; go on with it by --resume, or choose another --out")
        before = {**before_there_was_a_choice(), **before}
        differ = [
            f"{name} was {before.get(name)}, now {settings.get(name)}"
            for name in dict.fromkeys((*settings, *before))
            if name not in free and before.get(name) != settings.get(name)
        ]
        if differ:
            raise RunError(
                f"{self.path} belongs to another configuration: {'; '.join(differ)}. "
                "Resume it with its own, or give the new variant another --name or --out"
            )
        return before

    def _with_versions_before(self, versions: dict[str, Any]) -> dict[str, Any]:
        old = self._read_or_note("versions.json")
        earlier = old.pop("before", [])
        if not isinstance(earlier, list):
            earlier = []
        differ = [name for name in versions if old.get(name) != versions[name]]
        if old and differ:
            changes = ", ".join(f"{name} {old.get(name)} -> {versions[name]}" for name in differ)
            self.notes.append(f"resumed with other versions: {changes}")
            earlier = [*earlier, old]
        return {**versions, "before": earlier} if earlier else versions

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
