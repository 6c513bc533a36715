"""Lightning's hooks in the online loop: optimiser, schedule, loss, callbacks and loggers of a user."""

import csv
import math
from functools import partial

import numpy as np
import pytest
import torch
from lightning import Callback
from lightning.fabric.loggers import CSVLogger
from torch.optim.lr_scheduler import CosineAnnealingLR, ReduceLROnPlateau

from models import ARM
from sgimd_torch.algorithms.paper import sagg_riac
from sgimd_torch.forward_model.inverse import ModelAlone
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.memory import Memory

LR, STEPS = 0.01, 400


class Gradients(Callback):
    def on_before_optimizer_step(self, trainer, model, optimizer):
        model.log("gradient", torch.nn.utils.get_total_norm([weights.grad for weights in model.parameters()]))


class Decayed(ForwardModel):
    """Weight decay, a cosine schedule, a loss of its own, and a note of each epoch."""

    epochs = 0

    def configure_optimizers(self):
        optimizer = torch.optim.AdamW(self.parameters(), lr=LR, weight_decay=1.0)
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": self.schedule(optimizer), "interval": "step"}}

    def schedule(self, optimizer):
        return CosineAnnealingLR(optimizer, STEPS)

    def configure_callbacks(self):
        return Gradients()

    def training_step(self, batch, batch_idx=0):
        return {"loss": 0.0 * super().training_step(batch, batch_idx)}  # the decay alone changes the weights

    def on_train_epoch_end(self):
        self.epochs += 1
        self.log("epochs", self.epochs)


def with_movements(memory, n):
    some = Memory(0, 7, 2)
    some.extend(memory.contexts[:n], memory.thetas[:n], memory.outcomes[:n])
    return some


def test_optimiser_schedule_loss_callbacks_and_logger_are_the_users(memory, tmp_path):
    make = partial(Decayed, loggers=[CSVLogger(tmp_path, name="", version="")])
    learner = sagg_riac(ARM, 0, inverse=partial(ModelAlone, module=make))
    model, steps, weights = learner.inverse.model, 0, [*learner.inverse.model.networks.weights]
    before = [values.detach().clone() for values in weights]
    for n in (100, 200):
        fit = model.refresh(with_movements(memory, n)).fit
        steps += fit.steps
        assert fit.lr == pytest.approx(LR * (1 + math.cos(math.pi * steps / STEPS)) / 2)
    decay = math.prod(1 - LR * (1 + math.cos(math.pi * step / STEPS)) / 2 for step in range(steps))
    for now, then in zip(weights, before, strict=True):
        torch.testing.assert_close(now.data[:, :, :2], decay * then[:, :, :2], rtol=0.05, atol=1e-3)
    rows = list(csv.DictReader((tmp_path / "metrics.csv").read_text().splitlines()))
    assert sum(row["gradient"] == "0.0" for row in rows) == steps
    assert [row["epochs"] for row in rows if row["epochs"]] == ["1", "2"]


class Slowing(Decayed):
    """A schedule that reads the error on held-out exemplars once an epoch: none is good enough."""

    def configure_optimizers(self):
        optimizer = torch.optim.SGD(self.parameters(), lr=LR)
        return [optimizer], [ReduceLROnPlateau(optimizer, patience=0, threshold=1e9, threshold_mode="abs")]


@pytest.mark.parametrize("kind", [Decayed, Slowing])
def test_a_checkpoint_goes_on_where_the_schedule_was(kind, memory):
    one, other = kind(0, 7, 2), kind(0, 7, 2)
    for n in (100, 150):
        one.refresh(with_movements(memory, n))
    checkpoint = {"state_dict": one.state_dict()}
    one.on_save_checkpoint(checkpoint)
    other.restore(checkpoint)
    lrs = [model.refresh(with_movements(memory, 200)).fit.lr for model in (one, other)]
    assert lrs[0] == lrs[1] < LR
    assert all(map(torch.equal, one.state_dict().values(), other.state_dict().values()))


def test_a_schedule_goes_on_after_a_training_that_diverged(memory):
    model = Decayed(0, 7, 2)
    model.refresh(with_movements(memory, 100))
    before = [values.clone() for values in model.parameters()]
    model.training_step = lambda batch, step: sum(values.sum() for values in model.parameters()) * math.nan
    fit = model.refresh(with_movements(memory, 150)).fit
    assert fit.diverged
    assert fit.lr < LR
    assert all(map(torch.equal, model.parameters(), before))
    assert np.isfinite(model.relative_error)


def two(self):
    one, other = (torch.optim.SGD(self.parameters(), lr=LR) for _ in range(2))
    return [one, other]


def often(self):
    optimizer = torch.optim.SGD(self.parameters(), lr=LR)
    return {"optimizer": optimizer, "lr_scheduler": {"scheduler": CosineAnnealingLR(optimizer, 9), "frequency": 2}}


@pytest.mark.parametrize("configured", [two, often, lambda self: None])
def test_what_the_online_loop_cannot_do_is_refused_when_the_learner_is_made(configured):
    class Wrong(ForwardModel):
        configure_optimizers = configured

    with pytest.raises(ValueError, match="configure_optimizers must return an optimiser and at most one scheduler"):
        sagg_riac(ARM, 0, inverse=partial(ModelAlone, module=Wrong))
    with pytest.raises(ValueError, match="must make a ForwardModel, made a Linear"):
        sagg_riac(ARM, 0, inverse=partial(ModelAlone, module=lambda *dims, seed: torch.nn.Linear(2, 2)))


def test_a_training_step_without_a_loss_is_refused(memory):
    class Silent(ForwardModel):
        def training_step(self, batch, batch_idx=0):
            return None

    with pytest.raises(ValueError, match="training_step must return the loss, a tensor, got a NoneType"):
        Silent(0, 7, 2).refresh(memory)
