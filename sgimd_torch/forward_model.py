"""Forward model L: where will the float land? An ensemble of networks, learnt while the robot learns.

Not in Nguyen & Oudeyer (2014), who keep local models only. Deep ensembles with a predicted noise (Lakshminarayanan,
Pritzel & Blundell, NeurIPS 2017), trained online through Lightning Fabric: one optimiser for life, so that Adam's
moments survive from one refresh to the next.
    model = ForwardModel(0, 25, 2, seed=3); model.refresh(memory); model.predict(contexts, thetas).mean
"""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

try:
    import torch
    from lightning import Fabric, LightningModule
    from safetensors import SafetensorError, safe_open
    from safetensors.torch import save
except ImportError as error:
    raise ImportError(f"the forward model needs sgimd-torch[forward]: {error}") from error

from sgimd_torch.archives import write_bytes
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, check_count, check_vector, stream

VERSION: Final = 1
_HELD_OUT: Final = 10  # one exemplar in so many is never trained on
_FEWEST: Final = 50  # exemplars to begin with
_CHUNK: Final = 20  # steps between two looks at what is held out
_PATIENCE: Final = 5  # looks without improvement that end a refresh
_LOG_VARIANCES: Final = (-9.0, 3.0)  # of standardised outcomes: a noise of 1 % to 450 % of their spread


class Prediction(NamedTuple):
    """All ``(..., outcome_dim)`` m. ``mean`` is where the float should land; ``epistemic``, the standard deviation
    between the members, is what more data would settle; ``aleatoric``, the noise they predict, is what it would not."""

    mean: Array
    epistemic: Array
    aleatoric: Array


class Refresh(NamedTuple):
    """What a refresh did. ``steps`` of the optimiser, negative log likelihood of the ``held_out`` exemplars at its end
    (lower is better; of standardised outcomes), and whether it ``diverged``, so that the weights before it stand."""

    steps: int
    held_out: float
    diverged: bool


