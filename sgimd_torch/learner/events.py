"""Events of a learner. Only the learner makes them, and it tells each to its listeners, such as a record."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

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
    FAILED = "failed"  # movement without an outcome, for the reason ``reply``; if theta is None, no context was seen
    INTERRUPTED = "interrupted"  # interruption by the caller, before an outcome was told; place -1: between movements


class Event(NamedTuple):
    """An event, with the fields of its kind; ``who`` is the teacher who has shown something or was asked, ``place`` the
    number of the robot if several robots move at once."""

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
    place: int = 0


class BeforeMovement(NamedTuple):
    """Events since the last movement: a demonstration, a request and the reply to it, as in an `Episode`."""

    demonstration: Demonstration | None = None
    request: Request | None = None
    reply: str = ""
