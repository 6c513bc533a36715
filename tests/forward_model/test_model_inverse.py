"""The inverse by the forward model: nearer the goal, by more reliable movements, and never far from what was tried."""

import inspect

import numpy as np
import pytest
import torch

from models import ARM, boxes, problem_of
from sgimd_torch.algorithms.paper import sagg_riac
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
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, executed


def answers(inverse, goals):
    """The answers to ``goals`` by an evaluation without contexts."""
    return inverse.answer_many(np.zeros((len(goals), 0)), goals)


@pytest.fixture
def inverse(memory, model):
    return ModelInverse(problem_of(memory, model))


def test_where_outcomes_are_noisy_it_lands_nearer_than_what_it_starts_from(goals, fixed):
    fixed(share=1.0)  # what the model cannot predict is noise here
    arm = PlanarArm(7, noise=0.1)
    inverse = ModelInverse(problem_of(executed(arm, stream(0, "thetas").random((1500, 7))), environment=arm), trust=0.3)
    inverse.model.refresh(inverse.problem.memory)

    def mean_error(estimates):
        landed = [ARM.execute(NO_CONTEXT, estimate.theta, stream(2, "any")) for estimate in estimates]  # but for noise
        return np.linalg.norm(np.array(landed) - goals, axis=1).mean()

    assert mean_error(answers(inverse, goals)) < 0.8 * mean_error(answers(inverse.start, goals))


def test_without_steps_it_picks_among_what_is_known(memory, inverse, goals, monkeypatch):
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
    chosen = [estimate.theta[1] for estimate in answers(inverse, goals)]
    nearest = [estimate.theta[1] for estimate in answers(NearestNeighbour(problem), goals)]
    assert max(chosen) < 0.1 < np.mean(nearest)


def test_the_greater_the_caution_the_nearer_it_stays_to_what_was_tried(memory, inverse, goals, fixed, monkeypatch):
    monkeypatch.setattr(module, "_STEP", 0.05)

    def distance(caution):
        fixed(caution=caution)
        thetas = [estimate.theta for estimate in answers(inverse, goals)]
        return np.mean([np.linalg.norm(memory.thetas - theta, axis=1).min() for theta in thetas])

    careless, default, timid = map(distance, (0.0, 10.0, 1000.0))
    assert timid < 0.8 * default
    assert default < 0.5 * careless


def test_all_goals_together_find_what_each_finds_alone(inverse, goals):
    several = np.vstack([goals, goals + 0.05, goals - 0.05])  # more than one batch
    together = answers(inverse, several)
    assert len(together) == len(several)
    for goal, estimate in list(zip(several, together, strict=True))[::19]:
        alone = inverse(NO_CONTEXT, goal)
        np.testing.assert_allclose(estimate.theta, alone.theta, atol=1e-3)  # many steps in float32
        np.testing.assert_array_equal(estimate.thetas, alone.thetas)
        np.testing.assert_array_equal(estimate.outcomes, alone.outcomes)


def test_it_stays_in_the_box_at_a_goal_out_of_reach(inverse, monkeypatch):
    monkeypatch.setattr(module, "_STEP", 0.3)
    theta = inverse(NO_CONTEXT, np.array([9.0, 9.0])).theta
    assert ARM.policies.contains(theta)
    assert theta.min() == 0.0 or theta.max() == 1.0


def test_asking_changes_nothing_and_gives_the_same_answer_again(inverse, goals):
    model, random = inverse.model, torch.random.get_rng_state()
    before = [values.clone() for values in model.state_dict().values()]
    np.testing.assert_array_equal(inverse(NO_CONTEXT, goals[0]).theta, inverse(NO_CONTEXT, goals[0]).theta)
    assert all(torch.equal(was, now) for was, now in zip(before, model.state_dict().values(), strict=True))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_it_answers_like_its_start_until_the_model_is_good_enough(memory, inverse, goals):
    start = inverse.start(NO_CONTEXT, goals[0]).theta
    assert inverse.trusted
    assert not np.array_equal(inverse(NO_CONTEXT, goals[0]).theta, start)
    inverse.model.trust = 0.99 * inverse.model.relative_error
    for doubted in (inverse, ModelInverse(problem_of(memory))):  # whose model is not trained
        assert not doubted.trusted
        for estimate in (doubted(NO_CONTEXT, goals[0]), *answers(doubted, goals[:1])):
            np.testing.assert_array_equal(estimate.theta, start)


def test_a_memory_may_have_fewer_exemplars_than_candidates_and_anchors(model):
    few = executed(ARM, stream(3, "thetas").random((3, 7)))
    assert ARM.policies.contains(ModelInverse(problem_of(few, model))(NO_CONTEXT, np.zeros(2)).theta)


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
    for found, expected in zip(answers(alone, goals), answers(inverse, goals), strict=True):
        np.testing.assert_array_equal(found.theta, expected.theta)
    assert alone.predict(NO_CONTEXT, memory.thetas[0]) is None


