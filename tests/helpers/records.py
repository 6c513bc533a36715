"""Helpers for tests of records: events, and a small made-up record with rows in every table."""

import numpy as np

from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.record import DERIVED, Record, layout
from sgimd_torch.spaces import Demonstration, stream

DIMS = 1, 3, 2


def moved(theta, goal=None, context=(0.25,), outcome=(0.5, -0.5)):
    vectors = [None if each is None else np.array(each) for each in (context, theta, goal, outcome)]
    return Event(Kind.MOVED, *vectors, origin="local")


def shown(k=0.0, n_joints=2):
    trajectory = np.arange(4.0 * n_joints).reshape(4, n_joints) + k
    return Demonstration(np.array([k]), np.linspace(0, 1, 4), trajectory, np.array([0.1, k]))


def fill(path, seed=0, n=40):
    """Write a record with rows in all tables, and return its path."""
    rng = stream(seed, "record")
    with Record.make(path, DIMS, {"settings": {"seed": seed, "movements": n}, "versions": {"numpy": "2"}}) as record:
        for k in range(n):
            if k % 10 == 5:
                record.add(Event(Kind.SHOWN, lesson=shown(rng.random()), who="teacher"))
            record.add(moved(rng.random(3), rng.random(2), rng.random(1), rng.random(2)))
        for table in DERIVED:
            record.add_rows(table, rows_for(table, rng))
        record.commit()
    return path


def rows_for(table, rng, n=12):
    def cell(column):
        return {"INTEGER": int(rng.integers(100)), "REAL": rng.random(), "TEXT": "own"}[column.split()[1]]

    return [[cell(column) for column in layout(DIMS)[table][:-1]] for _ in range(n)]


def read(path):
    """The rows of all tables of a record, by table."""
    with Record(path) as record:
        return {table: list(record.rows(table)) for table in layout(record.dims)}
