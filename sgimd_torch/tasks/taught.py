"""Demonstrations of a task, checked and translatable.

demonstrations, notes, crc32 = demonstrations_of(task, file); translate = correspondence_of(task)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.demonstrations.fit import misfit_of, slow_clock
from sgimd_torch.environments.protocol import Translating, primitive_of
from sgimd_torch.files import checksum
from sgimd_torch.learner import Correspondence
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.tasks import Task

FASTER: Final = 3.0  # ratio of durations, shortest movement to recording; a larger ratio means times in a wrong unit
TOO_FAR: Final = 0.25  # share of a joint's range; a recording with a larger misfit is refused


def demonstrations_of(task: Task, file: Path | None) -> tuple[Sequence[Demonstration], list[str], str | None]:
    """Demonstrations of a teacher, messages about them, and the checksum of their file (None: no file).

    Args:
        task: task of the run.
        file: file of demonstrations to use in place of the task's demonstrations, or None.

    Raises:
        ValueError: there are no demonstrations, one cannot be translated, or the file is damaged.
        OSError: there is no such file.
    """
    source, robot = file or task.demonstrations, task.environment
    if source is None:
        raise ValueError(
            f"{type(robot).__name__} has no demonstrations, but this algorithm needs a teacher; give --demonstrations "
            "FILE, or choose an algorithm that learns alone: --algorithm practice"
        )
    if isinstance(source, Path):
        crc32: str | None = checksum(source)
        demonstrations: Sequence[Demonstration] = load_demonstrations(
            source, outcome_dim=robot.outcomes.dim, context_dim=robot.contexts.dim
        )
        for row, demonstration in enumerate(demonstrations):
            try:
                theta_of(task, demonstration)
            except ValueError as error:
                raise ValueError(f"{source}: recording {row} cannot be translated: {error}") from error
    else:
        crc32, demonstrations = None, source()
    notes = [f"{len(demonstrations)} demonstrations"] if demonstrations else []
    notes += [f"recording {row} {said}" for row, shown in enumerate(demonstrations) for said in slow_clock(shown)][:1]
    outside = [row for row, shown in enumerate(demonstrations) if not robot.outcomes.contains(shown.outcome)]
    if outside:
        unit = robot.outcomes.unit or "the unit of T"
        more = f", as do {len(outside) - 1} more" if len(outside) > 1 else ""
        notes.append(f"recording {outside[0]} lands outside T{more}; were they not recorded in {unit}?")
    return demonstrations, notes, crc32


def correspondence_of(task: Task) -> Correspondence:
    """The function (times, trajectory) -> theta_d of a task.

    Raises:
        ValueError: neither the task nor its environment has a correspondence.
    """
    if task.correspondence is not None:
        return task.correspondence
    if isinstance(task.environment, Translating):
        return task.environment.correspondence
    raise ValueError(
        f"{type(task.environment).__name__} has no correspondence, so demonstrations cannot be translated; give it "
        "a method correspondence(times, trajectory) -> theta, or return Task(environment, correspondence=...)"
    )


def theta_of(task: Task, demonstration: Demonstration) -> Array:
    """theta_d ``(theta_dim,)`` of a demonstration, eq. (6).

    Raises:
        ValueError: the task has no correspondence, the correspondence refuses the recording, or no movement of the
            robot comes near it.
    """
    robot, primitive = task.environment, primitive_of(task.environment)
    shortest, ranges, times = primitive.durations[0], primitive.ranges, demonstration.times
    if (lasts := times[-1] - times[0]) < shortest / FASTER:
        raise ValueError(
            f"it lasts {lasts:g} s, movements at least {shortest:g} s; is it in milliseconds, or played too fast?"
        )
    theta = correspondence_of(task)(times, demonstration.trajectory)
    theta = robot.policies.check("theta_d of the correspondence", theta)
    misfit = misfit_of(robot, theta, demonstration)
    if ranges is not None and misfit > TOO_FAR * ranges.sides.mean():
        raise ValueError(
            f"the nearest movement of the robot misses it by {misfit:.2f} (root mean square); is it in degrees, with "
            "the joints in another order, or with a jerk?"
        )
    return theta
