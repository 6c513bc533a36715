"""The learner: it explores on its own until a demonstration interrupts, and then answers the demonstration.

Algorithm 1 of Nguyen & Oudeyer (2014), rebuilt. All five learners of the paper are this class with two slots, an
autonomous and a social strategy. The caller owns the loop: ``move = learner.ask(context)``, execute it,
``learner.tell(outcome)``; ``learner.watch(demonstration)`` whenever the teacher shows something. Some learners want to
be shown a goal: ``learner.request(context)``, before ``ask``, says by whom. Which movement reaches a goal?
``learner.inverse(context, goal).theta``. Whoever listens is told what happens: ``learner.listeners.append(print)``.
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
    """Alternates between its own exploration and answers to demonstrations.

    Args:
        problem: what has to be learnt; its memory keeps the exemplar of every outcome that is told.
        autonomous: strategy of its own.
        social: how it answers a demonstration; None for a learner that cannot be taught.
        correspondence: function from times and trajectory to theta_d, eq. (6); needed with ``social``.

    Attributes:
        memory: exemplars, those of the problem.
        inverse: inverse model by which it answers; it may be replaced by another one of the same problem.
        listeners: functions that are called with each `Event`, after it has happened.
        begun: number of exemplars that it began with.
        movements: number of its movements, those at rest and those that failed included.

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
        self._life: list[int | Event] = []  # a movement is the row of memory that keeps it
        self._attempt: AskingAttempt | None = None
        self._context: Array = np.zeros(0)
        self._next: Move | Request | None = None  # of the attempt, not yet told or answered
        self._asked = False
        self._untold = False  # an attempt was begun by `request`, and no event says so yet
        self._lessons: set[tuple[bytes, bytes]] = set()
        self._offered_at = -1  # how many movements it had made when a teacher offered the lesson under way

    @property
    def idle(self) -> bool:
        """Whether no attempt is under way, so that the next ``ask`` begins one, also in a new context."""
        return self._attempt is None

    @property
    def lesson_waits(self) -> bool:
        """Whether an offered demonstration is still unanswered: a `run` that goes on here asks for no other."""
        return self._offered_at == self.movements

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of its goal model as they are now; none if that has no regions."""
        return self.autonomous.regions

    @property
    def waits_for_answer(self) -> bool:
        """Whether it has asked for a demonstration, which `watch` would answer."""
        return isinstance(self._next, Request)

    @property
    def context(self) -> Array:
        """``(context_dim,)`` of the attempt under way, read-only.

        Raises:
            RuntimeError: no attempt is under way.
        """
        if self._attempt is None:
            raise RuntimeError("no attempt is under way, so the context may be any; see idle")
        return self._context

    def events(self) -> Iterator[Event]:
        """What has happened to it, in order; of a movement without goal and origin."""
        memory = self.memory
        for each in self._life:
            if isinstance(each, int):
                each = Event(Kind.MOVED, memory.contexts[each], memory.thetas[each], outcome=memory.outcomes[each])
            yield each
        if self._untold:
            yield self._begun_event

    def ask(self, context: ArrayLike) -> Move | None:
        """The next movement, or None to stay still this time, when there is no outcome to tell.

        Args:
            context: ``(context_dim,)`` in which it will be executed. An attempt stays in the context in which it began;
                ``idle`` says when a new context can come.

        Raises:
            RuntimeError: the last movement's outcome was not told, or the context changed while not ``idle``.
            ValueError: a context of another shape, or not finite.
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
        """Its request to a teacher before its next movement; None if there is none. `watch` answers; `go_on_alone`, or
        `ask` at once, leaves it without an answer.

        Args:
            context: ``(context_dim,)``; an attempt begins in it if none is under way.

        Raises:
            ValueError: a context of another shape, or not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        if self._attempt is None:
            self._begin(self.autonomous.attempt(context := read_only(context)), context)
            self._untold = True
        return self._next if isinstance(self._next, Request) else None

    def go_on_alone(self, reply: str) -> None:
        """Say that its request has no answer.

        Args:
            reply: reason, for the record.

        Raises:
            RuntimeError: it has asked for nothing.
        """
        if not isinstance(self._next, Request):
            raise RuntimeError("go_on_alone() needs a request, but request() has given none")
        asked = self._request_event(self._next, reply)
        self._advance(None)
        self._publish(asked)

    def tell(self, outcome: ArrayLike) -> None:
        """Tell the outcome of the movement that was asked for; it enters memory.

        Args:
            outcome: ``(outcome_dim,)``.

        Raises:
            RuntimeError: no movement was asked for.
            ValueError: an outcome of another shape, not finite or beyond 1e100; nothing is remembered and the learner
                still waits.
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
        """See a demonstration: the attempt under way ends, and the social strategy answers from the next ``ask`` on.
        One that was requested goes to the attempt that had requested it.

        Args:
            demonstration: demonstration that is shown.
            who: name of the teacher who offers it, if one is asked before each movement, as in a `run`; see
                ``lesson_waits``. None for a lesson besides.

        Raises:
            RuntimeError: this learner has no social strategy, or the last movement's outcome was not told.
            ValueError: a demonstration that does not fit the spaces or the correspondence, or whose theta_d leaves Pi;
                nothing has happened then.
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
        """theta_d, eq. (6): the policy to which a demonstration corresponds.

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
        """Whether it was shown the same movement in the same context before.

        Raises:
            RuntimeError: this learner has no correspondence.
            ValueError: see `watch`.
        """
        return _lesson(demonstration, self.translate(demonstration)) in self._lessons

    def fail(self, reason: str) -> None:
        """Say that a movement has failed, so that there is no outcome to tell. It counts as a movement, nothing is
        remembered, and its attempt ends as by `interrupt`.

        Args:
            reason: why it failed, for the record.
        """
        self._stop(Kind.FAILED, reason)

    def interrupt(self) -> None:
        """End the attempt under way, if there is one; what it learnt so far counts. An outcome not yet told is no
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
        """An attempt was begun, as a replay has to know if it ends before its first movement."""
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
        """To the next movement, request or rest of the attempt; None begins one, or says that there was no answer."""
        attempt, self._attempt, self._next = self._attempt, None, None
        assert attempt is not None
        try:
            self._next = attempt.send(sent)
        except StopIteration:
            return
        self._attempt = attempt


def _lesson(demonstration: Demonstration, theta_d: Array) -> tuple[bytes, bytes]:
    return np.asarray(demonstration.context, dtype=np.float64).tobytes(), theta_d.tobytes()
