"""The learner: it explores alone until a demonstration interrupts, and then uses the demonstration.

Algorithm 1 of Nguyen & Oudeyer (2014), rebuilt. All five learners of the paper are this class with two strategies, an
autonomous and a social one. The caller owns the loop: ``move = learner.ask(context)``, execute it,
``learner.tell(outcome)``. ``learner.watch(demonstration)`` shows a demonstration. ``learner.request(context)``, before
``ask``, returns the request of a learner that asks teachers. ``learner.inverse(context, goal).theta`` is the movement
for a goal. ``learner.listeners.append(print)`` prints every event.

Several robots move at once by ``moves = learner.ask_many(contexts)`` and ``learner.tell_many(outcomes)``. Robot k has
place k of the learner, where its attempts go on. All robots share one memory, its goal models and one record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.learner.events import Change, Event, Kind
from sgimd_torch.learner.slots import RobotSlot
from sgimd_torch.parts import Inverse, Problem, Social, Strategy
from sgimd_torch.spaces import Array, Demonstration, Failure, Lesson, Move, Request, check_point, read_only

Correspondence = Callable[[Array, Array], Array]
"""Function from times ``(n_times,)`` and trajectory ``(n_times, n_joints)`` to theta_d ``(theta_dim,)``, eq. (6)."""


class Watcher(Protocol):
    """Notices changes of the robot, see `sgimd_torch.changes`."""

    def expect(self, context: Array, theta: Array, outcome: Array) -> None:
        """Compare an outcome, which is not in memory yet, with what is expected."""

    def restart_if_changed(self) -> tuple[Learner, Change | None] | None:
        """A learner to go on as, and the change if a new one was noticed; None to go on."""


class Learner:
    """Alternates between autonomous exploration and attempts after demonstrations.

    Args:
        problem: problem to learn; its memory gets an exemplar for every outcome that is told.
        autonomous: autonomous strategy.
        social: social strategy, which uses demonstrations; None: the learner cannot be taught.
        correspondence: function from times and trajectory to theta_d, eq. (6); needed with ``social``.

    Attributes:
        memory: all exemplars.
        problem: problem to learn; after a change of the robot its memory holds only exemplars that still help.
        inverse: inverse model; another inverse model of this problem may replace it.
        watcher: object that notices changes of the robot; None: nobody does.
        changes: changes of the robot so far.
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
        self.watcher: Watcher | None = None
        self.changes: list[Change] = []
        self._life: list[tuple[int, int] | Event] = []  # events; for a movement, its row in memory and its place
        self._places = [RobotSlot(0)]
        self._new: list[RobotSlot] = []  # places whose attempt no event has reported so far, in order of beginning
        self._asked: list[
            tuple[RobotSlot, Move | Failure | None]
        ] = []  # what was asked for last and is not told so far
        self._lessons: set[tuple[bytes, bytes]] = set()

    @property
    def idle(self) -> bool:
        """Whether no attempt is under way; then the next ``ask`` begins one, in any context."""
        return all(each.attempt is None for each in self._places)

    @property
    def lesson_waits(self) -> bool:
        """Whether an offered demonstration is still unanswered; a continued `run` then asks for no other one."""
        return self.lesson_waits_at(0)

    def lesson_waits_at(self, place: int) -> bool:
        """Whether the demonstration that was offered to the robot at ``place`` is still unanswered."""
        return self._place(place).offered_at == self.movements

    @property
    def regions(self) -> Sequence[Any]:
        """Current regions of the goal model; none if it has no regions."""
        return self.autonomous.regions

    @property
    def waits_for_answer(self) -> bool:
        """Whether the learner has asked for a demonstration and has no reply yet."""
        return any(each.request is not None for each in self._places)

    @property
    def context(self) -> Array:
        """Context ``(context_dim,)`` of the attempt under way, read-only.

        Raises:
            RuntimeError: no attempt is under way.
        """
        context = self.context_at(0)
        if context is None:
            raise RuntimeError("no attempt is under way, so the context may be any; see idle")
        return context

    def context_at(self, place: int) -> Array | None:
        """Context of the attempt under way at ``place``, read-only; None: the next attempt there may have any."""
        here = self._place(place)
        return None if here.attempt is None else here.context

    def events(self) -> Iterator[Event]:
        """All events so far, in order; movements lack goal and origin."""
        memory = self.memory
        for each in self._life:
            if not isinstance(each, Event):
                row, place = each
                context, theta, outcome = memory.contexts[row], memory.thetas[row], memory.outcomes[row]
                each = Event(Kind.MOVED, context, theta, outcome=outcome, place=place)
            yield each
        yield from self._begun([place for place, move in self._asked if not isinstance(move, Failure)])

    def ask(self, context: ArrayLike) -> Move | None:
        """The next movement, or None, which is a rest: there is no outcome to tell.

        Args:
            context: ``(context_dim,)``, the context of the movement. An attempt keeps its context until the learner is
                ``idle``.

        Raises:
            RuntimeError: the outcome of the last movement was not told, or the context changed during an attempt.
            ValueError: the context has another shape or is not finite, or a part has proposed a theta that is no point
                of Pi.
        """
        (move,) = self.ask_many([context])
        if move is None:
            self.tell_many([None])
        return move

    def ask_many(self, contexts: Sequence[ArrayLike | Failure]) -> list[Move | None]:
        """The next movements of several robots, before the outcome of any of them is known.

        Args:
            contexts: context ``(context_dim,)`` of each robot, or its `Failure` if it could not see one. An attempt
                keeps its context, see `context_at`.

        Returns:
            For each robot its movement. None: it rests, or has no context.

        Raises:
            RuntimeError: outcomes of the last movements were not told, or a context changed during an attempt.
            ValueError: there are no contexts, one has another shape or is not finite, or a part has proposed a theta
                that is no point of Pi.
        """
        if self._asked:
            raise RuntimeError(
                "ask() again needs the outcome of the last movement; was tell() forgotten? Without one, interrupt()"
            )
        if not len(contexts):
            raise ValueError("ask_many() needs a context for each robot, got none")
        dim = self.memory.context_dim
        seen = [each if isinstance(each, Failure) else check_point("context", each, dim) for each in contexts]
        for number, context in enumerate(seen):
            under_way = self.context_at(number)
            other = under_way is not None and not isinstance(context, Failure) and (context != under_way).any()
            if other:
                raise RuntimeError(f"the attempt under way began in context {under_way}, got {context}; see idle")
        asked = [(place, self._propose(place, context)) for place, context in zip(self._places, seen, strict=False)]
        self._asked = asked
        return [move if isinstance(move, Move) else None for _, move in asked]

    def request(self, context: ArrayLike, *, place: int = 0) -> Request | None:
        """The request to a teacher before the next movement, or None. `watch` replies with a demonstration; after
        `go_on_alone`, or after `ask` at once, the request stays without a demonstration.

        Args:
            context: ``(context_dim,)``, the context of a new attempt if none is under way.
            place: number of the robot.

        Raises:
            ValueError: the context has another shape, or is not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        here = self._place(place)
        if here.attempt is None:
            self._begin(here, context)
        return here.request

    def go_on_alone(self, reply: str, *, place: int = 0) -> None:
        """Tell the learner that its request gets no demonstration.

        Args:
            reply: reason, for the record.
            place: number of the robot with the request.

        Raises:
            RuntimeError: the learner has made no request.
        """
        here = self._place(place)
        if here.request is None:
            raise RuntimeError("go_on_alone() needs a request, but request() has given none")
        asked = here.asked(here.request, reply)
        here.advance(None)
        self._report_new(here)
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
        self.tell_many([outcome])

    def tell_many(self, outcomes: Sequence[ArrayLike | Failure | None]) -> None:
        """Tell what came of the movements from `ask_many`, in the same order; outcomes enter the memory in this order.

        Args:
            outcomes: outcome ``(outcome_dim,)`` of each movement, or its `Failure`; None for a rest, or for a robot
                without a context.

        Raises:
            RuntimeError: `ask_many` has given no movements.
            ValueError: there are more or fewer outcomes than movements, a movement has none, or an outcome has another
                shape, is not finite or is beyond 1e100. Nothing is remembered, and the learner still waits.
        """
        asked = self._asked
        if not asked:
            raise RuntimeError("tell() needs the outcome of a movement, but ask() has not proposed one")
        if len(outcomes) != len(asked):
            raise ValueError(f"tell_many() needs {len(asked)} outcomes, one for each movement, got {len(outcomes)}")
        told = [self._checked(move, outcome) for (_, move), outcome in zip(asked, outcomes, strict=True)]
        moves = [move if isinstance(move, Move) else None for _, move in asked]
        # A failure without a movement leaves no trace of the attempt, so its beginning is reported by itself.
        no_attempt_begun = [move is None and isinstance(each, Failure) for move, each in zip(moves, told, strict=True)]
        self._report_new(*(place for (place, _), each in zip(asked, no_attempt_begun, strict=True) if not each))
        self._asked = []
        for (place, _), move, outcome in zip(asked, moves, told, strict=True):
            self._tell(place, move, outcome)
        self._restart_if_changed()

    def replace_theta(self, theta: Array, *, place: int = 0) -> None:
        """Replace the movement that is asked for at ``place`` by the recorded ``theta``, which equals it but for
        rounding. Only a replay does this: the memory then holds what was executed."""
        here, move = self._asked[place]
        assert isinstance(move, Move)
        self._asked[place] = here, replace(move, theta=theta)

    def watch(self, demonstration: Demonstration, *, who: str | None = None, place: int = 0) -> None:
        """Watch a demonstration. A requested demonstration goes to the attempt that requested it. Any other
        demonstration ends the attempt under way, and the social strategy begins with the next ``ask``.

        Args:
            demonstration: demonstration that is shown.
            who: name of the teacher whose offers a `run` checks before each movement, see ``lesson_waits``; None:
                the demonstration comes from somebody else.
            place: number of the robot that uses the demonstration; attempts of other robots go on.

        Raises:
            RuntimeError: this learner has no social strategy, or the outcome of the last movement was not told.
            ValueError: the demonstration does not fit the spaces or the correspondence, or theta_d lies outside Pi;
                the learner is unchanged.
        """
        here = self._place(place)
        if self.social is None and here.request is None:
            raise RuntimeError("this learner has no social strategy, so it cannot be taught; use no teacher")
        if self._asked:
            raise RuntimeError("watch() needs the outcome of the last movement first; was tell() forgotten?")
        theta_d = self.translate(demonstration)
        self._lessons.add(_lesson(demonstration, theta_d))
        if here.request is not None:
            asked, who = here.asked(here.request, "shown"), here.request.teacher
            here.advance(Lesson(theta_d, demonstration))
            self._report_new(here)
            self._publish(asked)
        elif self.social is not None:
            self._report_new()
            here.end()
            here.offered_at = -1 if who is None else self.movements
            context = np.asarray(demonstration.context, dtype=np.float64)
            here.begin(self.social.attempt(context, theta_d, demonstration), context)
        self._publish(Event(Kind.SHOWN, lesson=demonstration, who=who, place=place))

    def add(self, context: ArrayLike, theta: ArrayLike, outcome: ArrayLike) -> None:
        """Remember a movement that this learner has not proposed, such as one by another program: its ``context``
        ``(context_dim,)``, ``theta`` in Pi, and ``outcome`` ``(outcome_dim,)``. It does not count as a movement.

        Raises:
            RuntimeError: the outcome of the last movement was not told.
            ValueError: a vector has another shape or is not finite, or theta lies outside Pi; nothing is remembered.
        """
        if self._asked:
            raise RuntimeError("add() needs the outcome of the last movement first; was tell() forgotten?")
        context = read_only(check_point("context", context, self.memory.context_dim))
        theta = read_only(self.problem.policies.check("theta", check_point("theta", theta, self.memory.theta_dim)))
        outcome = read_only(self.memory.check_outcome(theta, outcome))
        self._report_new()
        self._remember(context, theta, outcome)
        self._publish(Event(Kind.ADDED, context, theta, outcome=outcome))
        self._restart_if_changed()

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
        if not self._asked:
            self.ask_many([Failure(reason)])
        self.tell_many([Failure(reason)] * len(self._asked))

    def interrupt(self) -> None:
        """End all attempts under way; their movements so far count. Outcomes that were not told are no longer
        expected."""
        asked, self._asked = [each for each in self._asked if not isinstance(each[1], Failure)], []
        if self.idle:
            return
        self._report_new(*(place for place, _ in asked))
        stopped = [
            place.moved(Kind.INTERRUPTED, move)
            if isinstance(move, Move)
            else Event(Kind.INTERRUPTED, place.context, place=place.number)
            for place, move in asked
        ]
        for place in self._places:
            place.end()
        self._publish(*(stopped or [Event(Kind.INTERRUPTED, place=-1)]))

    def _place(self, number: int) -> RobotSlot:
        while len(self._places) <= number:
            self._places.append(RobotSlot(len(self._places)))
        return self._places[number]

    def _begin(self, place: RobotSlot, context: Array) -> None:
        context = read_only(context)
        self._new.append(place)
        place.begin(self.autonomous.attempt(context), context)

    def _propose(self, place: RobotSlot, context: Array | Failure) -> Move | Failure | None:
        """The next movement at a place; a new attempt begins if none is under way there."""
        if isinstance(context, Failure):
            return context
        for _ in range(2):  # the attempt under way may end with a request that gets no reply
            if place.attempt is None:
                self._begin(place, context)
            while place.request is not None:
                self.go_on_alone("nothing", place=place.number)
            if place.attempt is not None:
                return self._within_pi(place.move)
        raise RuntimeError(f"{type(self.autonomous).__name__}.attempt() has to yield at least once")

    def _within_pi(self, move: Move | None) -> Move | None:
        """The movement, which may go to a robot; a theta that is no point of Pi never does."""
        if move is None:
            return move
        pi, theta = self.problem.policies, move.theta
        if theta.dtype != pi.low.dtype or theta.shape != pi.low.shape or not pi.contains(theta):  # quicker than check
            part = self.social if move.origin == "imitate" and self.social else self.autonomous.maker(move.origin)
            name = f"theta of the part {type(part).__name__}"
            pi.check(name, check_point(name, theta, pi.dim))
        return move

    def _checked(self, move: Move | Failure | None, outcome: ArrayLike | Failure | None) -> Array | Failure | None:
        """What came of a movement; a rest without anything is None."""
        if isinstance(outcome, Failure):
            return outcome
        if isinstance(move, Move) and outcome is not None:
            return self.memory.check_outcome(move.theta, outcome)
        if isinstance(move, Move) or outcome is not None:
            raise ValueError(f"a movement has an outcome or a Failure, a rest has None; got {outcome} for {move}")
        return move

    def _tell(self, place: RobotSlot, move: Move | None, outcome: Array | Failure | None) -> None:
        """Tell what came of the movement at one place, after its check."""
        self.movements += 1
        if isinstance(outcome, Failure):
            lost = Event(Kind.FAILED, reply=outcome.reason, place=place.number)
            failed = lost if move is None else place.moved(Kind.FAILED, move, reply=outcome.reason)
            place.end()
            self._publish(failed)
        elif move is None or outcome is None:
            place.advance(None)
            self._publish(Event(Kind.RESTED, place.context, place=place.number))
        else:
            assert place.context is not None
            self._remember(place.context, move.theta, outcome)
            row = len(self.memory) - 1
            moved = place.moved(Kind.MOVED, move, self.memory.outcomes[-1])
            place.advance(moved.outcome)
            self._publish(moved, row=row)

    def _remember(self, context: Array, theta: Array, outcome: Array) -> None:
        if self.watcher is not None:
            self.watcher.expect(context, theta, outcome)
        self.memory.add(context, theta, outcome)
        if self.problem.memory is not self.memory:
            self.problem.memory.add(context, theta, outcome)

    def _restart_if_changed(self) -> None:
        """Begin again if the robot has changed: attempts end, and all parts are built anew."""
        found = None if self.watcher is None else self.watcher.restart_if_changed()
        if found is None:
            return
        for place in self._places:
            place.end()
        new, change = found
        self.problem, self.inverse, self.autonomous, self.social = new.problem, new.inverse, new.autonomous, new.social
        if change is not None:
            self.changes.append(change)
            self._publish(Event(Kind.CHANGED, reply=str(change)))

    def _publish(self, *events: Event, row: int | None = None) -> None:
        for event in events:
            self._life.append(event if row is None else (row, event.place))
            for listener in self.listeners:
                listener(event)

    def _report_new(self, *reported: RobotSlot) -> None:
        """Publish the beginnings of new attempts, unless the next events, at the places ``reported``, tell them."""
        begun, self._new = self._begun(reported), []
        self._publish(*begun)

    def _begun(self, reported: Sequence[RobotSlot]) -> list[Event]:
        """Events of all new attempts; none if events at the places ``reported`` tell all of them in their order.

        A replay begins attempts in the order of the events, so that each draws the same random numbers again.
        """
        in_order = self._new == [each for each in reported if each in self._new]
        return [] if in_order else [each.begun() for each in self._new]


def _lesson(demonstration: Demonstration, theta_d: Array) -> tuple[bytes, bytes]:
    return np.asarray(demonstration.context, dtype=np.float64).tobytes(), theta_d.tobytes()
