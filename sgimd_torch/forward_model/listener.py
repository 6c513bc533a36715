"""The forward model of a run: it is trained, its predictions are recorded, and a message says when it is not asked.

A replay makes its tables again, so a resumed run has them as if it had never stopped.
    model = ModelListener(record, parts.model, trust, inverse, memory, seconds); model.episode(episode, replayed=False)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from sgimd_torch.forward_model.diagnostics import coverage
from sgimd_torch.memory import Memory
from sgimd_torch.record import Record
from sgimd_torch.runs.listeners import Listener, Seconds
from sgimd_torch.runs.process import say
from sgimd_torch.spaces import Array, Episode

if TYPE_CHECKING:
    from sgimd_torch.forward_model.model import ForwardModel, Prediction

LEVEL: Final = 0.8  # of the regions whose coverage the board shows
NOT_ASKED: Final = "the forward model is not asked, the learner goes on without it"


class ModelListener(Listener):
    """Refreshes the model after every movement and records what it predicts.

    Args:
        record: of the run.
        model: of the run.
        trust: relative error above which the model is not asked.
        inverse: of the run; if it knows whether the model can be ``trusted``, it decides whether the model is asked.
        memory: of the learner.
        seconds: of the run; those spent here are counted since movement 0, because a replay spends them again.
    """

    def __init__(
        self, record: Record, model: ForwardModel, trust: float, inverse: object, memory: Memory, seconds: Seconds
    ) -> None:
        self._model, self._trust, self._memory, self._seconds = model, trust, memory, seconds
        self._record, self._inverse = record, inverse
        self._asked = False
        self._curves: dict[str, float] = {}

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Refresh after a movement; say what is new."""
        memory, movements, move = self._memory, episode.index + 1, episode.move
        with self._seconds.of("model"):
            refresh = self._model.refresh(memory, None if move is None else move.goal)
        if refresh is None:
            return
        error = self._model.relative_error
        learnt = refresh.steps, refresh.held_out, error, int(refresh.diverged)
        self._record.add_rows("refreshes", [(movements, len(memory), *learnt)])
        self._curves = {"model/relative_error": error, "model/held_out": refresh.held_out, "model/steps": refresh.steps}
        if refresh.predicted is not None:
            self._predicted(refresh.first, memory.outcomes[refresh.first :], refresh.predicted)
        news = ["training diverged; the forward model keeps its last good weights"] if refresh.diverged else []
        asked = getattr(self._inverse, "trusted", error <= self._trust)
        if asked != self._asked:
            self._asked = asked
            who = "the forward model is asked from here on" if asked else NOT_ASKED
            news.append(f"{who}: {self._how_wrong(error)}")
        if not replayed:
            say(*(f"movement {movements}: {each}" for each in news))

    def close(self) -> None:
        """Say so if the model is not asked."""
        if not self._asked:
            trained = self._model.trained
            why = self._how_wrong(self._model.relative_error) if trained else "there were too few exemplars to train it"
            say(f"{NOT_ASKED}: {why}")

    def new_curves(self) -> dict[str, float]:
        """For the board, by tag: what the last refresh left, none where they were given already."""
        curves, self._curves = self._curves, {}
        return curves

    def _predicted(self, first: int, outcomes: Array, predicted: Prediction) -> None:
        values = np.hstack((outcomes, *predicted)).tolist()
        self._record.add_rows("predictions", ((row, *each) for row, each in enumerate(values, first)))
        spread = np.hypot(predicted.epistemic, predicted.aleatoric)
        self._curves["model/error"] = float(np.linalg.norm(outcomes - predicted.mean, axis=1).mean())
        self._curves["model/coverage"] = coverage(outcomes, predicted.mean, spread, LEVEL)

    def _how_wrong(self, error: float) -> str:
        proof = "" if self._asked or error > self._trust else ", once it predicts movements better than a local process"
        return f"its relative error is {error:.3f}, it is trusted up to {self._trust:g}{proof}"
