"""The record of a run, opened: refuse what is not this run, keep what is whole, say what is not.

record, notes = open_run(build(config), resume=True, accept_loss=False)
A run is the file ``run.sqlite`` in OUT/NAME/seed-003; ``docs/runs.md`` explains its tables.
"""

from __future__ import annotations

import importlib.metadata
import platform
import shutil
import subprocess
import sys
from itertools import count
from pathlib import Path
from typing import Any, Final

import sgimd_torch
from sgimd_torch.catalogue import load
from sgimd_torch.files import checksum, make_folder
from sgimd_torch.record import DERIVED, Dims, InUseError, Record, RunError
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.config import EVALUATES, MAY_CHANGE, Config, code_of, words

FILE: Final = "run.sqlite"
LIBRARIES: Final = ("numpy", "scipy", "faiss-cpu", "mujoco")
FORWARD: Final = ("torch", "lightning", "safetensors")  # of runs with a forward model
EVALUATED: Final = ("evaluations", "errors", "regions")  # tables of evaluations
OF_MODEL: Final = ("predictions", "refreshes")  # tables of a forward model


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
    about: dict[str, Any] = {
        "settings": config.settings,
        "files": parts.data,
        "versions": {**versions(forward=bool(parts.learner.problem.trained)), **sources(config)},
        "robot": type(robot).__name__,
        "words": words(config),
        "spaces": {n: [b.low.tolist(), b.high.tolist(), b.names, b.unit] for n, b in spaces.items()},
    }
    dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
    make_folder(config.directory)
    record = None
    if holds_run(path):
        if not resume:
            raise RunError(f"{path.parent} holds a run already; go on with it by --resume, or choose another --out")
        record = _reopened(path, about, dims, config, accept_loss, notes)
    elif resume:
        notes.append(f"{path.parent} holds no run yet: it starts from the beginning")
    if record is None:
        record = Record.make(path, dims, about)
    record.replace_rows("goals", ((k, *goal) for k, goal in enumerate(parts.benchmark.goals.tolist())))
    return record, notes


def holds_run(path: Path) -> bool:
    """Whether there is a record; a process that was killed while it made one leaves an empty file."""
    return path.is_file() and path.stat().st_size > 0


def _reopened(
    path: Path, about: dict[str, Any], dims: Dims, config: Config, accept_loss: bool, notes: list[str]
) -> Record | None:
    """The record at ``path``, open for writing, without what the replay makes again; None if nothing can be read.

    ``about``, what makes the run now, gets the versions of its earlier parts, ``notes`` messages for the user.
    """
    try:
        record = Record(path, write=True)
    except InUseError:
        raise
    except RunError as error:
        _accept(path, f"{error}; nothing of it can be read", "make them", accept_loss, notes)
        path.unlink()
        return None
    try:
        differ = _refuse_other(record, about, dims)
        record = _whole(record, accept_loss, notes)
        if record.movements > config.movements:
            raise RunError(f"{path} has {record.movements} movements already, {config.movements} were asked for")
        _forget_evaluations(record, config, anew=bool(differ & {*EVALUATES}), notes=notes)
        for table in OF_MODEL:
            record.replace_rows(table, ())
        about["versions"] = _with_earlier(record.about["versions"], about["versions"], notes)
        record.settle(**about)
    except BaseException:
        record.close()
        raise
    return record


def _forget_evaluations(record: Record, config: Config, *, anew: bool, notes: list[str]) -> None:
    """Leave out those that are not wanted now, and what follows one that is missing; all to make them ``anew``."""
    made = list(dict.fromkeys(movements for movements, *_ in record.rows("evaluations")))
    kept = [] if anew else [movements for movements in made if movements in config.evaluations]
    while kept != config.evaluations[: len(kept)]:
        kept.pop()
    if others := [str(movements) for movements in made if movements not in kept]:
        notes.append(f"evaluations after {', '.join(others)} movements are left out, or made again if asked for")
        for table in EVALUATED:
            record.replace_rows(table, [row for row in record.rows(table) if row[0] in kept])