@pytest.mark.parametrize("kind", [ModelInverse, ModelAlone, ProvedModel])
def test_the_options_of_the_model_are_options_of_the_inverse_and_explained(kind):
    options = {"members": 2, "rate": 0.3, "noise_heads": False, "accelerator": "auto", "trust": 0.1}
    defaults = inspect.signature(ForwardModel).parameters
    assert {name: option.default for name, option in options_of(kind).items()} == {
        name: defaults[name].default for name in options
    }
    assert all(help_of(kind)[name] == help_of(ForwardModel)[name] for name in options)
    model = kind(Problem(ARM, 3, inverse=NearestNeighbour), **options).model
    assert {
        name: getattr(model, name) for name in ("members", "rate", "noise_heads", "trust")
    }.items() < options.items()
    assert model.sizes == {"context_dim": 0, "theta_dim": 7, "outcome_dim": 2}


def test_all_parts_share_the_model_that_the_first_has_made(memory):
    problem = problem_of(memory)
    proved = ProvedModel(problem, members=2)
    few = problem.over(executed(ARM, memory.thetas[:3]))
    assert model_of(problem, members=5) is ModelInverse(few).model is proved.model_inverse.model is proved.model
    assert [each.model for each in problem.trained] == [proved.model]
    assert proved.model.members == 2


def test_a_loop_that_trains_what_a_learner_shares_teaches_its_inverse():
    learner = sagg_riac(ARM, 0, inverse=ModelInverse)
    for _ in run(learner, ARM, 0, movements=60):
        for each in learner.problem.trained:
            each.refresh(learner.memory)
    assert learner.inverse.model.trained


def lived(outcome_of, n, scale=1.0, noise=0.1, **options):
    """``n`` random movements, of which a model and a `ProvedModel` were told after each 50."""
    problem, rng = Problem(boxes(Box.cube(0.0, 1.0, 3), scale * noise), 0, inverse=NearestNeighbour), stream(0, "lived")
    proved = ProvedModel(problem, **options)
    for theta in rng.random((n, 3)):
        problem.memory.add(NO_CONTEXT, theta, scale * outcome_of(theta, rng))
        proved.model.refresh(problem.memory)
    return proved


def smooth(theta, rng):
    return np.array([theta.sum(), theta[0] * theta[1]])


def noisy(theta, rng):
    """What a process would have to learn is small, and its noise depends on the movement."""
    return np.sin(6 * theta[:2]) + 0.3 * theta[2] * rng.standard_normal(2)


@pytest.fixture(scope="module")
def proved():
    return lived(noisy, 600)


def same_answers(proved, expected, goals):
    return all(
        np.array_equal(one.theta, other.theta) for one, other in zip(answers(proved, goals), expected, strict=True)
    )


def test_a_model_that_predicts_worse_than_the_process_is_not_asked():
    proved = lived(smooth, 500, rate=0.1)
    assert proved.model_inverse.trusted  # on its own it would be
    assert not proved.trusted
    goals = proved.problem.memory.outcomes[:3] + 0.01
    assert same_answers(proved, [proved.process(NO_CONTEXT, goal) for goal in goals], goals)
    assert not uses_model(proved, proved.model)
    assert uses_model(proved.process, proved.model)


def test_a_model_that_predicts_better_answers_once_there_were_enough_tests(proved):
    assert (lived(noisy, 150).trusted, proved.trusted) == (False, True)
    goals = proved.problem.memory.outcomes[:3] + 0.01
    assert same_answers(proved, answers(proved.model_inverse, goals), goals)


def test_told_that_nothing_is_noisy_it_wants_better_predictions(proved):
    assert proved.trusted
    assert not lived(noisy, 600, noise=0.0).trusted


def test_it_is_the_same_whether_or_not_it_was_asked(goals):
    asked, silent = lived(noisy, 100), lived(noisy, 100)
    rng = stream(5, "more")
    for theta in rng.random((500, 3)):
        outcome = noisy(theta, rng)
        for each in (asked, silent):
            each.problem.memory.add(NO_CONTEXT, theta, outcome)
            each.model.refresh(each.problem.memory)
        if len(asked.problem.memory) % 70 == 0:
            answers(asked, goals)
    assert asked.trusted == silent.trusted
    assert same_answers(asked, answers(silent, goals), goals)


def test_in_thousandths_of_the_unit_it_trusts_and_answers_the_same(proved):
    thousand = lived(noisy, 600, scale=1000.0)
    assert thousand.trusted == proved.trusted
    goals = stream(6, "goals").uniform(-0.9, 0.9, (20, 2))
    for found, scaled in zip(answers(proved, goals), answers(thousand, 1000.0 * goals), strict=True):
        np.testing.assert_allclose(found.theta, scaled.theta, atol=5e-3)  # many steps in float32
