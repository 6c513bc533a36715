"""Learners that ask where they expect to lose most doubt: doubts by hand, and the choice of mode and goal."""

import numpy as np
import pytest

from sgimd_torch.asking.entropy import EntropyGoals, doubt
from sgimd_torch.asking.interest import AUTONOMOUS
from sgimd_torch.spaces import stream
from worlds import NO_CONTEXT, problem, remember

IMITATE = "imitate all"
SHARED = 0.5240  # (1 + sqrt(5) + 5/3) e^-sqrt(5)
COSTS = {AUTONOMOUS: 1.0, IMITATE: 1.0}


def cluster(n=40):
    """``(n, 2)`` exemplars around the middle of a square whose sides are 1."""
    return 0.5 + 0.02 * stream(0, "cluster").standard_normal((n, 2))


def test_where_nothing_is_known_doubt_is_one_and_two_places_have_less_in_common_the_farther_they_are():
    points = np.array([[0.5, 0.5], [0.5, 0.6], [0.9, 0.9]])
    found = doubt(np.empty((0, 2)), points)
    # Matern 5/2: places a length of .1 apart share (1 + sqrt(5) + 5/3) e^-sqrt(5) of their doubt.
    assert found == pytest.approx(np.array([[1, SHARED, 0], [SHARED, 1, 0], [0, 0, 1]]), abs=1e-2)


def test_doubt_after_one_exemplar_by_hand():
    found = doubt(np.array([[0.5, 0.5]]), np.array([[0.5, 0.5], [0.5, 0.6]]))
    # Its noise has a variance of .1.
    assert np.diag(found) == pytest.approx([1 - 1 / 1.1, 1 - SHARED**2 / 1.1], abs=1e-4)


def test_doubt_is_small_among_exemplars_and_whole_far_from_them():
    points = np.array([[0.5, 0.5], [0.95, 0.05]])
    near, far = np.diag(doubt(cluster(), points))
    assert near < 0.1
    assert far == pytest.approx(1.0, abs=0.01)


def test_covariances_are_symmetric_and_no_variance_is_negative_or_above_one():
    points = stream(0, "points").random((30, 2))
    found = doubt(cluster(60), points)
    assert found == pytest.approx(found.T, abs=1e-9)
    assert ((np.diag(found) >= -1e-9) & (np.diag(found) <= 1 + 1e-9)).all()


def goals_with(outcomes):
    """A choice of a learner whose memory has these outcomes."""
    memory = remember(np.zeros((len(outcomes), 1)), np.reshape(outcomes, (-1, 2)))
    return EntropyGoals(problem(memory=memory)), memory


def test_it_asks_for_a_goal_far_from_what_is_known():
    known = np.column_stack((stream(0, "left").uniform(-1, 0, 300), stream(0, "up").uniform(-1, 1, 300)))
    goals, _ = goals_with(known)
    asked = [goal for name, goal in (goals.choose(NO_CONTEXT, COSTS) for _ in range(20)) if name == IMITATE]
    assert len(asked) > 10  # a goal of its own is anywhere, and half of T is known
    assert all(goal[0] > 0 for goal in asked)


def test_a_cost_makes_it_try_alone():
    goals, _ = goals_with([])
    assert {goals.choose(NO_CONTEXT, {**COSTS, IMITATE: 100.0})[0] for _ in range(20)} == {AUTONOMOUS}


def test_who_shows_what_is_known_already_is_asked_no_more():
    known = np.column_stack((stream(0, "left").uniform(-1, 0, 300), stream(0, "up").uniform(-1, 1, 300)))
    goals, memory = goals_with(known)
    for _ in range(30):  # whatever is asked for, what is shown is the same, known movement
        _, goal = goals.choose(NO_CONTEXT, COSTS)
        memory.add(NO_CONTEXT, np.zeros(1), [-0.5, 0.0])
        goals.add(NO_CONTEXT, goal, -0.5, IMITATE, 0.0)
    for _ in range(3):  # alone it comes where it aims
        _, goal = goals.choose(NO_CONTEXT, {AUTONOMOUS: 1.0})
        memory.add(NO_CONTEXT, np.zeros(1), goal)
        goals.add(NO_CONTEXT, goal, 0.0, AUTONOMOUS, 0.5)
    assert {goals.choose(NO_CONTEXT, COSTS)[0] for _ in range(20)} == {AUTONOMOUS}
