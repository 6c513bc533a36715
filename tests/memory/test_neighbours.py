"""Neighbours: those of sorted distances, ties to the oldest, whatever was asked before; in a graph nearly all."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.competence import Competence
from sgimd_torch.memory import Memory
from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat, Graph, Scan
from sgimd_torch.spaces import Array, Box, stream
from worlds import problem


def nearest(rows: Array, query: Array, k: int) -> list[int]:
    """The oracle: all rows by (distance, row number)."""
    return [int(row) for row in np.square(rows - query).sum(axis=1).argsort(kind="stable")[:k]]


def assert_nearest(near: Array, rows: Array, query: Array, k: int, make: type) -> None:
    """The rows are those of the oracle; of nearly equally near ones, faiss may find others."""
    distances, expected = np.square(rows - query).sum(axis=1), nearest(rows, query, k)
    assert len({*near.tolist()}) == len(expected)
    np.testing.assert_allclose(distances[near], distances[expected], rtol=1e-12 if make is Scan else 2e-6)
    assert (np.diff(distances[near]) >= -1e-12 * distances[near][1:]).all()


def structured(n: int, dim: int, seed: int = 0) -> Array:
    """As a life leaves them: ten in a row are variations of one movement."""
    rng = stream(seed, "rows")
    return rng.random((n // 10 + 1, dim)).repeat(10, axis=0)[:n] + 0.05 * rng.standard_normal((n, dim))


TABLES = {  # what single precision could confuse
    "normal": lambda rng, n, dim: rng.normal(size=(n, dim)),
    "many ties": lambda rng, n, dim: rng.integers(-1, 2, size=(n, dim)).astype(float),
    "all equal": lambda rng, n, dim: np.full((n, dim), 0.25),
    "far from zero": lambda rng, n, dim: 1e7 + rng.integers(0, 2**20, size=(n, dim)) * 2.0**-24,
    "some beyond single precision": lambda rng, n, dim: (
        rng.normal(size=(n, dim)) * 10.0 ** rng.integers(-60, 60, (n, 1))
    ),
    "tiny": lambda rng, n, dim: 1e-30 * rng.normal(size=(n, dim)),
    "first huge": lambda rng, n, dim: np.concatenate((np.full((1, dim), 1e30), rng.normal(size=(n - 1, dim)))),
}


@settings(max_examples=60)
@given(
    st.sampled_from([Flat, Graph, Scan]),
    st.sampled_from(sorted(TABLES)),
    st.integers(1, 9),
    st.lists(st.integers(1, 400), min_size=1, max_size=4),
    st.data(),
)
def test_neighbours_are_those_of_sorted_distances_while_the_table_grows(make, kind, dim, steps, data):
    rng = stream(data.draw(st.integers(0, 99)), kind)
    rows = TABLES[kind](rng, sum(steps), dim)
    side, n = make(Growing(dim)), 0
    for step in steps:
        side.keys.append(rows[n : n + step])
        n += step
        k = data.draw(st.integers(1, n + 3))
        asked = rng.integers(0, n, 4)
        queries = np.concatenate((rows[asked], rng.normal(size=(2, dim)), 1e6 * rng.normal(size=(1, dim))))
        for query, near in zip(queries, side.nearest(queries, k), strict=True):
            assert_nearest(near, rows[:n], query, k, make)
        within = float(np.median(np.abs(rows)))
        for row, near in zip(asked, side.nearest(rows[asked], k, within), strict=True):
            count = int((near >= 0).sum())
            assert (near[count:] == -1).all()
            assert_nearest(near[:count], rows[:n], rows[row], count, make)
            assert count == min(k, (np.square(rows[:n] - rows[row]).sum(axis=1) <= within**2).sum())


def test_rows_added_later_count_whatever_k_was_before():
    rows, side = np.append(0, 1 / np.arange(1.0, 60.0))[:, None], Flat(Growing(1))  # each is nearer to the first
    for n in range(1, 61):
        side.keys.append(rows[n - 1 : n])
        for k in (1, 40, 5):
            assert side.nearest(np.zeros((1, 1)), k)[0].tolist() == nearest(rows[:n], rows[0], k)


@pytest.fixture(scope="module")
def many():
    """Rows in a graph, and some that are not in it yet."""
    side = Graph(Growing(10, structured(24_300, 10)))
    assert len(side.keys) > side.flat_up_to + 1000
    return side


def test_a_graph_finds_nearly_all_nearest_first_and_within_the_radius(many):
    rows = many.keys.rows
    asked = np.append(np.arange(0, len(rows), 300), len(rows) - 1)
    hits = 0
    for row, near in zip(asked, many.nearest(rows[asked], 10), strict=True):
        assert near[0] == row
        assert (np.diff(np.square(rows[near] - rows[row]).sum(axis=1)) >= 0).all()
        hits += len({*near.tolist()} & {*nearest(rows, rows[row], 10)})
    assert 0.95 * 10 * len(asked) <= hits
    for row, near in zip(asked[:20], many.nearest(rows[asked[:20]], 10, within=0.3), strict=True):
        assert (np.square(rows[near[near >= 0]] - rows[row]).sum(axis=1) <= 0.3**2).all()
        assert near[0] == row


def test_a_graph_depends_on_the_rows_alone_not_on_when_they_were_added(many):
    rows, grown = many.keys.rows, Graph(Growing(10))
    for start in range(0, len(rows), 7_700):
        grown.keys.append(rows[start : start + 7_700])
        grown.nearest(rows[:2], 3)
    queries = np.concatenate((rows[::400], np.full((1, 10), 1e70)))
    assert np.array_equal(many.nearest(queries, 20, 0.4), grown.nearest(queries, 20, 0.4))


def test_threads_that_ask_at_once_get_what_one_gets():
    rows = structured(3000, 5)
    asked = [rows[start : start + 20] for start in range(0, 2000, 13)]
    alone, side = Flat(Growing(5, rows)), Flat(Growing(5, rows))
    with ThreadPoolExecutor(4) as pool:
        together = [near.tolist() for near in pool.map(lambda some: side.nearest(some, 20), asked)]
    assert together == [alone.nearest(some, 20).tolist() for some in asked]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda memory: pickle.loads(pickle.dumps(memory))])
@pytest.mark.parametrize("context_dim", [0, 2])
def test_a_copied_memory_answers_alike_and_grows_alone(copied, context_dim):
    rng, memory = stream(0, "copied"), Memory(context_dim, 3, 2)
    memory.extend(*(rng.random((200, dim)) for dim in (context_dim, 3, 2)))
    question = np.full(context_dim, 0.5), np.full(2, 0.5)
    memory.near_outcomes(*question, 5)
    other = copied(memory)
    assert other.near_outcomes(*question, 5).tolist() == memory.near_outcomes(*question, 5).tolist()
    assert np.array_equal(other.neighbourhoods(np.arange(9), 5), memory.neighbourhoods(np.arange(9), 5))
    assert np.array_equal(other.theta_range, memory.theta_range)
    other.add(question[0], np.zeros(3), question[1])
    assert (len(memory), len(other)) == (200, 201)
    assert other.near_outcomes(*question, 1).tolist() == [200]
    assert not other.thetas.flags.writeable


@pytest.mark.parametrize("context_dim", [0, 1])
def test_competence_asked_again_after_each_movement_is_that_of_a_fresh_memory(context_dim):
    rng, memory = stream(context_dim, "test"), Memory(context_dim, 1, 2)
    given = problem(outcomes=Box.cube(0, 2, 2), rest=[2, 2], noise=0.1, memory=memory)
    kept = Competence(given)
    for _ in range(20):
        context, goal = rng.random(context_dim), np.round(rng.random(2), 1)
        for _ in range(8):
            assert kept(context, goal) == Competence(given)(context, goal)
            for _ in range(int(rng.integers(0, 3))):
                memory.add(rng.random(context_dim), np.zeros(1), np.round(rng.random(2), 1))  # rounded: many ties


@pytest.mark.parametrize("moments", [(0, 1, 1, 7, 200), (7, 200)])
def test_the_range_of_thetas_is_that_of_all_of_them_whenever_it_is_asked_for(moments):
    rng, memory = stream(0, "test"), Memory(0, 3, 1)
    for n in moments:
        for theta in rng.normal(size=(n, 3)):
            memory.add([], theta, [0.0])
        lowest, highest = memory.theta_range
        assert np.array_equal(lowest, memory.thetas.min(axis=0, initial=np.inf))
        assert np.array_equal(highest, memory.thetas.max(axis=0, initial=-np.inf))


def test_nothing_is_kept_twice_where_there_is_no_context():
    memory = Memory(0, 3, 2)
    memory.add([], np.zeros(3), np.ones(2))
    assert np.shares_memory(memory.thetas, memory._by_theta.keys.rows)
    assert np.shares_memory(memory.outcomes, memory._by_outcome.keys.rows)
