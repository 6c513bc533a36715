"""Searches through the forward model: they come nearer than the simplex, learn from each outcome, keep to a region."""

from functools import partial

import numpy as np
import pytest
import torch

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.anchored import Anchored, Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.inverses.local import NearestNeighbour
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.searches.through_model import descend, gauss_newton, gradient_search
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, drive, executed

ARM = PlanarArm(7)
EXACT = Trust(share=0.0)  # as this arm is
FINE = partial(descend, steps=20, step=0.005)
UNTRAINED = ForwardModel(0, 7, 2)


@pytest.fixture(scope="module")
def biased(model):
    """Wrong by 20 cm, everywhere alike, and sure of itself."""
    biased = ForwardModel(0, 7, 2)
    biased.load_state_dict(model.state_dict())
    biased.outcome_mean += torch.tensor([0.2, 0.0])
    return biased


@pytest.fixture(scope="module")
def inverse(memory):
    """Of one that remembers a tenth of what the model has learnt from, so that its estimates can be improved on."""
    return LocallyLinear(executed(ARM, memory.thetas[:60]))


def pursue(search, estimate, goal, n=10):
    """At most ``n`` movements, and how far (m) from the goal they landed."""
    outcomes = []

    def execute(theta):
        outcomes.append(ARM.execute(estimate.context, theta, stream(0, "any")))
        return outcomes[-1]

    thetas = drive(search(estimate, goal), execute, n)
    return np.array(thetas), np.linalg.norm(np.array(outcomes) - goal, axis=1)


def nearest(make, inverse, goals, n=10):
    """How near each goal the best of ``n`` movements landed."""
    searches = [make(ARM.policies, stream(k, "search")) for k in range(len(goals))]
    found = [pursue(s, inverse(NO_CONTEXT, goal), goal, n)[1].min() for s, goal in zip(searches, goals, strict=True)]
    return np.array(found)


@pytest.mark.parametrize("propose", [descend, gauss_newton])
def test_it_comes_nearer_than_the_simplex_in_as_many_movements(model, inverse, goals, propose):
    search = partial(gradient_search, model=model, propose=propose, noise=0.01, trust=EXACT)
    found, simplex = nearest(search, inverse, goals[:8]), nearest(partial(nelder_mead, noise=0.01), inverse, goals[:8])
    assert (found < simplex).mean() > 0.5
    assert found.mean() < 0.5 * simplex.mean()


@pytest.mark.parametrize(("residual", "anchors"), [(True, True), (True, False), (False, True), (False, False)])
def test_the_outcomes_of_the_search_correct_the_models_error_here(memory, biased, inverse, goals, residual, anchors):
    def estimate(context, goal):  # whose only neighbour lies far away, and tells nothing of the bias here
        far = [np.linalg.norm(memory.outcomes - goal, axis=1).argmax()]
        return inverse(context, goal)._replace(thetas=memory.thetas[far], outcomes=memory.outcomes[far])

    trust = Trust(share=0.0, anchors=anchors)
    search = partial(gradient_search, model=biased, propose=FINE, noise=0.0, residual=residual, trust=trust)
    found = nearest(search, estimate, goals[:4], n=8)
    if residual and anchors:
        assert found.mean() < 0.03
    else:
        assert found.mean() > 0.1


def test_neighbours_of_the_estimate_already_correct_the_first_movement(memory, biased, goals):
    many = LocallyLinear(memory)
    first = [
        nearest(partial(gradient_search, model=biased, propose=FINE, noise=0.0, trust=trust), many, goals[:5], 1).mean()
        for trust in (EXACT, Trust(anchors=False))
    ]
    assert first[0] < first[1] / 2


