"""The files of a run directory: what is in each, how the log is laid out, how json is read, and how files are replaced.

    config.json      every choice that makes the run
    versions.json    of Python, the libraries and this repository; "before": those of earlier parts of a resumed run
    episodes.csv     the log, append-only, a line for each movement:
                         index, origin ("" at rest), demonstration (its row in the file, when one came just before),
                         context_*, theta_*, goal_*, outcome_*, crc32 of the fields before it
    evaluation.csv   movements, mean_error_m, median_error_m, p90_error_m, noise_floor_m
    regions.csv      the interest map at each evaluation, a line for each region, corners in C x T
    predictions.csv  with a forward model: what it foretold of each exemplar before it learnt from it, and what happened
    refreshes.csv    with a forward model: a line each time that it has learnt
    summary.json     movements so far, the last evaluation, seconds spent on physics, learning and evaluating
    lock             held by the process that writes

Numbers read back exactly, and no time of day is written: equal seeds make the same csv files, byte for byte. All files
but the log are replaced whole, so that nobody ever reads half of one.

``rundir.py`` writes a run directory, ``read_runs.py`` reads it, ``evaluations.py`` has the two small tables.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgimd_torch.session import Recorded
from sgimd_torch.spaces import Array, Episode


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
        fields += numbers(episode.context, self.context_dim)
        fields += numbers(move.theta if move else None, self.theta_dim)
        fields += numbers(move.goal if move else None, self.outcome_dim)
        fields += numbers(episode.outcome, self.outcome_dim)
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


def numbers(values: Array | None, dim: int) -> list[str]:
    """Fields that read back exactly; ``dim`` empty ones for None."""
    return [""] * dim if values is None else [repr(value) for value in values.tolist()]


def dropped(path: Path, tail: bytes, outlook: str) -> str:
    """The note that ``tail`` was not taken over from a damaged file."""
    n_lines = len(tail.splitlines())
    return f"{path}: dropped {len(tail)} bytes in {n_lines} line(s), torn or damaged; {outlook}"


def read_json(path: Path, *, missing: Any) -> Any:
    """A json object; ``missing`` if there is no such file.

    Raises:
        RunError: it is damaged, or a directory.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return missing
    except (ValueError, OSError) as error:
        raise RunError(f"{path} cannot be read ({error}); was it edited, or the disk full?") from error
    if not isinstance(content, dict):
        raise RunError(f"{path} must hold a json object, got {type(content).__name__}; was it edited?")
    return content


def make_folder(path: Path) -> None:
    """With its parents, where they are missing.

    Raises:
        RunError: something is in the way, or it may not be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        inside = (place for place in (path, *path.parents) if os.path.lexists(place) and not place.is_dir())
        blocker = next(inside, None)
        why = f"{blocker} is no folder" if blocker else f"{error.strerror}"
        raise RunError(f"{path} cannot be made: {why}; choose another --out") from error


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
