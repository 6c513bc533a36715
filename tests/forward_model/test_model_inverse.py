"""The inverse by the forward model: nearer the goal, by more reliable movements, and never far from what was tried."""

import numpy as np
import pytest
import torch

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.anchored import Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.inverses import through_model
from sgimd_torch.inverses.local import NearestNeighbour
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.inverses.proved import ProvedModel
from sgimd_torch.inverses.through_model import ModelInverse
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, executed

ARM = PlanarArm(7)


def test_where_outcomes_are_noisy_it_lands_nearer_than_what_it_starts_from(goals):
    arm = PlanarArm(7, noise=0.1)
    memory, model = executed(arm, stream(0, "thetas").random((1500, 7))), ForwardModel(0, 7, 2)
    model.refresh(memory)

    def mean_error(estimates):
        landed = [ARM.execute(NO_CONTEXT, estimate.theta, stream(2, "any")) for estimate in estimates]  # but for noise
        return np.linalg.norm(np.array(landed) - goals, axis=1).mean()

    trust = Trust(share=1.0, error=0.3)  # what the model cannot predict is noise here
    inverse, start = ModelInverse(memory, model, arm.policies, trust=trust), LocallyLinear(memory)
    found = mean_error(inverse.many(NO_CONTEXT, goals))
    assert found < 0.8 * mean_error([start(NO_CONTEXT, goal) for goal in goals])


def test_without_steps_it_picks_among_what_is_known(memory, model, goals, monkeypatch):
    monkeypatch.setattr(through_model, "_STEPS", 0)
    inverse = ModelInverse(memory, model, ARM.policies)
    for goal in goals[:5]:
        known = [inverse.start(NO_CONTEXT, goal).theta, *memory.thetas[memory.near_outcomes(NO_CONTEXT, goal, 10)]]
        assert np.abs(known - inverse(NO_CONTEXT, goal).theta).max(axis=1).min() < 1e-6  # rounded to float32


def test_of_two_ways_to_a_goal_the_reliable_one_wins():
    memory, rng = Memory(0, 2, 2), stream(0, "exemplars")
    for theta in rng.random((1500, 2)):  # theta_1 moves nothing, but the larger, the noisier
        memory.add(NO_CONTEXT, theta, np.array([theta[0], 0.0]) + 0.3 * theta[1] * rng.standard_normal(2))
    model = ForwardModel(0, 2, 2, rate=0.4)
    model.refresh(memory)
    inverse = ModelInverse(memory, model, Box.cube(0.0, 1.0, 2), trust=Trust(error=1.0))
    goals = np.array([[goal, 0.0] for goal in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)])
    chosen = [estimate.theta[1] for estimate in inverse.many(NO_CONTEXT, goals)]
    assert max(chosen) < 0.1 < np.mean([NearestNeighbour(memory)(NO_CONTEXT, goal).theta[1] for goal in goals])


def test_the_greater_the_caution_the_nearer_it_stays_to_what_was_tried(memory, model, goals, monkeypatch):
    monkeypatch.setattr(through_model, "_STEP", 0.05)

    def distance(caution):
        inverse = ModelInverse(memory, model, ARM.policies, trust=Trust(caution=caution))
        thetas = [estimate.theta for estimate in inverse.many(NO_CONTEXT, goals)]
        return np.mean([np.linalg.norm(memory.thetas - theta, axis=1).min() for theta in thetas])

    careless, default, timid = map(distance, (0.0, 10.0, 1000.0))
    assert timid < 0.8 * default
    assert default < 0.5 * careless


def test_all_goals_together_find_what_each_finds_alone(memory, model, goals):
    inverse = ModelInverse(memory, model, ARM.policies)
    several = np.vstack([goals, goals + 0.05, goals - 0.05])  # more than one batch
    together = inverse.many(NO_CONTEXT, several)
    assert len(together) == len(several)
    for goal, estimate in list(zip(several, together, strict=True))[::19]:
        alone = inverse(NO_CONTEXT, goal)
        np.testing.assert_allclose(estimate.theta, alone.theta, atol=1e-3)  # many steps in float32
        np.testing.assert_array_equal(estimate.thetas, alone.thetas)
        np.testing.assert_array_equal(estimate.outcomes, alone.outcomes)


def test_it_stays_in_the_box_at_a_goal_out_of_reach(memory, model, monkeypatch):
    monkeypatch.setattr(through_model, "_STEP", 0.3)
    theta = ModelInverse(memory, model, ARM.policies)(NO_CONTEXT, np.array([9.0, 9.0])).theta
    assert ARM.policies.contains(theta)
    assert theta.min() == 0.0 or theta.max() == 1.0


