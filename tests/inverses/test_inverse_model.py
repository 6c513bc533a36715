"""Eqs. (8) and (9): memories small enough to work the inverse out by hand, and laws every inverse model keeps."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from sgimd_torch.inverses.local import LocalInverse
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box, stream
from worlds import NO_CONTEXT, part, problem, remember


@pytest.fixture(params=[word for word in WORDS["inverse"] if not word.startswith("model")])
def make(request):
    """Every inverse model but forward models, which have to be trained first."""
    return part("inverse", request.param)


def remembering(thetas: Array, outcomes: Array, contexts: Array | None = None) -> Problem:
    return problem(memory=remember(thetas, outcomes, contexts))


def line(pairs: dict[float, float]) -> Problem:
    """One-dimensional movements and where they landed."""
    return remembering(np.array([[theta] for theta in pairs]), np.array([[outcome] for outcome in pairs.values()]))


def random_movements(n: int, theta_dim: int = 25) -> Problem:
    """Families of related movements, as goal babbling makes them, on a curved map."""
    rng = stream(0, "test inverse")
    thetas = np.clip(np.repeat(rng.uniform(0, 1, (n // 10, theta_dim)), 10, axis=0) + rng.normal(0, 0.05, (n, 1)), 0, 1)
    outcomes = np.sin(thetas @ rng.normal(size=(theta_dim, 2)))
    return remembering(thetas, outcomes)


def test_theta_is_the_gaussian_weighted_mean_of_the_neighbourhood() -> None:
    given = line({0.0: 0.0, 0.1: 1.0})
    # Distances 1/4 and 3/4, width their mean 1/2: weights exp(-1/8) and exp(-9/8), that is 1 : 1/e.
    theta = LocalInverse(given, width=1.0)(NO_CONTEXT, np.array([0.25])).theta
    assert theta[0] == pytest.approx(0.1 / (1 + np.e))
    # Half as wide: exp(-1/2) and exp(-9/2), that is 1 : 1/e^4.
    theta = LocalInverse(given, width=0.5)(NO_CONTEXT, np.array([0.25])).theta
    assert theta[0] == pytest.approx(0.1 / (1 + np.e**4))


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-9])
def test_the_gaussian_is_as_wide_in_any_unit(unit: float) -> None:
    given = line({0.0: 0.0, 0.1: unit})
    theta = LocalInverse(given, width=2.0)(NO_CONTEXT, np.zeros(1)).theta  # wide as what lies farther is far
    assert theta[0] == pytest.approx(0.1 / (1 + np.exp(0.5)))


def test_outcomes_that_all_lie_on_the_goal_weigh_the_same() -> None:
    assert LocalInverse(line({0.0: 0.0, 0.1: 0.0}))(NO_CONTEXT, np.zeros(1)).theta[0] == pytest.approx(0.05)
    copies = line({0.0: 0.5, 0.1: 0.5})
    assert LocalInverse(copies)(NO_CONTEXT, np.array([0.5])).theta[0] == pytest.approx(0.05)


def test_a_reproducible_movement_farther_away_beats_an_erratic_one_on_the_goal() -> None:
    # The erratic pair: standard deviation 0.4 / sqrt(2) = 0.28, so 0 + 0.14 against 0.12 + 0 for the reliable pair.
    given = line({0.10: 0.0, 0.11: 0.4, 0.90: 0.12, 0.91: 0.12})
    goal = np.array([0.0])
    assert LocalInverse(given, alpha=0.5)(NO_CONTEXT, goal).theta[0] == pytest.approx(0.905)
    assert LocalInverse(given, alpha=0.4)(NO_CONTEXT, goal).theta[0] < 0.11  # 0.11 against 0.12
    # The paper's variance of the erratic pair, 0.4**2 / 2 = 0.08: so 0 + 0.04 against 0.12.
    assert LocalInverse(given, alpha=0.5, variance=True)(NO_CONTEXT, goal).theta[0] < 0.11
    assert LocalInverse(given, alpha=1.6, variance=True)(NO_CONTEXT, goal).theta[0] == pytest.approx(0.905)  # 0.128


def test_ten_nearest_outcomes_are_compared_no_fewer() -> None:
    # Nine erratic pairs nearest to the goal, standard deviation 2 / sqrt(2) = 1.4; then a reliable one.
    erratic = {0.1 * k + pair: 0.001 * k + 400 * pair for k in range(9) for pair in (0.0, 0.005)}
    given = line(erratic | {0.95: 0.12, 0.955: 0.12})
    ten, nine = (LocalInverse(given, dist_n=0.01, **h)(NO_CONTEXT, np.zeros(1)).theta[0] for h in ({}, {"h_max": 9}))
    assert ten == pytest.approx(0.9525)
    assert nine < 0.01


def test_a_movement_without_neighbours_is_trusted_as_the_median_of_the_others() -> None:
    # Standard deviations of the pairs 0, 0.4 / sqrt(2) = 0.28 and 1.4: median 0.28, so 0 + 0.14 for the loner.
    loner, reliable = {0.5: 0.0}, {0.10: 0.12, 0.11: 0.12}
    erratic, wild = {0.90: 1.0, 0.91: 1.4}, {0.30: 2.0, 0.31: 4.0}
    near = LocalInverse(line(loner | reliable | erratic | wild), alpha=0.5)
    assert near(NO_CONTEXT, np.zeros(1)).theta[0] == pytest.approx(0.105)
    farther = {0.10: 0.16, 0.11: 0.16}
    assert LocalInverse(line(loner | farther | erratic | wild), alpha=0.5)(NO_CONTEXT, np.zeros(1)).theta[0] == 0.5


def test_where_no_movement_has_neighbours_the_nearest_to_the_goal_is_repeated() -> None:
    given = line({0.0: 0.3, 0.5: 0.2, 1.0: 0.4})
    estimate = LocalInverse(given)(NO_CONTEXT, np.zeros(1))
    assert estimate.theta.tolist() == [0.5]
    assert estimate.thetas.tolist() == [[0.5]]
    assert estimate.outcomes.tolist() == [[0.2]]


def test_the_neighbourhood_reaches_dist_n_and_no_more_than_k_max_nearest_first() -> None:
    given = line({0.0: 0.0, 0.119: 0.1, 0.121: 0.2, 0.05: 0.3})
    goal = np.zeros(1)
    default = LocalInverse(given, h_max=1)(NO_CONTEXT, goal)  # 0.6 * sqrt(1 / 25) = 0.12
    assert default.thetas.ravel().tolist() == [0.0, 0.05, 0.119]
    assert default.outcomes.ravel().tolist() == [0.0, 0.3, 0.1]
    assert LocalInverse(given, h_max=1, dist_n=1.0)(NO_CONTEXT, goal).thetas.shape == (4, 1)
    assert LocalInverse(given, h_max=1, k_max=2)(NO_CONTEXT, goal).thetas.ravel().tolist() == [0.0, 0.05]
    assert LocalInverse(random_movements(20)).dist_n == pytest.approx(0.6)


def test_nearest_neighbour_repeats_the_movement_that_came_nearest() -> None:
    given = line({0.1: 3.0, 0.2: 1.0, 0.3: 2.0})
    estimate = NearestNeighbour(given, k=2)(NO_CONTEXT, np.array([1.4]))
    assert estimate.theta.tolist() == [0.2]
    assert estimate.thetas.ravel().tolist() == [0.2, 0.3]
    assert estimate.outcomes.ravel().tolist() == [1.0, 2.0]


def linear_world(noise: float = 0.0) -> tuple[Problem, Array]:
    """One family of 5-D movements whose 2-D outcomes are linear in them."""
    rng = stream(1, "test inverse")
    jacobian = rng.normal(size=(5, 2))
    thetas = 0.5 + rng.uniform(-0.05, 0.05, (40, 5))
    return remembering(thetas, thetas @ jacobian + rng.normal(0, noise, (40, 2))), jacobian


def test_where_outcomes_are_linear_in_theta_the_linear_model_meets_the_goal() -> None:
    given, jacobian = linear_world()
    goal = given.memory.outcomes.mean(axis=0) + np.array([0.1, -0.05])
    linear = LocallyLinear(given)(NO_CONTEXT, goal)
    assert linear.theta @ jacobian == pytest.approx(goal, abs=1e-3)
    local = LocalInverse(given, k_max=20, width=1.0)(NO_CONTEXT, goal)
    assert np.linalg.norm(local.theta @ jacobian - goal) > 0.01  # an average alone stays among what was reached
    assert np.array_equal(linear.thetas, local.thetas)


def test_the_linear_model_does_not_depend_on_the_unit_of_outcomes() -> None:
    metres, _ = linear_world(noise=0.02)
    centimetres = remembering(metres.memory.thetas, 100 * metres.memory.outcomes)
    goal = np.array([0.3, 0.2])
    theta = LocallyLinear(metres)(NO_CONTEXT, goal).theta
    assert LocallyLinear(centimetres)(NO_CONTEXT, 100 * goal).theta == pytest.approx(theta)


def test_for_a_goal_out_of_reach_the_linear_model_stays_in_the_box_of_what_was_executed() -> None:
    given, _ = linear_world()
    theta = LocallyLinear(given)(NO_CONTEXT, np.array([100.0, 100.0])).theta
    executed = Box(given.memory.thetas.min(axis=0), given.memory.thetas.max(axis=0))
    assert executed.contains(theta)
    assert np.isin(theta, [executed.low, executed.high]).any()


def test_outcomes_on_a_line_move_the_linear_model_along_it_and_not_across() -> None:
    given = remembering(np.array([[0.4], [0.45], [0.5]]), np.array([[0.0, 1.0], [0.1, 1.0], [0.2, 1.0]]))
    inverse = LocallyLinear(given)
    assert inverse(NO_CONTEXT, np.array([0.17, 1.0])).theta[0] == pytest.approx(0.485, abs=1e-4)
    assert inverse(NO_CONTEXT, np.array([0.17, 1.5])).theta[0] == pytest.approx(0.485, abs=1e-4)


def test_outcomes_that_coincide_give_the_linear_model_no_slope() -> None:
    given = line({0.4: 1.0, 0.45: 1.0, 0.5: 1.0})
    theta = LocallyLinear(given)(NO_CONTEXT, np.array([2.0])).theta
    assert theta == LocalInverse(given)(NO_CONTEXT, np.array([2.0])).theta


def test_nothing_can_be_inferred_from_an_empty_memory(make) -> None:
    with pytest.raises(RuntimeError, match="empty"):
        make(problem())(NO_CONTEXT, np.zeros(2))


def test_one_exemplar_is_repeated_whatever_the_goal(make) -> None:
    inverse = make(remembering(np.array([[0.2, 0.7]]), np.array([[1.0, 1.0]])))
    for goal in (np.ones(2), np.array([-1e6, 3.0])):
        assert inverse(NO_CONTEXT, goal).theta.tolist() == [0.2, 0.7]


@pytest.mark.parametrize("far", [0.0, 0.5, 100.0, 1e9])
def test_asking_twice_answers_the_same_inside_the_policy_space(make, far: float) -> None:
    given = random_movements(500)
    inverse, goal, memory = make(given), far * np.array([0.8, -0.6]), given.memory
    (one_of_many,) = inverse.answer_many(NO_CONTEXT[None], goal[None])
    first, second = inverse(NO_CONTEXT, goal), inverse(NO_CONTEXT, goal)
    for a, b, c in zip(first, second, one_of_many, strict=True):
        assert np.array_equal(a, b)
        assert np.array_equal(a, c)
    assert given.policies.contains(first.theta)
    assert len(memory) == 500
    for theta, outcome in zip(first.thetas, first.outcomes, strict=True):
        row = int((memory.thetas == theta).all(axis=1).argmax())
        assert np.array_equal(memory.outcomes[row], outcome)


def test_answers_in_threads_are_those_one_by_one(make) -> None:
    given, goals = random_movements(300), stream(0, "goals").uniform(-1, 1, (200, 2))
    one_by_one = [estimate.theta for estimate in make(given).answer_many(np.zeros((200, 0)), goals)]
    inverse = make(random_movements(300))
    inverse(NO_CONTEXT, goals[0])  # fits
    with ThreadPoolExecutor(4) as pool:
        found = [estimate.theta for estimate in pool.map(partial(inverse, NO_CONTEXT), goals)]
    assert np.array_equal(found, one_by_one)


def test_a_goal_may_be_a_list_or_a_view(make) -> None:
    inverse, goal = make(random_movements(50)), np.array([0.2, -0.1])
    theta = inverse(NO_CONTEXT, goal).theta
    for same in (goal.tolist(), np.array([0.2, 9.0, -0.1])[::2]):
        assert np.array_equal(inverse([], same).theta, theta)


def test_a_mean_of_movements_on_the_border_does_not_leave_the_policy_space_by_rounding() -> None:
    rng = stream(2, "test inverse")
    for _ in range(50):
        given = remembering(np.ones((9, 2)), rng.normal(size=(9, 2)))
        assert given.policies.contains(LocalInverse(given)(NO_CONTEXT, rng.normal(size=2)).theta)


def test_the_neighbours_of_another_context_do_not_count() -> None:
    thetas, contexts = np.array([[0.10], [0.11], [0.90], [0.91]]), np.array([[0.0], [0.0], [5.0], [5.0]])
    given = remembering(thetas, np.zeros((4, 1)), contexts)
    assert LocalInverse(given)(np.array([0.0]), np.zeros(1)).theta[0] == pytest.approx(0.105)
    assert LocalInverse(given)(np.array([5.0]), np.zeros(1)).theta[0] == pytest.approx(0.905)


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan])
def test_a_width_that_is_not_positive_is_refused(width: float) -> None:
    with pytest.raises(ValueError, match="width"):
        LocalInverse(line({0.0: 0.0}), width=width)
