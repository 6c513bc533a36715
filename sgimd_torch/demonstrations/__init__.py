"""Demonstrations on disk: recorded joint trajectories, their times and outcomes.

One ``.npz`` file without pickle holds n recordings, one after another. They may differ in length:
    version          ()                   1
    lengths          (n,) int             number of samples of each recording, at least 2
    times            (sum of lengths,) s  increasing within each recording
    trajectories     (sum of lengths, n_joints) rad
    outcomes         (n, outcome_dim) m   landing points of the float
    contexts         (n, context_dim)     (n, 0) in the fishing task
``save_demonstrations`` writes such a file from a list of ``Demonstration``.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.files import read_npz, write_npz
from sgimd_torch.spaces import Array, Demonstration

SHIPPED = Path(__file__).parents[1] / "data" / "demonstrator_3.npz"
_FIELDS = ("lengths", "times", "trajectories", "outcomes", "contexts")


def save_demonstrations(path: str | os.PathLike[str], demonstrations: Sequence[Demonstration]) -> None:
    """Write a file for ``load_demonstrations``; the file appears whole or not at all.

    Raises:
        ValueError: no demonstration, or demonstrations of several robots.
        OSError: ``path`` is a directory, or cannot be written.
    """
    if not demonstrations:
        raise ValueError("there is no demonstration to save")
    fields: dict[str, np.ndarray] = {
        "lengths": np.array([len(d.times) for d in demonstrations]),
        "times": np.concatenate([d.times for d in demonstrations], dtype=np.float64),
        "trajectories": np.concatenate([d.trajectory for d in demonstrations], dtype=np.float64),
        "outcomes": np.stack([d.outcome for d in demonstrations], dtype=np.float64),
        "contexts": np.stack([d.context for d in demonstrations], dtype=np.float64),
    }
    _check(str(path), fields)
    write_npz(path, fields)


def load_demonstrations(
    path: str | os.PathLike[str] = SHIPPED,
    *,
    n_joints: int | None = None,
    outcome_dim: int | None = None,
    context_dim: int | None = None,
) -> list[Demonstration]:
    """Read demonstrations; by default the shipped demonstrations of demonstrator 3, a (simulated) human.

    Args:
        path: ``.npz`` file in the format above.
        n_joints, outcome_dim, context_dim: required dimensions; None accepts any number.

    Raises:
        ValueError: the file has another format, is empty or truncated, has times that do not increase or numbers
            that are not finite, or has other dimensions; the message names the file and the recording.
        OSError: there is no file, or it is a directory.
    """
    source = str(path)
    arrays = read_npz(path, "demonstration file", "save_demonstrations or sgimd demonstrations import", _FIELDS)
    _check(source, dict(zip(_FIELDS, arrays, strict=True)))
    lengths, times, trajectories, outcomes, contexts = arrays
    for name, field, wanted in (
        ("joints", trajectories, n_joints),
        ("outcome dimensions", outcomes, outcome_dim),
        ("context dimensions", contexts, context_dim),
    ):
        if wanted not in (None, field.shape[1]):
            raise ValueError(
                f"{source} has {field.shape[1]} {name}, the robot has {wanted}; was it recorded on another robot?"
            )
    starts = np.cumsum(lengths)[:-1]
    parts = (contexts, np.split(times, starts), np.split(trajectories, starts), outcomes)
    demonstrations: list[Demonstration] = []
    for part in zip(*parts, strict=True):
        try:
            demonstrations.append(Demonstration(*(values.astype(np.float64) for values in part)))
        except ValueError as error:
            raise ValueError(f"{source}: recording {len(demonstrations)}: {error}") from error
    return demonstrations


def _check(source: str, fields: dict[str, Array]) -> None:
    for name, field in fields.items():
        kind, flat = ("integers", True) if name == "lengths" else ("numbers", name == "times")
        if field.dtype.kind not in ("iu" if kind == "integers" else "iuf"):
            raise ValueError(f"{source}: {name} must be {kind}, got {field.dtype}; was text or a list saved?")
        if field.ndim != (1 if flat else 2):
            raise ValueError(f"{source}: {name} has {field.ndim} axes, shape {field.shape}")
    lengths = fields["lengths"]
    n = len(lengths)
    if n == 0:
        raise ValueError(f"{source} holds no demonstration")
    if (lengths < 2).any():
        raise ValueError(f"{source}: recording {int(np.argmax(lengths < 2))} has fewer than 2 samples")
    if not len(fields["outcomes"]) == len(fields["contexts"]) == n:
        rows = f"{len(fields['outcomes'])} outcomes, {len(fields['contexts'])} contexts"
        raise ValueError(f"{source}: {n} recordings, but {rows}")
    total = sum(lengths.tolist())  # numpy's sum may overflow to a small number
    if not len(fields["times"]) == len(fields["trajectories"]) == total:
        rows = f"{len(fields['times'])} times, {len(fields['trajectories'])} postures"
        raise ValueError(f"{source}: lengths add up to {total} samples, but there are {rows}; is it truncated?")
