"""Movements of another robot, such as a simulator, that a run begins with: ``--begin-with``.

memory, notes, crc32 = past_of(task, Path("simulated/practice/seed-000/run.sqlite"))
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.files import checksum, is_record, read_csv
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import Memory
from sgimd_torch.record import Dims, Record, Row, RunError
from sgimd_torch.spaces import Box, check_vector
from sgimd_torch.tasks import Task
from sgimd_torch.texts import NUMBER, numbers_in


def past_of(task: Task, path: Path, record: Path | None = None) -> tuple[Memory, list[str], str]:
    """The movements in a record, or in a csv file with columns ``context_0``, ``theta_0``, ``outcome_0`` and so on.

    Args:
        task: task of the run, whose robot must have the dimensions of these movements.
        path: record or csv file.
        record: record of the run, if it is on disk. It has these movements, too, so the file may be gone.

    Returns:
        The movements, messages about them, and the checksum of the file.

    Raises:
        ValueError: the file is damaged or has no movements, or its robot has other dimensions, units or bounds.
        OSError: the file cannot be read.
    """
    robot, exemplars, crc32 = task.environment, list[Row](), ""
    dims = robot.contexts.dim, robot.policies.dim, robot.outcomes.dim
    if record is not None:
        with Record(record) as kept:
            exemplars = [*kept.rows("prior")] if kept.dims == dims else []
            crc32 = kept.about.get("files", {}).get("begin_with_crc32")
    if not exemplars or path.exists():
        crc32 = checksum(path)
    if not exemplars:
        exemplars = list(_recorded(path, robot, dims) if is_record(path) else _listed(path, robot))
    if not exemplars:
        raise RunError(f"{path} holds no movements to begin with")
    contexts, thetas, outcomes = np.split(np.array(exemplars, dtype=np.float64), np.cumsum(dims)[:2], axis=1)
    robot.contexts.check(f"contexts of {path}", contexts)
    robot.policies.check(f"thetas of {path}", thetas)
    memory = Memory(*dims)
    memory.extend(contexts, thetas, check_vector(f"outcomes of {path}", outcomes, robot.outcomes.dim))
    return memory, [f"begins with {len(memory)} movements of {path}, as far as they help"], crc32


def _recorded(path: Path, robot: Environment, dims: Dims) -> Iterator[Row]:
    """Exemplars of a record, context, theta and outcome in a row; a run says in which boxes, with which units."""
    boxes = {"contexts": robot.contexts, "policies": robot.policies, "outcomes": robot.outcomes}
    with Record(path) as record:
        if record.dims != dims:
            raise RunError(f"{path} has dims {record.dims} of context, theta, outcome, this robot has {dims}")
        with record.translated_errors():
            spaces = {name: Box(*record.about["spaces"][name]) for name in boxes if "spaces" in record.about}
        for name, recorded in spaces.items():
            box = boxes[name]
            if recorded.unit != box.unit:
                raise RunError(f"{name} of {path} are in {recorded.unit or 'no unit'}, here in {box.unit or 'no unit'}")
            if name != "outcomes" and not np.array_equal([recorded.low, recorded.high], [box.low, box.high]):
                raise RunError(
                    f"{name} of {path} lie in {recorded.low} to {recorded.high}, here in {box.low} to {box.high}"
                )
        goal, outcome = sum(dims[:2]), sum(dims)  # their first columns, after those of context and theta
        forgotten = {k for row in record.rows("events") if row[1] == Kind.FORGOTTEN for k in numbers_in(row[-3])}
        for movement, kind, _, *cells in record.rows("events"):
            if kind == Kind.ADDED or (kind == Kind.MOVED and movement not in forgotten):
                yield *cells[:goal], *cells[outcome : outcome + dims[2]]


def _listed(path: Path, robot: Environment) -> Iterator[Row]:
    """Exemplars of a csv file, context, theta and outcome in a row; other columns do not matter."""
    boxes = {"context": robot.contexts, "theta": robot.policies, "outcome": robot.outcomes}
    wanted = [f"{name}_{k}" for name, box in boxes.items() for k in range(box.dim)]
    (_, heads), *rows = read_csv(path) or [(1, [])]
    faults = [f"lacks the column {name}" for name in wanted if name not in heads]
    faults += [f"has two columns {name}" for name in wanted if heads.count(name) > 1]
    more = [f"{name}_{box.dim}" for name, box in boxes.items()]
    faults += [f"has a column {name}, so it is of another robot" for name in more if name in heads]
    if faults:
        raise RunError(f"{path} {faults[0]}; this robot needs {', '.join(wanted)}")
    for number, row in rows:
        cells = dict(zip(heads, row, strict=False))
        try:
            yield tuple(NUMBER.of(cells.get(name, "")) for name in wanted)
        except ValueError as error:
            raise RunError(f"{path}: line {number} is no movement of {len(wanted)} numbers") from error
