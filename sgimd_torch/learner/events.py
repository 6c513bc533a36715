"""Events of a learner. Only the learner makes them, and it tells each to its listeners, such as a record."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.spaces import Array, Demonstration, Request

TEACHER: Final = "teacher"
"""Value of ``who`` for a demonstration offered by the teacher of a run."""


class Kind(StrEnum):
    """Kinds of events."""

    MOVED = "moved"
    RESTED = "rested"
    SHOWN = "shown"
    ASKED = "asked"  # request; ``reply`` is its result, and after "shown" the next event is the demonstration
    ADDED = "added"  # exemplar of a movement that the learner has not proposed
    RESTARTED = "restarted"  # the learner began again with the exemplars ``kept``, then those from row ``since`` on
    FORGOTTEN = "forgotten"  # the movements ``reply``, such as "12,40-45", were taken back
    CHANGED = "changed"  # a change of the robot was noticed, ``reply`` describes it; a replay notices it again
    FAILED = "failed"  # movement without an outcome, for the reason ``reply``; if theta is None, no context was seen
    INTERRUPTED = "interrupted"  # interruption by the caller, before an outcome was told; robot -1: between movements


class Change(NamedTuple):
    """A change of the robot: number of the first movement after it, number of movements when it was noticed, number of
    exemplars before it, and how many of these still help."""

    since: int
    noticed: int
    before: int
    helpful: int

    def __str__(self) -> str:
        kept = (
            f"{self.helpful} of {self.before} exemplars of before still help"
            if self.helpful
            else "nothing of before helps"
        )
        return f"since movement {self.since} outcomes are not what they were: {kept}"


class Event(NamedTuple):
    """An event, with the fields of its kind; ``who`` is the teacher who has shown something or was asked, ``robot`` the
    number of the robot if several move at once; ``since`` and ``kept`` are of a restart."""

    kind: Kind
    context: Array | None = None
    theta: Array | None = None
    goal: Array | None = None
    outcome: Array | None = None
    origin: str | None = None
    lesson: Demonstration | None = None
    who: str | None = None
    strategy: str | None = None
    reply: str | None = None
    robot: int = 0
    since: int | None = None
    kept: Exemplars | None = None


class BeforeMovement(NamedTuple):
    """Events since the last movement: a demonstration, a request and the reply to it, as in an `Episode`."""

    demonstration: Demonstration | None = None
    request: Request | None = None
    reply: str = ""
