"""Goals within reach: uniform where T is right, around what was reached where it is far too wide, in any unit."""

import numpy as np
import pytest

from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.goals.within_reach import WithinReach
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory.reached import Reached
from sgimd_torch.spaces import Box
from worlds import NO_CONTEXT, problem, remember


def remembering(outcomes, context_dim=0, thetas=None):
    """A memory of these outcomes, each of a movement of the same numbers unless ``thetas`` say otherwise."""
    return remember(outcomes if thetas is None else thetas, outcomes, np.zeros((len(outcomes), context_dim)))


def scattered(dim, n=300, seed=0):
    """Outcomes all over [-1, 1]^dim."""
    return np.random.default_rng(seed).uniform(-1, 1, (n, dim))


def within_reach(memory, space):
    return WithinReach(problem(outcomes=space, memory=memory, inverse=NearestNeighbour))


def drawn(memory, space, n=400, landed=None):
    """So many goals, each of them attempted; ``landed``: goal -> the outcome, an old one if there is none."""
    goals, found = within_reach(memory, space), []
    context = np.zeros(memory.context_dim)
    for _ in range(n):
        goal = goals.sample(context)
        outcome = memory.outcomes[0] if landed is None else landed(goal)
        memory.add(context, outcome, outcome)
        goals.add(context, goal, -0.5)
        found.append(goal)
    return np.array(found)


@pytest.mark.parametrize(
    ("outcomes", "space"),
    [
        *((scattered(dim), Box.cube(-1, 1, dim)) for dim in (1, 2, 6)),  # T is hardly larger than what is reached
        (np.zeros((50, 2)), Box.cube(-100, 100, 2)),  # no movement has had an effect yet
    ],
)
def test_goals_are_the_uniform_ones_bit_for_bit_if_t_is_small_or_nothing_has_had_an_effect(outcomes, space):
    uniform = UniformGoals(problem(outcomes=space))
    goals = drawn(remembering(outcomes), space, landed=(lambda goal: goal) if outcomes.any() else None)
    assert np.array_equal(goals, [uniform.sample(NO_CONTEXT) for _ in goals])


@pytest.mark.parametrize("dim", [1, 2, 6])
def test_where_t_is_a_hundred_times_too_wide_goals_stay_near_what_was_reached(dim):
    space = Box.cube(-100, 100, dim)
    found = drawn(remembering(scattered(dim, 21)), space, n=1000, landed=lambda goal: goal.clip(-1, 1))
    assert np.abs(found).max() <= 3  # at first three times as wide as what was reached
    assert np.abs(found[-300:]).max() <= 1.4
    assert (np.abs(found[-300:]) > 0.9).any(axis=0).all()


def test_the_box_grows_as_long_as_goals_beyond_are_reached():
    space = Box.cube(-100, 100, 2)
    found = drawn(remembering(scattered(2, 21)), space, landed=lambda goal: goal)
    assert np.abs(found[300:]).max() > 3 * np.abs(found[:10]).max()


@pytest.mark.parametrize(
    ("noise_within", "least", "most"), [(0.0, 0.0, 0.1), (0.5, 0.2, 0.5)], ids=["met", "missed by as much"]
)
def test_the_step_beyond_narrows_where_only_noise_leads_unless_goals_within_are_missed_as_much(
    noise_within, least, most
):
    rng, memory = np.random.default_rng(1), remembering(scattered(2))
    goals = within_reach(memory, Box.cube(-100, 100, 2))
    farthest = []
    for _ in range(1000):
        goal = goals.sample(NO_CONTEXT)
        noise = noise_within if np.abs(goal).max() <= 1 else max(0.3, noise_within)
        memory.add(NO_CONTEXT, goal, goal.clip(-1, 1) + noise * rng.normal(size=2))  # the goal itself as the movement
        goals.add(NO_CONTEXT, goal, -0.5)
        farthest.append(np.abs(goal).max())
    assert least < (max(farthest[-200:]) - 1) / 2 < most  # in sides of what was reached


