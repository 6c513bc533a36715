"""The main loop: a learner moves in an environment. If there is a record, it is replayed first.

Algorithm 1 of Nguyen & Oudeyer (2014).
    for episode in run(learner, environment, seed, movements=5000, teacher=teacher): ...
Movement i draws its noise from stream i. So its noise does not depend on earlier movements, whether they were executed
or only replayed.
"""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import FAILURES, Environment, SimulationError, check_instance
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import BeforeMovement
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Array, Demonstration, Episode, Request, check_count, check_point, read_only, stream

if TYPE_CHECKING:
    from sgimd_torch.learner.requests import Demonstrator
    from sgimd_torch.record import Record

Execute = Callable[[int, Array, Array], Array]
"""Function (index, context, theta) -> outcome of movement ``index``."""


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

    Yields:
        Every episode, after the learner was told the outcome.

    Raises (when iterated):
        ValueError: ``movements`` is not above the number that the learner has made, or the learner asks a teacher of
            unknown name.
        NoOutcomeError: ``failures`` movements in a row have failed. They count; another `run` may go on.
    """
    check_count("failures", failures, 1)
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
    before = BeforeMovement()
    with ExitStack() as until_the_end:
        if record is not None:
            from sgimd_torch.record.replay import replay  # loaded here, as most programs keep no record

            before = yield from replay(learner, record.events(), teacher=teacher)
            learner.listeners.append(record.add)
            until_the_end.callback(learner.listeners.remove, record.add)
        in_a_row = 0
        for index in range(learner.movements, movements):
            before = _offered(learner, teacher, index, before)
            context, move, outcome = None, None, None
            try:
                context = _observed(learner, environment, index, seed)
                if teachers and before.request is None:
                    before = _asked(learner, environment, context, teachers, before)
                move = learner.ask(context)
                if move is not None:
                    outcome = _tried("outcome", environment.outcomes.dim, execute, index, context, move.theta)
            except _NoOutcome as error:
                failed, in_a_row, cause = str(error), in_a_row + 1, error.__cause__
                learner.fail(failed)
                seen = np.full(environment.contexts.dim, np.nan) if context is None else context
                yield Episode(index, seen, move, None, *before, failed)
                if in_a_row == failures:
                    raise NoOutcomeError(f"{failures} movements in a row failed, the last one: {failed}") from cause
            else:
                if outcome is not None:
                    in_a_row = 0
                    learner.tell(outcome)
                yield Episode(index, context, move, outcome, *before)
            before = BeforeMovement()


def _offered(learner: Learner, teacher: Teacher | None, index: int, before: BeforeMovement) -> BeforeMovement:
    """Let the teacher offer a demonstration, unless the learner has not yet used the last one."""
    if teacher is None or learner.lesson_waits:
        return before
    offered = teacher.offer(index, learner.memory)
    if offered is None:
        return before
    learner.watch(offered, who=teacher.who)
    return before._replace(demonstration=offered)


def _observed(learner: Learner, environment: Environment, index: int, seed: int) -> Array:
    """The context of the next movement: the context of the current attempt, or a new one if an attempt is to begin."""
    if not learner.idle:
        return learner.context
    return _tried("context", environment.contexts.dim, environment.observe, stream(seed, "context", index))


def _asked(
    learner: Learner,
    environment: Environment,
    context: Array,
    teachers: Mapping[str, Demonstrator],
    before: BeforeMovement,
) -> BeforeMovement:
    """Let the learner ask one of the ``teachers`` for a demonstration, and show the learner the reply."""
    request = learner.request(context)
    if request is None:
        return before
    answer, reply = _answer(learner, environment, context, request, teachers)
    if answer is None:
        learner.go_on_alone(reply)
        return before._replace(request=request, reply=reply)
    learner.watch(answer)
    return BeforeMovement(answer, request, reply)


class _NoOutcome(Exception):
    """A movement failed; the message is the reason."""


def _tried(name: str, dim: int, robot: Callable[..., ArrayLike], *given: Any) -> Array:
    """Result of a call of the robot, as ``(dim,)`` finite numbers."""
    try:
        return read_only(check_point(name, robot(*given), dim))
    except (Exception, SystemExit) as error:  # no failure of a robot may end the run
        raise _NoOutcome(reason_of(error)) from error


def reason_of(error: BaseException) -> str:
    """Reason why a robot failed, in one line of at most 300 printable characters."""
    simulated = isinstance(error, SimulationError)
    said = str(error) if simulated else "".join(traceback.format_exception_only(error))
    return "".join(sign if sign.isprintable() else " " for sign in said)[:300].strip()


def _answer(
    learner: Learner, environment: Environment, context: Array, request: Request, teachers: Mapping[str, Demonstrator]
) -> tuple[Demonstration | None, str]:
    """The demonstration that replies to a request (None: there is no new and usable one), and ``Episode.reply``.

    The attempt keeps its context. A demonstration in another context of C is accepted, too, as a hint.
    """
    name = request.teacher
    if name not in teachers:
        raise ValueError(f"the learner asks {name!r}, but teachers are {', '.join(teachers)}; are they its teachers?")
    try:
        shown = teachers[name].demonstrate(context.copy(), request.goal, learner.memory)
        if shown is None:
            return None, "nothing"
        environment.contexts.check("context of the demonstration", shown.context)
        environment.outcomes.check("outcome of the demonstration", shown.outcome)
        return (None, "again") if learner.was_shown(shown) else (shown, "shown")
    except TimeoutError as error:
        said, reply = f"did not reply in time, so the learner goes on: {error}", "timed out"
    except Exception as error:  # no failure of a teacher may end the run
        said = f"gave no usable demonstration, so the learner goes on: {type(error).__name__}: {error}"
        reply = "failed"
    warnings.warn(f"teacher {name} {said}", RuntimeWarning, stacklevel=4)
    return None, reply


def live(environment: Environment, seed: int) -> Execute:
    """The function that executes movements in ``environment``; movement i draws its noise from stream i."""

    def execute(index: int, context: Array, theta: Array) -> Array:
        # The environment gets copies, so it may write into them.
        return environment.execute(context.copy(), theta.copy(), stream(seed, "environment", index))

    return execute
