"""The inverse by the forward model: nearer the goal, by more reliable movements, and never far from what was tried."""

import numpy as np
import pytest
import torch

from sgimd_torch.environment import PlanarArm
from sgimd_torch.forward_model import ForwardModel
from sgimd_torch.inverse_model import LocallyLinear, NearestNeighbour
from sgimd_torch.memory import Memory
from sgimd_torch.model_inverse import ModelInverse
from sgimd_torch.spaces import Box, stream

NO_CONTEXT = np.zeros(0)
ARM = PlanarArm(7)


@pytest.fixture(scope="module")
def taught():
    memory, rng = Memory(0, 7, 2), stream(0, "exemplars")
    for theta in rng.random((600, 7)):
        memory.add(NO_CONTEXT, theta, ARM.execute(NO_CONTEXT, theta, rng))
    model = ForwardModel(0, 7, 2, first=1000)
    model.refresh(memory)
    return memory, model


@pytest.fixture(scope="module")
def goals():
    rng = stream(1, "goals")
    return np.stack([ARM.execute(NO_CONTEXT, theta, rng) for theta in rng.random((30, 7))])


def test_where_outcomes_are_noisy_it_lands_nearer_than_what_it_starts_from(goals):
    arm, rng = PlanarArm(7, noise=0.1), stream(0, "exemplars")
    memory, model = Memory(0, 7, 2), ForwardModel(0, 7, 2, first=1000)
    for theta in rng.random((1500, 7)):
        memory.add(NO_CONTEXT, theta, arm.execute(NO_CONTEXT, theta, rng))
    model.refresh(memory)

    def mean_error(inverse):
        noise = stream(2, "evaluation")
        thetas = [inverse(NO_CONTEXT, goal).theta for goal in goals]
        landed = [[arm.execute(NO_CONTEXT, theta, noise) for theta in thetas] for _ in range(5)]
        return np.linalg.norm(np.array(landed) - goals, axis=2).mean()

    for start in (LocallyLinear(memory), NearestNeighbour(memory)):
        inverse = ModelInverse(memory, model, arm.policies, start=start, noise=arm.outcome_noise)
        assert mean_error(inverse) < 0.85 * mean_error(start)


def test_without_steps_it_picks_among_what_is_known(taught, goals):
    memory, model = taught
    inverse = ModelInverse(memory, model, ARM.policies, start=NearestNeighbour(memory), steps=0)
    for goal in goals[:5]:
        nearest = memory.thetas[memory.near_outcomes(NO_CONTEXT, goal, 20)]
        assert np.abs(nearest - inverse(NO_CONTEXT, goal).theta).max(axis=1).min() < 1e-6  # rounded to float32


def test_of_two_ways_to_a_goal_the_reliable_one_wins():
    memory, rng = Memory(0, 2, 2), stream(0, "exemplars")
    for theta in rng.random((1500, 2)):  # theta_1 moves nothing, but the larger, the noisier
        memory.add(NO_CONTEXT, theta, np.array([theta[0], 0.0]) + 0.3 * theta[1] * rng.standard_normal(2))
    model = ForwardModel(0, 2, 2, first=600)
    model.refresh(memory)
    inverse = ModelInverse(memory, model, Box.cube(0.0, 1.0, 2))
    chosen = [inverse(NO_CONTEXT, np.array([goal, 0.0])).theta[1] for goal in (0.3, 0.5, 0.7)]
    assert max(chosen) < 0.25


def test_the_greater_the_caution_the_nearer_it_stays_to_what_was_tried(taught, goals):
    memory, model = taught

    def distance(caution):
        inverse = ModelInverse(memory, model, ARM.policies, caution=caution, step=0.05)
        thetas = [inverse(NO_CONTEXT, goal).theta for goal in goals]
        return np.mean([np.linalg.norm(memory.thetas - theta, axis=1).min() for theta in thetas])

    assert distance(1000.0) < 0.8 * distance(0.0)


def test_it_stays_in_the_box_at_a_goal_out_of_reach(taught):
    memory, model = taught
    theta = ModelInverse(memory, model, ARM.policies, step=0.3)(NO_CONTEXT, np.array([9.0, 9.0])).theta
    assert ARM.policies.contains(theta)


def test_looking_changes_nothing_and_answers_alike(taught, goals):
    memory, model = taught
    before, random = [values.clone() for values in model.state_dict().values()], torch.random.get_rng_state()
    inverse = ModelInverse(memory, model, ARM.policies)
    np.testing.assert_array_equal(inverse(NO_CONTEXT, goals[0]).theta, inverse(NO_CONTEXT, goals[0]).theta)
    assert all(torch.equal(was, now) for was, now in zip(before, model.state_dict().values(), strict=True))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_before_the_model_has_learnt_it_answers_as_its_start():
    memory = Memory(0, 2, 2)
    memory.add(NO_CONTEXT, np.array([0.2, 0.4]), np.array([0.1, 0.3]))
    inverse = ModelInverse(memory, ForwardModel(0, 2, 2), Box.cube(0.0, 1.0, 2), start=NearestNeighbour(memory))
    np.testing.assert_array_equal(inverse(NO_CONTEXT, np.zeros(2)).theta, [0.2, 0.4])


def test_contexts_reach_the_model():
    arm, rng = PlanarArm(3, context=True), stream(0, "exemplars")
    memory = Memory(1, 3, 2)
    for theta in 0.3 + 0.4 * rng.random((1000, 3)):
        context = arm.observe(rng)
        memory.add(context, theta, arm.execute(context, theta, rng))
    model = ForwardModel(1, 3, 2, first=1000)
    model.refresh(memory)
    inverse = ModelInverse(memory, model, arm.policies)
    goal = memory.outcomes[0]
    for turned in (-0.5, 0.5):
        context = memory.contexts[0] + turned * np.sign(-memory.contexts[0])
        landed = arm.execute(context, inverse(context, goal).theta, rng)
        assert np.linalg.norm(landed - goal) < 0.15


@pytest.mark.parametrize(
    "options",
    [
        {"k": 0},
        {"anchors": 0},
        {"steps": -1},
        {"reach": 0.0},
        {"noise": -1.0},
        {"doubt": np.nan},
        {"caution": -1.0},
    ],
)
def test_numbers_out_of_their_range_are_refused(taught, options):
    with pytest.raises(ValueError, match=next(iter(options))):
        ModelInverse(*taught, ARM.policies, **options)
