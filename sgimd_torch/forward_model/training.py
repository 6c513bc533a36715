"""Online training: repeated fits of an ensemble to a growing set of exemplars; a fit that diverges is undone.

The training uses Lightning Fabric, with one optimiser for all fits, so that Adam's moments last from fit to fit.
    trainer.prepare(); fit = trainer.fit(x, y, scale, steps=15, give_up=2.0)
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import torch
from lightning import Fabric
from lightning.fabric.accelerators import ACCELERATOR_REGISTRY
from lightning.fabric.plugins.environments.lightning import LightningEnvironment

from sgimd_torch.forward_model.ensemble import Ensemble, nll
from sgimd_torch.options.catalogue import did_you_mean

_RECENT: Final = 0.25  # share of every batch that is drawn from the newest exemplars
_BATCH: Final = 128  # number of exemplars in a step, for each member
_HELD_OUT_EVERY: Final = 10  # every tenth exemplar is held out, that is, never trained on
_STEPS_PER_TEST: Final = 20  # number of optimiser steps between two tests on the held-out exemplars
_PATIENCE: Final = 5  # number of tests without improvement after which a fit ends


class Fit(NamedTuple):
    """Result of a fit.

    Attributes:
        steps: number of steps of the optimiser.
        loss: negative log likelihood of the held-out exemplars, in standardised outcomes; lower is better.
        relative_error: error of predictions for the held-out exemplars, see `ForwardModel.relative_error`.
        diverged: true if the fit diverged and the earlier weights were restored.
    """

    steps: int
    loss: float
    relative_error: float
    diverged: bool


@dataclass(eq=False)
class OnlineTrainer:
    """Fits one ensemble many times.

    Args:
        ensemble: networks, whose weights change.
        generator: random stream of the batches; each member has batches of its own.
        newest: number of last exemplars that count as the newest.
        accelerator: Lightning's name of the device that trains, or auto for the CPU.

    Raises:
        ValueError: this machine has no such device.
    """

    ensemble: Ensemble
    generator: torch.Generator
    newest: int
    accelerator: str
    fabric: Fabric | None = field(init=False)
    optimizer: Any = None

    def __post_init__(self) -> None:
        self.fabric = fabric_on(self.accelerator)  # refuses a missing device before the first movement

    def prepare(self) -> Fabric:
        """Move the weights to the device for training and make the optimiser, unless this was done before."""
        if self.fabric is None:
            self.fabric = fabric_on(self.accelerator)
        if self.optimizer is None:
            self.ensemble.to(self.fabric.device)
            self.optimizer = self.fabric.setup_optimizers(self.ensemble.configure_optimizers())
        return self.fabric

    def fit(self, x: torch.Tensor, y: torch.Tensor, scale: torch.Tensor, *, steps: int, give_up: float) -> Fit:
        """Train until predictions for the held-out exemplars, one in ten, stop improving.

        The weights before the fit are restored if it diverges or is interrupted.

        Args:
            x: ``(n, n_inputs)`` standardised inputs, the newest last, on the device of the ensemble.
            y: ``(n, n_outputs)`` standardised outputs.
            scale: ``(n_outputs,)`` factors that turn outputs into the unit of outcomes.
            steps: largest number of steps of the optimiser, at least 1.
            give_up: relative error above which the fit has diverged. A fit with a loss that is not finite has diverged,
                too.
        """
        fabric = self.prepare()
        is_held = torch.arange(len(x)) % _HELD_OUT_EVERY == _HELD_OUT_EVERY - 1
        rows = torch.nonzero(~is_held)[:, 0]
        before = {name: values.clone() for name, values in self.ensemble.state_dict().items()}
        best_loss, n_waited, n_done = math.inf, 0, 0
        try:
            while n_done < steps and n_waited < _PATIENCE:
                n_steps = min(_STEPS_PER_TEST, steps - n_done)
                for _ in range(n_steps):
                    drawn = self._draw(rows)
                    self.optimizer.zero_grad()
                    fabric.backward(self.ensemble.training_step((x[drawn], y[drawn])))
                    self.optimizer.step()
                n_done += n_steps
                loss, error = self.score(x[is_held], y[is_held], scale)
                if not (math.isfinite(loss) and error <= give_up):
                    self._restore(before)
                    return Fit(n_done, *self.score(x[is_held], y[is_held], scale), diverged=True)
                best_loss, n_waited = (loss, 0) if loss < best_loss else (best_loss, n_waited + 1)
        except BaseException:
            self._restore(before)
            raise
        return Fit(n_done, loss, error, diverged=False)

    def score(self, x: torch.Tensor, y: torch.Tensor, scale: torch.Tensor) -> tuple[float, float]:
        """Two numbers: the mean negative log likelihood of the members; and the error of their mean prediction, divided
        by the error of always predicting the mean of ``y``."""
        with torch.no_grad():
            mean, log_variance = self.ensemble(x)
            lengths = scale * torch.stack([mean.mean(dim=0) - y, y.mean(dim=0) - y])
            error = torch.div(*lengths.norm(dim=-1).mean(dim=-1).clamp(min=torch.finfo().tiny))
            return float(nll(mean, log_variance, y).mean()), float(error)

    def __getstate__(self) -> dict[str, Any]:
        """State for copies and other processes, without the optimiser."""
        return {**self.__dict__, "fabric": None, "optimizer": None}

    def _draw(self, rows: torch.Tensor) -> torch.Tensor:
        """Random rows ``(members, batch)``; the first quarter of each batch is drawn from the newest exemplars."""
        members, recent, n_recent = self.ensemble.members, rows[-self.newest :], round(_RECENT * _BATCH)
        drawn = rows[torch.randint(len(rows), (members, _BATCH), generator=self.generator)]
        drawn[:, :n_recent] = recent[torch.randint(len(recent), (members, n_recent), generator=self.generator)]
        return drawn

    def _restore(self, weights: dict[str, torch.Tensor]) -> None:
        """Restore these weights, with a new optimiser, because the old moments belong to other weights."""
        self.ensemble.load_state_dict(weights)
        self.optimizer = None


def fabric_on(accelerator: str) -> Fabric:
    """Fabric on one device of this process, whatever launcher has started the process.

    Args:
        accelerator: Lightning's name of the device, or auto for the CPU.

    Raises:
        ValueError: this machine has no such device, or torch cannot use it.
    """
    name = "cpu" if accelerator == "auto" else accelerator
    # ``fabric run`` leaves its choices in such variables, which Fabric would prefer to these arguments.
    hidden = {name: os.environ.pop(name) for name in [*os.environ] if name.startswith("LT_")}
    try:
        fabric = Fabric(accelerator=name, devices=1, plugins=[LightningEnvironment()])
        torch.zeros(1, device=fabric.device)  # a device may be found that torch cannot use
    except (RuntimeError, ValueError, ImportError) as error:
        known = ACCELERATOR_REGISTRY.available_accelerators()
        usable = [word for word in known if ACCELERATOR_REGISTRY[word]["accelerator"].is_available()]
        elsewhere = f"; is it meant for another machine, or is torch {torch.__version__} built without {accelerator}?"
        slip = elsewhere if accelerator in (*known, "gpu") else did_you_mean(accelerator, ["auto", *known])
        devices = " or ".join(["auto", *usable])
        raise ValueError(f"accelerator must be {devices} on this machine, got {accelerator!r}{slip}") from error
    finally:
        os.environ.update(hidden)
    return fabric


@contextmanager
def one_thread() -> Iterator[None]:
    """One thread of torch in a block or a decorated function, because sums of several threads round differently."""
    before = torch.get_num_threads()
    if before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
