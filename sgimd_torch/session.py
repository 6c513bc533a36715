"""The main loop: a learner in an environment, movement by movement; what a record holds is replayed first.

Algorithm 1 of Nguyen & Oudeyer (2014).
    for episode in run(learner, environment, seed, movements=5000, teacher=teacher): ...
Movement i draws its noise from stream i. So the noise does not depend on the movements before, and a replay, which
executes nothing, does not change the noise of the movements after it.
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
"""(index, context, theta) -> outcome of movement ``index``."""


class NoOutcomeError(RuntimeError):
    """So many movements in a row have failed that somebody should look; ``__cause__`` is what the last one raised."""


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
    """Let ``learner`` make ``movements`` movements, counting those at rest and those that fail.

    A movement fails if ``environment`` raises, or gives anything else than one finite outcome. The learner remembers
    nothing of it and ends its attempt; the next movement has the next stream.

    A context is observed when an attempt begins, and holds until it ends. The answer to a demonstration takes place in
    the context of the demonstration.

    Args:
        learner: is asked, told and shown. The caller may stop iterating at any time and go on using it; if a
            movement was broken off, as by Ctrl-C, after ``learner.interrupt()``.
        environment: is observed and executed.
        seed: of the environment's streams.
        movements: in all, counting those that ``learner`` has made before: its run goes on.
        teacher: is asked before every movement whether it demonstrates.
        teachers: by name, for a learner that asks for demonstrations. One that fails, or shows what this robot cannot
            use, counts as one without an answer, with a `RuntimeWarning`; so does one that raises TimeoutError.
        execute: is called instead of the environment's, see ``live``.
        record: what it holds is lived through again first, without executing anything or asking ``teachers``; what
            happens then is added to it. It is for a learner and a teacher freshly built.
        failures: failed movements in a row that end the run; at least 1.

    Yields:
        Every episode, after the learner was told its outcome.

    Raises (when iterated):
        ValueError: ``movements`` is not such a number, or the learner has made as many already; or it asks a teacher of
            another name.
        NoOutcomeError: ``failures`` movements in a row have failed. They are made; a `run` may go on after them.
    """
    check_count("failures", failures, 1)
    if not isinstance(learner, Learner):
        raise ValueError(f"learner must be a Learner, got a {type(learner).__name__}; sagg_riac(environment, seed)?")
    check_instance(environment)
    if teacher is not None and not isinstance(teacher, Teacher):
        raise ValueError(f"teacher must be a Teacher, got a {type(teacher).__name__}; PeriodicTeacher(shown, rng)?")
    made = learner.movements
    if check_count("movements", movements, 1) <= made:
        raise ValueError(
            f"movements must be above {made}, which the learner has made already and which count, got {movements}"
        )
    execute = live(environment, seed) if execute is None else execute
    before = BeforeMovement()
    with ExitStack() as until_the_end:
        if record is not None:
            from sgimd_torch.record.replay import replay  # most programs keep no record

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
    """Let the teacher offer a demonstration, unless one waits for an answer."""
    if teacher is None or learner.lesson_waits:
        return before
    offered = teacher.offer(index, learner.memory)
    if offered is None:
        return before
    learner.watch(offered, who=teacher.who)
    return before._replace(demonstration=offered)


def _observed(learner: Learner, environment: Environment, index: int, seed: int) -> Array:
    """The context of the next movement: a new one if an attempt is to begin."""
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
    """Let the learner ask one of the ``teachers`` for a demonstration, and show it the answer."""
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
    """What the robot gives, as ``(dim,)`` finite numbers."""
    try:
        return read_only(check_point(name, robot(*given), dim))
    except (Exception, SystemExit) as error:  # whatever a robot does, it must not end the learner's life
        raise _NoOutcome(reason_of(error)) from error


def reason_of(error: BaseException) -> str:
    """Why a robot failed, in one line of at most 300 characters that a terminal can show."""
    simulated = isinstance(error, SimulationError)
    said = str(error) if simulated else "".join(traceback.format_exception_only(error))
    return "".join(sign if sign.isprintable() else " " for sign in said)[:300].strip()


def _answer(
    learner: Learner, environment: Environment, context: Array, request: Request, teachers: Mapping[str, Demonstrator]
) -> tuple[Demonstration | None, str]:
    """The answer to a request, None if there is none that is new and that the learner can use; and ``Episode.reply``.

    The attempt stays in its own context: a demonstration of another one is a hint, as long as that lies in C.
    """
    name = request.teacher
    if name not in teachers:
        raise ValueError(f"the learner asks {name!r}, but teachers are {', '.join(teachers)}; are they those it knows?")
    try:
        shown = teachers[name].demonstrate(context.copy(), request.goal, learner.memory)
        if shown is None:
            return None, "nothing"
        environment.contexts.check("context of the demonstration", shown.context)
        environment.outcomes.check("outcome of the demonstration", shown.outcome)
        return (None, "again") if learner.was_shown(shown) else (shown, "shown")
    except TimeoutError as error:
        said, reply = f"did not answer in time, so the learner goes on: {error}", "timed out"
    except Exception as error:  # whatever a teacher does, it must not end the learner's life
        said = f"gave no answer that can be used, so the learner goes on: {type(error).__name__}: {error}"
        reply = "failed"
    warnings.warn(f"teacher {name} {said}", RuntimeWarning, stacklevel=4)
    return None, reply


def live(environment: Environment, seed: int) -> Execute:
    """Execute in ``environment``, movement i with the noise of stream i."""

    def execute(index: int, context: Array, theta: Array) -> Array:
        # Copies, so that an environment may write into them.
        return environment.execute(context.copy(), theta.copy(), stream(seed, "environment", index))

    return execute
