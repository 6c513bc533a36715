"""Forward model L: where will the float land? An ensemble of networks, learnt while the robot learns.

Not in Nguyen & Oudeyer (2014), who keep local models only. It is trained online through Lightning Fabric, with one
optimiser for life, so that Adam's moments survive from one refresh to the next.
    model = ForwardModel(0, 25, 2, seed=3); model.refresh(memory); model.predict(contexts, thetas).mean
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

try:
    import torch
    from lightning import Fabric
    from safetensors import SafetensorError, safe_open
    from safetensors.torch import save
except ImportError as error:
    raise ImportError(f"the forward model needs torch: pip install 'sgimd-torch[forward]' ({error})") from error

from sgimd_torch.files import write_bytes
from sgimd_torch.forward_model.ensemble import Ensemble, nll
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, check_count, check_vector, stream

VERSION: Final = 1
_SHAPE: Final = ("context_dim", "theta_dim", "outcome_dim", "members", "hidden", "noise_heads")  # in its file
_HELD_OUT: Final = 10  # one exemplar in so many is never trained on
_FEWEST: Final = 50  # exemplars to begin with
_CHUNK: Final = 20  # steps between two looks at what is held out
_NEAR: Final = 200  # exemplars that count as near a goal
_PATIENCE: Final = 5  # looks without improvement that end a refresh
_LOST: Final = 2.0  # relative error, twice that of predicting the mean


class Prediction(NamedTuple):
    """All ``(..., outcome_dim)`` m. ``mean`` is where the float should land; ``epistemic``, the standard deviation
    between the members, is what more data would settle; ``aleatoric``, the noise they predict, is what it would not."""

    mean: Array
    epistemic: Array
    aleatoric: Array


class Refresh(NamedTuple):
    """What a refresh did. ``steps`` of the optimiser, negative log likelihood of the ``held_out`` exemplars at its end
    (lower is better; of standardised outcomes), and whether it ``diverged``, so that the weights before it stand;
    ``first``, the row of the first exemplar that was new, and what was ``foreseen`` for it and those after it, just
    before they were learnt from, None at the first refresh."""

    steps: int
    held_out: float
    diverged: bool
    first: int
    foreseen: Prediction | None


class ForwardModel(Ensemble):
    """(c, theta) -> outcome, with its spread; differentiable in theta through ``landing``.

    Args:
        context_dim, theta_dim, outcome_dim: as those of the memory.
        seed: of the weights and of every batch; torch's global generator is neither read nor moved.
        members, hidden, noise_heads, lr, beta: as ``Ensemble``; each member draws batches of its own.
        every: new exemplars that a refresh waits for.
        rate: steps of the optimiser for each new exemplar, which is what learning costs: .3 of them take about as long
            as a fifth of a movement of the fishing rod, 2 as long as a whole one.
        batch: exemplars a step, for each member.
        recent: share of every batch drawn from the newest ``every`` exemplars.
        focus: share drawn from the 200 that landed nearest the goal that ``refresh`` is told.
        accelerator: Lightning's name of where to train: "cpu", the fastest for these sizes, "auto" or "cuda".

    The first refresh sets the scales for life. If its exemplars are variations of one movement, all later ones lie far
    outside and are learnt badly; ``relative_error`` shows it.

    Raises:
        ValueError: a number out of its range.
    """

    input_mean: torch.Tensor  # (context_dim + theta_dim,)
    input_scale: torch.Tensor
    outcome_mean: torch.Tensor  # (outcome_dim,)
    outcome_scale: torch.Tensor
    n_seen: torch.Tensor  # exemplars trained on
    missed: torch.Tensor  # see ``relative_error``

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
        rate: float = 0.3,
        batch: int = 128,
        recent: float = 0.25,
        focus: float = 0.0,
        lr: float = 1e-2,
        beta: float = 0.5,
        noise_heads: bool = True,
        accelerator: str = "cpu",
    ) -> None:
        sizes = {"context_dim": context_dim, "theta_dim": theta_dim, "outcome_dim": outcome_dim}
        for name, count in {**sizes, "members": members, "every": every, "batch": batch}.items():
            check_count(name, count, 0 if name == "context_dim" else 1)
        if not isinstance(hidden, Sequence) or not hidden:
            raise ValueError(f"hidden must be a sequence of layers' units such as (64, 64), got {hidden}")
        for units in hidden:
            check_count("hidden", units, 1)
        if not (0 < rate < math.inf and 0 < lr < math.inf and 0 <= beta <= 1):
            raise ValueError(f"needs rate, lr > 0, beta in [0, 1], got {rate}, {lr}, {beta}")
        if not (recent >= 0 and focus >= 0 and recent + focus <= 1):
            raise ValueError(f"recent and focus are shares of a batch, got {recent} and {focus}")
        generator = torch.Generator().manual_seed(int(stream(seed, "forward model").integers(2**63)))
        shape = members, list(hidden), noise_heads
        super().__init__(context_dim + theta_dim, outcome_dim, generator, *shape, lr=lr, beta=beta)
        self.sizes = sizes
        self.shape = dict(zip(("members", "hidden", "noise_heads"), shape, strict=True))
        self.every, self.rate, self.batch, self.recent, self.focus = every, rate, batch, recent, focus
        self.accelerator, self._random = accelerator, generator
        for name, dim in {"input": context_dim + theta_dim, "outcome": outcome_dim}.items():
            self.register_buffer(f"{name}_mean", torch.zeros(dim))
            self.register_buffer(f"{name}_scale", torch.ones(dim))
        self.register_buffer("n_seen", torch.zeros((), dtype=torch.int64))
        self.register_buffer("missed", torch.zeros(()))
        self._lightning: Fabric | None = None
        self._optimizer: Any = None

    @property
    def trained(self) -> bool:
        """Whether there was anything to learn from yet; before, it predicts nothing."""
        return int(self.n_seen) > 0

    @property
    def relative_error(self) -> float:
        """How far predictions for what is held out are from it, over how far their mean is: 1 is no better than that
        mean, 0 perfect, infinite before anything was learnt. A learner that repeats few movements with small variations
        makes it too low: what is held out has near copies among the rest."""
        return float(self.missed) if self.trained else math.inf

    def landing(self, context: torch.Tensor, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """``(members, ..., outcome_dim)`` each: the mean (m), and the variance that noise makes (m^2); differentiable.

        Args:
            context: ``(..., context_dim)``, or one for all of them.
            theta: ``(..., theta_dim)``.
        """
        inputs = torch.cat([context.expand(*theta.shape[:-1], context.shape[-1]), theta], dim=-1)
        mean, log_variance = self(((inputs - self.input_mean) / self.input_scale).reshape(-1, inputs.shape[-1]))
        shape = (self.members, *theta.shape[:-1], mean.shape[-1])
        mean, variance = mean.reshape(shape), log_variance.exp().reshape(shape)
        return self.outcome_mean + self.outcome_scale * mean, self.outcome_scale**2 * variance

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
            members = self.landing(self._tensor(contexts), self._tensor(thetas))
        means, variances = (part.cpu().double().numpy() for part in members)
        return Prediction(means.mean(axis=0), means.std(axis=0), np.sqrt(variances.mean(axis=0)))

    def refresh(self, memory: Memory, goal: Array | None = None) -> Refresh | None:
        """Learn from what is new in ``memory``, and from what is old again; nothing if less than ``every`` is new.

        Args:
            memory: the learner's; it is only read.
            goal: ``(outcome_dim,)`` m that the learner pursues, for ``focus``; None if it pursues none.

        It ends early when what is held out (one exemplar in ten, never trained on) is predicted no better. It goes back
        to the weights before it when the loss is not finite any more or twice as bad as predicting the mean, and
        also when it is interrupted.

        Raises:
            ValueError: a memory of other dimensions, or with fewer exemplars than it was trained on.
        """
        self.check_fits("memory", **{name: getattr(memory, name) for name in self.sizes})
        n, seen = len(memory), int(self.n_seen)
        if n < seen:
            raise ValueError(f"the model was trained on {seen} exemplars, the memory has {n}; is it another run's?")
        if n < _FEWEST or n - seen < self.every:
            return None
        near = None
        if goal is not None and self.focus:
            near = torch.as_tensor(memory.near_outcomes(memory.contexts[-1], goal, _NEAR))
        self._begin()  # it moves the weights to where they are trained, and the exemplars follow
        inputs, outcomes = np.hstack([memory.contexts, memory.thetas]), memory.outcomes
        if not seen:  # once and for all: later scales would turn what is learnt into something else
            for name, values in {"input": inputs, "outcome": outcomes}.items():
                spread = values.std(axis=0)
                getattr(self, f"{name}_mean").copy_(self._tensor(values.mean(axis=0)))
                getattr(self, f"{name}_scale").copy_(self._tensor(np.where(spread > 1e-9, spread, 1.0)))
        foreseen = self.predict(memory.contexts[seen:], memory.thetas[seen:]) if seen else None
        x = (self._tensor(inputs) - self.input_mean) / self.input_scale
        y = (self._tensor(outcomes) - self.outcome_mean) / self.outcome_scale
        before = _copy(self.state_dict())
        try:
            steps, held_out, diverged = self._train(x, y, max(1, round(self.rate * (n - seen))), near, before)
        except BaseException:
            self._restore(before)
            raise
        self.n_seen.fill_(n)
        return Refresh(steps, held_out, diverged, seen, foreseen)

    def check_fits(self, what: str, **sizes: int) -> None:
        """Raise ``ValueError`` unless the dimensions of ``what`` (``theta_dim=25``) are the model's."""
        if any(self.sizes[name] != size for name, size in sizes.items()):
            raise ValueError(f"the model has dimensions {self.sizes}, the {what} {sizes}; is it another robot's?")

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
            said = json.loads(about["model"])
            shape = {name: said[name] for name in _SHAPE}
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            raise ValueError(f"{path} does not say what model it holds: {error}") from error
        model = cls(**{**options, **shape})
        try:
            model.load_state_dict(state)
        except RuntimeError as error:
            raise ValueError(f"{path} holds weights of another shape than it says: {error}") from error
        if not all(torch.isfinite(values).all() for values in state.values()):
            raise ValueError(f"{path} holds weights that are not finite; was it saved while training diverged?")
        return model

    def __getstate__(self) -> dict[str, Any]:
        """For copies and other processes: as if saved and loaded, without the optimiser's moments."""
        return {**super().__getstate__(), "_lightning": None, "_optimizer": None}

    def _train(
        self, x: torch.Tensor, y: torch.Tensor, steps: int, near: torch.Tensor | None, before: dict[str, torch.Tensor]
    ) -> tuple[int, float, bool]:
        """At most ``steps`` on the standardised exemplars, the newest last; back to ``before`` if that diverges.
        Returns the first three of ``Refresh``."""
        fabric, optimizer = self._begin()
        is_held = torch.arange(len(x)) % _HELD_OUT == _HELD_OUT - 1
        held, rows = (x[is_held], y[is_held]), torch.nonzero(~is_held)[:, 0]
        special = [(rows[-self.every :], round(self.recent * self.batch))]
        if near is not None:
            special.append((near[~is_held[near]], round(self.focus * self.batch)))
        lost, best, waited, done = max(_LOST, 2 * self.relative_error), math.inf, 0, 0
        while done < steps and waited < _PATIENCE:
            chunk = min(_CHUNK, steps - done)
            for _ in range(chunk):
                picked = rows[torch.randint(len(rows), (self.members, self.batch), generator=self._random)]
                taken = 0
                for some, count in special:
                    drawn = torch.randint(len(some), (self.members, count), generator=self._random)
                    picked[:, taken : taken + count] = some[drawn]
                    taken += count
                optimizer.zero_grad()
                fabric.backward(self.training_step((x[picked], y[picked])))
                optimizer.step()
            done += chunk
            loss = self._held_out(*held)
            if not (math.isfinite(loss) and float(self.missed) <= lost):
                self._restore(before)
                return done, self._held_out(*held), True
            best, waited = (loss, 0) if loss < best else (best, waited + 1)
        return done, loss, False

    def _begin(self) -> tuple[Fabric, Any]:
        """Lightning's Fabric, and the optimiser for life."""
        if self._lightning is None:
            self._lightning = Fabric(accelerator=self.accelerator, devices=1)
            self.to(self._lightning.device)
        if self._optimizer is None:
            self._optimizer = self._lightning.setup_optimizers(self.configure_optimizers())
        return self._lightning, self._optimizer

    def _restore(self, state: dict[str, Any]) -> None:
        """Back to these weights, without the optimiser's moments, which are of others."""
        self.load_state_dict(state)
        self._optimizer = None

    def _held_out(self, x: torch.Tensor, y: torch.Tensor) -> float:
        """Negative log likelihood of what is held out, without ``beta``; the mean over the members. Sets ``missed``."""
        with torch.no_grad():
            mean, log_variance = self(x)
            length = self.outcome_scale * torch.stack([mean.mean(dim=0) - y, y.mean(dim=0) - y])
            self.missed.copy_(torch.div(*length.norm(dim=-1).mean(dim=-1).clamp(min=1e-9)))
            return float(nll(mean, log_variance, y).mean())

    def _tensor(self, values: Array) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32, device=self.input_mean.device)


def _copy(state: dict[str, Any]) -> dict[str, Any]:
    return {name: values.clone() for name, values in state.items()}
