"""Opening the record of a run: refuse what is not this run, keep what is whole, say what is not.

record, notes = open_run(build(config), resume=True, accept_loss=False)
A run is the file ``run.sqlite`` in OUT/NAME/seed-003; ``docs/runs.md`` explains its tables.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any, Final

import sgimd_torch
from sgimd_torch.catalogue import source
from sgimd_torch.files import checksum, make_folder
from sgimd_torch.record import DERIVED, InUseError, Record, RunError
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.config import EVALUATES, MAY_CHANGE, Config, words
from sgimd_torch.runs.evaluations import EVALUATED

FILE: Final = "run.sqlite"
_LASTING: Final = ("events", "demonstrations")  # tables that only a new life would make again
_SOURCE: Final = "source of "  # among the versions, before the word that names a part of a user's own
LIBRARIES: Final = {"numpy": "numpy", "scipy": "scipy", "faiss": "faiss-cpu", "mujoco": "mujoco"}
FORWARD: Final = ("torch", "lightning", "safetensors")  # of runs with a forward model


def open_run(parts: RunParts, *, resume: bool, accept_loss: bool = False) -> tuple[Record, list[str]]:
    """The record of a run, open for writing, and messages; nothing in it has changed before its first commit.

    Args:
        parts: of the run; its configuration says where it is.
        resume: go on with what is there; False refuses a run that is there already.
        accept_loss: go on even if movements of it are damaged or missing: a copy is kept, they are made again.

    Raises:
        RunError: there is a run and ``resume`` is False, or it has other settings or more movements, or it is damaged
            and the loss is not accepted; or something else is there; or another process writes it.
        OSError: it cannot be written.
    """
    config, robot = parts.config, parts.environment
    spaces = {"contexts": robot.contexts, "policies": robot.policies, "outcomes": robot.outcomes}
    path, notes = config.directory / FILE, list[str]()
    refuse_foreign(config.directory)
    about: dict[str, Any] = {
        "settings": config.settings,
        "files": parts.data,
        "versions": {**versions(forward=parts.model is not None), **sources(config)},
        "robot": type(robot).__name__,
        "words": words(config),
        "spaces": {n: [b.low.tolist(), b.high.tolist(), b.names, b.unit] for n, b in spaces.items()},
    }
    dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
    make_folder(config.directory)
    if holds_run(path) and not resume:
        raise RunError(f"{config.directory} holds a run already; go on with it by --resume, or choose another --out")
    record = _whole(path, accept_loss, notes) if holds_run(path) else None
    if record is None:
        notes += [f"{config.directory} holds no run yet: it starts from the beginning"] if resume and not notes else []
        record = Record.make(path, dims, about)
    else:
        try:
            if "settings" not in record.about:
                raise RunError(f"{path} is a life that Learner.save wrote, not a run; choose another --out")
            _refuse_other(record, about)
            if record.dims != dims:
                was = f"dims {record.dims} of context, theta, outcome, the robot now has {dims}"
                raise RunError(f"{path} was recorded with {was}; has the robot become another one?")
            if record.movements > config.movements:
                raise RunError(f"{path} has {record.movements} movements already, {config.movements} were asked for")
            about["versions"] = _with_earlier(record.about["versions"], about["versions"], notes)
            _keep_evaluations(record, parts, about)
            record.settle(**about)
        except BaseException:
            record.close()
            raise
    record.replace_rows("goals", ((k, *goal) for k, goal in enumerate(parts.benchmark.goals.tolist())))
    return record, notes


def holds_run(path: Path) -> bool:
    """Whether there is a record; a process that was killed while it made one leaves an empty file."""
    return path.is_file() and path.stat().st_size > 0


def refuse_foreign(folder: Path) -> None:
    """Refuse a folder with other things in it.

    Raises:
        RunError: it is a file, or holds something else than a run.
    """
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder} is a file, not a run directory; choose another --out")
    if not folder.exists() or (folder / FILE).exists():
        return
    foreign = sorted(entry for entry in os.listdir(folder) if not entry.endswith(".part"))
    if "config.json" in foreign:
        raise RunError(f"{folder} holds a run of files that this version does not read; choose another --out")
    if foreign:
        raise RunError(f"{folder} holds {', '.join(foreign[:3])} but no run (no {FILE}); choose another --out")


def _whole(path: Path, accept_loss: bool, notes: list[str]) -> Record | None:
    """The record at ``path``, without what is damaged; None if nothing is left of it."""
    try:
        record = Record(path, write=True)
        wrong = record.check()
    except InUseError:
        raise
    except RunError as error:
        _accept(path, f"{error}; nothing of it can be read", "make them", accept_loss, notes)
        path.unlink()
        return None
    if not wrong:
        return record
    lost = [message for table, message in wrong.items() if table in _LASTING]
    if lost:
        record.close()
        _accept(path, "; ".join(lost), "keep those before and make the others", accept_loss, notes)
        record = Record(path, write=True)
    try:
        dropped = {*wrong, *(EVALUATED if wrong.keys() & {*EVALUATED} else ())}
        whole = () if lost else [table for table in DERIVED if table not in dropped]
        notes += [f"{message}; it is made again" for message in wrong.values() if message not in lost]
        kept = record.rewrite(keep=whole)
    finally:
        record.close()
    if lost:
        notes.append(f"{kept} movements of {path} are kept, the others are made again")
    return Record(path, write=True)


def _accept(path: Path, what: str, how: str, accept_loss: bool, notes: list[str]) -> None:
    """Keep a copy of a record that loses movements, or refuse to go on."""
    if not accept_loss:
        raise RunError(f"{what} Restore it, or {how} again with --resume --accept-loss, which keeps a copy")
    copy = next(place for k in count() if not (place := path.with_name(f"run.lost-{k}.sqlite")).exists())
    shutil.copy2(path, copy)
    notes.append(f"{what} It is kept as {copy}")


def _refuse_other(record: Record, about: Mapping[str, Any]) -> None:
    before = {**record.about["settings"], **record.about["files"]}
    now = {**about["settings"], **about["files"]}
    differ = [
        f"{name} was {before.get(name)}, now {now.get(name)}"
        for name in dict.fromkeys((*now, *before))
        if name not in MAY_CHANGE and before.get(name) != now.get(name)
    ]
    if differ:
        raise RunError(
            f"{record.path.parent} belongs to another configuration: {'; '.join(differ)}. "
            "Resume it with its own, or give the new variant another --name or --out"
        )


def _with_earlier(old: dict[str, Any], now: dict[str, Any], notes: list[str]) -> dict[str, Any]:
    """The versions ``now``; those of earlier parts of the run, where they differ, are kept beside them."""
    earlier = old.pop("before", [])
    differ = [name for name, version in now.items() if old.get(name) != version]
    if differ:
        changes = ", ".join(f"{name} {old.get(name)} -> {now[name]}" for name in differ)
        notes += [f"resumed with other versions: {changes}", *changed_sources(old, now)]
        earlier = [*earlier, old]
    return {**now, "before": earlier} if earlier else now


def _keep_evaluations(record: Record, parts: RunParts, about: Mapping[str, Any]) -> None:
    """Of the evaluations so far only those that the whole run would have."""
    before = {**record.about["settings"], **record.about["files"]}
    now = {**about["settings"], **about["files"]}
    alike = all(before.get(name) == now.get(name) for name in EVALUATES)
    wanted = {*parts.config.evaluations} if alike else set()
    for table in EVALUATED:
        rows = list(record.rows(table))
        kept = [row for row in rows if row[0] in wanted]
        if len(kept) < len(rows):
            record.replace_rows(table, kept)


def sources(config: Config) -> dict[str, str]:
    """The file of each part of a user's own in a run, and its checksum, such as "toss.py, crc32 8f0a1b2c"."""
    found = {}
    for word in config.own:
        if (file := source(word)) is not None:
            depth = word.partition(":")[0].count(".") + 1 + (file.stem == "__init__")
            found[f"{_SOURCE}{word}"] = f"{Path(*file.parts[-depth:]).as_posix()}, crc32 {checksum(file)}"
    return found


def changed_sources(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """A note for each file of a user's own that is another one than ``before``."""
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
