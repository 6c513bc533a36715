"""Forward model L, which predicts the outcome of a movement: an ensemble of networks, trained while the robot learns.

Not in Nguyen & Oudeyer (2014), who use local models only. `OnlineTrainer` trains the networks. `ForwardModel` is a
LightningModule, which any loop of Lightning can train and ``load_from_checkpoint`` can load. A class derived from it
has its own optimiser, scheduler, loss and callbacks, by the methods of a LightningModule.
    model = ForwardModel(0, 25, 2, seed=3); model.refresh(memory); model.predict(contexts, thetas).mean
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from lightning import LightningModule

from sgimd_torch.calls import function_of
from sgimd_torch.forward_model.networks import (
    ACTIVATION,
    LOG_VARIANCES,
    WIDTHS,
    OwnNetworks,
    Perceptrons,
    Scales,
    described,
    nll,
)
from sgimd_torch.forward_model.training import Fit, OnlineTrainer, one_thread
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, check_count, check_vector, stream

TRUSTED_UP_TO: Final = 0.25  # largest relative error of a model that is used
_FEWEST_EXEMPLARS: Final = 50  # least number of exemplars for the first refresh
_DIVERGED_ABOVE: Final = 2.0  # relative error above which training has diverged


class Prediction(NamedTuple):
    """Prediction of outcomes; all arrays are ``(..., outcome_dim)``, in the unit of T.

    Attributes:
        mean: expected outcomes.
        epistemic: standard deviation of the members' expected outcomes; more exemplars would reduce it.
        aleatoric: standard deviation of the noise that the members predict; more exemplars would not reduce it.
    """

    mean: Array
    epistemic: Array
    aleatoric: Array


class Refresh(NamedTuple):
    """Result of a refresh.

    Attributes:
        fit: result of the training.
        first: row of the first new exemplar.
        predicted: prediction for the new exemplars by the earlier weights; None at the first refresh.
    """

    fit: Fit
    first: int
    predicted: Prediction | None


class ForwardModel(LightningModule):
    """Prediction of the outcome of theta in a context, with its spread; ``landing`` is differentiable in theta.

    Args:
        context_dim: dimension of C.
        theta_dim: dimension of Pi.
        outcome_dim: dimension of T.
        seed: number from which weights and batches come; torch's global generator is not used.
        members: number of networks; where they disagree, more exemplars would improve the prediction.
        every: number of new exemplars between two refreshes.
        network: constructor of a network, which may be your own, see `Network`; its own keywords are its options.
        widths: number of units of each hidden layer of a perceptron.
        activation: activation function of a perceptron: silu, relu, gelu or tanh.
        lr: learning rate of Adam.
        beta: exponent in [0, 1]; the loss of an exemplar is its negative log likelihood times (noise variance)^beta.
            With 0 noisy exemplars hardly count; with .5 they are learnt, too (Seitzer et al., ICLR 2022).
        batch: number of exemplars in a step, for each member.
        rate: number of steps of the optimiser for each new exemplar; .3 steps take a fifth of the time of a movement of
            the fishing rod, 2 steps take as long as such a movement.
        noise_heads: true: the predicted noise depends on the movement; false: all movements have the same noise.
        accelerator: device for training: auto (the CPU, the fastest for these sizes), cpu, cuda or mps.
        trust: relative error above which the forward model is not used.
        loggers: loggers of Lightning, to which ``log`` writes during a refresh.

    Attributes:
        before_learning: functions that test the model on new exemplars. Each refresh calls them first, with the memory
            and the number of exemplars that the model has learnt from.
        guides: whether movements of the learner have depended on the model; then their replay has to train it.
        awaited: checkpoint to load, instead of training, once the memory has the exemplars that it has learnt from.

    Raises:
        ValueError: a number is out of its range, a network is refused, or this machine has no such device.
    """

    input_mean: torch.Tensor  # (context_dim + theta_dim,)
    input_scale: torch.Tensor
    outcome_mean: torch.Tensor  # (outcome_dim,)
    outcome_scale: torch.Tensor
    n_seen: torch.Tensor  # number of exemplars that were learnt from
    n_scaled: torch.Tensor  # number of exemplars from which the scales were computed
    missed: torch.Tensor  # value of ``relative_error``
    proved: torch.Tensor  # whether a `ProvedModel` uses the model

    def __init__(
        self,
        context_dim: int,
        theta_dim: int,
        outcome_dim: int,
        *,
        seed: int = 0,
        members: int = 3,
        every: int = 50,
        network: Callable[..., Any] = Perceptrons,
        widths: tuple[int, ...] = WIDTHS,
        activation: str = ACTIVATION,
        lr: float = 1e-2,
        beta: float = 0.5,
        batch: int = 128,
        rate: float = 1.0,
        noise_heads: bool = True,
        accelerator: str = "auto",
        trust: float = TRUSTED_UP_TO,
        loggers: Sequence[Any] = (),
    ) -> None:
        super().__init__()
        self.save_hyperparameters(ignore=["network", "accelerator", "loggers"])  # these are chosen when it is loaded
        dims = context_dim, theta_dim, outcome_dim
        self.sizes = dict(zip(("context_dim", "theta_dim", "outcome_dim"), dims, strict=True))
        for name, count in {**self.sizes, "members": members, "every": every, "batch": batch}.items():
            check_count(name, count, 0 if name == "context_dim" else 1)
        for name, value in {"rate": rate, "trust": trust, "lr": lr}.items():
            if not 0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not 0 <= beta <= 1:
            raise ValueError(f"beta must lie in [0, 1], got {beta}")
        self.members, self.every, self.rate, self.trust, self.lr, self.beta = members, every, rate, trust, lr, beta
        self.before_learning: list[Callable[[Memory, int], object]] = []
        self.guides, self.awaited = False, dict[str, Any]()
        generator = torch.Generator().manual_seed(int(stream(seed, "forward model").integers(2**63)))
        self.networks: Perceptrons | OwnNetworks
        if isinstance(network, str):  # of a checkpoint, which names its network but does not hold its code
            raise ValueError(f"this checkpoint has {network}: load_from_checkpoint(path, network=...)")
        if function_of(network) is Perceptrons:
            inputs = context_dim + theta_dim
            self.networks = Perceptrons(inputs, outcome_dim, members, generator, widths, activation, noise_heads)
        elif (widths, activation) != (WIDTHS, ACTIVATION):
            raise ValueError(f"widths and activation are options of perceptrons, not of {described(network)}")
        else:
            self.networks = OwnNetworks(network, dims, members, generator, noise_heads)
            self.hparams["network"] = described(network)
        self._online = OnlineTrainer(self, generator, members, every, batch, accelerator, loggers)
        for name, dim in {"input": context_dim + theta_dim, "outcome": outcome_dim}.items():
            self.register_buffer(f"{name}_mean", torch.zeros(dim))
            self.register_buffer(f"{name}_scale", torch.ones(dim))
        self.register_buffer("n_seen", torch.zeros((), dtype=torch.int64))
        self.register_buffer("n_scaled", torch.zeros((), dtype=torch.int64))
        self.register_buffer("missed", torch.zeros(()))
        self.register_buffer("proved", torch.zeros((), dtype=torch.bool))

    @property
    def trained(self) -> bool:
        """Whether the model has learnt from any exemplars; before that, it cannot predict."""
        return int(self.n_seen) > 0

    @property
    def relative_error(self) -> float:
        """Error of predictions for the held-out exemplars, divided by the error of always predicting their mean: 0 if
        the model is perfect, infinite before the first refresh. If a learner repeats few movements with small
        variations, this value is too low, because held-out exemplars resemble training exemplars."""
        return float(self.missed) if self.trained else math.inf

    @property
    def trained_on(self) -> str:
        """Device that trains, and the instructions of the processor, which round differently."""
        return f"{self._online.prepare().device.type}, {torch.backends.cpu.get_cpu_capability()}"

    @property
    def trusted(self) -> bool:
        """Whether the relative error is small enough to use the model."""
        return self.relative_error <= self.trust

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and log variance ``(members, n, outcome_dim)`` for ``(n, n_inputs)``, or ``(members, n, n_inputs)``; all
        are standardised."""
        mean, log_variance = self.networks(inputs.expand(self.members, *inputs.shape[-2:]), self._scales)
        return mean, log_variance.clamp(*LOG_VARIANCES)

    def training_step(self, batch: tuple[torch.Tensor, torch.Tensor], batch_idx: int = 0) -> torch.Tensor:
        """Loss for `standardised` inputs and outcomes, ``(members, n, ...)`` or ``(n, ...)`` each: negative log
        likelihood, weighted by ``beta``."""
        inputs, outcomes = batch
        mean, log_variance = self(inputs)
        return (nll(mean, log_variance, outcomes) * (self.beta * log_variance).exp().detach()).mean()

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam, in the fused implementation."""
        return torch.optim.Adam(self.parameters(), lr=self.lr, fused=True)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Lightning's hook: add what the next refresh needs besides the weights."""
        checkpoint["online"] = self._online.state

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Lightning's hook: the next refresh goes on as if the model had not been saved."""
        self._online.state = checkpoint["online"]

    def restore(self, checkpoint: dict[str, Any]) -> None:
        """Go on from a checkpoint of this model."""
        self.load_state_dict(checkpoint["state_dict"])
        self.on_load_checkpoint(checkpoint)

    def standardised(self, memory: Memory) -> tuple[torch.Tensor, torch.Tensor]:
        """Inputs ``(n, context_dim + theta_dim)`` and outcomes ``(n, outcome_dim)`` to train on."""
        inputs = self.tensor(np.hstack([memory.contexts, memory.thetas]))
        outcomes = self.tensor(memory.outcomes)
        return (inputs - self.input_mean) / self.input_scale, (outcomes - self.outcome_mean) / self.outcome_scale

    def landing(self, context: torch.Tensor, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and noise variance of outcomes by each member, ``(members, ..., outcome_dim)`` each; differentiable.

        Args:
            context: ``(..., context_dim)``, or one context for all thetas.
            theta: ``(..., theta_dim)``.
        """
        if self.training:
            self.eval()
        inputs = torch.cat([context.expand(*theta.shape[:-1], context.shape[-1]), theta], dim=-1)
        mean, log_variance = self(((inputs - self.input_mean) / self.input_scale).reshape(-1, inputs.shape[-1]))
        shape = (self.members, *theta.shape[:-1], mean.shape[-1])
        mean, variance = mean.reshape(shape), log_variance.exp().reshape(shape)
        return self.outcome_mean + self.outcome_scale * mean, self.outcome_scale**2 * variance

    @one_thread()
    def predict(self, contexts: Array, thetas: Array) -> Prediction:
        """Prediction of the outcomes of movements.

        Args:
            contexts: ``(..., context_dim)``, or one context for all thetas.
            thetas: ``(..., theta_dim)``.

        Raises:
            ValueError: an array has other dimensions, or is not finite.
            RuntimeError: the model is not ``trained``.
        """
        if not self.trained:
            raise RuntimeError(f"the forward model is not trained yet; refresh() needs {_FEWEST_EXEMPLARS} exemplars")
        contexts = check_vector("contexts", contexts, self.sizes["context_dim"])
        thetas = check_vector("thetas", thetas, self.sizes["theta_dim"], "were outcomes passed instead?")
        with torch.no_grad():
            members = self.landing(self.tensor(contexts), self.tensor(thetas))
        means, variances = (tensor.cpu().double().numpy() for tensor in members)
        return Prediction(means.mean(axis=0), means.std(axis=0), np.sqrt(variances.mean(axis=0)))

    def refresh(self, memory: Memory) -> Refresh | None:
        """Learn from new and old exemplars in ``memory``; None if fewer than ``every`` exemplars are new, or all
        outcomes are equal.

        With an ``awaited`` checkpoint: load it if its moment has come, and return None.

        Training ends early when predictions for the held-out exemplars (one in ten, never trained on) stop improving.
        The earlier weights are restored if the loss is not finite, if the relative error exceeds both 2 and twice
        its earlier value, or if training is interrupted.

        Args:
            memory: memory of the learner; it is only read.

        Raises:
            ValueError: the memory has other dimensions, or fewer exemplars than the model was trained on.
        """
        if self.awaited:
            if len(memory) == int(self.awaited["state_dict"]["n_seen"]):
                self.restore(self.awaited)
                self.awaited = {}
            return None
        sizes = {name: getattr(memory, name) for name in self.sizes}
        if sizes != self.sizes:
            raise ValueError(f"the model has dimensions {self.sizes}, the memory {sizes}; is it another robot's?")
        n, seen = len(memory), int(self.n_seen)
        if n < seen:
            raise ValueError(f"the model was trained on {seen} exemplars, the memory has {n}; is it another run's?")
        if n < _FEWEST_EXEMPLARS or n - seen < self.every:
            return None
        if not seen and not np.ptp(memory.outcomes, axis=0).any():  # no movement has had an effect yet
            return None
        return self._learn(memory, seen)

    @one_thread()
    def _learn(self, memory: Memory, seen: int) -> Refresh:
        """Learn from all exemplars in ``memory``; the model has learnt from the first ``seen`` before."""
        n = len(memory)
        for test in self.before_learning if seen else ():
            test(memory, seen)
        self._online.prepare()  # weights must be on the device before the exemplars
        predicted = self.predict(memory.contexts[seen:], memory.thetas[seen:]) if seen else None
        if n > 2 * int(self.n_scaled):
            self._scale(np.hstack([memory.contexts, memory.thetas]), memory.outcomes)
        fit = self._online.fit(
            *self.standardised(memory),
            self.outcome_scale,
            steps=max(1, round(self.rate * (n - seen))),
            give_up=max(_DIVERGED_ABOVE, 2 * self.relative_error),
        )
        self.missed.fill_(fit.relative_error)
        self.n_seen.fill_(n)
        return Refresh(fit, seen, predicted)

    @property
    def _scales(self) -> Scales:
        return Scales(self.input_mean, self.input_scale, self.outcome_mean, self.outcome_scale)

    def _scale(self, inputs: Array, outcomes: Array) -> None:
        """Standardise inputs and outcomes anew. Means that perceptrons predict do not change; predicted noise keeps its
        ratio to the spread of outcomes."""
        new = Scales(*(part for values in (inputs, outcomes) for part in self._spread(values)))
        if int(self.n_scaled):
            self.networks.rescale(self._scales, new)
        for old, value in zip(self._scales, new, strict=True):
            old.copy_(value)
        self.n_scaled.fill_(len(inputs))

    def _spread(self, values: Array) -> tuple[torch.Tensor, torch.Tensor]:
        spread = values.std(axis=0)
        return self.tensor(values.mean(axis=0)), self.tensor(np.where(spread > 0, spread, 1.0))

    def tensor(self, values: Array) -> torch.Tensor:
        """``values`` in the precision and on the device of the model."""
        return torch.tensor(values, dtype=torch.float32, device=self.input_mean.device)
