"""One forward model for all parts of a learner, and its place in a run: training, records of its predictions, messages.

    model = model_of(problem, members=5); model_of(problem) is model
A replay writes the tables of the record again, except rows that come before a checkpoint which it loads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.special import gammaincinv

from sgimd_torch.calls import call_checked, function_of, with_keywords_of
from sgimd_torch.forward_model.checkpoints import read_checkpoint, write_checkpoint
from sgimd_torch.forward_model.model import ForwardModel, Refresh
from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Inverse, Problem, Trained
from sgimd_torch.record import Record, Row, RunError
from sgimd_torch.runs.hooks import Listener
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.run import RunLoop, Seconds
from sgimd_torch.spaces import Array, Episode

LEVEL: Final = 0.8  # share of outcomes that the predicted regions should contain, for the board's model/coverage
NOT_USED: Final = "the forward model is not used, the learner goes on without it"


class SharedModel(Trained):
    """Forward model of a problem.

    Args:
        problem: problem to learn, with the dimensions and the seed of the model.
        module: constructor of the model.
        options: options of `ForwardModel`.

    Raises:
        ValueError: ``module`` makes no `ForwardModel`.
    """

    def __init__(self, problem: Problem, module: Callable[..., ForwardModel], **options: Any) -> None:
        if problem.outcomes.periodic:
            raise ValueError("a forward model does not know outcomes that wrap; let outcomes be their cosine and sine")
        what = f"module {function_of(module).__name__}"
        self.model = call_checked(what, module, *problem.dims, seed=problem.seed, **options)
        if not isinstance(self.model, ForwardModel):
            raise ValueError(f"{what} must make a ForwardModel, made a {type(self.model).__name__}")
        self.device = self.model.trained_on
        if why := getattr(self.model.networks, "one_by_one", ""):
            problem.remarks.append(f"the members of the forward model are computed one by one, which is slower: {why}")

    def refresh(self, memory: Memory) -> Refresh | None:
        """Result of `ForwardModel.refresh`."""
        return self.model.refresh(memory)

    def listener(self, loop: RunLoop) -> ModelListener:
        """Listener that refreshes the model in a run."""
        learner, directory = loop.parts.learner, loop.parts.config.directory
        return ModelListener(loop.record, self.model, learner.inverse, learner.memory, loop.seconds, directory)

    def restore(self, directory: Path, refreshes: Sequence[Row]) -> None:
        """Let a replay load the checkpoint of the run in ``directory`` instead of training, unless the model has guided
        the learner before: each of these movements depends on the model of its time."""
        checkpoint = self._checkpoint(directory, refreshes)
        self.model.awaited = {} if checkpoint.get("guides") else checkpoint

    def recall(self, directory: Path, refreshes: Sequence[Row], memory: Memory) -> None:
        """Bring the model into the state after the last of these ``refreshes``; without its checkpoint, train again."""
        checkpoint = self._checkpoint(directory, refreshes)
        if checkpoint and tuple(checkpoint["refresh"]) == refreshes[-1]:
            self.model.restore(checkpoint)
            return
        for _, exemplars, *_ in refreshes:
            if exemplars > int(self.model.n_seen):
                self.model.refresh(Exemplars.of(memory, slice(exemplars)).memory_like(memory))

    def _checkpoint(self, directory: Path, refreshes: Sequence[Row]) -> dict[str, Any]:
        try:
            return read_checkpoint(directory, self.model, refreshes)
        except RunError as error:
            say(f"{error}; the forward model is trained again")
            return {}


_OPTIONS: Final = ("members", "network", "widths", "activation", "lr", "beta", "batch", "rate", "noise_heads")


@with_keywords_of(ForwardModel, *_OPTIONS, "accelerator", "trust")
def model_of(problem: Problem, *, module: Callable[..., ForwardModel] = ForwardModel, **options: Any) -> ForwardModel:
    """The forward model of a problem; the first call makes it, by ``module``, with these options."""
    return problem.shared(SharedModel, partial(SharedModel, problem, module, **options)).model


class ModelBased(Inverse):
    """Inverse model that uses the forward model of its problem if the forward model can be trusted.

    Attributes:
        model: forward model.
    """

    says_how_sure = False  # its estimates have no standard deviation

    @with_keywords_of(model_of)
    def __init__(self, problem: Problem, **options: Any) -> None:
        super().__init__(problem)
        self.model = model_of(problem, **options)

    @property
    def trusted(self) -> bool:
        """Whether the forward model is used now."""
        return self.model.trusted


def uses_model(inverse: Inverse, model: ForwardModel) -> bool:
    """Whether a learner with this ``inverse`` uses the ``model`` now; a `ModelBased` has its own ``trusted``."""
    return inverse.trusted if isinstance(inverse, ModelBased) else model.trusted


class ModelListener(Listener):
    """Refreshes the model after every movement, records its predictions and writes its checkpoint.

    Args:
        record: record of the run.
        model: forward model of the run.
        inverse: inverse model of the learner.
        memory: memory of the learner.
        seconds: clock of the run; it includes the training during a replay.
        directory: directory of the run.
    """

    def __init__(
        self,
        record: Record,
        model: ForwardModel,
        inverse: Inverse,
        memory: Memory,
        seconds: Seconds,
        directory: Path,
    ) -> None:
        self._record, self._model, self._memory, self._seconds = record, model, memory, seconds
        self._inverse, self._is_used, self._directory = inverse, False, directory
        self._curves: dict[str, float] = {}
        self._refresh: Row = ()  # row of the last refresh
        self._written: Row = ()  # row of the refresh in the last checkpoint
        # Rows that the replay does not compute again, because it loads an awaited checkpoint.
        movements, exemplars, *_ = model.awaited.get("refresh", (0, 0))
        refreshes = [row for row in record.rows("refreshes") if row[0] <= movements]
        predictions = [row for row in record.rows("predictions") if row[0] < exemplars]
        record.replace_rows("refreshes", refreshes)
        record.replace_rows("predictions", predictions)
        self._kept, self._kept_predictions = {row[0]: row for row in refreshes}, iter(predictions)

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Refresh the model after a movement; print a message if its use begins or ends, or its training diverges."""
        memory, movements = self._memory, episode.index + 1
        with self._seconds.of("model"):
            refresh = self._model.refresh(memory)
        if kept := self._kept.get(movements):
            n_new = kept[1] - self._refresh[1] if self._refresh else 0
            self._told(kept, np.array([cells for _, *cells in islice(self._kept_predictions, n_new)]))
            self._is_used = uses_model(self._inverse, self._model)
        if refresh is None:
            return
        error, fit, predicted = self._model.relative_error, refresh.fit, np.empty((0, 0))
        learnt = fit.loss, error, int(fit.diverged), fit.training_loss, fit.gradient_norm, fit.lr
        row = movements, len(memory), fit.steps, *learnt
        self._record.add_rows("refreshes", [row])
        if refresh.predicted is not None:
            predicted = np.hstack((memory.outcomes[refresh.first :], *refresh.predicted))
            rows = ((exemplar, *columns) for exemplar, columns in enumerate(predicted.tolist(), refresh.first))
            self._record.add_rows("predictions", rows)
        self._told(row, predicted)
        news = ["training diverged; the forward model keeps its last good weights"] if fit.diverged else []
        is_used = uses_model(self._inverse, self._model)
        if is_used != self._is_used:
            self._is_used = is_used
            who = "the forward model is used from here on" if is_used else NOT_USED
            news.append(f"{who}: {self._how_wrong(error)}")
        if not replayed:
            self._curves["time/training_step"] = fit.seconds
            say(*(f"movement {movements}: {message}" for message in news))

    def flush(self) -> None:
        """Write a checkpoint of the last refresh, which the record has by now."""
        if self._refresh != self._written:
            write_checkpoint(self._directory, self._model, self._refresh)
            self._written = self._refresh

    def close(self) -> None:
        """Print a message if the model is not used."""
        if not self._is_used:
            trained = self._model.trained
            why = self._how_wrong(self._model.relative_error) if trained else "there were too few exemplars to train it"
            say(f"{NOT_USED}: {why}")

    def curves(self) -> dict[str, float]:
        """Numbers of the last refresh by tag of the board; empty if they were read before."""
        curves, self._curves = self._curves, {}
        return curves

    def _told(self, row: Row, predicted: Array) -> None:
        """Remember a refresh: its ``row``, and ``predicted``, rows of the record without the number of the exemplar."""
        self._refresh = row
        _, _, steps, held_out, error, _, training, norm, lr = row
        self._curves = {"model/relative_error": error, "model/held_out": held_out, "model/training_loss": training}
        self._curves |= {"model/steps": steps, "model/gradient_norm": norm, "model/learning_rate": lr}
        if predicted.size:
            outcomes, mean, epistemic, aleatoric = np.hsplit(predicted, 4)
            self._curves["model/error"] = float(np.linalg.norm(outcomes - mean, axis=1).mean())
            self._curves["model/coverage"] = coverage(outcomes, mean, np.hypot(epistemic, aleatoric), LEVEL)

    def _how_wrong(self, error: float) -> str:
        unproved = not self._is_used and self._model.trusted
        proof = ", once it predicts movements as well as a local process" if unproved else ""
        return f"its relative error is {error:.3f}, it is trusted up to {self._model.trust:g}{proof}"


def coverage(observed: Array, mean: Array, spread: Array, level: float) -> float:
    """Share of the outcomes that lie in their predicted regions, which should contain the share ``level``.

    The regions are ellipsoids, because the predictions are Gaussians with independent dimensions. A share below
    ``level`` means that the predicted standard deviations are too small, a share above that they are too large.
    Predictions must be made before the model learns from the outcomes (prequential analysis: Dawid, J. R. Stat. Soc. A
    147, 1984), because on its training exemplars any model looks good.

    Args:
        observed: ``(n, outcome_dim)`` outcomes, n >= 1.
        mean: ``(n, outcome_dim)`` predicted outcomes.
        spread: ``(n, outcome_dim)`` standard deviations > 0, epistemic and aleatoric together.
        level: share between 0 and 1.
    """
    squared = (((observed - mean) / spread) ** 2).sum(axis=1)
    return float((squared <= 2 * gammaincinv(observed.shape[1] / 2, level)).mean())  # a quantile of chi-square
