"""Where the time of a run goes: physics, the learner, evaluations."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sgimd_torch.spaces import Episode


class Seconds:
    """Seconds spent so far. Those of a resumed run add to ``before``, but for those that a replay spends again."""

    def __init__(self, before: dict[str, Any]) -> None:
        self._spent = {
            "physics": before.get("seconds_physics", 0.0),
            "learner": 0.0,
            "evaluation": before.get("seconds_evaluation", 0.0),
        }

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Times a block, or a function that it decorates. Physics does not count as the learner's time."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            taken = time.perf_counter() - begun
            self._spent[part] = self._spent.get(part, 0.0) + taken
            if part == "physics":
                self._spent["learner"] -= taken

    def of_learner(self, episodes: Iterator[Episode]) -> Iterator[Episode]:
        """``episodes``, timed: asking, telling, watching and the teacher's choice."""
        while True:
            with self.of("learner"):
                episode = next(episodes, None)
            if episode is None:
                return
            yield episode

    def summary(self) -> dict[str, float]:
        """By name, as the record has them."""
        return {f"seconds_{part}": round(seconds, 3) for part, seconds in self._spent.items()}
