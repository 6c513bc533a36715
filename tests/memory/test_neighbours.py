"""Neighbours: those of brute force, ties to the older, whenever they are asked for; above a size nearly all of them."""

import numpy as np
import pytest

from sgimd_torch.competence import Competence
from sgimd_torch.memory import Memory
from sgimd_torch.memory.neighbours import EXACT_UP_TO, PolicyNeighbours, Table, TreeNeighbours
from sgimd_torch.spaces import Array, Box, stream
from worlds import problem


def table(rows: Array) -> Table:
    filled = Table(rows.shape[1])
    filled.append(rows)
    return filled


def nearest(rows: Array, query: Array, k: int) -> list[int]:
    """The oracle: all rows by (distance, row number)."""
    return [int(row) for row in np.square(rows - query).sum(axis=1).argsort(kind="stable")[:k]]


def structured(n: int, dim: int, seed: int = 0) -> Array:
    """As a life leaves them: ten in a row are variations of one movement."""
    rng = stream(seed, "rows")
    return rng.random((n // 10 + 1, dim)).repeat(10, axis=0)[:n] + 0.05 * rng.standard_normal((n, dim))


@pytest.mark.parametrize("dim", [1, 2, 3, 9])
def test_a_tree_gives_what_brute_force_gives_while_the_table_grows(dim: int) -> None:
    rng = stream(dim, "test")
    rows = rng.normal(size=(20_000, dim))
    side = TreeNeighbours(Table(dim))
    for start, stop in (
        (0, 5),
        (5, 8192),
        (8192, 8193),
        (8193, 9000),
        (9000, 17_000),
        (17_000, 17_100),
        (17_100, 20_000),
    ):
        side.keys.append(rows[start:stop])
        for query in (*rng.normal(size=(5, dim)), rows[start], 1e6 * rng.normal(size=dim)):
            for k in (1, 10, 40):
                assert side.nearest(query, k).tolist() == nearest(rows[:stop], query, k)
    assert sorted(side.nearest(rows[0], 30_000)) == list(range(20_000))


def test_ties_go_to_the_older_in_the_tree_and_among_the_newest() -> None:
    grid = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)
    rows = np.tile(grid, (1200, 1))[stream(0, "order").permutation(10_800)]
    side = TreeNeighbours(table(rows[:9000]))
    assert side.nearest(np.zeros(2), 1).tolist() == nearest(rows[:9000], np.zeros(2), 1)  # builds the tree
    side.keys.append(rows[9000:9100])
    for query in (np.zeros(2), np.ones(2), np.array([0.5, 0.5]), np.array([0.5, 0.0])):
        for k in (1, 10, 1500, 9050, 10_000):
            assert side.nearest(query, k).tolist() == nearest(rows[:9100], query, k)


def test_many_copies_of_one_outcome_make_no_deep_tree() -> None:
    rows = np.concatenate((np.full((30_000, 2), 0.25), 10.0 ** -np.arange(300.0)[:, None] * np.ones(2)))
    side = TreeNeighbours(table(rows))
    for query in (np.zeros(2), np.full(2, 0.25), np.ones(2)):
        assert side.nearest(query, 20).tolist() == nearest(rows, query, 20)


def test_above_it_nearly_all_are_found_nearest_first_and_within_the_radius() -> None:
    rows = structured(3 * EXACT_UP_TO, 10)
    side = PolicyNeighbours(table(rows))
    asked = np.arange(0, len(rows), 500)
    hits = 0
    for row, found in zip(asked, side.nearest(rows[asked], 10), strict=True):
        assert found[0] == row
        assert (np.diff(np.square(rows[found] - rows[row]).sum(axis=1)) >= 0).all()
        hits += len({*found.tolist()} & {*nearest(rows, rows[row], 10)})
    assert hits >= 0.95 * 10 * len(asked)
    for row, found in zip(asked[:20], side.nearest(rows[asked[:20]], 10, within=0.3), strict=True):
        assert (np.square(rows[found[found >= 0]] - rows[row]).sum(axis=1) <= 0.3**2).all()
        assert found[0] == row


def test_what_is_found_depends_on_the_rows_alone_not_on_when_it_was_asked_or_loaded() -> None:
    n = 2 * EXACT_UP_TO + 5000
    rows = structured(n, 6)
    at_once, grown = PolicyNeighbours(table(rows)), PolicyNeighbours(Table(6))
    for start in range(0, n, 1777):
        grown.keys.append(rows[start : start + 1777])
        grown.nearest(rows[:2], 3)
    queries = rows[::400]
    for one, other in zip(at_once.nearest(queries, 20, 0.4), grown.nearest(queries, 20, 0.4), strict=True):
        assert one.tolist() == other.tolist()


@pytest.mark.parametrize("n", [3000, EXACT_UP_TO + 3000])
def test_the_neighbours_of_a_row_that_are_kept_are_those_of_a_fresh_look(n: int) -> None:
    rows, rng = np.round(structured(n, 6), 1), stream(0, "asked")  # rounded: many ties
    side = PolicyNeighbours(Table(6))
    for start in range(0, n, n // 7):
        side.keys.append(rows[start : start + n // 7])
        for k, within in ((1, np.inf), (20, 0.2), (5, np.inf), (30, np.inf)):
            asked = rng.integers(0, len(side.keys), 10)
            fresh = PolicyNeighbours(side.keys).nearest(rows[asked], k, within)
            assert side.around(asked, k, within).tolist() == fresh.tolist()


def test_keys_and_queries_beyond_float32_are_still_answered() -> None:
    rows = structured(EXACT_UP_TO + 2000, 3)
    rows[5::1000] *= 1e60
    side = PolicyNeighbours(table(rows))
    for query in (rows[5], rows[6], np.full(3, 1e70)):
        (found,) = side.nearest(query[None], 10)
        assert len(found) == 10
        assert np.isfinite(rows[found]).all()
    assert side.nearest(rows[5][None], 10)[0].tolist() == nearest(rows, rows[5], 10)


@pytest.mark.parametrize("context_dim", [0, 1])
def test_competence_asked_again_after_each_movement_is_that_of_a_fresh_look(context_dim: int) -> None:
    rng, memory = stream(context_dim, "test"), Memory(context_dim, 1, 2)

    given = problem(outcomes=Box.cube(0, 2, 2), rest=[2, 2], noise=0.1, memory=memory)
    kept, looks = Competence(given), 0
    for _ in range(20):
        context, goal = rng.random(context_dim), np.round(rng.random(2), 1)
        for _ in range(8):
            expected = Competence(given)(context, goal)
            assert kept(context, goal) == expected
            near = memory.near_outcomes(context, goal, 1)
            fresh = memory.copy().near_outcomes(context, goal, 20)
            assert near.tolist() == fresh[:1].tolist()
            assert memory.near_outcomes(context, goal, 20).tolist() == fresh.tolist()
            for _ in range(int(rng.integers(0, 3))):
                memory.add(rng.random(context_dim), np.zeros(1), np.round(rng.random(2), 1))  # rounded: many ties
            looks += 1
    assert looks == 160


def test_the_nearest_outcome_asked_again_stays_the_oldest_of_equals() -> None:
    memory = Memory(0, 1, 1)
    rows = []
    for outcome in (3.0, -2.0, 2.0, 2.0, 1.0, -1.0, 0.0, 0.0):
        memory.add([], [0.0], [outcome])
        rows.append(int(memory.near_outcomes([], [0.0], 1)[0]))
    assert rows == [0, 1, 1, 1, 4, 4, 6, 6]


@pytest.mark.parametrize("moments", [(0, 1, 1, 7, 200), (7, 200)])
def test_the_range_of_thetas_is_that_of_all_of_them_whenever_it_is_asked_for(moments: tuple[int, ...]) -> None:
    rng, memory = stream(0, "test"), Memory(0, 3, 1)
    for n in moments:
        for theta in rng.normal(size=(n, 3)):
            memory.add([], theta, [0.0])
        lowest, highest = memory.theta_range
        assert np.array_equal(lowest, memory.thetas.min(axis=0, initial=np.inf))
        assert np.array_equal(highest, memory.thetas.max(axis=0, initial=-np.inf))


def test_nothing_is_kept_twice_where_there_is_no_context() -> None:
    memory = Memory(0, 3, 2)
    memory.add([], np.zeros(3), np.ones(2))
    assert np.shares_memory(memory.thetas, memory._policy_side.keys.rows)
    assert np.shares_memory(memory.outcomes, memory._outcome_side.keys.rows)
