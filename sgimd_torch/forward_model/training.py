"""Online training: an ensemble is fitted again and again while exemplars come in, and goes back when it diverges.

It uses Lightning Fabric, with one optimiser for all fits, so that Adam's moments last from one fit to the next.
    trainer.prepare(); fit = trainer.fit(x, y, scale, steps=15, give_up=2.0)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import torch
from lightning import Fabric

from sgimd_torch.forward_model.ensemble import Ensemble, nll

RECENT: Final = 0.25  # share of every batch that is drawn from the newest exemplars
_BATCH: Final = 128  # exemplars per step, for each member
_HELD_OUT_EVERY: Final = 10  # the last of this many exemplars is held out: never trained on
_STEPS_PER_LOOK: Final = 20  # of the optimiser, between two looks at what is held out
_PATIENCE: Final = 5  # looks without improvement that end a fit


class Fit(NamedTuple):
    """How a fit ended: ``steps`` made; for the held-out exemplars ``loss``, the negative log likelihood, and
    ``relative_error``; and whether it ``diverged``, so that the weights before it are kept."""

    steps: int
    loss: float
    relative_error: float
    diverged: bool


@dataclass(eq=False)
class OnlineTrainer:
    """Fits one ensemble many times.

    Args:
        ensemble: its weights change.
        generator: draws the batches, of each member its own.
        newest: how many exemplars count as new.
        focus: share of every batch that is drawn from the exemplars that a fit favours.
        accelerator: Lightning's name of where to train.
    """

    ensemble: Ensemble
    generator: torch.Generator
    newest: int
    focus: float
    accelerator: str
    fabric: Fabric | None = None
    optimizer: Any = None

    def prepare(self) -> Fabric:
        """Move the weights to where they are trained, and make the optimiser, unless that is done."""
        if self.fabric is None:
            self.fabric = Fabric(accelerator=self.accelerator, devices=1)
            self.ensemble.to(self.fabric.device)
        if self.optimizer is None:
            self.optimizer = self.fabric.setup_optimizers(self.ensemble.configure_optimizers())
        return self.fabric

    def fit(
        self,
        x: torch.Tensor,
        y: torch.Tensor,
        scale: torch.Tensor,
        *,
        steps: int,
        give_up: float,
        favoured: torch.Tensor | None = None,
    ) -> Fit:
        """Train until predictions for the held-out exemplars, one in ten, do not improve.

        Goes back to the weights before it if it diverges, and also when it is interrupted.

        Args:
            x, y: ``(n, n_inputs)`` and ``(n, n_outputs)``, standardised, the newest last, where `prepare` moved the
                ensemble.
            scale: ``(n_outputs,)`` by which outputs are multiplied to measure distances.
            steps: the most steps of the optimiser, at least 1.
            give_up: relative error above which the fit has diverged, as it has when the loss is not finite.
            favoured: ``(k,)`` rows of x and y, for ``focus``.
        """
        fabric = self.prepare()
        is_held = torch.arange(len(x)) % _HELD_OUT_EVERY == _HELD_OUT_EVERY - 1
        rows = torch.nonzero(~is_held)[:, 0]
        shares = [(rows[-self.newest :], round(RECENT * _BATCH))]
        if favoured is not None:
            shares.append((favoured[~is_held[favoured]], round(self.focus * _BATCH)))
        before = {name: values.clone() for name, values in self.ensemble.state_dict().items()}
        best, waited, done = math.inf, 0, 0
        try:
            while done < steps and waited < _PATIENCE:
                n_steps = min(_STEPS_PER_LOOK, steps - done)
                for _ in range(n_steps):
                    picked = self._draw(rows, shares)
                    self.optimizer.zero_grad()
                    fabric.backward(self.ensemble.training_step((x[picked], y[picked])))
                    self.optimizer.step()
                done += n_steps
                loss, error = self.judge(x[is_held], y[is_held], scale)
                if not (math.isfinite(loss) and error <= give_up):
                    self._restore(before)
                    return Fit(done, *self.judge(x[is_held], y[is_held], scale), diverged=True)
                best, waited = (loss, 0) if loss < best else (best, waited + 1)
        except BaseException:
            self._restore(before)
            raise
        return Fit(done, loss, error, diverged=False)

    def judge(self, x: torch.Tensor, y: torch.Tensor, scale: torch.Tensor) -> tuple[float, float]:
        """Negative log likelihood without ``beta``, mean over the members; and the error of their mean prediction, over
        the error of always predicting the mean of ``y``."""
        with torch.no_grad():
            mean, log_variance = self.ensemble(x)
            length = scale * torch.stack([mean.mean(dim=0) - y, y.mean(dim=0) - y])
            error = torch.div(*length.norm(dim=-1).mean(dim=-1).clamp(min=torch.finfo().tiny))
            return float(nll(mean, log_variance, y).mean()), float(error)

    def __getstate__(self) -> dict[str, Any]:
        """For copies and other processes: without the optimiser."""
        return {**self.__dict__, "fabric": None, "optimizer": None}

    def _draw(self, rows: torch.Tensor, shares: list[tuple[torch.Tensor, int]]) -> torch.Tensor:
        """``(members, batch)`` of the ``rows``, of which each of ``shares`` gives as many as it says."""
        members = self.ensemble.members
        picked = rows[torch.randint(len(rows), (members, _BATCH), generator=self.generator)]
        taken = 0
        for some, count in shares:
            drawn = torch.randint(len(some), (members, count), generator=self.generator)
            picked[:, taken : taken + count] = some[drawn]
            taken += count
        return picked

    def _restore(self, weights: dict[str, torch.Tensor]) -> None:
        """Back to these weights, with a new optimiser: the moments of the old one belong to other weights."""
        self.ensemble.load_state_dict(weights)
        self.optimizer = None
