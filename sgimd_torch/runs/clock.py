"""Where the time of a run goes: physics, the learner, evaluations."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sgimd_torch.session import Execute
from sgimd_torch.spaces import Array, Episode


class Seconds:
    """Seconds spent so far; those of a resumed run are added to ``before``, its last summary."""

    def __init__(self, before: dict[str, Any]) -> None:
        self.physics: float = before.get("seconds_physics", 0.0)
        self.evaluation: float = before.get("seconds_evaluation", 0.0)
        self.learner = 0.0

    def of_physics(self, execute: Execute) -> Execute:
        """``execute``, timed; its time does not count as the learner's."""

        def timed(index: int, context: Array, theta: Array) -> Array:
            begun = time.perf_counter()
            try:
                return execute(index, context, theta)
            finally:
                taken = time.perf_counter() - begun
                self.physics += taken
                self.learner -= taken

        return timed

    def of_learner(self, episodes: Iterator[Episode]) -> Iterator[Episode]:
        """``episodes``, timed: asking, telling, watching and the teacher's choice."""
        begun = time.perf_counter()
        for episode in episodes:
            self.learner += time.perf_counter() - begun
            yield episode
            begun = time.perf_counter()

    @contextmanager
    def of_evaluation(self) -> Iterator[None]:
        """Times an evaluation and its writing."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.evaluation += time.perf_counter() - begun

    def summary(self) -> dict[str, float]:
        """As they go to summary.json."""
        named = {"physics": self.physics, "learner": self.learner, "evaluation": self.evaluation}
        return {f"seconds_{name}": round(seconds, 3) for name, seconds in named.items()}
