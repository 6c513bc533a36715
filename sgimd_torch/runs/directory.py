"""Open the record of a run; refuse a record of another run.

record, notes = open_run(build(config), resume=True)
A run is the file ``run.sqlite`` in OUT/NAME/seed-003; ``docs/runs.md`` explains its tables.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

import sgimd_torch
from sgimd_torch.calls import function_of
from sgimd_torch.environments.protocol import Environment, FromFiles
from sgimd_torch.files import checksum, make_folder
from sgimd_torch.options.catalogue import OURS, WORDS, load_word, rooms_of
from sgimd_torch.options.config import Config, differ, words
from sgimd_torch.record import Dims, Record, RunError
from sgimd_torch.rooms import rooms
from sgimd_torch.runs.build import build
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.run_parts import RunParts

RUN_FILE: Final = "run.sqlite"
CODE: Final = (*WORDS, "evaluated_by", *(name for room in rooms().values() for name in getattr(room, "CODE", ())))
"""Last words of options that may name code of a user, as ``package.module:attribute``."""
THREADS: Final = "environment.threads"
DEVICE: Final = "inverse.accelerator"
EVALUATES: Final = ("evaluated_by", "repeats", "floor_at", "benchmark_crc32")  # equal options of all evaluations
LONGEST: Final = 504  # bytes, longest path of a file that SQLite opens
LIBRARIES: Final = ("numpy", "scipy", "faiss-cpu", "mujoco")
FORWARD: Final = ("torch", "lightning")  # libraries of a forward model
EVALUATED: Final = ("evaluations", "errors", "regions")  # tables that each evaluation adds to
OF_MODEL: Final = ("predictions", "refreshes")  # tables that a forward model adds to; it also clears them


@cache
def not_compared() -> frozenset[str]:
    """Settings in which runs may differ: they name, show or speed up a run."""
    return frozenset({"seed", "out", "name", THREADS, DEVICE}).union(
        *(hook.may_change for hook in _hooks() if not hook.compared)
    )


@cache
def may_change() -> frozenset[str]:
    """Options that may change when a run is resumed, as they do not affect the learner. Files are compared by their
    checksums: the demonstrations must be equal, the benchmark may be another one."""
    own = {"movements", "out", "name", "failures", "evaluate_at", *EVALUATES, THREADS, DEVICE}
    return frozenset(own.union(*(hook.may_change for hook in _hooks())))


def _hooks() -> list[Any]:
    return [load_word("hook", word) for word in WORDS["hook"]]


def open_run(parts: RunParts, *, resume: bool) -> tuple[Record, list[str]]:
    """The record of a run, open for writing, and messages. The file does not change before the first commit.

    Args:
        parts: parts of the run; its configuration has the directory.
        resume: whether to continue an existing run; if False, an existing run is an error.

    Raises:
        RunError: there is a run and ``resume`` is False; the run has other settings, or more movements; the file is
            damaged or no record; another process is writing it.
        OSError: the file cannot be written.
    """
    config, robot, goals = parts.config, parts.environment, parts.benchmark.goals
    spaces = {"contexts": robot.contexts, "policies": robot.policies, "outcomes": robot.outcomes}
    path, notes = config.directory / RUN_FILE, list[str]()
    about: dict[str, Any] = {
        "settings": config.settings,
        "folder": os.getcwd(),
        "files": parts.data,
        "versions": versions_of(parts),
        "robot": type(robot).__name__,
        "words": words(config),
        "tolerance": parts.learner.problem.tolerance,
        "robots": parts.robots,
        "rooms": rooms_of((part.kind, part.word) for part in config.chosen.values() if part.kind != "hook"),
        "ended_early": None,
        "spaces": {n: [b.low.tolist(), b.high.tolist(), b.names, b.unit, b.periodic] for n, b in spaces.items()},
    }
    dims = parts.learner.problem.dims
    if len(os.fsencode(path.resolve())) > LONGEST:
        raise ValueError(
            f"the path {str(path)[:100]}... has more than {LONGEST} bytes; choose a shorter --out or --name"
        )
    make_folder(config.directory)
    if record_of(config) is None:
        if resume:
            notes.append(f"{path.parent} holds no run yet: the run starts from the beginning")
        record = Record.make(path, dims, about)
        if parts.prior is not None:
            exemplars = parts.prior.contexts, parts.prior.thetas, parts.prior.outcomes
            record.replace_rows("prior", np.concatenate(exemplars, axis=1).tolist())
    elif resume:
        record = _reopened(path, about, dims, parts, notes)
    else:
        raise RunError(f"{path.parent} already holds a run; continue it with --resume, or choose another --out")
    record.replace_rows("goals", ((k, *goal) for k, goal in enumerate(goals.tolist())))
    return record, notes


def with_found_earlier(config: Config) -> Config:
    """The settings, with what the robot found by movements when this run began, if the run is on disk."""
    names = {
        f"environment.{name}" for name in getattr(function_of(config.chosen["environment"].make), "FOUND_OPTIONS", ())
    }
    path = record_of(config) if names else None
    if path is None:
        return config
    with Record(path) as record:
        before = record.about.get("settings", {})
        others = changed_settings(before, config.settings, record.about.get("folder", ""))
    if any(name.startswith("environment") for name in {*others} & config.settings.keys() - names - not_compared()):
        return config  # it is another robot's run
    earlier = {name: before[name] for name in names & before.keys() if name not in dict(config.parts)}
    return Config.from_settings({**config.settings, **earlier})


def changed_settings(before: Mapping[str, Any], now: Mapping[str, Any], folder: str) -> list[str]:
    """Names of the settings that differ; relative paths of the settings ``before`` begin in ``folder``."""

    def are_one_path(one: Any, other: Any) -> bool:
        both = isinstance(one, str) and isinstance(other, str)
        return both and os.path.realpath(os.path.join(folder, one)) == os.path.realpath(other)

    pairs = {name: (before.get(name), now.get(name)) for name in (*now, *before)}
    return [name for name, pair in pairs.items() if differ(*pair) and not are_one_path(*pair)]


def record_of(config: Config) -> Path | None:
    """The record of a run, if it is on disk; a process killed at the very beginning leaves an empty file."""
    path = config.directory / RUN_FILE
    return path if path.is_file() and path.stat().st_size > 0 else None


def build_again(config: Config, record: Path | None) -> RunParts:
    """Build the parts of a run on disk; if this machine lacks the device that trained its model, the CPU trains it.

    Args:
        config: settings of the run.
        record: record of the run; None: the run is not on disk, so a missing device is an error.

    Raises:
        ValueError, FileNotFoundError: see ``build``.
        RunError: a file that the run on disk needs is gone.
    """
    try:
        return build(config, record)
    except FileNotFoundError as error:
        if record is None:
            raise
        raise RunError(f"{record.parent} needs {error.filename}, which is gone; put it back") from error
    except ValueError as error:
        if record is None or config.values.get(DEVICE, "auto") == "auto":
            raise
        parts = build(replace(config, parts={**dict(config.parts), DEVICE: "auto"}), record)
        say(f"the CPU trains the forward model of this record: {error}")
        return parts


def _reopened(path: Path, about: dict[str, Any], dims: Dims, parts: RunParts, notes: list[str]) -> Record:
    """The record at ``path``, open for writing, without the tables that the replay fills again.

    ``about`` describes the run now, and gets the versions of earlier parts of the run. ``notes`` gets messages.
    """
    record, config = Record(path, write=True), parts.config
    try:
        others = _refuse_other(record, about, dims)
        if record.movements > config.movements:
            raise RunError(f"{path} has {record.movements} movements already, {config.movements} were requested")
        if others & {name for part in config.chosen.values() if part.kind == "hook" for name in part.options}:
            record.about["ended_early"] = None
        about["ended_early"] = record.about["ended_early"]
        earlier_goals, goals = np.array([goal for _, *goal in record.rows("goals")]), parts.benchmark.goals
        anew = bool(others & {*EVALUATES}) or len(earlier_goals) != len(goals) or not np.allclose(earlier_goals, goals)
        _forget_evaluations(record, parts, anew=anew, notes=notes)
        if not parts.learner.problem.trained:
            for table in OF_MODEL:
                record.replace_rows(table, ())
        versions = record.about["versions"]
        earlier = versions.pop("before", [])
        if changes := changed_versions(versions, about["versions"]):
            notes.append(f"resumed with other versions: {changes}; only new movements and evaluations use them")
            earlier = [*earlier, versions]
        about["versions"] |= {"before": earlier} if earlier else {}
        record.about |= about
    except BaseException:
        record.close()
        raise
    return record


def has_ended(record: Record, parts: RunParts) -> bool:
    """Whether no movement is left to make, or to make again for a hook."""
    ended = record.movements >= parts.config.movements or record.about["ended_early"] is not None
    return ended and not any(hook.needs_episodes for hook in parts.hooks)


def _forget_evaluations(record: Record, parts: RunParts, *, anew: bool, notes: list[str]) -> None:
    """Drop evaluations that are not requested, and all after the first missing one; with ``anew``, drop all."""
    config, made = parts.config, list(dict.fromkeys(movements for movements, *_ in record.rows("evaluations")))
    requested = sorted({*config.evaluations, *(record.about["ended_early"] or [])[:1]})
    first_missing = min(parts.missing(made, requested), default=math.inf)
    kept = [] if anew else [n for n in made if n < first_missing and parts.due(n, requested)]
    ended = record.about["settings"]["movements"]
    if config.floor_at is None and ended != config.movements:  # this run ends later, so noise is not measured there
        kept = [movements for movements in kept if movements != ended]
    if others := [str(movements) for movements in made if movements not in kept]:
        notes.append(f"evaluations after {', '.join(others)} movements are dropped, or repeated if requested")
        for table in EVALUATED[:-1] if has_ended(record, parts) else EVALUATED:  # regions cannot be had again
            record.replace_rows(table, [row for row in record.rows(table) if row[0] in kept])


def _refuse_other(record: Record, about: dict[str, Any], dims: Dims) -> set[str]:
    """Refuse a record of another run; return the names of the settings that differ and are allowed to differ."""
    if "settings" not in record.about:
        raise RunError(f"{record.path} is a life that save_life wrote, not a run; choose another --out")
    before, now = ({**told["settings"], **told["files"]} for told in (record.about, about))
    others = changed_settings(before, now, record.about.get("folder", ""))
    if changed := [name for name in others if name not in may_change() and f"{name}_crc32" not in about["files"]]:
        raise RunError(
            f"{record.path.parent} belongs to another configuration: "
            f"{'; '.join(f'{name} was {before.get(name)}, now {now.get(name)}' for name in changed)}. "
            "Resume it with its own settings, or give the new variant another --name or --out"
        )
    if record.dims != dims:
        was = f"dims {record.dims} of context, theta and outcome, the robot now has {dims}"
        raise RunError(f"{record.path} was recorded with {was}; is this another robot?")
    return {*others}


def changed_versions(old: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """The versions that differ, such as "torch 2.5.1 -> 2.6.0"; "" if none does."""
    return ", ".join(
        f"{name} {old.get(name)} -> {version}" for name, version in now.items() if old.get(name) != version
    )


def versions_of(parts: RunParts) -> dict[str, Any]:
    """Versions of all that a run depends on, and the device that trains its forward model.

    ``commit`` is None outside a git repository and ends in "-dirty" if files have changed.
    """
    describe, here = ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"], Path(__file__).parent
    try:
        done = subprocess.run(describe, cwd=here, capture_output=True, text=True, check=True, timeout=10)
        commit = done.stdout.strip()
    except (OSError, subprocess.SubprocessError):
        commit = None
    trained = parts.learner.problem.trained
    devices = [("device", part.device) for part in trained if part.device]
    libraries = (*LIBRARIES, *FORWARD) if trained else LIBRARIES
    return {
        "python": platform.python_version(),
        **{name.removesuffix("-cpu"): importlib.metadata.version(name) for name in libraries},
        "sgimd_torch": sgimd_torch.__version__,
        "platform": platform.platform(),
        "commit": commit,
        **dict(devices),
        **sources(parts.config, parts.environment),
    }


def sources(config: Config, robot: Environment) -> dict[str, str]:
    """File and checksum of the module of each part of the user's own, such as "toss.py, crc32 8f0a1b2c", and of its
    robot's files."""
    files = robot.files if isinstance(robot, FromFiles) else ()
    root = os.path.commonpath([path.parent for path in files]) if files else ""
    checksums = {f"file {path.relative_to(root)}": f"crc32 {checksum(path)}" for path in files}
    for word in code_of(config.settings):
        spec = importlib.util.find_spec(word.partition(":")[0])
        if spec is not None and spec.has_location and spec.origin:
            path = Path(spec.origin)
            checksums[f"source of {word}"] = f"{path.name}, crc32 {checksum(path)}"
    return checksums


def code_of(settings: Mapping[str, Any]) -> list[str]:
    """Places ``package.module:attribute`` in ``settings`` that are a user's own code."""
    named = [value for name, value in settings.items() if name.rpartition(".")[2] in CODE]
    words = [word for value in named for word in (value if isinstance(value, list) else [value])]
    return sorted({word for word in words if isinstance(word, str) and ":" in word and word not in OURS})
