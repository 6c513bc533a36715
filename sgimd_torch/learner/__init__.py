"""The learner: it explores alone until a demonstration interrupts, and then uses the demonstration.

Algorithm 1 of Nguyen & Oudeyer (2014), rebuilt. All five learners of the paper are this class with two strategies, an
autonomous and a social one. The caller owns the loop: ``move = learner.ask(context)``, execute it,
``learner.tell(outcome)``. ``learner.watch(demonstration)`` shows a demonstration. ``learner.request(context)``, before
``ask``, returns the request of a learner that asks teachers. ``learner.inverse(context, goal).theta`` is the movement
for a goal. ``learner.listeners.append(print)`` prints every event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.parts import Inverse, Problem, Social, Strategy
from sgimd_torch.spaces import Array, AskingAttempt, Demonstration, Lesson, Move, Request, check_point, read_only

Correspondence = Callable[[Array, Array], Array]
"""Function from times ``(n_times,)`` and trajectory ``(n_times, n_joints)`` to theta_d ``(theta_dim,)``, eq. (6)."""


class Learner:
    """Alternates between autonomous exploration and attempts after demonstrations.

    Args:
        problem: problem to learn; its memory gets an exemplar for every outcome that is told.
        autonomous: autonomous strategy.
        social: social strategy, which uses demonstrations; None: the learner cannot be taught.
        correspondence: function from times and trajectory to theta_d, eq. (6); needed with ``social``.

    Attributes:
        memory: exemplars, the memory of the problem.
        inverse: inverse model; another inverse model of this problem may replace it.
        listeners: functions that are called with each `Event`, after it has happened.
        begun: number of exemplars at the start.
        movements: number of movements, rests and failed movements included.

    Raises:
        ValueError: ``social`` without ``correspondence``.
    """

    def __init__(
        self,
        problem: Problem,
        autonomous: Strategy,
        *,
        social: Social | None = None,
        correspondence: Correspondence | None = None,
    ) -> None:
        if social is not None and correspondence is None:
            raise ValueError("a social strategy needs a correspondence, which translates trajectories into theta")
        self.problem, self.autonomous, self.social, self.correspondence = problem, autonomous, social, correspondence
        self.memory = problem.memory
        self.inverse: Inverse = problem.inverse
        self.listeners: list[Callable[[Event], object]] = []
        self.begun, self.movements = len(self.memory), 0
        self._life: list[int | Event] = []  # events; for a movement, its row in memory
        self._attempt: AskingAttempt | None = None
        self._context: Array = np.zeros(0)
        self._next: Move | Request | None = None  # last yield of the attempt, without outcome or reply so far
        self._asked = False
        self._untold = False  # whether `request` began an attempt that no event has reported yet
        self._lessons: set[tuple[bytes, bytes]] = set()
        self._offered_at = -1  # number of movements when a teacher offered the current lesson

    @property
    def idle(self) -> bool:
        """Whether no attempt is under way; then the next ``ask`` begins one, in any context."""
        return self._attempt is None

    @property
    def lesson_waits(self) -> bool:
        """Whether an offered demonstration is still unanswered; a continued `run` then asks for no other one."""
        return self._offered_at == self.movements

    @property
    def regions(self) -> Sequence[Any]:
        """Current regions of the goal model; none if it has no regions."""
        return self.autonomous.regions

    @property
    def waits_for_answer(self) -> bool:
        """Whether the learner has asked for a demonstration and has no reply yet."""
        return isinstance(self._next, Request)

    @property
    def context(self) -> Array:
        """Context ``(context_dim,)`` of the attempt under way, read-only.

        Raises:
            RuntimeError: no attempt is under way.
        """
        if self._attempt is None:
            raise RuntimeError("no attempt is under way, so the context may be any; see idle")
        return self._context

    def events(self) -> Iterator[Event]:
        """All events so far, in order; movements lack goal and origin."""
        memory = self.memory
        for each in self._life:
            if isinstance(each, int):
                each = Event(Kind.MOVED, memory.contexts[each], memory.thetas[each], outcome=memory.outcomes[each])
            yield each
        if self._untold:
            yield self._begun_event

    def ask(self, context: ArrayLike) -> Move | None:
        """The next movement, or None, which is a rest: there is no outcome to tell.

        Args:
            context: ``(context_dim,)``, the context of the movement. An attempt keeps its context until the learner is
                ``idle``.

        Raises:
            RuntimeError: the outcome of the last movement was not told, or the context changed during an attempt.
            ValueError: the context has another shape, or is not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        if self._asked:
            raise RuntimeError(
                "ask() again needs the outcome of the last movement; was tell() forgotten? Without one, interrupt()"
            )
        self._go_on_alone()
        if self._attempt is None:
            self._begin(self.autonomous.attempt(context := read_only(context)), context)
            self._go_on_alone()
            if self._attempt is None:
                raise RuntimeError(f"{type(self.autonomous).__name__}.attempt() has to yield at least once")
        elif context is not self._context and not np.array_equal(context, self._context):
            raise RuntimeError(f"the attempt under way began in context {self._context}, got {context}; see idle")
        if not isinstance(self._next, Move):
            self.movements += 1
            self._advance(None)
            self._publish(Event(Kind.RESTED, self._context))
            return None
        self._asked = True
        return self._next

    def request(self, context: ArrayLike) -> Request | None:
        """The request to a teacher before the next movement, or None. `watch` replies with a demonstration; after
        `go_on_alone`, or after `ask` at once, the request stays without a demonstration.

        Args:
            context: ``(context_dim,)``, the context of a new attempt if none is under way.

        Raises:
            ValueError: the context has another shape, or is not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        if self._attempt is None:
            self._begin(self.autonomous.attempt(context := read_only(context)), context)
            self._untold = True
        return self._next if isinstance(self._next, Request) else None

    def go_on_alone(self, reply: str) -> None:
        """Tell the learner that its request gets no demonstration.

        Args:
            reply: reason, for the record.

        Raises:
            RuntimeError: the learner has made no request.
        """
        if not isinstance(self._next, Request):
            raise RuntimeError("go_on_alone() needs a request, but request() has given none")
        asked = self._request_event(self._next, reply)
        self._advance(None)
        self._publish(asked)

    def tell(self, outcome: ArrayLike) -> None:
        """Tell the outcome of the movement from `ask`; it enters the memory.

        Args:
            outcome: ``(outcome_dim,)``.

        Raises:
            RuntimeError: `ask` has given no movement.
            ValueError: the outcome has another shape, is not finite or is beyond 1e100. Nothing is remembered, and the
                learner still waits for an outcome.
        """
        if not self._asked or not isinstance(self._next, Move):
            raise RuntimeError("tell() needs the outcome of a movement, but ask() has not proposed one")
        move, context = self._next, self._context
        self.memory.add(context, move.theta, outcome)
        self._asked = False
        self.movements += 1
        row = len(self.memory) - 1
        reached = self.memory.outcomes[-1]
        self._advance(reached)
        self._publish(Event(Kind.MOVED, context, move.theta, move.goal, reached, move.origin), row=row)

    def watch(self, demonstration: Demonstration, *, who: str | None = None) -> None:
        """Watch a demonstration. A requested demonstration goes to the attempt that requested it. Any other
        demonstration ends the attempt under way, and the social strategy begins with the next ``ask``.

        Args:
            demonstration: demonstration that is shown.
            who: name of the teacher whose offers a `run` checks before each movement, see ``lesson_waits``; None:
                the demonstration comes from somebody else.

        Raises:
            RuntimeError: this learner has no social strategy, or the outcome of the last movement was not told.
            ValueError: the demonstration does not fit the spaces or the correspondence, or theta_d lies outside Pi;
                the learner is unchanged.
        """
        request = self._next if isinstance(self._next, Request) else None
        if self.social is None and request is None:
            raise RuntimeError("this learner has no social strategy, so it cannot be taught; use no teacher")
        if self._asked:
            raise RuntimeError("watch() needs the outcome of the last movement first; was tell() forgotten?")
        theta_d = self.translate(demonstration)
        self._lessons.add(_lesson(demonstration, theta_d))
        if request is not None:
            asked, who = self._request_event(request, "shown"), request.teacher
            self._advance(Lesson(theta_d, demonstration))
            self._publish(asked, Event(Kind.SHOWN, lesson=demonstration, who=who))
        elif self.social is not None:
            self._tell_begun()
            self._end()
            self._offered_at = -1 if who is None else self.movements
            context = np.asarray(demonstration.context, dtype=np.float64)
            self._begin(self.social.attempt(context, theta_d, demonstration), context)
            self._publish(Event(Kind.SHOWN, lesson=demonstration, who=who))

    def translate(self, demonstration: Demonstration) -> Array:
        """theta_d, eq. (6): the policy that corresponds to a demonstration.

        Raises:
            RuntimeError: this learner has no correspondence.
            ValueError: see `watch`.
        """
        if self.correspondence is None:
            raise RuntimeError("this learner has no correspondence, so it cannot be shown anything")
        check_point("context of the demonstration", demonstration.context, self.memory.context_dim)
        check_point("outcome of the demonstration", demonstration.outcome, self.memory.outcome_dim)
        theta_d = self.correspondence(demonstration.times, demonstration.trajectory)
        theta_d = check_point("theta_d of the correspondence", theta_d, self.memory.theta_dim)
        return self.problem.policies.check("theta_d of the correspondence", theta_d)

    def was_shown(self, demonstration: Demonstration) -> bool:
        """Whether the learner has watched a demonstration with equal theta_d and context before.

        Raises:
            RuntimeError: this learner has no correspondence.
            ValueError: see `watch`.
        """
        return _lesson(demonstration, self.translate(demonstration)) in self._lessons

    def fail(self, reason: str) -> None:
        """Tell the learner that a movement has failed and has no outcome. The movement counts, nothing is
        remembered, and the attempt ends as by `interrupt`.

        Args:
            reason: reason of the failure, for the record.
        """
        self._stop(Kind.FAILED, reason)

    def interrupt(self) -> None:
        """End the attempt under way, if there is one; its movements so far count. An outcome that was not told is no
        longer expected."""
        if self._attempt is not None:
            self._stop(Kind.INTERRUPTED, None)

    def _go_on_alone(self) -> None:
        while self.waits_for_answer:
            self.go_on_alone("nothing")

    def _stop(self, kind: Kind, reply: str | None) -> None:
        if self._asked and isinstance(self._next, Move):
            move = self._next
            stopped = Event(kind, self._context, move.theta, move.goal, None, move.origin, reply=reply)
        else:
            self._tell_begun()
            stopped = Event(kind, reply=reply)
        self._end()
        self.movements += kind == Kind.FAILED
        self._publish(stopped)

    def _publish(self, *events: Event, row: int | None = None) -> None:
        self._untold = False
        for event in events:
            self._life.append(event if row is None else row)
            for listener in self.listeners:
                listener(event)

    def _request_event(self, request: Request, reply: str) -> Event:
        goal, who, strategy = request.goal, request.teacher, request.strategy
        return Event(Kind.ASKED, self._context, goal=goal, who=who, strategy=strategy, reply=reply)

    @property
    def _begun_event(self) -> Event:
        """Event of an attempt without movements so far; replays need it if the attempt ends before a movement."""
        return Event(Kind.ASKED, self._context)

    def _tell_begun(self) -> None:
        if self._untold:
            self._publish(self._begun_event)

    def _end(self) -> None:
        if self._attempt is not None:
            self._attempt.close()
        self._attempt = self._next = None
        self._asked, self._untold, self._offered_at = False, False, -1

    def _begin(self, attempt: AskingAttempt, context: Array) -> None:
        self._context, self._attempt = context, attempt
        self._advance(None)

    def _advance(self, sent: Array | Lesson | None) -> None:
        """Go to the next movement, request or rest; ``sent`` is None at the start, or if there was no reply."""
        attempt, self._attempt, self._next = self._attempt, None, None
        assert attempt is not None
        try:
            self._next = attempt.send(sent)
        except StopIteration:
            return
        self._attempt = attempt


def _lesson(demonstration: Demonstration, theta_d: Array) -> tuple[bytes, bytes]:
    return np.asarray(demonstration.context, dtype=np.float64).tobytes(), theta_d.tobytes()
