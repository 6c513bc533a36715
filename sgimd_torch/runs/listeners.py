"""Who listens to a run. A listener is its file and a line of ``listeners_of``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.record import Record
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.spaces import Episode


class Listener(Protocol):
    """Is told what happens in a run. A resumed run tells it everything again, from its record."""

    def episode(self, episode: Episode, replayed: bool) -> None:
        """A movement was made, or replayed."""
        ...

    def evaluated(self, movements: int, found: Mapping[str, Evaluation]) -> None:
        """The learner was evaluated after so many movements, by each of its answers."""
        ...

    def begin(self) -> None:
        """The replay is over: from now on files may change."""
        ...

    def flush(self) -> None:
        """What was told so far is to be on the disk."""
        ...

    def close(self) -> None:
        """The run has ended, or was stopped."""
        ...


def listeners_of(parts: RunParts, record: Record, seconds: Seconds) -> list[Listener]:
    """Those of a run, in the order in which they are told.

    Args:
        parts, record: of the run.
        seconds: its clock.
    """
    found: list[Listener] = []
    curves: Callable[[], Mapping[str, float]] = dict
    if parts.model is not None and parts.trust is not None:
        from sgimd_torch.runs.model_listener import ModelListener

        model = ModelListener(record, parts.model, parts.trust.error, parts.inverse, parts.learner.memory, seconds)
        found.append(model)
        curves = model.new_curves
    if parts.config.board:
        from sgimd_torch.board.listener import BoardListener

        found.append(BoardListener(parts.config.directory, parts, seconds.summary, curves))
    return found
