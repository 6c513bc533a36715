"""Online training: repeated fits of networks to a growing set of exemplars; a fit that diverges is undone.

The training uses Lightning Fabric, with one optimiser for all fits, so that Adam's moments last from fit to fit. For
Lightning's hooks a fit is an epoch. A callback gets Fabric as its trainer, and ``log`` writes to the loggers of Fabric.
    trainer.prepare(); fit = trainer.fit(x, y, scale, steps=15, give_up=2.0)
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import torch
from lightning import Fabric
from lightning.fabric.accelerators import ACCELERATOR_REGISTRY
from lightning.fabric.plugins.environments.lightning import LightningEnvironment

from sgimd_torch.forward_model.networks import nll
from sgimd_torch.texts import did_you_mean

_RECENT: Final = 0.25  # share of every batch that is drawn from the newest exemplars
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
        training_loss: negative log likelihood of as many exemplars that were trained on.
        gradient_norm: length of the gradient in the last step.
        lr: learning rate after the last step.
        seconds: mean duration of a step.
    """

    steps: int
    loss: float
    relative_error: float
    diverged: bool
    training_loss: float
    gradient_norm: float
    lr: float
    seconds: float


@dataclass(eq=False)
class OnlineTrainer:
    """Fits the networks of one model many times.

    Args:
        model: LightningModule, whose weights change.
        generator: random stream of the batches; each member has batches of its own.
        members: number of networks of the model.
        newest: number of last exemplars that count as the newest.
        batch: number of exemplars in a step, for each member.
        accelerator: Lightning's name of the device that trains, or auto for the CPU.
        loggers: loggers of Lightning, for what the model and its callbacks log.

    Raises:
        ValueError: this machine has no such device.
    """

    model: Any
    generator: torch.Generator
    members: int
    newest: int
    batch: int
    accelerator: str
    loggers: Sequence[Any] = ()
    fabric: Fabric = field(init=False)
    optimizer: Any = None
    schedule: Schedule | None = None
    callbacks: Sequence[Any] = ()
    moments: Any = None  # of optimiser and scheduler that are still to be made

    def __post_init__(self) -> None:
        self.fabric = fabric_on(self.accelerator, self.loggers)  # refuses a missing device before the first movement

    def prepare(self) -> Fabric:
        """Move the weights to the device, and make optimiser, scheduler and callbacks, unless this was done before."""
        if self.optimizer is None:
            self.model.to(self.fabric.device)
            optimizer, self.schedule = one_of_each(self.model.configure_optimizers())
            self.optimizer = self.fabric.setup_optimizers(optimizer)
            callbacks = self.model.configure_callbacks()
            self.callbacks = callbacks if isinstance(callbacks, Sequence) else [callbacks]
            if self.moments is not None:
                moments, schedule = self.moments
                self.optimizer.load_state_dict(moments)
                if self.schedule is not None:
                    self.schedule.scheduler.load_state_dict(schedule)
                self.moments = None
        return self.fabric

    @property
    def state(self) -> dict[str, Any]:
        """What a checkpoint needs besides the weights, so that training goes on as if it had not stopped."""
        moments = self.moments
        if self.optimizer is not None:
            schedule = {} if self.schedule is None else self.schedule.scheduler.state_dict()
            moments = self.optimizer.state_dict(), schedule
        return {"generator": self.generator.get_state(), "moments": moments}

    @state.setter
    def state(self, state: Mapping[str, Any]) -> None:
        self.generator.set_state(state["generator"].cpu())
        self.optimizer, self.moments = None, state["moments"]

    def fit(self, x: torch.Tensor, y: torch.Tensor, scale: torch.Tensor, *, steps: int, give_up: float) -> Fit:
        """Train until predictions for the held-out exemplars, one in ten, stop improving.

        The weights before the fit are restored if it diverges or is interrupted.

        Args:
            x: ``(n, n_inputs)`` standardised inputs, the newest last, on the device of the model.
            y: ``(n, n_outputs)`` standardised outputs.
            scale: ``(n_outputs,)`` factors that turn outputs into the unit of outcomes.
            steps: largest number of steps of the optimiser, at least 1.
            give_up: relative error above which the fit has diverged. A fit with a loss that is not finite has diverged,
                too.
        """
        fabric = self.prepare()
        is_held = torch.arange(len(x)) % _HELD_OUT_EVERY == _HELD_OUT_EVERY - 1
        rows = torch.nonzero(~is_held)[:, 0]
        before = {name: values.clone() for name, values in self.model.state_dict().items()}
        best_loss, n_waited, n_done, diverged, seconds = math.inf, 0, 0, False, 0.0
        self.model.fabric = fabric
        try:
            self._call("on_train_epoch_start")
            while n_done < steps and n_waited < _PATIENCE and not diverged:
                n_steps, begun = min(_STEPS_PER_TEST, steps - n_done), time.perf_counter()
                with self._own_randomness(len(x) + n_done):
                    for step in range(n_done, n_done + n_steps):
                        drawn = self._draw(rows)
                        self._step((x[drawn], y[drawn]), step)
                n_done, seconds = n_done + n_steps, seconds + time.perf_counter() - begun
                loss, error = self.score(x[is_held], y[is_held], scale)
                diverged = not (math.isfinite(loss) and error <= give_up)
                best_loss, n_waited = (loss, 0) if loss < best_loss else (best_loss, n_waited + 1)
            gradients = [weights.grad for weights in self.model.parameters() if weights.grad is not None]
            norm, lr = float(torch.nn.utils.get_total_norm(gradients)), self.optimizer.param_groups[0]["lr"]
            self._advance("epoch", loss)
            self._call("on_train_epoch_end")
            if diverged:
                self._restore(before)
                loss, error = self.score(x[is_held], y[is_held], scale)
            trained, _ = self.score(x[rows[:: _HELD_OUT_EVERY - 1]], y[rows[:: _HELD_OUT_EVERY - 1]], scale)
        except BaseException:
            self._restore(before)
            raise
        finally:
            self.model.fabric = None  # so that a Trainer may go on with it
            for logger in fabric.loggers:
                logger.save()
        return Fit(n_done, loss, error, diverged, trained, norm, lr, seconds / n_done)

    def score(self, x: torch.Tensor, y: torch.Tensor, scale: torch.Tensor) -> tuple[float, float]:
        """Two numbers: the mean negative log likelihood of the members; and the error of their mean prediction, divided
        by the error of always predicting the mean of ``y``."""
        self.model.eval()
        with torch.no_grad():
            mean, log_variance = self.model(x)
            lengths = scale * torch.stack([mean.mean(dim=0) - y, y.mean(dim=0) - y])
            error = torch.div(*lengths.norm(dim=-1).mean(dim=-1).clamp(min=torch.finfo().tiny))
            return float(nll(mean, log_variance, y).mean()), float(error)

    def __getstate__(self) -> dict[str, Any]:
        """State for copies and other processes, without the optimiser."""
        return {**self.__dict__, "optimizer": None, "moments": None, "schedule": None, "callbacks": ()}

    def _step(self, batch: tuple[torch.Tensor, torch.Tensor], step: int) -> None:
        """A step of the optimiser, with the hooks of Lightning around it."""
        self._call("on_train_batch_start", batch, step)
        self.optimizer.zero_grad()
        outputs = self.model.training_step(batch, step)
        loss = outputs["loss"] if isinstance(outputs, Mapping) else outputs
        if not isinstance(loss, torch.Tensor):
            raise ValueError(f"training_step must return the loss, a tensor, got a {type(loss).__name__}")
        self.fabric.backward(loss)
        self._call("on_after_backward")
        self._call("on_before_optimizer_step", self.optimizer)
        self.optimizer.step()
        self._advance("step")
        self._call("on_train_batch_end", outputs, batch, step)

    def _call(self, hook: str, *arguments: Any) -> None:
        """Call a hook of the callbacks, then of the model."""
        for callback in self.callbacks:
            getattr(callback, hook)(self.fabric, self.model, *arguments)
        getattr(self.model, hook)(*arguments)

    def _advance(self, interval: str, *loss: float) -> None:
        """Let the scheduler step if it steps at this ``interval``."""
        if self.schedule is not None and self.schedule.interval == interval:
            needs_loss = isinstance(self.schedule.scheduler, torch.optim.lr_scheduler.ReduceLROnPlateau)
            self.schedule.scheduler.step(*loss if needs_loss else ())

    def _draw(self, rows: torch.Tensor) -> torch.Tensor:
        """Random rows ``(members, batch)``; the first quarter of each batch is drawn from the newest exemplars."""
        recent, n_recent = rows[-self.newest :], round(_RECENT * self.batch)
        drawn = rows[torch.randint(len(rows), (self.members, self.batch), generator=self.generator)]
        drawn[:, :n_recent] = recent[torch.randint(len(recent), (self.members, n_recent), generator=self.generator)]
        return drawn

    @contextmanager
    def _own_randomness(self, number: int) -> Iterator[None]:
        """Training mode, and a random stream with this ``number`` for layers that draw, such as dropout."""
        with torch.random.fork_rng(devices=[]):
            torch.default_generator.manual_seed(self.generator.initial_seed() + number)
            self.model.train()
            yield

    def _restore(self, weights: dict[str, torch.Tensor]) -> None:
        """Restore these weights, without the moments, which belong to other weights; a schedule goes on."""
        self.model.load_state_dict(weights)
        self.optimizer.optimizer.state.clear()


