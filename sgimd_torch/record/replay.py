"""Replay: a learner freshly built from equal parts repeats recorded events, and so equals the recorded learner.

The learner draws the same random numbers again, so goals, searches and memory are equal, even in the middle of an
attempt. So `sgimd_torch.record` has to keep nothing but events.
    for episode in replay(learner, record.events(), teacher=teacher): ...
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from typing import Final

import numpy as np

from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import TEACHER, BeforeMovement, Event, Kind
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Array, Demonstration, Episode, Request

_HINT: Final = "was it recorded by another version, on another processor or with another configuration?"


class ReplayError(RuntimeError):
    """The learner does not repeat its record, because library version, processor or configuration differ."""


def replay(
    learner: Learner, events: Iterable[Event], *, teacher: Teacher | None = None
) -> Generator[Episode, None, BeforeMovement]:
    """Let ``learner`` repeat ``events``. Nothing is executed, and no demonstration is requested from anybody.

    Args:
        learner: learner freshly built.
        events: events of the record.
        teacher: teacher, freshly built; its ``offer`` is called before each movement, so that its random draws continue
            as in the recorded run. Demonstrations without ``who`` were not offered, and are taken from the record. None
            to take all demonstrations from the record.

    Yields:
        Episodes, as `run` has yielded them.

    Returns:
        Demonstration, request and reply after the last episode.

    Raises (when iterated):
        ReplayError: the learner proposes another movement than the recorded one, or the teacher offers another one.
    """
    offered: Demonstration | None = None
    asked_at = -1  # index of the movement before which the teacher was asked last
    before = BeforeMovement()
    for event in events:
        index = learner.movements
        # Between two runs the caller may show something, or begin or end an attempt; no teacher is asked before that.
        between = event.kind in (Kind.SHOWN, Kind.ASKED, Kind.INTERRUPTED) and event.who is None and event.theta is None
        if teacher is not None and asked_at < index and not between:
            asked_at, offered = index, teacher.offer(index, learner.memory)
        match event.kind:
            case Kind.SHOWN:
                if event.who == TEACHER and teacher is not None:
                    _check_lesson(index, event.lesson, offered)
                if learner.social is None and not learner.waits_for_answer:
                    found = f"before movement {index} the learner asked for a demonstration, now it does not"
                    raise ReplayError(f"{found}; is it built in the same way and with the same seed?")
                assert event.lesson is not None
                learner.watch(event.lesson, who=event.who)
                if not between:
                    offered, before = None, before._replace(demonstration=event.lesson)
            case Kind.ASKED:
                assert event.context is not None
                learner.request(event.context)
                if event.who is not None and event.goal is not None:
                    request = Request(event.who, event.goal, event.strategy or "")
                    before = before._replace(request=request, reply=event.reply or "")
                    if event.reply != "shown":
                        learner.go_on_alone(event.reply or "")
            case Kind.INTERRUPTED if between:
                learner.interrupt()
                asked_at = -1  # the resumed run asked its teacher once more
            case Kind.FAILED if event.theta is None:
                learner.fail(event.reply or "")
                yield Episode(
                    index, np.full(learner.memory.context_dim, np.nan), None, None, *before, event.reply or ""
                )
                before = BeforeMovement()
            case _:
                assert event.context is not None
                _check_lesson(index, None, offered)
                move = learner.ask(event.context)
                _check_repeats(index, "theta", event.theta, None if move is None else move.theta)
                if event.goal is not None:
                    _check_repeats(index, "goal", event.goal, None if move is None else move.goal)
                if event.kind == Kind.INTERRUPTED:
                    learner.interrupt()
                    asked_at = -1  # the resumed run asked its teacher once more
                    continue
                failed = (event.reply or "") if event.kind == Kind.FAILED else ""
                if event.kind == Kind.FAILED:
                    learner.fail(failed)
                elif event.outcome is not None:
                    learner.tell(event.outcome)
                yield Episode(index, event.context, move, event.outcome, *before, failed)
                before = BeforeMovement()
    return before


def _check_repeats(index: int, name: str, recorded: Array | None, now: Array | None) -> None:
    """Refuse a learner that proposes another vector than the recorded one; None means a rest."""
    if recorded is None or now is None:
        if recorded is now:
            return
        was, is_now = ("rest", "moves") if recorded is None else ("a movement", "rests")
        raise ReplayError(f"movement {index} was recorded as {was}, the learner now {is_now}; {_HINT}")
    differ = np.flatnonzero(recorded != now)
    if differ.size:
        k = differ[0]
        raise ReplayError(
            f"movement {index} was recorded with another {name}: {name}_{k} was {recorded[k]}, now {now[k]}; "
            f"{differ.size} of {now.size} entries differ; {_HINT}"
        )


def _check_lesson(index: int, recorded: Demonstration | None, offered: Demonstration | None) -> None:
    """Refuse a teacher that offers another demonstration than the recorded one."""
    fields = ("context", "times", "trajectory", "outcome")
    if recorded is None or offered is None:
        same = recorded is offered
    else:
        same = all(np.array_equal(getattr(recorded, name), getattr(offered, name)) for name in fields)
    if not same:
        was, now = ("nothing" if each is None else "a demonstration" for each in (recorded, offered))
        other = "another one" if recorded is not None and offered is not None else now
        raise ReplayError(f"before movement {index} {was} was shown, the teacher now offers {other}; is it built anew?")
