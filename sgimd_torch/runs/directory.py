"""The run directory as its one writer sees it: refuse what is not this run, take over what is whole, go on from there.

with RunDirectory(path, settings, ...) as directory: directory.begin(); directory.append(line); directory.flush()
``runfiles.py`` explains the files.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from sgimd_torch.runs.config import before_there_was_a_choice
from sgimd_torch.runs.log import Columns, RunError, dropped, make_folder, read_json, write_json
from sgimd_torch.runs.tables import Evaluations

_UNFINISHED = ("lock", "versions.json")  # what a run killed before its config.json may have left, besides *.part


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
        evaluations: those found, and where new ones go.
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
        make_folder(path)
        self._lock = _lock(path)
        try:
            self.before = self._settings_before(settings, free, resume)
            if self.before is not None:
                versions = self._with_versions_before(versions)
                self.summary = self._summary_before()
            elif resume:
                self.notes.append(f"{path} holds no run yet: it starts from the beginning")
            self._kept = self._read_log()
            if len(self.lines) > movements:
                raise RunError(f"{path} has {len(self.lines)} movements already, asked for were {movements}")
            self._settings, self._versions = dict(settings), versions
            self.evaluations = Evaluations(path, region_dims, self.notes)
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
        self.evaluations.begin()

    def append(self, line: bytes) -> None:
        """One more line for the log, on disk with the next ``flush``."""
        self._pending += line

    def flush(self) -> None:
        """Hand the log to the operating system: a killed process then loses nothing of it."""
        while self._pending and self._log is not None:
            del self._pending[: os.write(self._log, self._pending)]

    def summarise(self, **summary: Any) -> None:
        """Replace summary.json."""
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
        wrong = [
            name for name, value in summary.items() if name.startswith("seconds_") and type(value) not in (int, float)
        ]
        if wrong:
            self.notes.append(f"{self.path}/summary.json: {', '.join(wrong)} must be numbers; it counts as missing")
        return {} if wrong else summary

    def _read_or_note(self, name: str) -> dict[str, Any]:
        """A file that only says how things went: damaged, it is as good as missing."""
        try:
            found: dict[str, Any] = read_json(self.path / name, missing={})
        except RunError as error:
            self.notes.append(f"{error}; it counts as missing")
            return {}
        return found

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
            self.notes.append(dropped(path, content[kept:], f"{len(self.lines)} movements are kept"))
        return kept


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