class Schedule(NamedTuple):
    """Scheduler of the learning rate, and when it steps: after each ``step``, or after each ``epoch``, that is, fit."""

    scheduler: Any
    interval: str = "epoch"


def one_of_each(configured: Any) -> tuple[torch.optim.Optimizer, Schedule | None]:
    """Optimiser and schedule, from what ``configure_optimizers`` of a LightningModule returns.

    Raises:
        ValueError: it has more than one of each, or options that the online loop does not know.
    """
    schedule: Any = None
    match configured:
        case {"optimizer": optimizer}:
            schedule = configured.get("lr_scheduler")
        case [[optimizer], [schedule]]:
            pass
        case [optimizer]:
            pass
        case optimizer:
            pass
    options = schedule if isinstance(schedule, Mapping) else {"scheduler": schedule}
    known = {"scheduler", "interval", "monitor", "name"}
    if not (isinstance(optimizer, torch.optim.Optimizer) and options.keys() <= known):
        raise ValueError(
            "configure_optimizers must return an optimiser and at most one scheduler, in a form of Lightning, with "
            f"no options of it but interval (epoch or step), got {configured!r}"
        )
    return optimizer, Schedule(options["scheduler"], options.get("interval", "epoch")) if schedule else None


def fabric_on(accelerator: str, loggers: Sequence[Any] = ()) -> Fabric:
    """Fabric on one device of this process, whatever launcher has started the process.

    Args:
        accelerator: Lightning's name of the device, or auto for the CPU.
        loggers: loggers of Lightning.

    Raises:
        ValueError: this machine has no such device, or torch cannot use it.
    """
    name = "cpu" if accelerator == "auto" else accelerator
    # ``fabric run`` leaves its choices in such variables, which Fabric would prefer to these arguments.
    hidden = {name: os.environ.pop(name) for name in [*os.environ] if name.startswith("LT_")}
    try:
        fabric = Fabric(accelerator=name, devices=1, plugins=[LightningEnvironment()], loggers=list(loggers))
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
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
