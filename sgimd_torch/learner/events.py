"""Events: what happens to a learner. The learner alone makes them; whoever listens, as a record does, is told each."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

from sgimd_torch.spaces import Array, Demonstration, Request

TEACHER: Final = "teacher"
"""``who`` of a demonstration that the teacher of a run offered."""


class Kind(StrEnum):
    """Kinds of events."""

    MOVED = "moved"
    RESTED = "rested"
    SHOWN = "shown"
    ASKED = "asked"  # for a demonstration; ``reply`` says what came of it, and what is shown next answers it
    FAILED = "failed"  # a movement got no outcome: ``reply`` says why; without theta, no context could be observed
    INTERRUPTED = "interrupted"  # by the caller; with theta, before the outcome of that movement was told


class Event(NamedTuple):
    """An event, with what belongs to its kind; ``who`` has shown something or was asked."""

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


class BeforeMovement(NamedTuple):
    """Events since the last movement: a demonstration, a request and the reply to it, as in an `Episode`."""

    demonstration: Demonstration | None = None
    request: Request | None = None
    reply: str = ""
