"""Listeners, which are told the movements and evaluations of a run, and a clock that times the parts of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.spaces import Episode


class Listener(Protocol):
    """Listener of a run; it overrides the methods that it needs.

    A resumed run first tells its listeners everything that is in the record.
    """

    def episode(self, episode: Episode, replayed: bool) -> None:
        """A movement was made, or replayed."""
        return

    def evaluated(self, movements: int, found: Mapping[str, Evaluation]) -> None:
        """The learner was evaluated after ``movements`` movements; ``found`` is by name of the inverse model."""
        return

    def begin(self) -> None:
        """The replay of the record is over; before this call, a listener must not change files."""
        return

    def curves(self) -> Mapping[str, float]:
        """New numbers for the board since the last call, by tag."""
        return {}

    def flush(self) -> None:
        """Write everything to the disk that is still in memory."""
        return

    def close(self) -> None:
        """The run has ended, or was stopped."""
        return


class Seconds:
    """Seconds spent so far, by part of the run.

    Args:
        before: seconds of the resumed run; physics and evaluation continue from there, as a replay skips both.
    """

    def __init__(self, before: Mapping[str, float]) -> None:
        self._spent = {part: before.get(f"seconds_{part}", 0.0) for part in ("physics", "evaluation")} | {
            "learner": 0.0
        }

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Add the time of a block to a ``part``."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self._spend(part, begun)

    def of_physics(self, execute: Callable[..., Any]) -> Callable[..., Any]:
        """A wrapper of ``execute`` that counts its time as physics, and takes this time off the learner's."""

        def timed(*arguments: Any) -> Any:
            begun = time.perf_counter()
            try:
                return execute(*arguments)
            finally:
                self._spend("physics", begun)
                self._spend("learner", begun, -1)

        return timed

    def of_learner(self, episodes: Iterator[Episode]) -> Iterator[Episode]:
        """The ``episodes``, whose time counts as the learner's: ask, tell, watch, and the choices of teachers."""
        while True:
            begun = time.perf_counter()
            episode = next(episodes, None)
            self._spend("learner", begun)
            if episode is None:
                return
            yield episode

    def _spend(self, part: str, begun: float, sign: int = 1) -> None:
        self._spent[part] = self._spent.get(part, 0.0) + sign * (time.perf_counter() - begun)

    def summary(self) -> dict[str, float]:
        """Seconds by name, as the record stores them."""
        return {f"seconds_{part}": round(seconds, 3) for part, seconds in self._spent.items()}
