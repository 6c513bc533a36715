"""The learner: it explores on its own until a demonstration interrupts, and then answers the demonstration.

Algorithm 1 of Nguyen & Oudeyer (2014), rebuilt. All five learners of the paper are this class with two slots, an
autonomous and a social strategy. The caller owns the loop: ``move = learner.ask(context)``, execute it,
``learner.tell(outcome)``; ``learner.watch(demonstration)`` whenever the teacher shows something. Some learners want to
be shown a goal: ``learner.request(context)``, before ``ask``, says by whom. Which movement reaches a goal?
``learner.inverse(context, goal).theta``. ``learner.save(path)`` and ``learner.load(path)`` keep its life.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.files import replacing
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.learner.replay import TEACHER, ReplayError, replay
from sgimd_torch.memory import Memory
from sgimd_torch.record import Event, Kind, Record, RunError
from sgimd_torch.spaces import (
    Array,
    AskingAttempt,
    Box,
    Demonstration,
    Estimate,
    Lesson,
    Move,
    Request,
    check_point,
    read_only,
)
from sgimd_torch.strategies import SocialStrategy, Strategy

if TYPE_CHECKING:
    from sgimd_torch.goals.regions import Region
    from sgimd_torch.teachers import Teacher

__all__ = ["Learner", "ReplayError"]


class Learner:
    """Alternates between its own exploration and answers to demonstrations.

    Args:
        memory: keeps the exemplar of every outcome that is told.
        autonomous: what it does on its own.
        social: how it answers a demonstration; None for a learner that cannot be taught.
        correspondence: (times, trajectory) -> theta_d, eq. (6); needed with ``social``.
        inverse: (context, goal) -> estimate, by which it answers; None for `LocallyLinear`. The attribute may be
            replaced, by a `ModelInverse` of the same memory, for example.
        policies: Pi, which a demonstration must not leave; None does not check that.

    Raises:
        ValueError: ``social`` without ``correspondence``.
    """

    def __init__(
        self,
        memory: Memory,
        autonomous: Strategy,
        *,
        social: SocialStrategy | None = None,
        correspondence: Callable[[Array, Array], Array] | None = None,
        inverse: Callable[[Array, Array], Estimate] | None = None,
        policies: Box | None = None,
    ) -> None:
        if social is not None and correspondence is None:
            raise ValueError("a social strategy needs a correspondence, which translates trajectories into theta")
        self.memory = memory
        self.autonomous = autonomous
        self.social = social
        self.correspondence = correspondence
        self.inverse: Callable[[Array, Array], Estimate] = LocallyLinear(memory) if inverse is None else inverse
        self.policies = policies
        self._attempt: AskingAttempt | None = None
        self._context: Array = np.zeros(0)
        self._next: Move | Request | None = None  # of the attempt, not yet told or answered
        self._asked = False
        self._events: list[int | Event] = []  # a movement is the row of memory that keeps it
        self._begun = len(memory)
        self._movements = 0
        self._lessons: set[tuple[bytes, bytes]] = set()
        self._offered_at = -1  # how many it had made when a teacher offered the lesson under way

    @property
    def movements(self) -> int:
        """How many it has made, those at rest and those that failed included."""
        return self._movements

    @property
    def idle(self) -> bool:
        """Whether no attempt is under way, so that the next ``ask`` begins one, also in a new context."""
        return self._attempt is None

    @property
    def lesson_waits(self) -> bool:
        """Whether no movement has answered yet what a teacher offered: a `run` that goes on here asks for no other."""
        return self._offered_at == self._movements

    @property
    def regions(self) -> Sequence[Region]:
        """Of its goal model as they are now; none if that has no regions."""
        return list(getattr(getattr(self.autonomous, "goals", None), "regions", ()))

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
        self._go_unanswered()
        if self._attempt is None:
            context = read_only(context)
            self._begin(self.autonomous.attempt(context), context)
            self._go_unanswered()
            if self._attempt is None:
                raise RuntimeError(f"{type(self.autonomous).__name__}.attempt() has to yield at least once")
        elif context is not self._context and not np.array_equal(context, self._context):
            raise RuntimeError(f"the attempt under way began in context {self._context}, got {context}; see idle")
        if not isinstance(self._next, Move):
            self._events.append(Event(Kind.RESTED, self._context))
            self._movements += 1
            self._advance(None)
            return None
        self._asked = True
        return self._next

    def request(self, context: ArrayLike) -> Request | None:
        """What it asks a teacher for before its next movement; None if nothing. `watch` answers, `ask` without an
        answer goes on alone.

        Args:
            context: as for `ask`; an attempt begins in it if none is under way.

        Raises:
            ValueError: a context of another shape, or not finite.
        """
        context = check_point("context", context, self.memory.context_dim)
        if self._attempt is None:
            context = read_only(context)
            self._begin(self.autonomous.attempt(context), context)
            self._events.append(Event(Kind.ASKED, self._context))
        return self._next if isinstance(self._next, Request) else None

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
        self.memory.add(self._context, self._next.theta, outcome)
        self._asked = False
        self._events.append(len(self.memory) - 1)
        self._movements += 1
        self._advance(self.memory.outcomes[-1])

    def watch(self, demonstration: Demonstration, *, offered: bool = False) -> None:
        """See a demonstration: the attempt under way ends, and the social strategy answers from the next ``ask`` on.
        One that was requested goes to the attempt that had requested it.

        Args:
            demonstration: what is shown.
            offered: by the teacher of a `run`, see ``lesson_waits``.

        Raises:
            RuntimeError: this learner has no social strategy, or the last movement's outcome was not told.
            ValueError: a demonstration that does not fit the spaces or the correspondence, or whose theta_d leaves Pi;
                nothing has happened then.
        """
        requested = self.waits_for_answer
        if self.social is None and not requested:
            raise RuntimeError("this learner has no social strategy, so it cannot be taught; use no teacher")
        if self._asked:
            raise RuntimeError("watch() needs the outcome of the last movement first; was tell() forgotten?")
        theta_d = self.translate(demonstration)
        if not requested:
            self._end()
            self._offered_at = self._movements if offered else -1
        self._events.append(Event(Kind.SHOWN, lesson=demonstration, who=TEACHER if offered else None))
        self._lessons.add(_lesson(demonstration, theta_d))
        if requested:
            self._advance(Lesson(theta_d, demonstration))
        elif self.social is not None:
            context = np.asarray(demonstration.context, dtype=np.float64)
            self._begin(self.social.attempt(context, theta_d, demonstration), context)

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
        if self.policies is not None:
            self.policies.check("theta_d of the correspondence", theta_d)
        return theta_d

    def was_shown(self, demonstration: Demonstration) -> bool:
        """Whether it was shown the same movement in the same context before.

        Raises:
            RuntimeError, ValueError: as `translate`.
        """
        return _lesson(demonstration, self.translate(demonstration)) in self._lessons

    def fail(self, reason: str) -> None:
        """Say that a movement has failed, so that there is no outcome to tell. It counts as a movement, nothing is
        remembered, and its attempt ends as by `interrupt`.

        Args:
            reason: why, for the record.
        """
        theta = self._next.theta if self._asked and isinstance(self._next, Move) else None
        context = self._context if theta is not None else None
        self._events.append(Event(Kind.FAILED, context, theta, reply=reason))
        self._movements += 1
        self._end()

    def interrupt(self) -> None:
        """End the attempt under way; what it learnt so far counts. An outcome not yet told is no longer expected."""
        if self._asked and isinstance(self._next, Move):
            self._events.append(Event(Kind.INTERRUPTED, self._context, self._next.theta))
        elif self._attempt is not None:
            self._events.append(Event(Kind.INTERRUPTED))
        self._end()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write its life to a record: contexts, movements, rests, outcomes and lessons, in SQLite.

        A movement that was asked for and not told yet is left out: after `load`, ask for it again.

        Raises:
            OSError: ``path`` is a directory, or cannot be written.
        """
        memory = self.memory
        dims = memory.context_dim, memory.theta_dim, memory.outcome_dim
        with (
            replacing(path) as partial,
            Record.make(partial, dims, {"begun": self._begun, "exemplars": len(memory)}) as record,
        ):
            for event in self._events:
                record.add(self._moved(event) if isinstance(event, int) else event)
            record.commit()

    def load(
        self,
        path: str | os.PathLike[str],
        *,
        teacher: Teacher | None = None,
        after: Callable[[Move | None], object] | None = None,
    ) -> None:
        """Live through a saved life again, or through the life of a run; then go on as if it had never stopped.

        Args:
            path: what `save` wrote, or the ``run.sqlite`` of a run.
            teacher: freshly built, too, if one draws lessons at random: it is asked before each movement, as in `run`,
                so that it goes on in the same way. None for the lessons of the file alone.
            after: called after each movement, told or at rest (then with None), as your loop does to refresh a forward
                model.

        Raises:
            ReplayError: this learner would have moved otherwise, or its memory comes out otherwise. It has then lived a
                part of that life; build another one.
            RuntimeError: it has lived already.
            RunError: no record, damaged, or of another robot.
        """
        if self._events or self._attempt is not None:
            raise RuntimeError("load() needs a learner freshly built; this one has lived already")
        dims = self.memory.context_dim, self.memory.theta_dim, self.memory.outcome_dim
        with Record(path) as record:
            for damage in record.check().values():
                raise RunError(damage)
            if record.dims != dims:
                raise RunError(f"{path} has dims {record.dims} of context, theta, outcome, got {dims}; another robot?")
            begun, exemplars = record.about.get("begun", 0), record.about.get("exemplars")
            if begun != self._begun:
                raise ReplayError(f"{path} began with {begun} exemplars in memory, this learner with {self._begun}")
            for episode in replay(self, record.events(), teacher=teacher):
                if after is not None:
                    after(episode.move)
        if exemplars not in (None, len(self.memory)):
            raise ReplayError(f"{path} ended with another memory; were exemplars added to one of them by hand?")

    def _moved(self, row: int) -> Event:
        memory = self.memory
        return Event(Kind.MOVED, memory.contexts[row], memory.thetas[row], outcome=memory.outcomes[row])

    def _end(self) -> None:
        if self._attempt is not None:
            self._attempt.close()
        self._attempt = self._next = None
        self._asked, self._offered_at = False, -1

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

    def _go_unanswered(self) -> None:
        while isinstance(self._next, Request):
            self._advance(None)


def _lesson(demonstration: Demonstration, theta_d: Array) -> tuple[bytes, bytes]:
    return np.asarray(demonstration.context, dtype=np.float64).tobytes(), theta_d.tobytes()
