"""The checkpoint of a run's forward model, which can be loaded instead of training again.

write_checkpoint(directory, model, refresh); ForwardModel.load_from_checkpoint(directory / CHECKPOINT)  # Lightning's
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Any, Final

import lightning
import torch

from sgimd_torch import __version__
from sgimd_torch.files import make_folder, replacing
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.record import Row, RunError

CHECKPOINT: Final = "checkpoints/last.ckpt"  # in the directory of a run


def write_checkpoint(directory: Path, model: ForwardModel, refresh: Row) -> None:
    """Write the checkpoint of ``model`` after the ``refresh`` with this row in the record of the run in ``directory``.

    Raises:
        OSError: the file cannot be written.
    """
    checkpoint = {
        "pytorch-lightning_version": lightning.__version__,
        "made_by": __version__,
        "state_dict": model.state_dict(),
        "hyper_parameters": dict(model.hparams),
        "refresh": list(refresh),
        "guides": model.guides,
    }
    model.on_save_checkpoint(checkpoint)
    checkpoint["crc32"] = _crc32(checkpoint)
    path = directory / CHECKPOINT
    make_folder(path.parent)
    with replacing(path) as partial:
        torch.save(checkpoint, partial)


def read_checkpoint(directory: Path, model: ForwardModel, refreshes: Sequence[Row]) -> dict[str, Any]:
    """The checkpoint of the run in ``directory``, if it was made at one of these ``refreshes``; {}: there is none.

    Args:
        directory: directory of the run.
        model: model freshly built from the settings of the run.
        refreshes: first rows of this table in the record of the run.

    Raises:
        RunError: the checkpoint is damaged, or of another run, robot, network or version.
    """
    path = directory / CHECKPOINT
    if not refreshes or not path.exists():
        return {}
    try:
        checkpoint: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        written, right = checkpoint.pop("crc32", None), _crc32(checkpoint)
        made_by, made_with, weights = (checkpoint[name] for name in ("made_by", "hyper_parameters", "state_dict"))
        shapes = {name: values.shape for name, values in weights.items()}
        complete = {"refresh", "guides", "online"} <= checkpoint.keys()
    except Exception as error:  # torch raises many kinds
        raise RunError(f"{path} cannot be read as a checkpoint: it is damaged, or another file") from error
    if made_by != __version__ or not complete:
        raise RunError(f"{path} was written by version {made_by}, this is {__version__}")
    if written != right:
        raise RunError(f"{path} is not what was written: its weights or other values were changed")
    own = dict(model.hparams)
    if others := [name for name in {**own, **made_with} if made_with.get(name) != own.get(name)]:
        told = ", ".join(f"{name} {made_with.get(name)}, here {own.get(name)}" for name in others)
        raise RunError(f"{path} is of another model: {told}")
    if shapes != {name: values.shape for name, values in model.state_dict().items()}:
        raise RunError(f"{path} has weights of other shapes; was the network changed?")
    if (refresh := tuple(checkpoint["refresh"])) in refreshes:
        return checkpoint
    if refresh[0] <= refreshes[-1][0]:
        raise RunError(f"{path} is of another run")
    return {}


def _crc32(value: Any, crc: int = 0) -> int:
    """Checksum of the content of a checkpoint: tensors, and what dictionaries and lists have."""
    if isinstance(value, torch.Tensor):
        crc = zlib.crc32(f"{value.dtype}{value.shape}".encode(), crc)
        return zlib.crc32(value.detach().cpu().numpy().tobytes(), crc)
    if isinstance(value, dict):
        return reduce(lambda crc, item: _crc32([*item], crc), value.items(), crc)
    if isinstance(value, list | tuple):
        return reduce(lambda crc, each: _crc32(each, crc), value, crc)
    return zlib.crc32(repr(value).encode(), crc)
