"""The life of a learner: contexts, movements, rests, outcomes and lessons, in the order in which they came.

A learner of the same parts that lives through them again draws the same numbers, so its goals, its searches and its
memory come out the same, in the middle of an attempt, too. So nothing else has to be saved.
    write_life(path, events, begun, memory); life = read_life(path); for event in life.events: ...

The file is an npz without pickle:
    version          ()                   1
    kinds            (n,) integers        of the events: 0 moved, 1 rested, 2 asked and interrupted, 3 shown,
                                          4 interrupted, 5 begun
    contexts         (n_asked, c)         of the events 0, 1, 2 and 5
    thetas           (n_proposed, p)      of the events 0 and 2
    outcomes         (n_moved, t)         of the events 0
    lesson_*                              of the events 3, end to end, as in a file of demonstrations
    begun            ()                   exemplars in memory before the first event
    memory_crc32     ()                   checksum of the memory after the last
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.files import Stored, read_npz, write_npz
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration, first_entry

_VERSION: Final = 1
_LESSON: Final = ("lesson_lengths", "lesson_times", "lesson_trajectories", "lesson_outcomes", "lesson_contexts")
_NAMES: Final = ("kinds", "contexts", "thetas", "outcomes", *_LESSON, "begun", "memory_crc32")


class ReplayError(RuntimeError):
    """The learner does not repeat what was recorded: another library version, processor or configuration."""


class Kind(IntEnum):
    """What happened."""

    MOVED = 0
    RESTED = 1
    DROPPED = 2  # asked for a movement, then interrupted before its outcome was told
    SHOWN = 3
    INTERRUPTED = 4
    BEGUN = 5  # an attempt that may begin with a request; a demonstration shown next answers it


class Event(NamedTuple):
    """Something that happened to a learner, with what belongs to its kind."""

    kind: Kind
    context: Array | None = None
    theta: Array | None = None
    outcome: Array | None = None
    lesson: Demonstration | None = None


class Life(NamedTuple):
    """``events``; ``begun``: exemplars in memory before them; ``memory_crc32`` of the memory after them."""

    events: list[Event]
    begun: int
    memory_crc32: int


def check_repeats(index: int, recorded: Array | None, theta: Array | None) -> None:
    """Refuse a learner that proposes another theta than the recorded one; None stands for a rest.

    Raises:
        ReplayError: it names the movement and the first parameter that differs.
    """
    slip = "was it recorded by another version, on another processor or with another configuration?"
    if recorded is None or theta is None:
        if recorded is theta:
            return
        was, now = ("rest", "moves") if recorded is None else ("a movement", "rests")
        raise ReplayError(f"movement {index} was recorded as {was}, the learner now {now}; {slip}")
    differ = np.flatnonzero(recorded != theta)
    if differ.size:
        k = differ[0]
        raise ReplayError(
            f"movement {index} was recorded with another theta: theta_{k} was {recorded[k]}, now {theta[k]}; "
            f"{differ.size} of {theta.size} parameters differ; {slip}"
        )


def check_lesson(index: int, recorded: Demonstration | None, offered: Demonstration | None) -> None:
    """Refuse a teacher that offers something else than was shown.

    Raises:
        ReplayError: it names the movement.
    """
    fields = ("context", "times", "trajectory", "outcome")
    if recorded is None or offered is None:
        same = recorded is offered
    else:
        same = all(np.array_equal(getattr(recorded, name), getattr(offered, name)) for name in fields)
    if not same:
        was, now = ("nothing" if each is None else "a demonstration" for each in (recorded, offered))
        other = "another one" if recorded is not None and offered is not None else now
        raise ReplayError(f"before movement {index} {was} was shown, the teacher now offers {other}; is it built anew?")


def memory_crc32(memory: Memory) -> int:
    """Checksum of all exemplars."""
    crc = 0
    for table in (memory.contexts, memory.thetas, memory.outcomes):
        crc = zlib.crc32(np.ascontiguousarray(table).tobytes(), crc)
    return crc


def write_life(path: str | os.PathLike[str], events: Sequence[int | Event], begun: int, memory: Memory) -> None:
    """Replace ``path`` by a whole file.

    Args:
        path: of the file.
        events: a movement is the row of ``memory`` that keeps it.
        begun: exemplars in memory before the first event.
        memory: after the last.

    Raises:
        ValueError: lessons that differ in their number of joints, or whose times do not fit their postures.
        OSError: ``path`` is a directory, or cannot be written.
    """
    full = [_moved(memory, event) if isinstance(event, int) else event for event in events]
    lessons = [event.lesson for event in full if event.lesson is not None]
    if any(d.trajectory.ndim != 2 or d.times.shape != d.trajectory.shape[:1] for d in lessons):
        raise ValueError("a lesson cannot be saved: it needs (n_times,) times and a (n_times, n_joints) trajectory")
    if len({d.trajectory.shape[1] for d in lessons}) > 1:
        raise ValueError("lessons cannot be saved: they differ in their number of joints")
    n_joints = lessons[0].trajectory.shape[1] if lessons else 0
    write_npz(
        path,
        {
            "version": _VERSION,
            "kinds": np.array([event.kind for event in full], dtype=np.uint8),
            "contexts": _rows([event.context for event in full], memory.context_dim),
            "thetas": _rows([event.theta for event in full], memory.theta_dim),
            "outcomes": _rows([event.outcome for event in full], memory.outcome_dim),
            "lesson_lengths": np.array([len(d.times) for d in lessons], dtype=np.int64),
            "lesson_times": np.concatenate([*(d.times for d in lessons), np.empty(0)]),
            "lesson_trajectories": np.concatenate([*(d.trajectory for d in lessons), np.empty((0, n_joints))]),
            "lesson_outcomes": _rows([d.outcome for d in lessons], memory.outcome_dim),
            "lesson_contexts": _rows([d.context for d in lessons], memory.context_dim),
            "begun": begun,
            "memory_crc32": memory_crc32(memory),
        },
    )


def read_life(path: str | os.PathLike[str], memory: Memory) -> Life:
    """The life that ``write_life`` wrote.

    Args:
        path: of the file.
        memory: of the learner that is to live it; its dimensions must be those of the file.

    Raises:
        ValueError: not such a file, truncated, of another version, for another robot, or with arrays that do not fit
            together.
        OSError: there is no file, or it is a directory.
    """
    arrays = dict(zip(_NAMES, read_npz(path, "saved life", "Learner.save", _NAMES), strict=True))
    _check(str(path), arrays, memory)
    contexts, thetas, outcomes = (iter(arrays[name]) for name in ("contexts", "thetas", "outcomes"))
    ends = np.cumsum(arrays["lesson_lengths"])
    lessons = (
        Demonstration(context, times, trajectory, outcome)
        for context, times, trajectory, outcome in zip(
            arrays["lesson_contexts"],
            np.split(arrays["lesson_times"], ends[:-1]),
            np.split(arrays["lesson_trajectories"], ends[:-1]),
            arrays["lesson_outcomes"],
            strict=True,
        )
    )
    events = [
        Event(
            Kind(kind),
            next(contexts) if kind in _ASKED else None,
            next(thetas) if kind in _PROPOSED else None,
            next(outcomes) if kind == Kind.MOVED else None,
            next(lessons) if kind == Kind.SHOWN else None,
        )
        for kind in arrays["kinds"].tolist()
    ]
    return Life(events, int(arrays["begun"]), int(arrays["memory_crc32"]))


_PROPOSED: Final = (Kind.MOVED, Kind.DROPPED)
_ASKED: Final = (*_PROPOSED, Kind.RESTED, Kind.BEGUN)


def _moved(memory: Memory, row: int) -> Event:
    return Event(Kind.MOVED, memory.contexts[row], memory.thetas[row], memory.outcomes[row])


def _rows(values: Sequence[Array | None], dim: int) -> Array:
    rows = [value for value in values if value is not None]
    return np.array(rows, dtype=np.float64).reshape(len(rows), dim)


def _check(source: str, arrays: dict[str, Stored], memory: Memory) -> None:
    kinds, lengths = arrays["kinds"], arrays["lesson_lengths"]
    for name, axes in (("kinds", 1), ("lesson_lengths", 1), ("begun", 0), ("memory_crc32", 0)):
        if arrays[name].ndim != axes or arrays[name].dtype.kind not in "iu":
            raise ValueError(f"{source}: {name} must be integers of {axes} axes, got {arrays[name].dtype}")
    if (kinds > max(Kind)).any() or (kinds < 0).any() or (lengths < 0).any():
        raise ValueError(f"{source} holds events of an unknown kind; was it saved by a newer version?")
    n_shown = int((kinds == Kind.SHOWN).sum())
    samples = sum(lengths.tolist())
    wanted = {
        "contexts": (int(np.isin(kinds, _ASKED).sum()), memory.context_dim),
        "thetas": (int(np.isin(kinds, _PROPOSED).sum()), memory.theta_dim),
        "outcomes": (int((kinds == Kind.MOVED).sum()), memory.outcome_dim),
        "lesson_lengths": (n_shown,),
        "lesson_times": (samples,),
        "lesson_trajectories": (samples, *arrays["lesson_trajectories"].shape[1:2]),
        "lesson_outcomes": (n_shown, memory.outcome_dim),
        "lesson_contexts": (n_shown, memory.context_dim),
    }
    for name, shape in wanted.items():
        found = arrays[name]
        if found.shape != shape or (name != "lesson_lengths" and found.dtype != np.float64):
            slip = "was it saved by a learner of another robot?"
            raise ValueError(f"{source}: {name} must be float64 {shape}, got {found.dtype} {found.shape}; {slip}")
        if not np.isfinite(found).all():
            raise ValueError(f"{source}: {name} must be finite, but {first_entry(found, ~np.isfinite(found))}")
