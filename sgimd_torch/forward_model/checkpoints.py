"""Checkpoints of the forward model of a run, which a replay loads instead of training again.

checkpoints = Checkpoints(directory); checkpoints.write("last", model, refresh)
ForwardModel.load_from_checkpoint(directory / "checkpoints/last.ckpt")  # they are Lightning's
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import torch

from sgimd_torch import __version__
from sgimd_torch.files import make_folder, replacing
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.record import Row, RunError


@dataclass(frozen=True)
class Checkpoints:
    """Checkpoints of a run: ``checkpoints/last.ckpt``, and files such as ``checkpoints/000500.ckpt``.

    Args:
        directory: directory of the run.
        at_evaluations: whether to write one at each evaluation, too.
    """

    directory: Path
    at_evaluations: bool = False

    def write(self, name: str, model: ForwardModel, refresh: Row) -> None:
        """Write a checkpoint of ``model`` after the ``refresh`` with this row in the record.

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
        make_folder(self.directory / "checkpoints")
        with replacing(self.directory / "checkpoints" / f"{name}.ckpt") as partial:
            torch.save(checkpoint, partial)

    def newest(self, model: ForwardModel, refreshes: Sequence[Row], span: tuple[float, float]) -> dict[str, Any]:
        """The newest checkpoint of a refresh in ``span`` that a replay can load instead of training; {}: none.

        If the model has guided the learner before, each of these movements depends on the model of its time.

        Args:
            model: model freshly built from the settings of the run.
            refreshes: rows of this table in the record of the run.
            span: number of movements, above the first and up to the second.

        Raises:
            RunError: a checkpoint is damaged, or of another run, robot, network or version.
        """
        # "last" comes first, then the evaluations from the last to the first.
        paths = sorted((self.directory / "checkpoints").glob("*.ckpt"), reverse=True) if span[1] > 0 else []
        for path in paths:
            if path.stem == "last" or (path.stem.isdigit() and int(path.stem) <= span[1]):
                checkpoint = _read(path, model)
                refresh = tuple(checkpoint["refresh"])
                if span[0] < refresh[0] <= span[1]:
                    if refresh not in refreshes:
                        raise RunError(f"{path} is of another run")
                    return {} if checkpoint["guides"] else checkpoint
        return {}


def _read(path: Path, model: ForwardModel) -> dict[str, Any]:
    """A checkpoint that ``model`` can load; RunError: it cannot."""
    try:
        checkpoint: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        made_by, made_with, weights = (checkpoint[name] for name in ("made_by", "hyper_parameters", "state_dict"))
        shapes = {name: values.shape for name, values in weights.items()}
        complete = {"refresh", "guides", "online"} <= checkpoint.keys()
    except Exception as error:  # torch raises many kinds
        raise RunError(f"{path} cannot be read as a checkpoint: {str(error).partition(chr(10))[0]}") from error
    if made_by != __version__ or not complete:
        raise RunError(f"{path} was written by version {made_by}, this is {__version__}")
    own = dict(model.hparams)
    if others := [name for name in {**own, **made_with} if made_with.get(name) != own.get(name)]:
        told = ", ".join(f"{name} {made_with.get(name)}, here {own.get(name)}" for name in others)
        raise RunError(f"{path} is of another model: {told}")
    if shapes != {name: values.shape for name, values in model.state_dict().items()}:
        raise RunError(f"{path} has weights of other shapes; was the network changed?")
    return checkpoint
