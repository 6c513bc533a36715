"""The main loop: a learner moves in an environment. If there is a record, it is replayed first.

Algorithm 1 of Nguyen & Oudeyer (2014).
    for episode in run(learner, environment, seed, movements=5000, teacher=teacher): ...
Movement i draws its noise from stream i. So its noise does not depend on earlier movements, whether they were executed
or only replayed.

With ``at_once=8`` eight robots move at once: the learner proposes eight movements before it knows the outcome of any.
Each robot has attempts of its own. A demonstration before movement i goes to the robot of movement i; its attempt ends,
and the others go on. A robot that imitates, or rests until a teacher replies, does so for movement after movement.
All robots wait for the slowest. A robot that fails ends its own attempt only.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import chain
from typing import TYPE_CHECKING, Final

import numpy as np

from sgimd_torch.environments.protocol import (
    FAILURES,
    Environment,
    NotExecutedError,
    check_instance,
    execute_many,
    observed,
    tried,
)
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import BeforeMovement
from sgimd_torch.parts import Demonstrator, Teacher
from sgimd_torch.spaces import (
    Array,
    Demonstration,
    Episode,
    Failure,
    Move,
    Request,
    check_count,
    stream,
)

if TYPE_CHECKING:
    from sgimd_torch.record import Record

JOINS_EVERY: Final = 30
"""One robot moves for each so many movements before, until all of ``at_once`` move.

