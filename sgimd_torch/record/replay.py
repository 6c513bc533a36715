"""Replay: a new learner, built from the same parts, repeats recorded events, and so equals the recorded learner.

The learner draws the same random numbers again, so goals, searches and memory are equal, even in the middle of an
attempt. So `sgimd_torch.record` has to keep nothing but events.
    save_life(learner, path); load_life(new, path)
    for episode in replay(learner, record.events(), teacher=teacher): ...
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, Final

import numpy as np

from sgimd_torch import __version__
from sgimd_torch.files import replacing
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import TEACHER, BeforeMovement, Event, Kind
from sgimd_torch.parts import Teacher
from sgimd_torch.record import Record, ReplayError, RunError
from sgimd_torch.spaces import ROUNDING, Array, Box, Demonstration, Episode, Failure, Move, Request
from sgimd_torch.texts import numbers_in

_HINT: Final = "was it recorded by another version or processor, or with another seed or configuration?"
_TRAINED_ELSEWHERE: Final = (
    "movement {} was recorded with another theta: another device or processor trained the forward model. The learner "
    "remembers the recorded thetas"
)
# Events that are never grouped with others.
_ALONE: Final = (Kind.SHOWN, Kind.ASKED, Kind.ADDED, Kind.RESTARTED, Kind.CHANGED, Kind.FORGOTTEN)
_ROUNDED: Final = (
    "movement {} was recorded with a theta that differs by rounding: another version or processor made the record. The "
    "learner remembers the recorded theta"
)
_LESSON_ROUNDED: Final = (
    "before movement {} a demonstration was shown that differs by rounding: another version or processor made the "
    "record. The recorded demonstration counts"
)


def save_life(learner: Learner, path: str | os.PathLike[str]) -> None:
    """Write the life of a learner to a record: contexts, movements, rests, outcomes and lessons, in SQLite.

    A movement whose outcome was not told yet is left out: after `load_life`, ask for this movement again.

    Raises:
        ValueError: exemplars entered the memory without `Learner.add`, so no learner could repeat this life.
        OSError: ``path`` is a directory, a pipe, a device or a run, or cannot be written.
    """
    counted = {Kind.MOVED, Kind.ADDED, *([Kind.SHOWN] if learner.social and learner.social.remembers else [])}
    events = [*learner.events()]
    lived = learner.begun + sum(event.kind in counted for event in events)
    lived -= sum(len(numbers_in(event.reply or "")) for event in events if event.kind == Kind.FORGOTTEN)
    if len(learner.memory) != lived:
        raise ValueError(
            f"the memory has {len(learner.memory)} exemplars, but {lived} were lived; were some added without "
            "learner.add(), which records them?"
        )
    with suppress(RunError), Record(path) as before:
        if "settings" in before.about:
            raise OSError(f"{path} is the record of a run, which no life replaces; choose another file")
    about = {"begun": learner.begun, "seed": learner.seed, "versions": {"sgimd_torch": __version__}}
    with replacing(path, record=True) as partial, Record.make(partial, learner.problem.dims, about) as record:
        for event in events:
            record.add(event)
        record.commit()


def load_life(
    learner: Learner,
    path: str | os.PathLike[str],
    *,
    teacher: Teacher | None = None,
    after: Callable[[Move | None], object] | None = None,
) -> None:
    """Let a learner repeat a saved life or the life of a run; it can then go on as if the life had never stopped.

    Args:
        learner: learner freshly built from the same parts.
        path: file that `save_life` wrote, or the ``run.sqlite`` of a run.
        teacher: teacher freshly built, if it draws at random: it is asked before each movement, as in `run`, so that
            its draws go on in the same way. None: nobody is asked.
        after: function that gets each movement, None at a rest, such as the refresh of a forward model in your loop.

    Raises:
        ReplayError: this learner makes another movement. It has then lived a part of that life; build a new learner.
        RuntimeError: the learner has lived already.
        RunError: there is no record at ``path``, or it is of another robot, or damaged; then, too, build a new learner.
    """
    for episode in repeated(learner, path, teacher=teacher):
        if after is not None:
            after(episode.move)


def repeated(learner: Learner, path: str | os.PathLike[str], *, teacher: Teacher | None = None) -> Iterator[Episode]:
    """Let a learner repeat a saved life, one movement for each episode that is taken; see `load_life`."""
    if any(learner.events()) or not learner.idle:
        raise RuntimeError("load_life() needs a learner freshly built; this one has lived already")
    dims = learner.problem.dims
    with Record(path) as record:
        if record.dims != dims:
            raise RunError(f"{path} has dims {record.dims} of context, theta, outcome, not {dims}; another robot?")
        begun = record.about.get("begun", 0)
        if begun != learner.begun:
            raise ReplayError(f"{path} began with {begun} exemplars in memory, this learner began with {learner.begun}")
        if (seed := record.about.get("seed", learner.seed)) != learner.seed:
            raise ReplayError(f"{path} is the life of a learner with seed {seed}, this learner has seed {learner.seed}")
        exact = repeats_exactly(record.about, learner)
        yield from replay(learner, record.events(), teacher=teacher, exact=exact)


def replay(
    learner: Learner, events: Iterable[Event], *, teacher: Teacher | None = None, exact: bool = True
) -> Generator[Episode, None, dict[int, BeforeMovement]]:
    """Let ``learner`` repeat ``events``. Nothing is executed, and no recorded request reaches a teacher.

    Args:
        learner: learner freshly built.
        events: events of the record.
        teacher: teacher freshly built, if it draws at random. Its ``offer`` is called before each movement, so that its
            draws go on as in the run; an offer must equal the recorded demonstration. None: nobody is asked.
        exact: whether thetas must repeat, but for rounding; see ``repeats_exactly``. Goals must repeat anyway.

    Yields:
        Episodes, as `run` has yielded them.

    Returns:
        Demonstration, request and reply since the last episode of each robot, by number of the robot.

    Raises (when iterated):
        ReplayError: the learner proposes a movement, or the teacher a demonstration, that differs from the record. If a
            theta or a demonstration differs by rounding, see `ROUNDING`, the recorded one counts, and the first such
            difference gives a `RuntimeWarning`.
    """
    rounded = False
    offered: dict[int, Demonstration | None] = {}  # by number of the movement
    asked_until = 0  # the teacher was asked before all movements below this number
    before: dict[int, BeforeMovement] = {}
    for group in _together(events):
        event, index = group[0], learner.movements
        last, preceding = index + group[-1].robot, before.get(event.robot, BeforeMovement())
        # Between two runs the caller may show something, or begin or end an attempt; then no teacher is asked.
        between = event.robot < 0 or (event.kind in _ALONE and event.who is None)
        if teacher is not None and not between:
            offered |= {k: teacher.offer(k, learner.memory) for k in range(max(asked_until, index), last + 1)}
            asked_until = max(asked_until, last + 1)
        match event.kind:
            case Kind.SHOWN:
                if event.who == TEACHER and teacher is not None:
                    differs = _check_lesson(last, event.lesson, offered.pop(last, None))
                    if differs and not rounded:
                        warnings.warn(_LESSON_ROUNDED.format(last), RuntimeWarning, stacklevel=2)
                    rounded |= differs
                assert event.lesson is not None
                try:
                    learner.watch(event.lesson, who=event.who, robot=event.robot)
                except RuntimeError as error:
                    refused = f"before movement {last} the learner was shown a demonstration, now it takes none"
                    raise ReplayError(f"{refused}; is it built in the same way and with the same seed?") from error
                if not between:
                    offered.pop(last, None)
                    before[event.robot] = preceding._replace(demonstration=event.lesson)
            case Kind.ASKED:
                assert event.context is not None
                learner.request(event.context, robot=event.robot)
                if event.who is not None and event.goal is not None:
                    request = Request(event.who, event.goal, event.strategy or "")
                    before[event.robot] = preceding._replace(request=request, reply=event.reply or "")
                    if event.reply != "shown":
                        learner.go_on_alone(event.reply or "", robot=event.robot)
            case Kind.ADDED:
                assert event.context is not None
                assert event.theta is not None
                assert event.outcome is not None
                learner.add(event.context, event.theta, event.outcome)
            case Kind.FORGOTTEN:
                learner.forget(numbers_in(event.reply or ""))
            case Kind.RESTARTED | Kind.CHANGED:  # the learner has noticed it again
                pass
            case Kind.INTERRUPTED if between:
                learner.interrupt()
                asked_until = index  # when the run was resumed, its teacher was asked again
            case _:
                for number in range(index, last + 1):
                    _check_lesson(number, None, offered.pop(number, None))
                contexts: list[Array | Failure] = [Failure("")] * (group[-1].robot + 1)
                for event in group:
                    if event.context is not None and not _unseen(event):
                        contexts[event.robot] = event.context
                moves = learner.ask_many(contexts)
                for event in group:
                    if _check_move(learner, event, index + event.robot, moves[event.robot], exact):
                        assert event.theta is not None
                        learner.replace_theta(event.theta, robot=event.robot)
                        if not rounded:
                            remark = (_ROUNDED if exact else _TRAINED_ELSEWHERE).format(index + event.robot)
                            warnings.warn(remark, RuntimeWarning, stacklevel=2)
                        rounded = True
                if event.kind == Kind.INTERRUPTED:
                    learner.interrupt()
                    asked_until = index  # when the run was resumed, its teacher was asked again
                    continue
                learner.tell_many([Failure(event.reply or "") if _failed(event) else event.outcome for event in group])
                for event in group:
                    context, failed = event.context, event.reply or "" if _failed(event) else ""
                    if context is None or _unseen(event):
                        context = np.full(learner.memory.context_dim, np.nan)
                    preceding = before.pop(event.robot, BeforeMovement())
                    yield Episode(index + event.robot, context, moves[event.robot], event.outcome, *preceding, failed)
    return before


def repeats_exactly(about: Mapping[str, Any], learner: Learner) -> bool:
    """Whether the forward model of a learner, if any, is trained as for the record that ``about`` describes.

    Another device or processor rounds differently, so the model, and a search through it, differ a little.
    """
    versions, devices = about.get("versions", {}), {part.device for part in learner.problem.trained}
    recorded = {made_by.get("device") for made_by in (versions, *versions.get("before", ()))} - {None}
    return not devices or recorded <= devices


def _together(events: Iterable[Event]) -> Iterator[list[Event]]:
    """Groups of events: movements that were made at once, by number of the robot; every other event is alone."""
    group: list[Event] = []
    for event in events:
        moved = event.kind not in _ALONE and event.robot >= 0
        same = group and (event.kind == Kind.INTERRUPTED) == (group[-1].kind == Kind.INTERRUPTED)
        if group and not (moved and same and event.robot > group[-1].robot):
            yield group
            group = []
        if moved:
            group.append(event)
        else:
            yield [event]
    if group:
        yield group


def _failed(event: Event) -> bool:
    return event.kind == Kind.FAILED


def _unseen(event: Event) -> bool:
    """Whether the robot failed before it could see a context."""
    return _failed(event) and event.theta is None


def _check_move(learner: Learner, event: Event, index: int, move: Move | None, exact: bool) -> bool:
    """Refuse a learner that proposes another movement than the recorded one.

    Returns:
        Whether the thetas differ; if ``exact``, by rounding.
    """
    if move is None or event.theta is None:
        if move is not None or event.theta is not None:
            was, now = ("rest", "moves") if event.theta is None else ("a movement", "rests")
            raise ReplayError(f"movement {index} was recorded as {was}, the learner now {now}; {_HINT}")
        return False
    problem = learner.problem
    if event.goal is not None:
        _check_repeats(problem.outcomes, index, "goal", event.goal, move.goal)
    differs = bool((event.theta != move.theta).any())
    if exact and differs:
        _check_repeats(problem.policies, index, "theta", event.theta, move.theta)
    return differs


def _check_repeats(box: Box, index: int, name: str, recorded: Array, now: Array | None) -> None:
    if now is None:
        raise ReplayError(f"movement {index} was recorded with a {name}, the learner now has none; {_HINT}")
    if (recorded != now).any() and not box.same(recorded, now):
        k = int(np.argmax(np.abs(recorded - now) / box.sides))
        raise ReplayError(
            f"movement {index} was recorded with another {name}: {name}_{k} was {recorded[k]}, now {now[k]}; "
            f"{np.count_nonzero(recorded != now)} of {now.size} entries differ; {_HINT}"
        )


def _check_lesson(index: int, recorded: Demonstration | None, offered: Demonstration | None) -> bool:
    """Refuse a teacher that offers another demonstration than the recorded one.

    Returns:
        Whether the demonstrations differ, by rounding.
    """
    if recorded is offered:
        return False
    if recorded is not None and offered is not None:
        fields = ("context", "times", "trajectory", "outcome")
        pairs = [(getattr(recorded, name), getattr(offered, name)) for name in fields]
        if all(was.shape == now.shape and np.allclose(was, now, ROUNDING, ROUNDING) for was, now in pairs):
            return not all(np.array_equal(was, now) for was, now in pairs)
    was, now = ("nothing" if lesson is None else "a demonstration" for lesson in (recorded, offered))
    other = "another one" if recorded is not None and offered is not None else now
    raise ReplayError(f"before movement {index} {was} was shown, the teacher now offers {other}; is it built anew?")
