"""Eqs. (7) and (2): numbers worked by hand, the paper's own scale argument, and what the two readings remember."""

from functools import partial

import numpy as np
import pytest

from sgimd_torch.competence import AttemptCompetence, Competence, performance
from sgimd_torch.spaces import Array, stream
from worlds import NO_CONTEXT, problem, remember

REST = np.array([0.0, 0.5])
relative = partial(performance, rest=REST, d_min=0.02)


def from_rest(x: float, y: float) -> Array:
    return REST + np.array([x, y])


@pytest.mark.parametrize(
    ("outcome", "expected"),
    [
        ((3.0, 4.5), 0.0),  # met
        ((0.0, 0.5), -1.0),  # not moved
        ((3.0, 2.0), -0.5),  # 2.5 m short of a goal 5 m from rest
        ((0.0, 4.5), -0.6),  # 3 m short
        ((-3.0, -3.5), -1.0),  # 10 m off scores no less than not moving
    ],
)
def test_performance_is_the_distance_left_relative_to_the_distance_from_rest(
    outcome: tuple[float, float], expected: float
) -> None:
    assert relative(np.array([3.0, 4.5]), np.array(outcome)) == pytest.approx(expected, abs=1e-15)


def test_a_goal_ten_times_farther_missed_ten_times_more_scores_the_same() -> None:
    near = relative(from_rest(100.0, 0.0), from_rest(90.0, 0.0))
    far = relative(from_rest(1000.0, 0.0), from_rest(900.0, 0.0))
    assert near == pytest.approx(-0.1)
    assert far == pytest.approx(near)


def test_a_goal_at_rest_is_judged_by_the_noise_instead_of_dividing_by_zero() -> None:
    assert relative(REST, REST) == 0
    assert relative(REST, from_rest(0.004, 0.0)) == pytest.approx(-0.2)
    assert relative(from_rest(0.002, 0.0), REST) == pytest.approx(-0.1)


def test_leading_axes_broadcast_and_agree_with_one_at_a_time() -> None:
    rng = stream(0, "test")
    goals, outcomes = rng.normal(size=(3, 1, 2)), rng.normal(size=(4, 2))
    together = relative(goals, outcomes)
    assert together.shape == (3, 4)
    for i in range(3):
        for j in range(4):
            assert together[i, j] == relative(goals[i, 0], outcomes[j])


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_that_is_not_positive_is_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match="d_min"):
        performance(REST, REST, REST, d_min=wrong)


def test_competence_is_the_best_performance_over_all_of_memory() -> None:
    rng = stream(1, "test")
    memory = remember(np.zeros((60, 1)), rng.uniform(-1, 1, (60, 2)))
    competence = Competence(problem(memory=memory, rest=REST))
    for goal in rng.uniform(-2, 2, (30, 2)):
        assert competence(NO_CONTEXT, goal) == max(relative(goal, outcome) for outcome in memory.outcomes)


def test_competence_never_falls_while_the_attempt_reading_can() -> None:
    goal = np.array([1.0, 0.5])
    given = problem(memory=remember(np.zeros((1, 1)), np.array([[0.9, 0.5]])), rest=REST)
    remembered, attempted = Competence(given), AttemptCompetence(given)
    good, bad = np.array([[0.2, 0.5], [0.9, 0.5]]), np.array([[0.2, 0.5], [0.4, 0.5]])
    assert remembered(NO_CONTEXT, goal, bad) == pytest.approx(-0.1)
    assert attempted(NO_CONTEXT, goal, good) == pytest.approx(-0.1)
    assert attempted(NO_CONTEXT, goal, bad) == pytest.approx(-0.6)


def test_competence_belongs_to_a_context() -> None:
    memory = remember(np.zeros((2, 1)), np.array([[1.0, 0.5], [0.0, 0.5]]), np.array([[0.0], [9.0]]))
    competence = Competence(problem(memory=memory, rest=REST))
    goal = np.array([1.0, 0.5])
    assert competence(np.array([0.0]), goal) == 0
    assert competence(np.array([9.0]), goal) == -1
