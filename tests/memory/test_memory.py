"""Memory: neighbours are those of exact arithmetic, and exemplars never change."""

import numpy as np
import pytest

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, stream
from worlds import NO_CONTEXT, remember


def nearest(points: Array, query: Array | float, k: int) -> list[int]:
    """The oracle: all rows by (distance, row number)."""
    return [int(row) for row in np.square(points - query).sum(axis=1).argsort(kind="stable")[:k]]


def random_memory(n: int, seed: int = 0) -> Memory:
    rng = stream(seed, "test memory")
    return remember(rng.uniform(0, 1, (n, 25)), rng.uniform(-1, 1, (n, 2)))


def test_mirror_images_that_float32_rounds_apart_are_still_ties() -> None:
    rng = stream(0, "mirror")
    goal, shifts = rng.integers(2**38, 2**40) * 2.0**-40, rng.integers(2**38, 2**40, 100) * 2.0**-40
    outcomes = np.concatenate((goal + shifts, goal - shifts))[rng.permutation(200), None]
    memory = remember(np.zeros((200, 1)), outcomes)
    assert memory.near_outcomes(NO_CONTEXT, [goal], 150).tolist() == nearest(outcomes, goal, 150)


def test_the_radius_includes_its_own_border_and_may_contain_nothing() -> None:
    memory = remember(np.array([[0.0], [0.5], [1.0]]), np.zeros((3, 2)))
    assert memory.near_policies(NO_CONTEXT, np.array([0.0]), 3, within=0.5).tolist() == [0, 1]
    assert memory.near_policies(NO_CONTEXT, np.array([2.0]), 3, within=0.5).tolist() == []


def test_neighbourhoods_ask_for_many_rows_what_near_policies_asks_for_one() -> None:
    rng = stream(2, "test memory")
    memory = remember(rng.uniform(0, 1, (400, 3)), rng.uniform(0, 1, (400, 2)), rng.uniform(0, 1, (400, 2)))
    rows = np.arange(0, 400, 7)
    for row, found in zip(rows, memory.neighbourhoods(rows, 5, within=0.2), strict=True):
        alike = memory.near_policies(memory.contexts[row], memory.thetas[row], 5, within=0.2).tolist()
        assert found.tolist() == alike + [-1] * (5 - len(alike))


def test_context_counts_on_both_sides() -> None:
    rng = stream(3, "test memory")
    contexts, thetas, outcomes = (rng.uniform(-1, 1, (500, dim)) for dim in (2, 3, 2))
    memory = remember(thetas, outcomes, contexts)
    context, goal, theta = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 3)
    expected = nearest(np.hstack((contexts, outcomes)), np.append(context, goal), 10)
    assert memory.near_outcomes(context, goal, 10).tolist() == expected
    expected = nearest(np.hstack((contexts, thetas)), np.append(context, theta), 10)
    assert memory.near_policies(context, theta, 10).tolist() == expected


def test_exemplars_are_kept_in_order_and_in_full_precision() -> None:
    rng = stream(4, "test memory")
    contexts, thetas, outcomes = (rng.normal(size=(150, dim)) for dim in (1, 4, 2))
    memory = remember(thetas, outcomes, contexts)
    assert len(memory) == 150
    assert np.array_equal(memory.contexts, contexts)
    assert np.array_equal(memory.thetas, thetas)
    assert np.array_equal(memory.outcomes, outcomes)


def test_what_is_handed_out_is_read_only_and_what_came_in_may_change_afterwards() -> None:
    memory = random_memory(3)
    for view in (memory.contexts, memory.thetas, memory.outcomes):
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 7.0
    outcome = np.array([0.5, 0.5])
    memory.add(NO_CONTEXT, np.zeros(25), outcome)
    outcome[:] = 9.0
    assert memory.outcomes[-1].tolist() == [0.5, 0.5]


def test_a_view_taken_before_keeps_what_it_showed_while_memory_outgrows_its_room() -> None:
    memory = random_memory(5)
    before, copy = memory.thetas, memory.thetas.copy()
    for _ in range(300):
        memory.add(NO_CONTEXT, np.ones(25), np.zeros(2))
    assert np.array_equal(before, copy)
    assert np.array_equal(memory.thetas[:5], copy)


@pytest.mark.parametrize(
    ("context", "theta", "outcome", "named"),
    [
        (np.zeros(1), np.zeros(3), np.zeros(2), "context"),
        (np.zeros(0), np.zeros(2), np.zeros(3), "theta"),
        (np.zeros(0), np.zeros((1, 3)), np.zeros(2), "theta"),
        (np.zeros(0), np.zeros(3), np.array([0.0, np.nan]), "outcome .*theta"),
        (np.zeros(0), np.array([0.0, np.inf, 0.0]), np.zeros(2), "theta"),
        (np.zeros(0), np.zeros(3), np.float64(1.0), "outcome"),
    ],
)
def test_a_wrong_exemplar_is_refused_by_name_and_nothing_of_it_is_kept(
    context: Array, theta: Array, outcome: Array, named: str
) -> None:
    memory = Memory(0, 3, 2)
    with pytest.raises(ValueError, match=named):
        memory.add(context, theta, outcome)
    assert (len(memory), len(memory.contexts), len(memory.outcomes)) == (0, 0, 0)
    memory.add(np.zeros(0), np.ones(3), np.ones(2))
    assert memory.near_outcomes(NO_CONTEXT, np.ones(2), 5).tolist() == [0]
    assert memory.near_policies(NO_CONTEXT, np.ones(3), 5).tolist() == [0]


def test_wrong_questions_are_refused() -> None:
    memory = random_memory(2)
    with pytest.raises(ValueError, match="goal"):
        memory.near_outcomes(NO_CONTEXT, np.zeros(25), 1)
    with pytest.raises(ValueError, match="theta"):
        memory.near_policies(NO_CONTEXT, np.full(25, np.nan), 1)
    with pytest.raises(ValueError, match="k must"):
        memory.near_outcomes(NO_CONTEXT, np.zeros(2), 0)
    with pytest.raises(ValueError, match="theta_dim"):
        Memory(0, 0, 2)
