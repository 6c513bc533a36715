"""Opening the record of a run: refuse what is not this run, keep what is whole, say what is not.

record, notes = open_run(build(config), resume=True, accept_loss=False)
A run is the file ``run.sqlite`` in OUT/NAME/seed-003; ``docs/runs.md`` explains its tables.
"""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import sgimd_torch
from sgimd_torch.catalogue import load
from sgimd_torch.files import checksum, make_folder
from sgimd_torch.record import Record, RunError
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.config import Config, code_of, words

FILE: Final = "run.sqlite"
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
    record = None
    if holds_run(path):
        if not resume:
            raise RunError(f"{path.parent} holds a run already; go on with it by --resume, or choose another --out")
        from sgimd_torch.runs.resuming import reopened  # a new run needs nothing of it

        record = reopened(path, about, dims, config, accept_loss, notes)
    elif resume:
        notes.append(f"{path.parent} holds no run yet: it starts from the beginning")
    if record is None:
        record = Record.make(path, dims, about)
    record.replace_rows("goals", ((k, *goal) for k, goal in enumerate(parts.benchmark.goals.tolist())))
    return record, notes


def holds_run(path: Path) -> bool:
    """Whether there is a record; a process that was killed while it made one leaves an empty file."""
    return path.is_file() and path.stat().st_size > 0


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
