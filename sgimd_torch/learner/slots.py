"""A slot of a learner for each of several robots that move at once: the attempt of this robot."""

from __future__ import annotations

from dataclasses import dataclass

from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.spaces import Array, AskingAttempt, Lesson, Move, Request


@dataclass(eq=False)
class RobotSlot:
    """The attempt of one robot.

    Args:
        number: number of the robot, from 0.
        attempt: movements of the attempt; None: no attempt is under way.
        context: context of the attempt.
        next: last yield of the attempt, without outcome or reply so far; None: a rest.
        offered_at: number of movements when a teacher offered the current lesson; -1: there is none.
    """

    number: int
    attempt: AskingAttempt | None = None
    context: Array | None = None
    next: Move | Request | None = None
    offered_at: int = -1

    @property
    def move(self) -> Move | None:
        """The movement to execute next; None: a rest, or a request comes first."""
        return self.next if isinstance(self.next, Move) else None

    @property
    def request(self) -> Request | None:
        """The request that has no reply so far."""
        return self.next if isinstance(self.next, Request) else None

    def begin(self, attempt: AskingAttempt, context: Array) -> None:
        """Begin an ``attempt`` in this ``context``, and go to its first movement, request or rest."""
        self.attempt, self.context = attempt, context
        self.advance(None)

    def advance(self, sent: Array | Lesson | None) -> None:
        """Go to the next movement, request or rest; ``sent`` is None at the start, or if there was no reply."""
        attempt, self.attempt, self.next = self.attempt, None, None
        assert attempt is not None
        try:
            self.next = attempt.send(sent)
        except StopIteration:
            return
        self.attempt = attempt

    def end(self) -> None:
        """End the attempt, if there is one."""
        if self.attempt is not None:
            self.attempt.close()
        self.attempt = self.next = None
        self.offered_at = -1

    def asked(self, request: Request, reply: str) -> Event:
        """Event of a request and its reply."""
        goal, who, strategy = request.goal, request.teacher, request.strategy
        return Event(Kind.ASKED, self.context, goal=goal, who=who, strategy=strategy, reply=reply, robot=self.number)

    def moved(self, kind: Kind, move: Move, outcome: Array | None = None, reply: str | None = None) -> Event:
        """Event of a movement, with the ``origin`` of its proposal, and its outcome, or why it failed as ``reply``."""
        return Event(kind, self.context, move.theta, move.goal, outcome, move.origin, reply=reply, robot=self.number)
