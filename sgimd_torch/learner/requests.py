"""Teachers who are asked for a demonstration: the learner makes a `Request`, and a `Demonstrator` replies."""

from __future__ import annotations

from abc import abstractmethod

from sgimd_torch.catalogue.built import Built
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration


class Demonstrator(Built):
    """Teacher who is asked for a demonstration of a goal. Built from ``(demonstrations, rng)`` and options.

    Attributes:
        takes: duration of a reply, in movements, for which the learner rests.
    """

    takes: int = 0

    @abstractmethod
    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """A demonstration of ``goal`` ``(outcome_dim,)`` in ``context`` ``(context_dim,)``, or None. A replayed
        run repeats the request and needs an equal reply, so random draws must depend only on seed and arguments."""