FAR = scattered(2)
FAR[7] = 90.0


@pytest.mark.parametrize(
    ("outcomes", "half_side", "landed", "after", "farthest"),
    [
        (scattered(2) * [1, 0], 100, lambda goal: goal.clip(-1, 1) * [1, 0], 200, 1.5),
        (FAR, 100, lambda goal: goal.clip(-1, 1), 0, 4.0),
        (scattered(2) + np.array([10, 0]), 1, None, 0, 1.0),
    ],
    ids=["a dimension that nothing has moved yet", "one rare outcome far away", "outcomes outside T"],
)
def test_goals_stay_near_what_can_be_reached_again(outcomes, half_side, landed, after, farthest):
    memory = remembering(outcomes, thetas=scattered(2))
    goals = drawn(memory, Box.cube(-half_side, half_side, 2), landed=landed)
    assert np.abs(goals[after:]).max() <= farthest


def test_a_context_changes_nothing_but_what_is_checked():
    space = Box.cube(-100, 100, 2)
    with_contexts = drawn(remembering(scattered(2), 1), space)
    assert np.array_equal(with_contexts, drawn(remembering(scattered(2)), space))
    goals = within_reach(remembering(scattered(2), 1), space)
    with pytest.raises(ValueError, match="context"):
        goals.sample([2.0])


def test_in_a_unit_a_thousand_times_smaller_goals_are_a_thousand_times_as_large():
    outcomes, space = scattered(3), Box.cube(-50, 50, 3)
    metres = drawn(remembering(outcomes), space)
    millimetres = drawn(remembering(1000 * outcomes), Box.cube(-50_000, 50_000, 3))
    np.testing.assert_allclose(millimetres, 1000 * metres, rtol=1e-9)


def test_of_more_candidates_the_goal_is_the_one_with_the_less_sure_answer():
    thetas = np.random.default_rng(0).uniform(-1, 1, (120, 2))
    thetas[:100, 0] = np.abs(thetas[:100, 0])  # on one side movements are rare
    memory, shares, sure = remembering(thetas, thetas=thetas), [], []
    for candidates in (1, 2, 5):
        given = problem(outcomes=Box.cube(-1, 1, 2), memory=memory, inverse=LocalProcess)
        goals = WithinReach(given, candidates=candidates)
        drawn = np.array([goals.sample(NO_CONTEXT) for _ in range(200)])
        shares.append((drawn[:, 0] < 0).mean())
        sure.append(np.mean([given.inverse(NO_CONTEXT, goal).sd for goal in drawn]))
    assert shares[0] == pytest.approx(0.5, abs=0.11)  # three standard errors
    assert sure == sorted(sure)
    assert shares == sorted(shares)


@pytest.mark.parametrize(("side", "at_home"), [(1000, 0.5), (4, 0.1)])
def test_in_a_t_far_too_wide_half_of_the_goals_lie_where_global_movements_landed(side, at_home):
    outcomes = np.concatenate((scattered(2, 40) / 4, scattered(2, 300)))  # of global movements, then of others
    goals = within_reach(remembering(outcomes), Box.cube(-side, side, 2))
    goals.problem.shared(Reached, Reached).rows.extend(range(40))
    near = [np.abs(goals.sample(NO_CONTEXT)).max() < 0.3 for _ in range(400)]
    assert np.mean(near) == pytest.approx(at_home, abs=0.1)


def test_the_box_contains_an_outcome_that_came_twice():
    space = Box.cube(-20, 20, 2)
    goals = within_reach(remembering(scattered(2)), space)
    assert np.abs(np.array([goals.sample(NO_CONTEXT) for _ in range(200)])).max() < 3
    goals.problem.shared(Reached, Reached).confirmed.append(np.array([8.0, 0.0]))
    found = np.array([goals.sample(NO_CONTEXT) for _ in range(200)])
    assert found[:, 0].max() > 7
    assert found[:, 0].min() > -5