class ForwardModel(LightningModule):
    """(c, theta) -> outcome, with its spread; differentiable in theta through ``forward``.

    Args:
        context_dim, theta_dim, outcome_dim: as those of the memory.
        seed: of the weights and of every batch; torch's global generator is neither read nor moved.
        members: networks in the ensemble; each starts from other weights and draws batches of its own.
        hidden: units of each hidden layer.
        every: new exemplars that a refresh waits for.
        rate: steps of the optimiser for each new exemplar; ``first`` of them more at the first refresh.
        batch: exemplars a step, for each member.
        recent: share of every batch drawn from the newest ``every`` exemplars.
        lr: of Adam.
        beta: 0 is the likelihood itself; .5 keeps noisy movements from being given up on (Seitzer et al., ICLR 2022).
        accelerator: Lightning's name of where to train: "cpu", the fastest for these sizes, "auto" or "cuda".

    Raises:
        ValueError: a number out of its range.
    """

    input_mean: torch.Tensor  # (context_dim + theta_dim,)
    input_scale: torch.Tensor
    outcome_mean: torch.Tensor  # (outcome_dim,)
    outcome_scale: torch.Tensor
    n_seen: torch.Tensor  # exemplars trained on

    def __init__(
        self,
        context_dim: int,
        theta_dim: int,
        outcome_dim: int,
        *,
        seed: int = 0,
        members: int = 3,
        hidden: Sequence[int] = (64, 64),
        every: int = 50,
        rate: float = 0.4,
        first: int = 300,
        batch: int = 128,
        recent: float = 0.25,
        lr: float = 3e-3,
        beta: float = 0.5,
        accelerator: str = "cpu",
    ) -> None:
        super().__init__()
        check_count("context_dim", context_dim, 0)
        for name, count in {"theta_dim": theta_dim, "outcome_dim": outcome_dim, "members": members}.items():
            check_count(name, count, 1)
        if not hidden or min(hidden) < 1 or every < 1 or first < 0 or batch < 1:
            raise ValueError(f"needs hidden, every, batch >= 1, first >= 0, got {hidden}, {every}, {batch}, {first}")
        if not (0 < rate < math.inf and 0 < lr < math.inf and 0 <= recent <= 1 and 0 <= beta <= 1):
            raise ValueError(f"needs rate, lr > 0, recent, beta in [0, 1], got {rate}, {lr}, {recent}, {beta}")
        self.sizes = {"context_dim": context_dim, "theta_dim": theta_dim, "outcome_dim": outcome_dim}
        self.shape = {"members": members, "hidden": list(hidden)}
        self.every, self.rate, self.first, self.batch = every, rate, first, batch
        self.recent, self.lr, self.beta, self.accelerator = recent, lr, beta, accelerator
        self._random = torch.Generator().manual_seed(int(stream(seed, "forward model").integers(2**63)))
        widths = [context_dim + theta_dim, *hidden, 2 * outcome_dim]
        self.weights, self.biases = torch.nn.ParameterList(), torch.nn.ParameterList()
        for n_in, n_out in itertools.pairwise(widths):
            self.weights.append(torch.randn(members, n_in, n_out, generator=self._random) / math.sqrt(n_in))
            self.biases.append(torch.zeros(members, 1, n_out))
        for name, dim in {"input": widths[0], "outcome": outcome_dim}.items():
            self.register_buffer(f"{name}_mean", torch.zeros(dim))
            self.register_buffer(f"{name}_scale", torch.ones(dim))
        self.register_buffer("n_seen", torch.zeros((), dtype=torch.int64))
        self._fabric: Fabric | None = None
        self._optimizer: Any = None

    @property
    def trained(self) -> bool:
        """Whether there was anything to learn from yet; before, it predicts nothing."""
        return int(self.n_seen) > 0

    def forward(self, context: torch.Tensor, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """``(members, ..., outcome_dim)`` each: the mean (m), and the variance that noise makes (m^2)."""
        inputs = torch.cat([context.expand(*theta.shape[:-1], context.shape[-1]), theta], dim=-1)
        x = ((inputs - self.input_mean) / self.input_scale).reshape(-1, inputs.shape[-1])
        members = len(self.weights[0])
        mean, log_variance = self._standardised(x.expand(members, *x.shape))
        shape = (members, *theta.shape[:-1], mean.shape[-1])
        mean, variance = mean.reshape(shape), log_variance.exp().reshape(shape)
        return self.outcome_mean + self.outcome_scale * mean, self.outcome_scale**2 * variance

    def training_step(self, batch: tuple[torch.Tensor, torch.Tensor], batch_idx: int = 0) -> torch.Tensor:
        """Negative log likelihood of ``(inputs, outcomes)``, both standardised, ``(members, n, ...)``."""
        inputs, outcomes = batch
        mean, log_variance = self._standardised(inputs)
        loss = 0.5 * (log_variance + (outcomes - mean) ** 2 * (-log_variance).exp())
        return (loss * (self.beta * log_variance).exp().detach()).mean()

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(self.parameters(), lr=self.lr)

    def predict(self, contexts: Array, thetas: Array) -> Prediction:
        """Where movements should land.

        Args:
            contexts: ``(..., context_dim)``, or one for all of them.
            thetas: ``(..., theta_dim)``.

        Raises:
            ValueError: other dimensions, or not finite.
            RuntimeError: it is not ``trained``.
        """
        if not self.trained:
            raise RuntimeError(f"the forward model has seen nothing yet; refresh() needs {_FEWEST} exemplars")
        contexts = check_vector("contexts", contexts, self.sizes["context_dim"])
        thetas = check_vector("thetas", thetas, self.sizes["theta_dim"], "were outcomes passed instead?")
        with torch.no_grad():
            members = self(self._tensor(contexts), self._tensor(thetas))
        means, variances = (part.cpu().double().numpy() for part in members)
        return Prediction(means.mean(axis=0), means.std(axis=0), np.sqrt(variances.mean(axis=0)))

    def refresh(self, memory: Memory) -> Refresh | None:
        """Learn from what is new in ``memory``, and from what is old again; nothing if less than ``every`` is new.

        It ends early when what is held out (one exemplar in ten, never trained on) is predicted no better, and goes
        back to the weights before it when the loss is not finite any more.

        Raises:
            ValueError: a memory of other dimensions, or with fewer exemplars than it was trained on.
        """
        dims = {name: getattr(memory, name.replace("_dim", "s")).shape[1] for name in self.sizes}
        if dims != self.sizes:
            raise ValueError(f"the model has dimensions {self.sizes}, the memory {dims}; is it another robot's?")
        n, seen = len(memory), int(self.n_seen)
        if n < seen:
            raise ValueError(f"the model was trained on {seen} exemplars, the memory has {n}; is it another run's?")
        if n < _FEWEST or n - seen < self.every:
            return None
        inputs, outcomes = np.hstack([memory.contexts, memory.thetas]), memory.outcomes
        if not seen:  # once and for all: later scales would turn what is learnt into something else
            for name, values in {"input": inputs, "outcome": outcomes}.items():
                spread = values.std(axis=0)
                getattr(self, f"{name}_mean").copy_(self._tensor(values.mean(axis=0)))
                getattr(self, f"{name}_scale").copy_(self._tensor(np.where(spread > 1e-9, spread, 1.0)))
        x = (self._tensor(inputs) - self.input_mean) / self.input_scale
        y = (self._tensor(outcomes) - self.outcome_mean) / self.outcome_scale
        self.n_seen.fill_(n)
        return self._train(x, y, round(self.rate * (n - seen)) + (0 if seen else self.first))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a safetensors file whose header says in JSON what the model is; it appears whole or not at all.

        The optimiser's moments are not in it: a loaded model predicts the same, and learns on from fresh ones.

        Raises:
            OSError: ``path`` is a directory, or cannot be written.
        """
        about = {"version": str(VERSION), "model": json.dumps({**self.sizes, **self.shape})}
        write_bytes(path, save({k: v.contiguous() for k, v in self.state_dict().items()}, about))

    @classmethod
    def load(cls, path: str | os.PathLike[str], **options: Any) -> ForwardModel:
        """The model that ``save`` wrote; ``options`` are those of the constructor that concern training.

        Raises:
            ValueError: not such a file, truncated, of another version, or with weights that do not fit or are
                not finite.
            OSError: there is no file.
        """
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"there is no forward model {path}")
        try:
            with safe_open(str(path), framework="pt") as file:
                about = file.metadata() or {}
                state = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118, it is no dict
        except SafetensorError as error:
            raise ValueError(f"{path} is no forward model, or was truncated: {error}") from error
        if about.get("version") != str(VERSION):
            raise ValueError(f"{path} has version {about.get('version')}, this library reads {VERSION}")
        try:
            model = cls(**{**options, **json.loads(about["model"])})
            model.load_state_dict(state)
        except (KeyError, TypeError, RuntimeError, json.JSONDecodeError) as error:
            raise ValueError(f"{path} holds weights of another shape than it says: {error}") from error
        if not all(torch.isfinite(values).all() for values in state.values()):
            raise ValueError(f"{path} holds weights that are not finite; was it saved while training diverged?")
        return model

    def _train(self, x: torch.Tensor, y: torch.Tensor, steps: int) -> Refresh:
        """At most ``steps`` on the standardised exemplars, the newest last."""
        fabric, optimizer = self._begin()
        is_held = torch.arange(len(x)) % _HELD_OUT == _HELD_OUT - 1
        held, rows = (x[is_held], y[is_held]), torch.nonzero(~is_held)[:, 0]
        members, n_new = len(self.weights[0]), round(self.recent * self.batch)
        newest = rows[-self.every :]
        before, best, waited, done = _copy(self.state_dict()), math.inf, 0, 0
        while done < steps and waited < _PATIENCE:
            chunk = min(_CHUNK, steps - done)
            for _ in range(chunk):
                picked = rows[torch.randint(len(rows), (members, self.batch), generator=self._random)]
                picked[:, :n_new] = newest[torch.randint(len(newest), (members, n_new), generator=self._random)]
                optimizer.zero_grad()
                fabric.backward(self.training_step((x[picked], y[picked])))
                optimizer.step()
            done += chunk
            loss = self._held_out(*held)
            if not math.isfinite(loss):
                self.load_state_dict(before)
                self._optimizer = None  # its moments are as bad as the weights were
                return Refresh(done, self._held_out(*held), True)
            best, waited = (loss, 0) if loss < best else (best, waited + 1)
        return Refresh(done, loss, False)

    def _begin(self) -> tuple[Fabric, Any]:
        """Lightning's Fabric, and the optimiser for life."""
        if self._fabric is None:
            self._fabric = Fabric(accelerator=self.accelerator, devices=1)
            self.to(self._fabric.device)
        if self._optimizer is None:
            self._optimizer = self._fabric.setup_optimizers(self.configure_optimizers())
        return self._fabric, self._optimizer

    def _held_out(self, x: torch.Tensor, y: torch.Tensor) -> float:
        """Negative log likelihood of what is held out, without ``beta``; the mean over the members."""
        with torch.no_grad():
            mean, log_variance = self._standardised(x.expand(len(self.weights[0]), *x.shape))
            return float((0.5 * (log_variance + (y - mean) ** 2 * (-log_variance).exp())).mean())

    def _standardised(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and log variance ``(members, n, outcome_dim)`` of ``(members, n, ...)``: one batched product a layer."""
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.baddbmm(bias, torch.nn.functional.silu(x) if layer else x, weight)
        mean, log_variance = x.chunk(2, dim=-1)
        return mean, log_variance.clamp(*_LOG_VARIANCES)

    def _tensor(self, values: Array) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32, device=self.input_mean.device)


def _copy(state: dict[str, Any]) -> dict[str, Any]:
    return {name: values.clone() for name, values in state.items()}
