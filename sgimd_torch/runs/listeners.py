"""Listeners, which are told the movements and evaluations of a run, and a clock for the parts of a run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.spaces import Episode


class Listener(Protocol):
    """Listener of a run. A resumed run first tells its listeners everything that is in the record.

    A listener overrides the methods that it needs.
    """

    def episode(self, episode: Episode, replayed: bool) -> None:
        """A movement was made, or replayed."""
        return

    def evaluated(self, movements: int, found: Mapping[str, Evaluation]) -> None:
        """The learner was evaluated after this number of movements; ``found`` is by name of the inverse model."""
        return

    def begin(self) -> None:
        """The replay is over: from now on files may change."""
        return

    def curves(self) -> Mapping[str, float]:
        """Numbers for the board since the last call, by tag."""
        return {}

    def flush(self) -> None:
        """Write everything so far to the disk."""
        return

    def close(self) -> None:
        """The run has ended, or was stopped."""
        return


class Seconds:
    """Seconds spent so far, by part of the run. Physics and evaluation, which are not replayed, begin at ``before``."""

    def __init__(self, before: Mapping[str, float]) -> None:
        self._spent = {part: before.get(f"seconds_{part}", 0.0) for part in ("physics", "evaluation")}
        self._spent["learner"] = self._within = 0.0

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """A block, or a decorated function, of this part. Blocks within it count for their own parts alone."""
        begun, around, self._within = time.perf_counter(), self._within, 0.0
        try:
            yield
        finally:
            passed = time.perf_counter() - begun
            self._spent[part] = self._spent.get(part, 0.0) + passed - self._within
            self._within = around + passed

    def summary(self) -> dict[str, float]:
        """Seconds by name, as the record stores them."""
        return {f"seconds_{part}": round(seconds, 3) for part, seconds in self._spent.items()}