Early movements teach most, so each should know the outcomes of those before it.
"""

Execute = Callable[[Sequence[int], Sequence[Array], Sequence[Array]], Sequence[Array | Failure]]
"""Function (indices, contexts, thetas) -> for each of these movements its outcome, or a failure."""


class NoOutcomeError(RuntimeError):
    """Too many movements in a row have failed; ``__cause__`` is the exception of the last one."""


def run(
    learner: Learner,
    environment: Environment,
    seed: int,
    *,
    movements: int,
    teacher: Teacher | None = None,
    teachers: Mapping[str, Demonstrator] | None = None,
    execute: Execute | None = None,
    record: Record | None = None,
    failures: int = FAILURES,
    at_once: int = 1,
) -> Iterator[Episode]:
    """Let ``learner`` move until it has made this number of ``movements``; rests and failed movements count.

    A movement fails if ``environment`` raises, or returns anything but one finite outcome. The learner remembers
    nothing of the failed movement and ends its attempt; the next movement has the next stream.

    A context is observed when an attempt begins, and stays until the attempt ends. Movements after a demonstration are
    made in the context of the demonstration.

    Args:
        learner: learner of this environment. The caller may stop iterating at any time and use the learner again. If
            Ctrl-C has broken off a movement, call ``learner.interrupt()`` first.
        environment: robot and world, which observes contexts and executes movements.
        seed: number from which the environment's random streams come.
        movements: number of movements in all; those that ``learner`` has made before count.
        teacher: teacher who may demonstrate before each movement; None: no teacher.
        teachers: teachers by name, for a learner that asks. If a teacher fails, raises TimeoutError or shows a
            demonstration that this robot cannot use, the learner gets no reply, and there is a `RuntimeWarning`.
        execute: function that executes movements; None for ``live(environment, seed)``.
        record: record to write. Its events are replayed first; the replay executes nothing and asks no teacher of
            ``teachers``. Learner and teacher must be freshly built.
        failures: number of failed movements in a row that ends the run, at least 1.
        at_once: number of robots that move at once, at least 1; at first one, then one for each 30 movements before.
            `BatchEnvironment.execute_many` executes their movements; other environments execute them one by one.

    Yields:
        Every episode, after the learner was told the outcome.

    Raises (when iterated):
        ValueError: ``movements`` is not above the number that the learner has made, or the learner asks a teacher of
            unknown name.
        NoOutcomeError: ``failures`` or more movements in a row have failed. They count; another `run` may go on.
    """
    check_count("failures", failures, 1)
    check_count("at_once", at_once, 1)
    if not isinstance(learner, Learner):
        raise ValueError(f"learner must be a Learner, got a {type(learner).__name__}; try sagg_riac(environment, seed)")
    check_instance(environment)
    if teacher is not None and not isinstance(teacher, Teacher):
        raise ValueError(f"teacher must be a Teacher, got a {type(teacher).__name__}; try PeriodicTeacher(shown, rng)")
    made = learner.movements
    if check_count("movements", movements, 1) <= made:
        raise ValueError(
            f"movements must be above {made}, the number that the learner has made already, got {movements}"
        )
    execute = live(environment, seed) if execute is None else execute
    before: dict[int, BeforeMovement] = {}
    with ExitStack() as at_the_end:
        if record is not None:
            events = record.events()
            if (first_event := next(events, None)) is not None:
                from sgimd_torch.record.replay import repeats_exactly, replay  # a new life has nothing to replay

                exact = repeats_exactly(record.about, learner)
                before = yield from replay(learner, chain([first_event], events), teacher=teacher, exact=exact)
            learner.listeners.append(record.add)
            at_the_end.callback(learner.listeners.remove, record.add)
        failed_in_a_row: list[Failure] = []
        while (first := learner.movements) < movements:
            contexts: list[Array | Failure] = []
            for robot in range(min(at_once, max(1, first // JOINS_EVERY), movements - first)):
                index = first + robot
                preceding = _offered(learner, teacher, index, robot, before.get(robot, BeforeMovement()))
                context = _observed(learner, environment, index, robot, seed)
                if teachers and preceding.request is None and not isinstance(context, Failure):
                    preceding = _asked(learner, environment, context, robot, teachers, preceding)
                before[robot] = preceding
                contexts.append(context)
            moves = learner.ask_many(contexts)
            outcomes = _executed(execute, first, contexts, moves)
            learner.tell_many(outcomes)
            for robot, (context, move, outcome) in enumerate(zip(contexts, moves, outcomes, strict=True)):
                seen = np.full(environment.contexts.dim, np.nan) if isinstance(context, Failure) else context
                preceding = before.pop(robot)
                if isinstance(outcome, Failure):
                    if not isinstance(outcome.cause, NotExecutedError):
                        failed_in_a_row.append(outcome)
                    yield Episode(first + robot, seen, move, None, *preceding, outcome.reason)
                else:
                    if move is not None and len(failed_in_a_row) < failures:
                        failed_in_a_row.clear()
                    yield Episode(first + robot, seen, move, outcome, *preceding)
            if len(failed_in_a_row) >= failures:
                last = failed_in_a_row[-1]
                reason = f"{len(failed_in_a_row)} movements in a row failed, the last one: {last.reason}"
                raise NoOutcomeError(reason) from last.cause


def _offered(
    learner: Learner, teacher: Teacher | None, index: int, robot: int, before: BeforeMovement
) -> BeforeMovement:
    """Let the teacher offer a demonstration, unless the robot has not yet used the last one."""
    if teacher is None or learner.lesson_waits_for(robot):
        return before
    offered = teacher.offer(index, learner.memory)
    if offered is None:
        return before
    learner.watch(offered, who=teacher.who, robot=robot)
    return before._replace(demonstration=offered)


def _observed(learner: Learner, environment: Environment, index: int, robot: int, seed: int) -> Array | Failure:
    """The context of the next movement: the context of the current attempt, or a new one if an attempt is to begin."""
    context = learner.context_of(robot)
    if context is not None:
        return context
    return tried("context", environment.contexts.dim, observed, environment, stream(seed, "context", index))


def _asked(
    learner: Learner,
    environment: Environment,
    context: Array,
    robot: int,
    teachers: Mapping[str, Demonstrator],
    before: BeforeMovement,
) -> BeforeMovement:
    """Let the learner ask one of the ``teachers`` for a demonstration, and show the learner the reply."""
    request = learner.request(context, robot=robot)
    if request is None:
        return before
    demonstration, reply = _reply(learner, environment, context, request, teachers)
    if demonstration is None:
        learner.go_on_alone(reply, robot=robot)
        return before._replace(request=request, reply=reply)
    learner.watch(demonstration, robot=robot)
    return BeforeMovement(demonstration, request, reply)


def _executed(
    execute: Execute, first: int, contexts: Sequence[Array | Failure], moves: Sequence[Move | None]
) -> list[Array | Failure | None]:
    """For each robot its outcome, or why it has none; None: it rests. The first robot makes movement ``first``."""
    outcomes: list[Array | Failure | None] = [context if isinstance(context, Failure) else None for context in contexts]
    moving = [(first + k, contexts[k], move.theta) for k, move in enumerate(moves) if move is not None]
    if moving:
        for (index, *_), outcome in zip(moving, execute(*zip(*moving, strict=True)), strict=True):
            outcomes[index - first] = outcome
    return outcomes


def _reply(
    learner: Learner, environment: Environment, context: Array, request: Request, teachers: Mapping[str, Demonstrator]
) -> tuple[Demonstration | None, str]:
    """The demonstration that replies to a request (None: there is no new and usable one), and ``Episode.reply``.

    The attempt keeps its context. A demonstration in another context of C is accepted, too, as a hint.
    """
    name = request.teacher
    if name not in teachers:
        raise ValueError(f"the learner asks {name!r}, but teachers are {', '.join(teachers)}; are they its teachers?")
    try:
        demonstration = teachers[name].demonstrate(context.copy(), request.goal, learner.memory)
        if demonstration is None:
            return None, "nothing"
        environment.contexts.check("context of the demonstration", demonstration.context)
        environment.outcomes.check("outcome of the demonstration", demonstration.outcome)
        return (None, "again") if learner.was_shown(demonstration) else (demonstration, "shown")
    except TimeoutError as error:
        said, reply = f"did not reply in time, so the learner goes on: {error}", "timed out"
    except (Exception, SystemExit) as error:  # no failure of a teacher may end the run
        said = f"gave no usable demonstration, so the learner goes on: {type(error).__name__}: {error}"
        reply = "failed"
    warnings.warn(f"teacher {name} {said}", RuntimeWarning, stacklevel=4)
    return None, reply


def live(environment: Environment, seed: int) -> Execute:
    """The function that executes movements in ``environment``; movement i draws its noise from stream i."""

    def execute(indices: Sequence[int], contexts: Sequence[Array], thetas: Sequence[Array]) -> list[Array | Failure]:
        return execute_many(environment, contexts, thetas, [stream(seed, "environment", index) for index in indices])

    return execute
