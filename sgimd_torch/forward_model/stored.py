"""The file of a forward model: safetensors, whose header says what the model is and has a checksum of it all.

    header    "version" "2"; "model", JSON: context_dim, theta_dim, outcome_dim, members, hidden, noise_heads;
              "sha256", of "model" and of the names, types, shapes and numbers of the tensors
    tensors   weights.k and biases.k of layer k, scales and counts, as ``ForwardModel`` names them
Files of version 1 have no checksum and are refused.
    write_model(path, {"context_dim": 0, ...}, model.state_dict()); about, state = read_model(path)
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

try:
    import torch
    from safetensors import SafetensorError, safe_open
    from safetensors.torch import save
except ImportError as error:
    raise ImportError(f"the forward model needs torch: pip install 'sgimd-torch[forward]' ({error})") from error

from sgimd_torch.files import write_bytes
from sgimd_torch.spaces import check_count

VERSION: Final = 2
_COUNTS: Final = {"context_dim": 0, "theta_dim": 1, "outcome_dim": 1, "members": 1}  # and the least of each


def write_model(path: str | os.PathLike[str], about: Mapping[str, Any], state: Mapping[str, torch.Tensor]) -> None:
    """Replace ``path``; ``about`` and ``state`` as ``read_model`` gives them.

    Raises:
        OSError: ``path`` is a directory, or cannot be written.
    """
    state, model = {name: values.cpu().contiguous() for name, values in state.items()}, json.dumps(dict(about))
    header = {"version": str(VERSION), "model": model, "sha256": _checksum(model, state)}
    write_bytes(path, save(state, header))


def read_model(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    """The dimensions and shape of the model in a file, and its tensors by name.

    What the header says is checked against the shapes of the tensors before any of them is read.

    Raises:
        ValueError: not such a file, truncated or changed, of another version, or with numbers that no model has.
        OSError: there is no file, or it may not be read.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no forward model {path}")
    path.open("rb").close()  # says why it may not be read
    try:
        with safe_open(str(path), framework="pt") as file:
            header = file.metadata() or {}
            _check_version(path, header.get("version"))
            about = _about(path, header)
            _check_shapes(path, about, {name: file.get_slice(name) for name in file.keys()})  # noqa: SIM118, it is no dict
            state = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except SafetensorError as error:
        raise ValueError(f"{path} is no forward model, or was truncated: {str(error)[:100]}") from error
    if header.get("sha256") != _checksum(header["model"], state):
        raise ValueError(f"{path} is damaged: its checksum is another; was it changed after it was saved?")
    _check_numbers(path, state)
    return about, state


def _checksum(model: str, state: Mapping[str, torch.Tensor]) -> str:
    total = hashlib.sha256(model.encode())
    for name, values in sorted(state.items()):
        total.update(f"\n{name} {values.dtype} {list(values.shape)}\n".encode())
        total.update(values.numpy().data)
    return total.hexdigest()


def _check_version(path: Path, version: str | None) -> None:
    if version == "1":
        slip = "train the model again from the memory, as a run does when it is resumed"
        raise ValueError(f"{path} has version 1, which has no checksum, this library reads {VERSION}; {slip}")
    if version != str(VERSION):
        raise ValueError(f"{path} has version {str(version)[:40]}, this library reads {VERSION}")


def _about(path: Path, header: Mapping[str, str]) -> dict[str, Any]:
    try:
        said = json.loads(header["model"])
        about = {name: check_count(name, said[name], least) for name, least in _COUNTS.items()}
        hidden, noise_heads = said["hidden"], said["noise_heads"]
        if not isinstance(hidden, list) or not hidden or not isinstance(noise_heads, bool):
            raise ValueError("hidden must be a list of counts, noise_heads true or false")
        return {**about, "hidden": [check_count("hidden", units, 1) for units in hidden], "noise_heads": noise_heads}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} does not say what model it holds: {str(error)[:100]}") from error


def _check_shapes(path: Path, about: Mapping[str, Any], slices: Mapping[str, Any]) -> None:
    inputs, outputs, members = about["context_dim"] + about["theta_dim"], about["outcome_dim"], about["members"]
    wanted: dict[str, tuple[str, list[int]]] = {"n_seen": ("I64", []), "missed": ("F32", [])}
    for name, dim in {"input": inputs, "outcome": outputs}.items():
        wanted |= {f"{name}_mean": ("F32", [dim]), f"{name}_scale": ("F32", [dim])}
    for k, (n_in, n_out) in enumerate(itertools.pairwise([inputs, *about["hidden"], 2 * outputs])):
        wanted |= {f"weights.{k}": ("F32", [members, n_in, n_out]), f"biases.{k}": ("F32", [members, 1, n_out])}
    found = {name: (values.get_dtype(), values.get_shape()) for name, values in slices.items()}
    for name in sorted({*wanted, *found}):
        if wanted.get(name) != found.get(name):
            slip = f"{name[:40]} should be {wanted.get(name, 'missing')}, is {found.get(name, 'missing')}"
            raise ValueError(f"{path} holds weights of another shape than it says: {slip}")


def _check_numbers(path: Path, state: Mapping[str, torch.Tensor]) -> None:
    if not all(torch.isfinite(values).all() for values in state.values()):
        raise ValueError(f"{path} holds weights that are not finite; was it saved while training diverged?")
    for name in ("input_scale", "outcome_scale"):
        if not (state[name] > 0).all():
            raise ValueError(f"{path} holds {name} that is not positive: {state[name].min()}")
    for name in ("n_seen", "missed"):
        if state[name] < 0:
            raise ValueError(f"{path} holds a negative {name}: {state[name]}")
