"""The inverse by the forward model: nearer the goal, by more reliable movements, and never far from what was tried."""

import inspect

import numpy as np
import pytest
import torch

from models import ARM, boxes, problem_of
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model import inverse as module
from sgimd_torch.forward_model.inverse import ModelAlone, ModelInverse
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.proved import ProvedModel
from sgimd_torch.forward_model.shared import model_of, uses_model
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory import Memory
from sgimd_torch.options.signature import help_of, options_of
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, executed, problem


def answers(inverse, goals):
    """Movements ``(n, theta_dim)`` for ``goals`` by an evaluation without contexts."""
    return np.array([estimate.theta for estimate in inverse.answer_many(np.zeros((len(goals), 0)), goals)])


@pytest.fixture
def inverse(memory, model):
    return ModelInverse(problem_of(memory, model))


def test_where_outcomes_are_noisy_it_lands_nearer_than_the_estimates_it_starts_from(goals, fixed):
    fixed(share=1.0)  # what the model cannot predict is noise in this world
    arm = PlanarArm(7, noise=0.1)
    inverse = ModelInverse(problem_of(executed(arm, stream(0, "thetas").random((1500, 7))), environment=arm), trust=0.3)
    inverse.model.refresh(inverse.problem.memory)
    ours, starts = (executed(ARM, answers(one, goals)).outcomes - goals for one in (inverse, inverse.start))
    assert np.linalg.norm(ours, axis=1).mean() < 0.8 * np.linalg.norm(starts, axis=1).mean()


def test_without_steps_it_picks_among_remembered_movements(memory, inverse, goals, monkeypatch):
    monkeypatch.setattr(module, "_STEPS", 0)
    for goal in goals[:5]:
        known = [inverse.start(NO_CONTEXT, goal).theta, *memory.thetas[memory.near_outcomes(NO_CONTEXT, goal, 10)]]
        assert np.abs(known - inverse(NO_CONTEXT, goal).theta).max(axis=1).min() < 1e-6  # rounded to float32


def test_of_two_ways_to_a_goal_the_reliable_one_wins():
    memory, rng = Memory(0, 2, 2), stream(0, "exemplars")
    for theta in rng.random((1500, 2)):  # theta_1 moves nothing, but the larger, the noisier
        memory.add(NO_CONTEXT, theta, np.array([theta[0], 0.0]) + 0.3 * theta[1] * rng.standard_normal(2))
    problem = problem_of(memory, environment=boxes(Box.cube(0.0, 1.0, 2)))
    inverse = ModelInverse(problem, rate=0.4, trust=1.0)
    inverse.model.refresh(memory)
    goals = np.array([[goal, 0.0] for goal in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)])
    assert answers(inverse, goals)[:, 1].max() < 0.1 < answers(NearestNeighbour(problem), goals)[:, 1].mean()


def test_the_greater_the_caution_the_nearer_it_stays_to_executed_movements(memory, inverse, goals, fixed, monkeypatch):
    monkeypatch.setattr(module, "_STEP", 0.05)

    def distance(caution):
        fixed(caution=caution)
        return np.linalg.norm(memory.thetas - answers(inverse, goals)[:, None], axis=2).min(axis=1).mean()

    careless, default, timid = map(distance, (0.0, 10.0, 1000.0))
    assert timid < 0.8 * default
    assert default < 0.5 * careless


def test_goals_are_answered_together_as_each_alone(inverse, goals):
    several = np.vstack([goals, goals + 0.05, goals - 0.05])  # more than one batch
    together = inverse.answer_many(np.zeros((len(several), 0)), several)
    assert len(together) == len(several)
    for goal, estimate in list(zip(several, together, strict=True))[::19]:
        alone = inverse(NO_CONTEXT, goal)
        np.testing.assert_allclose(estimate.theta, alone.theta, atol=1e-3)  # many steps in float32
        np.testing.assert_array_equal(estimate.thetas, alone.thetas)
        np.testing.assert_array_equal(estimate.outcomes, alone.outcomes)


def test_answers_stay_in_pi_with_a_goal_out_of_reach_and_with_few_exemplars(inverse, model, monkeypatch):
    few = executed(ARM, stream(3, "thetas").random((3, 7)))  # fewer than candidates and anchors
    assert ARM.policies.contains(ModelInverse(problem_of(few, model))(NO_CONTEXT, np.zeros(2)).theta)
    monkeypatch.setattr(module, "_STEP", 0.3)
    theta = inverse(NO_CONTEXT, np.array([9.0, 9.0])).theta
    assert ARM.policies.contains(theta)
    assert theta.min() == 0.0 or theta.max() == 1.0


def test_an_answer_changes_nothing_and_is_the_same_again(inverse, goals):
    model, random = inverse.model, torch.random.get_rng_state()
    before = [values.clone() for values in model.state_dict().values()]
    np.testing.assert_array_equal(inverse(NO_CONTEXT, goals[0]).theta, inverse(NO_CONTEXT, goals[0]).theta)
    assert all(map(torch.equal, before, model.state_dict().values()))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_it_answers_like_its_start_until_the_model_is_good_enough(memory, inverse, goals):
    start = inverse.start(NO_CONTEXT, goals[0]).theta
    assert inverse.trusted
    assert not np.array_equal(inverse(NO_CONTEXT, goals[0]).theta, start)
    inverse.model.trust = 0.99 * inverse.model.relative_error
    for untrusted in (inverse, ModelInverse(problem_of(memory))):  # the second model is not trained
        assert not untrusted.trusted
        for theta in (untrusted(NO_CONTEXT, goals[0]).theta, *answers(untrusted, goals[:1])):
            np.testing.assert_array_equal(theta, start)


