"""The layout of a record: the columns of every table, and rows as Python objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from typing import Any, Final

import numpy as np

from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.spaces import Array, Demonstration

DERIVED: Final = ("goals", "evaluations", "errors", "regions", "predictions", "refreshes")  # tables that a replay fills
HINT: Final = "was it damaged or edited? sqlite3 run.sqlite .recover prints what can be read"  # end of error messages

Dims = tuple[int, int, int]
"""Dimensions of context, theta and outcome."""

Row = tuple[Any, ...]


class RunError(ValueError):
    """A record cannot be used: it is missing, damaged, in use, or belongs to another run."""


class ReplayError(RuntimeError):
    """A learner or its teacher does not repeat the record: version, processor, parts or seed differ."""


_COUNTED: Final = (Kind.MOVED, Kind.RESTED, Kind.FAILED)  # events that count as movements
_IN_CONTEXT: Final = (*_COUNTED, Kind.ASKED, Kind.ADDED, Kind.INTERRUPTED)  # events with a context


def layout(dims: Dims) -> dict[str, list[str]]:
    """Declarations of the columns of every table, in SQL. SQLite allows at most 2,000 columns in a table."""
    c, p, t = dims
    context, theta, goal, outcome = (
        _vector(name, dim) for name, dim in (("context", c), ("theta", p), ("goal", t), ("outcome", t))
    )
    words = ["demonstration INTEGER", "who TEXT", "strategy TEXT", "reply TEXT", "robot INTEGER", "since INTEGER"]
    evaluated = ["movements INTEGER", "inverse TEXT"]
    numbers = ["mean_error", "median_error", "p90_error", "noise_floor", "expected_error"]
    predicted = [column for name in ("predicted", "epistemic", "aleatoric") for column in _vector(name, t)]
    learnt = ["held_out REAL", "relative_error REAL", "diverged INTEGER"]
    learnt += ["training_loss REAL", "gradient_norm REAL", "learning_rate REAL"]
    corners = [column for name in ("low", "high") for column in _vector(name, c + t)]
    interest = ["competence REAL", "interest REAL"]
    columns = {
        "about": ["name TEXT", "value TEXT"],
        "events": ["movement INTEGER", "kind TEXT", "origin TEXT", *context, *theta, *goal, *outcome, *words],
        "prior": [*context, *theta, *outcome],
        "kept": ["event INTEGER", *context, *theta, *outcome],
        "demonstrations": [*context, *outcome, "n_joints INTEGER", "times BLOB", "trajectory BLOB"],
        "goals": ["goal INTEGER", *goal],
        "evaluations": [*evaluated, *(f"{name} REAL" for name in numbers), "goals_met INTEGER"],
        "errors": [*evaluated, "goal INTEGER", "error REAL", "noise REAL", "failed INTEGER", "expected REAL", *context],
        "regions": ["movements INTEGER", "path TEXT", *corners, "attempts INTEGER", "goals INTEGER", *interest],
        "predictions": ["exemplar INTEGER", *outcome, *predicted],
        "refreshes": ["movements INTEGER", "exemplars INTEGER", "steps INTEGER", *learnt],
    }
    return {table: [*names, "checksum INTEGER"] for table, names in columns.items()}


def event_row(event: Event, movement: int, lesson: int | None, dims: Dims) -> Row:
    """The row of an event after ``movement`` movements; ``lesson`` is the row number of the event's demonstration."""
    c, p, t = dims
    vectors = (
        *_cells(event.context, c),
        *_cells(event.theta, p),
        *_cells(event.goal, t),
        *_cells(event.outcome, t),
    )
    origin, who, strategy, reply = map(_text, (event.origin, event.who, event.strategy, event.reply))
    return movement, str(event.kind), origin, *vectors, lesson, who, strategy, reply, event.robot, event.since


def event_reader(dims: Dims, demonstrations: Sequence[Demonstration]) -> Callable[[Row], Event]:
    """A function that turns a row of ``events`` into an event; ``demonstrations`` are those of the record."""
    every = (*dims, dims[2])
    parts = [slice(*ends) for ends in pairwise(accumulate(every, initial=3))]

    def read(row: Row) -> Event:
        context, theta, goal, outcome = (_array(row[part]) for part in parts)
        lesson, who, strategy, reply, robot, since = row[-6:]
        kind = Kind(row[1])
        if kind not in _IN_CONTEXT:
            context = None
        demonstration = None if lesson is None else demonstrations[lesson]
        return Event(kind, context, theta, goal, outcome, row[2], demonstration, who, strategy, reply, robot, since)

    return read


def movements_after(movement: int, kind: str) -> int:
    """Number of movements after an event of this ``kind``; ``movement`` is the number before it. Rests count, too."""
    return movement + (kind in _COUNTED)


def demonstration_row(demonstration: Demonstration, dims: Dims) -> Row:
    """The row of a demonstration."""
    times, trajectory = demonstration.times, demonstration.trajectory
    vectors = *_cells(demonstration.context, dims[0]), *_cells(demonstration.outcome, dims[2])
    return *vectors, trajectory.shape[1], times.tobytes(), trajectory.tobytes()


def read_demonstration(row: Row, dims: Dims) -> Demonstration:
    """The demonstration in a row of the table ``demonstrations``."""
    *vectors, n_joints, times, trajectory = row
    context, outcome = _array(tuple(vectors[: dims[0]])), _array(tuple(vectors[dims[0] :]))
    assert context is not None
    assert outcome is not None
    return Demonstration(context, np.frombuffer(times), np.frombuffer(trajectory).reshape(-1, n_joints), outcome)


def _vector(name: str, dim: int) -> list[str]:
    return [f"{name}_{k} REAL" for k in range(dim)]


def _text(value: str | None) -> str | None:
    """A text of Python; numpy's and other texts come back from SQLite as such."""
    if not isinstance(value, str | None):
        raise ValueError(f"a record keeps origins, names and replies as text, got {value!r}")
    return None if value is None else str(value)


def _cells(values: Array | None, dim: int) -> list[Any]:
    """The cells of a vector, all NULL if the vector is None or has a NaN. -0.0 becomes 0.0, as in SQLite."""
    numbers = None if values is None else np.asarray(values, dtype=np.float64) + 0.0
    if numbers is not None and numbers.shape != (dim,):
        raise ValueError(f"a record keeps vectors of {dim} numbers here, got shape {numbers.shape}; is it a goal?")
    return [None] * dim if numbers is None or np.isnan(numbers).any() else numbers.tolist()


def _array(cells: Row) -> Array | None:
    """The vector in some cells of a row, None if one of the cells is NULL."""
    return None if None in cells else np.array(cells, dtype=np.float64)


def plain(row: Sequence[Any]) -> Row:
    """A row as SQLite returns it: NaN becomes NULL, numpy's numbers become Python's."""
    values = (value.item() if isinstance(value, np.generic) else value for value in row)
    return tuple((None if value != value else value + 0.0) if isinstance(value, float) else value for value in values)
