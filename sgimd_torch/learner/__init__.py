"""The learner: it explores alone until a demonstration interrupts, and then uses the demonstration.

Algorithm 1 of Nguyen & Oudeyer (2014), rebuilt. All five learners of the paper are this class with two strategies, an
autonomous and a social one. The caller owns the loop: ``move = learner.ask(context)``, execute it,
``learner.tell(outcome)``. ``learner.watch(demonstration)`` shows a demonstration. ``learner.request(context)``, before
``ask``, returns the request of a learner that asks teachers. ``learner.inverse(context, goal).theta`` is the movement
for a goal. ``learner.forget([12])`` takes movement 12 back. ``learner.listeners.append(print)`` prints every event.

Several robots move at once by ``moves = learner.ask_many(contexts)`` and ``learner.tell_many(outcomes)``. Robot k has
slot k of the learner, where its attempts go on. All robots share one memory, its goal models and one record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, NoReturn, Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.learner.events import Change, Event, Kind
from sgimd_torch.learner.slots import RobotSlot
from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Inverse, Problem, Social, Strategy
from sgimd_torch.spaces import Array, Demonstration, Failure, Lesson, Move, Request, check_point, read_only, stream

Correspondence = Callable[[Array, Array], Array]
"""Function from times ``(n_times,)`` and trajectory ``(n_times, n_joints)`` to theta_d ``(theta_dim,)``, eq. (6)."""


class Watcher(Protocol):
    """Watches all movements; if its robot has changed, a learner begins again."""

    def expect(self, context: Array, theta: Array, outcome: Array) -> None:
        """Compare an outcome, which is not in memory yet, with what is expected."""

    def restart_if_changed(self) -> Restart | None:
        """What to begin again with; None to go on."""

    def begin_again(self, exemplars: Exemplars, n: int) -> Learner:
        """The learner of a `Restart` after ``n`` exemplars in all, whose memory has these ``exemplars``."""


class Restart(NamedTuple):
    """How a learner begins again.

    Attributes:
        learner: learner to go on as; its memory has the exemplars ``kept``, then those since the change.
        kept: exemplars of before that still help, as they would be now.
        since: row, in the memory of all exemplars, of the first one since the change.
        change: change that was noticed now; None: an earlier one.
    """

    learner: Learner
    kept: Exemplars
    since: int
    change: Change | None


class Beginning(NamedTuple):
    """How a learner began, so that it can begin again.

    Attributes:
        begin: function (seed, memory) that builds it.
        memory: exemplars that it began with.
        watch: function that makes its watcher; None: nobody watches.
    """

    begin: Callable[[int, Memory], Learner]
    memory: Memory
    watch: Callable[[], Watcher | None]


class Learner:
    """Alternates between autonomous exploration and attempts after demonstrations.

    Args:
        problem: problem to learn; its memory gets an exemplar for every outcome that is told.
        autonomous: autonomous strategy.
        social: social strategy, which uses demonstrations; None: the learner cannot be taught.
        correspondence: function from times and trajectory to theta_d, eq. (6); needed with ``social``.

    Attributes:
        memory: all exemplars; without those of forgotten movements, it is another memory.
        problem: problem to learn; after a change of the robot its memory holds only exemplars that still help.
        inverse: inverse model; another inverse model of this problem may replace it.
        watcher: object that notices changes of the robot; None: nobody does.
        changes: changes of the robot so far.
        listeners: functions that are called with each `Event`, after it has happened.
        begun, seed: number of exemplars at the start, and number from which all random streams come.
        movements: number of movements, rests and failed movements included.
        rows: row in memory of the exemplar of each movement, by number; of a movement that left none, what it was.
        beginning: function, memory and watcher of its beginning; None: unknown, so it cannot forget.

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
        self.begun, self.seed, self.movements = len(self.memory), problem.seed, 0
        self.watcher: Watcher | None = None
        self.changes: list[Change] = []
        self.rows: dict[int, int | Kind] = {}
        self.beginning: Beginning | None = None
        self._life: list[tuple[int, int] | Event] = []  # events; for a movement, its number and its robot
        self._slots = [RobotSlot(0)]
        self._new: list[RobotSlot] = []  # slots whose attempt no event has reported so far, in order of beginning
        self._asked: list[tuple[RobotSlot, Move | Failure | None]] = []  # what was asked for and is not told so far
        self._lessons: set[tuple[bytes, bytes]] = set()

    @property
    def idle(self) -> bool:
        """Whether no attempt is under way; then the next ``ask`` begins one, in any context."""
        return all(slot.attempt is None for slot in self._slots)

    def lesson_waits_for(self, robot: int) -> bool:
        """Whether the demonstration that was offered to this ``robot`` is still unanswered."""
        return self._slot(robot).offered_at == self.movements

    @property
    def regions(self) -> Sequence[Any]:
        """Current regions of the goal model; none if it has no regions."""
        return self.autonomous.regions

    def context_of(self, robot: int) -> Array | None:
        """Context of the attempt of this ``robot`` under way, read-only; None: its next attempt may have any."""
        slot = self._slot(robot)
        return None if slot.attempt is None else slot.context

    def events(self) -> Iterator[Event]:
        """All events so far, in order; movements lack goal and origin."""
        yield from map(self._event, self._life)
        yield from self._beginnings([slot for slot, move in self._asked if not isinstance(move, Failure)])

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a learner cannot be copied or pickled, as an attempt under way is a generator; save_life(learner, path), "
            "then load_life(new, path) into a learner built in the same way"
        )

    def ask(self, context: ArrayLike) -> Move | None:
        """The next movement, or None, which is a rest: there is no outcome to tell. See `ask_many`."""
        (move,) = self.ask_many([context])
        if move is None:
            self.tell_many([None])
        return move

    def ask_many(self, contexts: Sequence[ArrayLike | Failure]) -> list[Move | None]:
        """The next movements of several robots, before the outcome of any of them is known.

        Args:
            contexts: context ``(context_dim,)`` of each robot, or its `Failure` if it could not see one. An attempt
                keeps its context, see `context_of`.

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
        checked = [
            context if isinstance(context, Failure) else check_point("context", context, dim) for context in contexts
        ]
        for number, context in enumerate(checked):
            under_way = self.context_of(number)
            differs = under_way is not None and not isinstance(context, Failure) and (context != under_way).any()
            if differs:
                raise RuntimeError(f"the attempt under way began in context {under_way}, got {context}; see idle")
        slots = [self._slot(number) for number in range(len(checked))]
        self._asked = [(slot, self._propose(slot, context)) for slot, context in zip(slots, checked, strict=True)]
        return [move if isinstance(move, Move) else None for _, move in self._asked]

    def request(self, context: ArrayLike, *, robot: int = 0) -> Request | None:
        """The request to a teacher before the next movement, or None. `watch` replies with a demonstration; after
        `go_on_alone`, or after `ask` at once, the request stays without a demonstration.

        Args:
            context: ``(context_dim,)``, the context of a new attempt if none is under way.
            robot: number of the robot.

        Raises:
            ValueError: the context has another shape, or is not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        slot = self._slot(robot)
        if slot.attempt is None:
            self._begin(slot, context)
        return slot.request

    def go_on_alone(self, reply: str, *, robot: int = 0) -> None:
        """Tell the learner that its request gets no demonstration.

        Args:
            reply: reason, for the record.
            robot: number of the robot with the request.

        Raises:
            RuntimeError: the learner has made no request.
        """
        slot = self._slot(robot)
        if slot.request is None:
            raise RuntimeError("go_on_alone() needs a request, but request() has given none")
        asked = slot.asked(slot.request, reply)
        slot.advance(None)
        self._report_new(slot)
        self._publish(asked)

    def tell(self, outcome: ArrayLike) -> None:
        """Tell the outcome ``(outcome_dim,)`` of the movement from `ask`; it enters the memory. See `tell_many`."""
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
        # A rest that fails leaves no trace of its attempt, so the beginning of the attempt is reported by itself.
        pairs = zip(asked, told, strict=True)
        traced = [slot for (slot, move), outcome in pairs if isinstance(move, Move) or outcome is None]
        self._report_new(*traced)
        self._asked = []
        for (slot, move), outcome in zip(asked, told, strict=True):
            self._tell(slot, move if isinstance(move, Move) else None, outcome)
        self._publish(*self._restarted())

    def replace_theta(self, theta: Array, *, robot: int = 0) -> None:
        """Replace the movement that is asked for of a ``robot`` by the recorded ``theta``, which equals it but for
        rounding. Only a replay does this: the memory then holds what was executed."""
        slot, move = self._asked[robot]
        assert isinstance(move, Move)
        self._asked[robot] = slot, replace(move, theta=theta)

    def watch(self, demonstration: Demonstration, *, who: str | None = None, robot: int = 0) -> None:
        """Watch a demonstration. A requested demonstration goes to the attempt that requested it. Any other
        demonstration ends the attempt under way, and the social strategy begins with the next ``ask``.

        Args:
            demonstration: demonstration that is shown.
            who: name of the teacher whose offers a `run` checks before each movement, see `lesson_waits_for`; None: the
                demonstration comes from somebody else.
            robot: number of the robot that uses the demonstration; attempts of other robots go on.

        Raises:
            RuntimeError: this learner has no social strategy, or the outcome of the last movement was not told.
            ValueError: the demonstration does not fit the spaces or the correspondence, or theta_d lies outside Pi;
                the learner is unchanged.
        """
        slot = self._slot(robot)
        if self.social is None and slot.request is None:
            raise RuntimeError("this learner has no social strategy, so it cannot be taught; use no teacher")
        if self._asked:
            raise RuntimeError("watch() needs the outcome of the last movement first; was tell() forgotten?")
        theta_d = self.translate(demonstration)
        self._lessons.add(_lesson_key(demonstration, theta_d))
        if slot.request is not None:
            asked, who = slot.asked(slot.request, "shown"), slot.request.teacher
            slot.advance(Lesson(theta_d, demonstration))
            self._report_new(slot)
            self._publish(asked)
        elif self.social is not None:
            self._report_new()
            slot.end()
            slot.offered_at = -1 if who is None else self.movements
            context = np.asarray(demonstration.context, dtype=np.float64)
            slot.begin(self.social.attempt(context, theta_d, demonstration), context)
        self._publish(Event(Kind.SHOWN, lesson=demonstration, who=who, robot=robot))

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
        outcome = read_only(self.problem.outcomes.wrapped(self.memory.check_outcome(theta, outcome)))
        self._report_new()
        self._remember(context, theta, outcome)
        self._publish(Event(Kind.ADDED, context, theta, outcome=outcome))
        self._publish(*self._restarted())

    def forget(self, movements: Iterable[int]) -> None:
        """Take back movements whose outcomes were wrong: from now on it is as if their exemplars had never come.

        The learner begins again with all other exemplars, as after a change of its robot: attempts under way end, and
        all parts are built anew, the goal model with its regions, too. Changes of the robot are looked for again, so
        one that only wrong outcomes had shown is taken back. `events` keep the movements.

        Args:
            movements: numbers of the movements from 0, as in the column ``movement`` of a record and in messages.

        Raises:
            RuntimeError: the outcome of the last movement was not told.
            ValueError: there is no such movement, it left no exemplar, or it was forgotten before; or this learner has
                a forward model, or no `beginning`. Nothing is forgotten then.
        """
        from sgimd_torch.learner.forgetting import forgettable  # few learners forget
        from sgimd_torch.texts import as_spans

        numbers = forgettable(movements, self.rows, len(self._asked))
        if self._asked:
            raise RuntimeError("forget() needs the outcome of the last movement first; was tell() forgotten?")
        if self.problem.trained:
            raise ValueError("a forward model cannot forget what it was trained on; begin a new run")
        if self.beginning is None:
            raise ValueError("this learner cannot forget, as it cannot begin again: use algorithms.learner_of()")
        self._report_new()
        self._publish(Event(Kind.FORGOTTEN, reply=as_spans(numbers)), *self.take_back(numbers))

    def take_back(self, numbers: Sequence[int], *, watched: bool = True) -> list[Event]:
        """Begin again without the exemplars of these movements, and return the events of restarts on the way.

        Args:
            numbers: numbers of movements that have an exemplar.
            watched: whether changes of the robot are looked for; if not, a record tells them.
        """
        assert self.beginning is not None
        (begin, memory, watch), movements = self.beginning, self.movements
        seed = int(stream(self.seed, "forget", movements).integers(2**63))
        gone, numbers_of = {*numbers}, {row: number for number, row in self.rows.items() if isinstance(row, int)}
        self._life = [
            entry if isinstance(entry, Event) or entry[0] not in gone else self._event(entry) for entry in self._life
        ]
        self.rows |= dict.fromkeys(numbers, Kind.FORGOTTEN)
        for slot in self._slots:
            slot.end()
        before, events = Exemplars.of(self.memory), list[Event]()
        self.go_on_as(begin(seed, memory))
        self.memory, self.changes = self.problem.memory, []
        watcher = None if self.watcher is None else watch()
        self.watcher = watcher if watched else None
        for row in range(self.begun, len(before.thetas)):
            number = numbers_of.get(row)  # None: it was added or shown
            if number in gone:
                continue
            if number is not None:
                self.rows[number], self.movements = len(self.memory), number + 1
            self._remember(*(table[row] for table in before))
            events += self._restarted()
        self.watcher, self.movements = watcher, movements
        self.go_on_as(begin(seed, self.problem.memory))  # some parts look at the memory when they are built
        return events

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
        return _lesson_key(demonstration, self.translate(demonstration)) in self._lessons

    def fail(self, reason: str) -> None:
        """Tell the learner that a movement has failed and has no outcome. The movement counts, nothing is
        remembered, and the attempt ends as by `interrupt`.

        Args:
            reason: reason of the failure, for the record.

        Raises:
            RuntimeError: several robots were asked for movements; `tell_many` says which of them have failed.
        """
        if not self._asked:
            self.ask_many([Failure(reason)])
        if (n := len(self._asked)) > 1:
            raise RuntimeError(
                f"fail() is of one robot, but {n} were asked; write tell_many([outcome, Failure(reason)])"
            )
        self.tell_many([Failure(reason)])

    def interrupt(self) -> None:
        """End all attempts under way; their movements so far count. Outcomes that were not told are no longer
        expected."""
        asked, self._asked = [(slot, move) for slot, move in self._asked if not isinstance(move, Failure)], []
        if self.idle:
            return
        self._report_new(*(slot for slot, _ in asked))
        stopped = [
            Event(Kind.INTERRUPTED, slot.context, robot=slot.number)
            if move is None
            else slot.moved(Kind.INTERRUPTED, move)
            for slot, move in asked
        ]
        for slot in self._slots:
            slot.end()
        self._publish(*(stopped or [Event(Kind.INTERRUPTED, robot=-1)]))

    def _slot(self, number: int) -> RobotSlot:
        while len(self._slots) <= number:
            self._slots.append(RobotSlot(len(self._slots)))
        return self._slots[number]

    def _begin(self, slot: RobotSlot, context: Array) -> None:
        context = read_only(context)
        self._new.append(slot)
        slot.begin(self.autonomous.attempt(context), context)

    def _propose(self, slot: RobotSlot, context: Array | Failure) -> Move | Failure | None:
        """The next movement of a robot; a new attempt begins if none is under way."""
        if isinstance(context, Failure):
            return context
        for _ in range(2):  # the attempt under way may end with a request that gets no reply
            if slot.attempt is None:
                self._begin(slot, context)
            while slot.request is not None:
                self.go_on_alone("nothing", robot=slot.number)
            if slot.attempt is not None:
                return self._within_pi(slot.move)
        raise RuntimeError(f"{type(self.autonomous).__name__}.attempt() has to yield at least once")

    def _within_pi(self, move: Move | None) -> Move | None:
        """The movement, after a check that its theta is a point of Pi; no other theta may go to a robot."""
        if move is None:
            return move
        pi, theta = self.problem.policies, move.theta
        if theta.dtype != pi.low.dtype or theta.shape != pi.low.shape or not pi.contains(theta):  # quicker than check
            part = self.social if move.origin == "imitate" and self.social else self.autonomous.maker(move.origin)
            name = f"theta of the part {type(part).__name__}"
            pi.check(name, check_point(name, theta, pi.dim))
        return move

    def _checked(self, move: Move | Failure | None, outcome: ArrayLike | Failure | None) -> Array | Failure | None:
        """The outcome or the failure of a movement, after its check; None for a rest."""
        if isinstance(outcome, Failure):
            return outcome
        if isinstance(move, Move) and outcome is not None:
            return self.problem.outcomes.wrapped(self.memory.check_outcome(move.theta, outcome))
        if isinstance(move, Move) or outcome is not None:
            raise ValueError(f"a movement has an outcome or a Failure, a rest has None; got {outcome} for {move}")
        return move

    def _tell(self, slot: RobotSlot, move: Move | None, outcome: Array | Failure | None) -> None:
        """Tell what came of the movement of one robot, after its check."""
        number = self.movements
        self.movements += 1
        if isinstance(outcome, Failure):
            self.rows[number] = Kind.FAILED
            lost = Event(Kind.FAILED, reply=outcome.reason, robot=slot.number)
            failed = lost if move is None else slot.moved(Kind.FAILED, move, reply=outcome.reason)
            slot.end()
            self._publish(failed)
        elif move is None or outcome is None:
            self.rows[number] = Kind.RESTED
            slot.advance(None)
            self._publish(Event(Kind.RESTED, slot.context, robot=slot.number))
        else:
            assert slot.context is not None
            self._remember(slot.context, move.theta, outcome)
            self.rows[number] = len(self.memory) - 1
            moved = slot.moved(Kind.MOVED, move, self.memory.outcomes[-1])
            slot.advance(moved.outcome)
            self._publish(moved, number=number)

    def _remember(self, context: Array, theta: Array, outcome: Array) -> None:
        if self.watcher is not None:
            self.watcher.expect(context, theta, outcome)
        for memory in dict.fromkeys((self.memory, self.problem.memory)):
            memory.extend(context[None], theta[None], outcome[None])

    def _restarted(self) -> Iterator[Event]:
        """Begin again if the robot has changed: attempts end, and all parts are built anew. The events are returned."""
        restart = None if self.watcher is None else self.watcher.restart_if_changed()
        if restart is None:
            return
        for slot in self._slots:
            slot.end()
        self.go_on_as(restart.learner)
        yield Event(Kind.RESTARTED, since=restart.since, kept=restart.kept)
        if restart.change is not None:
            self.changes.append(restart.change)
            yield Event(Kind.CHANGED, reply=str(restart.change))

    def go_on_as(self, other: Learner) -> None:
        """Take the problem and all parts of a learner that has begun again."""
        self.problem, self.inverse, self.autonomous = other.problem, other.inverse, other.autonomous
        self.social = other.social

    def _event(self, entry: tuple[int, int] | Event) -> Event:
        """An event of this life; a movement lacks goal and origin."""
        if isinstance(entry, Event):
            return entry
        row = self.rows[entry[0]]
        assert isinstance(row, int)
        context, theta, outcome = (table[row] for table in Exemplars.of(self.memory))
        return Event(Kind.MOVED, context, theta, outcome=outcome, robot=entry[1])

    def _publish(self, *events: Event, number: int | None = None) -> None:
        for event in events:
            self._life.append(event if number is None else (number, event.robot))
            for listener in self.listeners:
                listener(event)

    def _report_new(self, *reported: RobotSlot) -> None:
        """Publish the beginnings of new attempts, unless the next events, of the slots ``reported``, tell them."""
        beginnings, self._new = self._beginnings(reported), []
        self._publish(*beginnings)

    def _beginnings(self, reported: Sequence[RobotSlot]) -> list[Event]:
        """Events of all new attempts; none if events of the slots ``reported`` tell all of them in their order.

        A replay begins attempts in the order of the events, so that each draws the same random numbers again.
        """
        in_order = self._new == [slot for slot in reported if slot in self._new]
        return [] if in_order else [Event(Kind.ASKED, slot.context, robot=slot.number) for slot in self._new]


def _lesson_key(demonstration: Demonstration, theta_d: Array) -> tuple[bytes, bytes]:
    return np.asarray(demonstration.context, dtype=np.float64).tobytes(), theta_d.tobytes()