def test_contexts_reach_the_model_and_goals_in_several_are_answered_one_by_one():
    arm = PlanarArm(3, context=True)
    memory = executed(arm, 0.3 + 0.4 * stream(0, "thetas").random((1000, 3)))
    inverse, goal = ModelInverse(problem_of(memory, environment=arm)), memory.outcomes[0]
    inverse.model.refresh(memory)
    contexts = [memory.contexts[0] + turned * np.sign(-memory.contexts[0]) for turned in (-0.5, 0.5)]
    for context, estimate in zip(contexts, inverse.answer_many(np.array(contexts), np.array([goal] * 2)), strict=True):
        np.testing.assert_array_equal(estimate.theta, inverse(context, goal).theta)
        assert np.linalg.norm(arm.execute(context, estimate.theta, stream(0, "any")) - goal) < 0.02


def test_alone_it_learns_by_the_locally_linear_answer_and_is_evaluated_by_the_model(memory, model, inverse, goals):
    alone = ModelAlone(problem_of(memory, model))
    np.testing.assert_array_equal(alone(NO_CONTEXT, goals[0]).theta, inverse.start(NO_CONTEXT, goals[0]).theta)
    np.testing.assert_array_equal(answers(alone, goals), answers(inverse, goals))
    assert alone.predict(NO_CONTEXT, memory.thetas[0]) is None


@pytest.mark.parametrize("kind", [ModelInverse, ModelAlone, ProvedModel])
def test_the_options_of_the_model_are_options_of_the_inverse_and_explained(kind):
    defaults = inspect.signature(ForwardModel).parameters
    names = defaults.keys() - {"context_dim", "theta_dim", "outcome_dim", "seed", "every", "loggers"}
    assert {name: option.default for name, option in options_of(kind).items()} == {
        name: defaults[name].default for name in names
    }
    assert all(help_of(kind)[name] == help_of(ForwardModel)[name] for name in names)


def test_all_parts_share_the_model_that_the_first_has_made(memory):
    problem = problem_of(memory)
    proved = ProvedModel(problem, members=2)
    few = problem.over(executed(ARM, memory.thetas[:3]))
    assert model_of(problem, members=5) is ModelInverse(few).model is proved.model_inverse.model is proved.model
    assert [shared.model for shared in problem.trained] == [proved.model]
    assert proved.model.members == 2


def lived(outcome_of, n, scale=1.0, noise=0.1, asked=None, **options):
    """A `ProvedModel` after ``n`` random movements; its model was refreshed after each, and ``asked`` are goals that it
    was asked for now and then."""
    problem, rng = Problem(boxes(Box.cube(0.0, 1.0, 3), scale * noise), 0, inverse=NearestNeighbour), stream(0, "lived")
    proved = ProvedModel(problem, **options)
    for theta in rng.random((n, 3)):
        problem.memory.add(NO_CONTEXT, theta, scale * outcome_of(theta, rng))
        proved.model.refresh(problem.memory)
        if asked is not None and len(problem.memory) % 70 == 0:
            answers(proved, asked)
    return proved


def smooth(theta, rng):
    return np.array([theta.sum(), theta[0] * theta[1]])


def noisy(theta, rng):
    """A small effect, which a process can hardly learn; its noise depends on the movement."""
    return np.sin(6 * theta[:2]) + 0.3 * theta[2] * rng.standard_normal(2)


@pytest.fixture(scope="module")
def proved():
    return lived(noisy, 1000)


@pytest.mark.parametrize("trusted", [False, True])
def test_the_model_answers_if_it_predicts_as_well_as_the_process(proved, trusted):
    inverse = proved if trusted else lived(smooth, 500, rate=0.1)
    assert inverse.model_inverse.trusted  # by its relative error alone
    assert inverse.trusted is trusted
    goals = inverse.problem.memory.outcomes[:3] + 0.01
    np.testing.assert_array_equal(
        answers(inverse, goals), answers(inverse.model_inverse if trusted else inverse.process, goals)
    )
    assert uses_model(inverse, inverse.model) is trusted
    assert uses_model(inverse.process, inverse.model)


def test_it_wants_enough_tests_and_better_predictions_where_nothing_is_noisy(proved):
    assert proved.trusted
    assert not lived(noisy, 150).trusted
    assert not lived(noisy, 1000, noise=0.0).trusted


def test_answers_do_not_change_what_is_proved(proved, goals):
    asked = lived(noisy, 1000, asked=goals)
    assert asked.trusted == proved.trusted
    np.testing.assert_array_equal(answers(asked, goals), answers(proved, goals))


def test_in_thousandths_of_the_unit_it_trusts_and_answers_the_same(proved):
    thousand = lived(noisy, 1000, scale=1000.0)
    assert thousand.trusted == proved.trusted
    goals = stream(6, "goals").uniform(-0.9, 0.9, (20, 2))
    np.testing.assert_allclose(answers(proved, goals), answers(thousand, 1000.0 * goals), atol=5e-3)  # float32


def test_a_model_does_not_know_outcomes_that_wrap(memory):
    wrapping = problem(memory=memory, outcomes=Box([-1, 0], [1, 360], periodic=(False, True)))
    with pytest.raises(ValueError, match="does not know outcomes that wrap; let outcomes be their cosine and sine"):
        model_of(wrapping)