@pytest.mark.parametrize("propose", [partial(descend, steps=20, step=0.05), gauss_newton])
def test_no_proposal_leaves_the_trust_region_of_its_start_or_the_box(model, inverse, goals, propose):
    lengths = []

    def watched(anchored, starts, goal, radius):
        proposals = propose(anchored, starts, goal, radius)
        change = (proposals - starts).double().numpy() / ARM.policies.sides
        lengths.append(np.sqrt((change**2).mean(axis=1)) / radius)
        assert ARM.policies.contains(proposals.numpy()).all()
        return proposals

    search = gradient_search(ARM.policies, stream(0, "search"), model=model, propose=watched, noise=0.5)
    for goal in (*goals[:3], np.array([3.0, 3.0])):
        assert ARM.policies.contains(pursue(search, inverse(NO_CONTEXT, goal), goal, n=3)[0]).all()  # with the noise
    assert max(map(max, lengths)) == pytest.approx(1.0, abs=1e-3)  # the far goal draws it to the border


def radii(model, estimate, goal, outcome, n=5):
    """Those of ``n`` movements in a world where each lands as ``outcome`` (predicted, nearest so far) says."""
    seen, asked = [], []

    def watched(anchored, starts, goal, radius):
        seen.append(radius)
        asked[:] = [anchored]
        return descend(anchored, starts, goal, radius)

    search = gradient_search(ARM.policies, stream(0, "search"), model=model, propose=watched, noise=0.0)
    attempt, outcomes = search(estimate, goal), [*estimate.outcomes]
    theta = next(attempt)
    for _ in range(n - 1):
        with torch.no_grad():
            predicted = asked[0].predict(asked[0].tensor(theta[None]))[0][0].double().numpy()
        outcomes.append(outcome(predicted, min(outcomes, key=lambda landed: np.linalg.norm(landed - goal))))
        theta = attempt.send(outcomes[-1])
    return seen


def test_the_trust_region_grows_where_the_prediction_is_right_and_shrinks_where_it_is_not(model, inverse):
    goal = np.array([3.0, 3.0])  # never reached, so that there is always a change to be predicted
    estimate = inverse(NO_CONTEXT, goal)
    agreeing = radii(model, estimate, goal, lambda predicted, _: predicted)
    assert agreeing == pytest.approx([0.15, 0.225, 0.3, 0.3, 0.3])
    contradicting = radii(model, estimate, goal, lambda predicted, before: before - 2 * (predicted - before))
    assert contradicting == pytest.approx([0.15, 0.075, 0.0375, 0.02, 0.02])
    in_between = radii(model, estimate, goal, lambda predicted, before: before + (predicted - before) / 4, n=3)
    assert in_between == [0.15, 0.15, 0.15]


def test_it_starts_from_the_estimate_and_then_from_what_has_landed_nearest(model, memory, goals):
    estimate, goal, seen = NearestNeighbour(memory, k=6)(NO_CONTEXT, goals[0]), goals[0], []

    def watched(anchored, starts, goal, radius):
        seen.append(starts.numpy())
        return descend(anchored, starts, goal, radius)

    search = gradient_search(ARM.policies, stream(0, "search"), model=model, propose=watched)
    attempt = search(estimate, goal)
    first = next(attempt)
    second = attempt.send(goal + 0.001)  # nearer than all
    attempt.send(goal - 1.0)  # farther than all
    np.testing.assert_allclose(seen[0], np.vstack([estimate.theta, estimate.thetas[:5]]), rtol=1e-6)
    for starts in seen[1:]:
        np.testing.assert_allclose(starts, np.vstack([first, estimate.thetas[:4]]), rtol=1e-6)
    assert not np.array_equal(first, second)


def test_with_a_model_that_is_not_trusted_it_is_the_simplex_bit_for_bit(model, inverse, goals):
    for untrusted, trust in ((UNTRAINED, Trust()), (model, Trust(error=0.9 * model.relative_error))):
        for goal in goals[:3]:
            found, simplex = (
                pursue(search(ARM.policies, stream(3, "search")), inverse(NO_CONTEXT, goal), goal, n=6)[0]
                for search in (partial(gradient_search, model=untrusted, trust=trust), nelder_mead)
            )
            np.testing.assert_array_equal(found, simplex)
    asked = next(
        gradient_search(ARM.policies, stream(3, "search"), model=model)(inverse(NO_CONTEXT, goals[0]), goals[0])
    )
    assert not np.array_equal(asked, found[0])


