"""Recordings from a LeRobot dataset (format v3) on disk; videos are not read.

    columns = Columns(joints=("observation.state[0:6]",), outcome=("observation.environment_state[0:2]",),
                      time="timestamp", recording="episode_index")
    shown = read_lerobot("datasets/my_arm", columns)
``meta/info.json`` has the version, the counts and the features. ``data/chunk-000/file-000.parquet`` and further files
have a row for each frame; one file may hold several episodes.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from sgimd_torch.demonstrations.columns import Columns, recordings
from sgimd_torch.spaces import Demonstration

try:
    import pyarrow
    import pyarrow.parquet
except ImportError as error:
    raise ImportError(f"a LeRobot dataset needs pyarrow: pip install 'sgimd-torch[lerobot]' ({error})") from error


def read_lerobot(root: str | os.PathLike[str], columns: Columns) -> list[Demonstration]:
    """Read all episodes of a dataset, in order.

    Args:
        root: folder of the dataset, with ``meta`` and ``data``.
        columns: names of features; usually the time is ``timestamp``, and the recording is ``episode_index``.

    Raises:
        ValueError: the folder is no dataset, has another version, lacks a feature, has not as many episodes and frames
            as ``info.json`` says, or has an episode that `recordings` refuses.
        OSError: a file cannot be read.
    """
    root = Path(root)
    info = _info(root / "meta" / "info.json")
    version = str(info.get("codebase_version"))
    if not version.startswith("v3."):
        raise ValueError(f"{root} has format {version[:20]}, this library reads v3; lerobot converts older formats")
    missing = [name for name in columns.plain if name not in info.get("features", ())]
    if missing:
        raise ValueError(f"{root} has no feature {', '.join(missing)}; it has {', '.join(info.get('features', ()))}")
    files = sorted((root / "data").glob("*/*.parquet"))
    if not files:
        raise ValueError(f"{root} has no data/chunk-000/file-000.parquet; were only its videos copied?")
    parts = [_columns(file, columns.plain) for file in files]
    table = {name: np.concatenate([part[name] for part in parts]) for name in columns.plain}
    found = recordings(str(root), table, columns)
    rows = len(table[columns.time])
    for what, said, read in (("frames", "total_frames", rows), ("episodes", "total_episodes", len(found))):
        if info.get(said) != read:
            raise ValueError(f"{root} says {info.get(said)} {what}, but {read} were found; is a file missing?")
    return found


def _info(path: Path) -> dict[str, Any]:
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise ValueError(f"{path.parents[1]} is no LeRobot dataset: it has no meta/info.json") from None
    except ValueError as error:
        raise ValueError(f"{path} is no json: {str(error)[:100]}") from error
    if not isinstance(info, dict):
        raise ValueError(f"{path} must hold an object, got {type(info).__name__}")
    return info


def _columns(file: Path, names: list[str]) -> dict[str, np.ndarray]:
    """Columns of a parquet file by name, as ``(n_rows,)`` values or ``(n_rows, k)`` vectors."""
    try:
        table = pyarrow.parquet.read_table(file, columns=names, page_checksum_verification=True)
        return {name: np.array(table.column(name).to_pylist()) for name in names}
    except (pyarrow.ArrowException, OSError, ValueError, KeyError) as error:  # ValueError: vectors differ in length
        raise ValueError(f"{file} cannot be read: {str(error)[:200]}; is it whole, with columns {names}?") from error
