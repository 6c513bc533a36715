"""The forward model in a run: training, tables of its predictions in the record, and messages about its use.

A replay writes the tables again, so the tables of a resumed run are complete.
    listener = ModelListener(record, model, asked, learner.memory, seconds); listener.episode(episode, replayed=False)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from sgimd_torch.forward_model.diagnostics import coverage
from sgimd_torch.forward_model.model import ForwardModel, Prediction
from sgimd_torch.memory import Memory
from sgimd_torch.record import Record
from sgimd_torch.runs.run import Listener, Seconds
from sgimd_torch.runs.signals import say
from sgimd_torch.spaces import Array, Episode

LEVEL: Final = 0.8  # share of outcomes that the predicted regions should contain, for the board's model/coverage
NOT_ASKED: Final = "the forward model is not used, the learner goes on without it"


class ModelListener(Listener):
    """Refreshes the model after every movement and records its predictions.

    Args:
        record: record of the run.
        model: forward model of the run.
        asked: function that returns whether the learner uses the model now.
        memory: memory of the learner.
        seconds: clock of the run; it includes the training during a replay.
    """

    def __init__(
        self, record: Record, model: ForwardModel, asked: Callable[[], bool], memory: Memory, seconds: Seconds
    ) -> None:
        self._record, self._model, self._memory, self._seconds = record, model, memory, seconds
        self._is_asked, self._asked = asked, False
        self._curves: dict[str, float] = {}

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Refresh the model after a movement; print a message if its use begins or ends, or its training diverges."""
        memory, movements = self._memory, episode.index + 1
        with self._seconds.of("model"):
            refresh = self._model.refresh(memory)
        if refresh is None:
            return
        error = self._model.relative_error
        learnt = refresh.steps, refresh.held_out, error, int(refresh.diverged)
        self._record.add_rows("refreshes", [(movements, len(memory), *learnt)])
        self._curves = {"model/relative_error": error, "model/held_out": refresh.held_out, "model/steps": refresh.steps}
        if refresh.predicted is not None:
            self._predicted(refresh.first, memory.outcomes[refresh.first :], refresh.predicted)
        news = ["training diverged; the forward model keeps its last good weights"] if refresh.diverged else []
        asked = self._is_asked()
        if asked != self._asked:
            self._asked = asked
            who = "the forward model is used from here on" if asked else NOT_ASKED
            news.append(f"{who}: {self._how_wrong(error)}")
        if not replayed:
            say(*(f"movement {movements}: {each}" for each in news))

    def close(self) -> None:
        """Print a message if the model is not used."""
        if not self._asked:
            trained = self._model.trained
            why = self._how_wrong(self._model.relative_error) if trained else "there were too few exemplars to train it"
            say(f"{NOT_ASKED}: {why}")

    def curves(self) -> dict[str, float]:
        """Numbers of the last refresh by tag of the board; empty if they were read before."""
        curves, self._curves = self._curves, {}
        return curves

    def _predicted(self, first: int, outcomes: Array, predicted: Prediction) -> None:
        values = np.hstack((outcomes, *predicted)).tolist()
        self._record.add_rows("predictions", ((row, *each) for row, each in enumerate(values, first)))
        spread = np.hypot(predicted.epistemic, predicted.aleatoric)
        self._curves["model/error"] = float(np.linalg.norm(outcomes - predicted.mean, axis=1).mean())
        self._curves["model/coverage"] = coverage(outcomes, predicted.mean, spread, LEVEL)

    def _how_wrong(self, error: float) -> str:
        unproved = not self._asked and self._model.trusted
        proof = ", once it predicts movements as well as a local process" if unproved else ""
        return f"its relative error is {error:.3f}, it is trusted up to {self._model.trust:g}{proof}"