def test_a_model_that_becomes_good_enough_is_asked_for_the_next_goal(model, inverse, goals):
    learner = ForwardModel(0, 7, 2)
    search = gradient_search(ARM.policies, stream(3, "search"), model=learner, noise=0.0, propose=gauss_newton)
    estimate = inverse(NO_CONTEXT, goals[0])
    pursue(search, estimate, goals[0], n=2)
    learner.load_state_dict(model.state_dict())
    expected = gradient_search(ARM.policies, stream(4, "other"), model=model, noise=0.0, propose=gauss_newton)
    np.testing.assert_array_equal(next(search(estimate, goals[0])), next(expected(estimate, goals[0])))


def test_the_same_seed_makes_the_same_movements_and_the_model_stays_as_it_is(model, inverse, goals):
    before, random = [values.clone() for values in model.state_dict().values()], torch.random.get_rng_state()

    def search(seed):
        return gradient_search(ARM.policies, stream(seed, "search"), model=model)

    one, same, other = (pursue(search(seed), inverse(NO_CONTEXT, goals[0]), goals[0], 4)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert all(torch.equal(was, now) for was, now in zip(before, model.state_dict().values(), strict=True))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_contexts_reach_the_model():
    arm = PlanarArm(3, context=True)
    memory, model = executed(arm, 0.3 + 0.4 * stream(0, "thetas").random((1000, 3))), ForwardModel(1, 3, 2, rate=1.0)
    model.refresh(memory)
    inverse, goal, trust = LocallyLinear(memory), memory.outcomes[0], Trust(anchors=False)
    search = gradient_search(arm.policies, stream(0, "search"), model=model, propose=FINE, noise=0.0, trust=trust)
    for context in (memory.contexts[0] / 2, memory.contexts[0] / 2 - 0.3):
        estimate = inverse(context, goal)
        here, elsewhere = (next(search(estimate._replace(context=asked), goal)) for asked in (context, context + 0.5))
        here, elsewhere = (arm.execute(context, theta, stream(0, "any")) - goal for theta in (here, elsewhere))
        assert np.linalg.norm(here) < 0.06 < np.linalg.norm(elsewhere) / 2


def test_gauss_newton_takes_the_least_change_that_meets_the_goal_to_first_order(model, memory):
    policies = Box(np.full(7, -5.0), 5.0 * np.arange(1, 8))  # sides of many lengths, and far borders
    five = memory.thetas[None, :5], memory.outcomes[None, :5]
    near = Anchored(model, policies, NO_CONTEXT, np.zeros((1, 5, 0)), *five, EXACT)
    starts, goal = near.tensor(memory.thetas[10:14]), near.tensor([[0.2, 0.3]])
    found = gauss_newton(near, starts, goal, 10.0, steps=1, damping=1e-7)
    for start, proposal in zip(starts, found, strict=True):
        jacobian = torch.autograd.functional.jacobian(lambda theta: near.predict(theta[None])[0][0], start)
        missing = goal[0] - near.predict(start[None])[0][0].detach()
        least = np.linalg.pinv(jacobian.double().numpy() * policies.sides) @ missing.double().numpy()
        np.testing.assert_allclose((proposal - start).numpy() / policies.sides, least, atol=1e-4)


@pytest.mark.parametrize(
    ("policies", "noise", "named"),
    [*((ARM.policies, noise, "noise") for noise in (-0.1, 0.6, np.nan)), (PlanarArm(3).policies, 0.0, "policies")],
)
def test_a_noise_out_of_its_range_and_a_model_of_another_robot_are_refused(policies, noise, named):
    with pytest.raises(ValueError, match=named):
        gradient_search(policies, stream(0, "search"), model=UNTRAINED, noise=noise)
