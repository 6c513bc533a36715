"""Recordings from a LeRobot dataset (format v2.1 or v3) on disk; videos are not read.

    names = ColumnNames(joints=("observation.state[0:6]",), outcome=("observation.environment_state[0:2]",),
                        time="timestamp", recording="episode_index")
    recordings, unclear = read_lerobot("datasets/my_arm", names)
``meta/info.json`` has the version, the counts and the features. ``data/chunk-000/*.parquet`` and further folders have
a row for each frame; a file of v3 may hold several episodes. The name of an entry, such as ``gripper.pos``, is a
column, too; if several features have such an entry, that of ``observation.state`` is meant.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from difflib import get_close_matches
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.extras.recordings.columns import ColumnNames, Recording, Sheet, recordings_of
from sgimd_torch.extras.recordings.text import POINTER
from sgimd_torch.files import check_regular

try:
    import pyarrow
    import pyarrow.parquet
except ImportError as error:
    raise ImportError(f"a LeRobot dataset needs pyarrow: pip install 'sgimd-torch[lerobot]' ({error})") from error

STATE: Final = "observation.state"  # the feature that is meant if several have an entry of one name
_RECORD_SHARES: Final = ("so100", "so101", "koch", "lekiwi")  # robots that record shares of the ranges of joints


def read_lerobot(root: str | os.PathLike[str], names: ColumnNames) -> tuple[list[Recording], str]:
    """All episodes of a dataset in order, and the reason why their units are unclear ("": none).

    Args:
        root: folder of the dataset, with ``meta`` and ``data``.
        names: names of features or entries; usually the time is ``timestamp``, the recording ``episode_index``.

    Raises:
        ValueError: the folder is no dataset, has another version, lacks a feature, or has not as many episodes and
            frames as ``info.json`` says.
        OSError: a file cannot be read.
    """
    root = Path(root)
    if root.is_file():
        dataset = next(
            (folder for folder in root.absolute().parents if (folder / "meta").is_dir()), "its folder with meta"
        )
        raise ValueError(f"{root} is one file of a LeRobot dataset; name the dataset instead: {dataset}")
    info = _info(root)
    version = str(info.get("codebase_version"))
    if version != "v2.1" and not version.startswith("v3."):
        raise ValueError(f"{root} has format {version[:20]}, v2.1 and v3 can be read; lerobot converts older formats")
    features = info.get("features", {})
    entries = {name: _entries(feature) for name, feature in features.items()}
    joints, outcome, context = (
        tuple(_indexed(name, entries) for name in group) for group in (names.joints, names.outcome, names.context)
    )
    names = replace(names, joints=joints, outcome=outcome, context=context)
    for name in names.columns:
        if name not in features:
            known = [*entries, *chain.from_iterable(entries.values())]
            near = " or ".join(get_close_matches(name, known, 3, 0.0))
            raise ValueError(f"{root} has no feature {name}; did you mean {near}? It has {', '.join(features)}")
    files = sorted((root / "data").glob("*/*.parquet"))
    if not files:
        raise ValueError(f"{root} has no data/chunk-000/*.parquet; were only its videos copied?")
    parts = [_columns(file, names.columns) for file in files]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in names.columns}
    n_rows = len(columns[names.columns[0]])
    recordings = recordings_of(Sheet(root.name, columns, range(n_rows), entries), names)
    for noun, key, n in (("frames", "total_frames", n_rows), ("episodes", "total_episodes", len(recordings))):
        if names.recording == "episode_index" and info.get(key) != n:
            more = isinstance(said := info.get(key), int) and n > said
            slip = "was meta/info.json written before the last ones?" if more else "is a file missing?"
            raise ValueError(f"{root} says {said} {noun}, but {n} were found; {slip}")
    robot = str(info.get("robot_type"))
    records = "records degrees or shares of a joint's range, -100..100, and of the gripper 0..100"
    return recordings, f"a robot {robot} {records}" if any(name in robot for name in _RECORD_SHARES) else ""


def _entries(feature: Any) -> list[str]:
    """Names of the entries of a feature; a list of names may lie in a list, or under a name."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):  # {"motors": [names]}, or {name: number}
        names = [value if isinstance(value, list) else name for name, value in names.items()]
    if not isinstance(names, list):
        return []
    flat = [str(name) for part in names for name in (part if isinstance(part, list) else [part])]
    return flat if flat and feature.get("shape") == [len(flat)] else []


def _indexed(name: str, entries: dict[str, list[str]]) -> str:
    """``feature[k]`` for the name of an entry; another name is left alone."""
    homes = {feature: f"{feature}[{names.index(name)}]" for feature, names in entries.items() if name in names}
    if name in entries or not homes:
        return name
    if any(entries[feature].count(name) > 1 for feature in homes):
        raise ValueError(f"a feature has two entries {name}; write {' or '.join(homes)} with a number, such as [0]")
    if STATE not in homes and len(homes) > 1:
        raise ValueError(f"{name} is an entry of several features; write {' or '.join(homes.values())}")
    return homes.get(STATE, next(iter(homes.values())))


def _info(root: Path) -> dict[str, Any]:
    path = root / "meta/info.json"
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise ValueError(f"{root} is no LeRobot dataset of v2.1 or v3: it has no meta/info.json") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no json: {str(error)[:100]}") from error
    if not isinstance(info, dict) or not isinstance(info.get("features", {}), dict):
        raise ValueError(f"{path} must hold an object with features, got {type(info).__name__}")
    return info


def _columns(file: Path, names: list[str]) -> dict[str, np.ndarray]:
    """Columns of a parquet file by name, as ``(n_rows,)`` values or ``(n_rows, k)`` vectors."""
    check_regular(file)
    with open(file, "rb") as content:
        if content.read(len(POINTER)) == POINTER.encode():
            raise ValueError(f"{file} is a pointer of Git LFS, not the file itself; git lfs pull gets the file")
    try:
        table = pyarrow.parquet.read_table(file, columns=names, page_checksum_verification=True)
        return {name: np.array(table.column(name).to_pylist()) for name in names}
    # ValueError: vectors differ in length.
    except (pyarrow.ArrowException, OSError, ValueError, KeyError) as error:
        raise ValueError(f"{file} cannot be read: {str(error)[:200]}; is it whole, with columns {names}?") from error