def test_asking_changes_nothing_and_gives_the_same_answer_again(memory, model, goals):
    before, random = [values.clone() for values in model.state_dict().values()], torch.random.get_rng_state()
    inverse = ModelInverse(memory, model, ARM.policies)
    np.testing.assert_array_equal(inverse(NO_CONTEXT, goals[0]).theta, inverse(NO_CONTEXT, goals[0]).theta)
    assert all(torch.equal(was, now) for was, now in zip(before, model.state_dict().values(), strict=True))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_it_answers_like_its_start_until_the_model_is_good_enough(memory, model, goals):
    exact = Trust(error=1.01 * model.relative_error)
    asked = ModelInverse(memory, model, ARM.policies, trust=exact)
    start = asked.start(NO_CONTEXT, goals[0]).theta
    assert asked.trusted
    assert not np.array_equal(asked(NO_CONTEXT, goals[0]).theta, start)
    untrained = ForwardModel(0, 7, 2)
    for doubted, trust in ((model, Trust(error=0.99 * model.relative_error)), (untrained, Trust())):
        inverse = ModelInverse(memory, doubted, ARM.policies, trust=trust)
        assert not inverse.trusted
        for estimate in (inverse(NO_CONTEXT, goals[0]), *inverse.many(NO_CONTEXT, goals[:1])):
            np.testing.assert_array_equal(estimate.theta, start)


def test_a_memory_may_have_fewer_exemplars_than_candidates_and_anchors(model):
    few = executed(ARM, stream(3, "thetas").random((3, 7)))
    assert ARM.policies.contains(ModelInverse(few, model, ARM.policies)(NO_CONTEXT, np.zeros(2)).theta)


def test_contexts_reach_the_model():
    arm = PlanarArm(3, context=True)
    memory, model = executed(arm, 0.3 + 0.4 * stream(0, "thetas").random((1000, 3))), ForwardModel(1, 3, 2, rate=1.0)
    model.refresh(memory)
    inverse, goal = ModelInverse(memory, model, arm.policies), memory.outcomes[0]
    for turned in (-0.5, 0.5):
        context = memory.contexts[0] + turned * np.sign(-memory.contexts[0])
        landed = arm.execute(context, inverse(context, goal).theta, stream(0, "any"))
        assert np.linalg.norm(landed - goal) < 0.02


@pytest.mark.parametrize(("joints", "policies", "named"), [(3, 7, "memory"), (7, 3, "policies")])
def test_a_model_of_another_robot_is_refused(model, joints, policies, named):
    with pytest.raises(ValueError, match=named):
        ModelInverse(Memory(0, joints, 2), model, PlanarArm(policies).policies)


def lived(outcome_of, n, scale=1.0, noise=0.1, **options):
    """``n`` random movements, of which a model and a `ProvedModel` were told after each 50."""
    memory, model = Memory(0, 3, 2), ForwardModel(0, 3, 2, **options)
    proved, rng = ProvedModel(memory, model, CUBE, outcome_noise=scale * noise), stream(0, "lived")
    for theta in rng.random((n, 3)):
        memory.add(NO_CONTEXT, theta, scale * outcome_of(theta, rng))
        model.refresh(memory)
    return proved


CUBE = Box.cube(0.0, 1.0, 3)


def smooth(theta, rng):
    return np.array([theta.sum(), theta[0] * theta[1]])


def noisy(theta, rng):
    """What a process would have to learn is small, and its noise depends on the movement."""
    return np.sin(6 * theta[:2]) + 0.3 * theta[2] * rng.standard_normal(2)


@pytest.fixture(scope="module")
def proved():
    return lived(noisy, 600)


def same_answers(proved, expected, goals):
    found = proved.many(NO_CONTEXT, goals)
    return all(np.array_equal(one.theta, other.theta) for one, other in zip(found, expected, strict=True))


def test_a_model_that_predicts_worse_than_the_process_is_not_asked():
    proved = lived(smooth, 500, rate=0.1)
    assert proved.through_model.trusted  # on its own it would be
    assert not proved.trusted
    goals = proved.process.memory.outcomes[:3] + 0.01
    assert same_answers(proved, [proved.process(NO_CONTEXT, goal) for goal in goals], goals)


def test_a_model_that_predicts_better_answers_once_there_were_enough_tests(proved):
    assert (lived(noisy, 150).trusted, proved.trusted) == (False, True)
    goals = proved.process.memory.outcomes[:3] + 0.01
    assert same_answers(proved, proved.through_model.many(NO_CONTEXT, goals), goals)


def test_told_that_nothing_is_noisy_it_wants_better_predictions(proved):
    assert proved.trusted
    assert not lived(noisy, 600, noise=0.0).trusted


def test_it_is_the_same_whether_or_not_it_was_asked(goals):
    asked, silent = lived(noisy, 100), lived(noisy, 100)
    rng = stream(5, "more")
    for theta in rng.random((500, 3)):
        outcome = noisy(theta, rng)
        for each in (asked, silent):
            each.process.memory.add(NO_CONTEXT, theta, outcome)
            each.through_model.model.refresh(each.process.memory)
        if len(asked.process.memory) % 70 == 0:
            asked.many(NO_CONTEXT, goals)
    assert asked.trusted == silent.trusted
    assert same_answers(asked, silent.many(NO_CONTEXT, goals), goals)


def test_in_thousandths_of_the_unit_it_trusts_and_answers_the_same(proved):
    thousand = lived(noisy, 600, scale=1000.0)
    assert thousand.trusted == proved.trusted
    goals = stream(6, "goals").uniform(-0.9, 0.9, (20, 2))
    answers = (each.many(NO_CONTEXT, scale * goals) for each, scale in ((proved, 1.0), (thousand, 1000.0)))
    for found, scaled in zip(*answers, strict=True):
        np.testing.assert_allclose(found.theta, scaled.theta, atol=5e-3)  # many steps in float32