def _refuse_other(record: Record, about: dict[str, Any], dims: Dims) -> set[str]:
    """Refuse what is not the beginning of this run; the names of the settings that differ, but may."""
    if "settings" not in record.about:
        raise RunError(f"{record.path} is a life that Learner.save wrote, not a run; choose another --out")
    before, now = ({**each["settings"], **each["files"]} for each in (record.about, about))
    differ = [name for name in dict.fromkeys((*now, *before)) if before.get(name) != now.get(name)]
    if changed := [name for name in differ if name not in MAY_CHANGE]:
        raise RunError(
            f"{record.path.parent} belongs to another configuration: "
            f"{'; '.join(f'{name} was {before.get(name)}, now {now.get(name)}' for name in changed)}. "
            "Resume it with its own, or give the new variant another --name or --out"
        )
    if record.dims != dims:
        was = f"dims {record.dims} of context, theta, outcome, the robot now has {dims}"
        raise RunError(f"{record.path} was recorded with {was}; has the robot become another one?")
    return {*differ}


def _whole(record: Record, accept_loss: bool, notes: list[str]) -> Record:
    """The record without what is damaged."""
    wrong, path = record.check(), record.path
    if not wrong:
        return record
    notes += [f"{message}; it is made again" for table, message in wrong.items() if table in DERIVED]
    lost = [message for table, message in wrong.items() if table not in DERIVED]
    if not lost:
        return record.rewrite()
    record.close()  # to copy it while it is open would give up its lock
    _accept(path, "; ".join(lost), "keep those before and make the others", accept_loss, notes)
    record = Record(path, write=True).rewrite()
    notes.append(f"{record.movements} movements of {path} are kept, the others are made again")
    return record


def _accept(path: Path, what: str, how: str, accept_loss: bool, notes: list[str]) -> None:
    """Keep a copy of a record that loses movements, or refuse to go on."""
    if not accept_loss:
        raise RunError(f"{what} Restore it, or {how} again with --resume --accept-loss, which keeps a copy")
    copy = next(place for k in count() if not (place := path.with_name(f"run.lost-{k}.sqlite")).exists())
    shutil.copy2(path, copy)
    notes.append(f"{what} It is kept as {copy}")


def _with_earlier(old: dict[str, Any], now: dict[str, Any], notes: list[str]) -> dict[str, Any]:
    """The versions ``now``; those of earlier parts of the run, where they differ, are kept beside them."""
    earlier = old.pop("before", [])
    differ = [name for name, version in now.items() if old.get(name) != version]
    if differ:
        changes = ", ".join(f"{name} {old.get(name)} -> {now[name]}" for name in differ)
        notes.append(f"resumed with other versions: {changes}; only new movements and evaluations are by these")
        earlier = [*earlier, old]
    return {**now, "before": earlier} if earlier else now


def sources(config: Config) -> dict[str, str]:
    """The file of each part of a user's own in a run, and its checksum, such as "toss.py, crc32 8f0a1b2c"."""
    found = {}
    for word in code_of(config.settings):
        load(word)
        if file := getattr(sys.modules[word.partition(":")[0]], "__file__", None):
            found[f"source of {word}"] = f"{Path(file).name}, crc32 {checksum(Path(file))}"
    return found


def versions(*, forward: bool) -> dict[str, Any]:
    """What runs here; ``commit`` is None outside a git repository and ends in "-dirty" when files were changed.

    Args:
        forward: also of the libraries of a forward model, which a run without one does not need.
    """
    here = str(Path(__file__).parent)
    describe = ["git", "-C", here, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        commit = subprocess.run(describe, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        commit = None
    return {
        "python": platform.python_version(),
        **{name.removesuffix("-cpu"): importlib.metadata.version(name) for name in (*LIBRARIES, *FORWARD * forward)},
        "sgimd_torch": sgimd_torch.__version__,
        "platform": platform.platform(),
        "commit": commit,
    }
