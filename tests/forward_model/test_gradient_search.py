"""Searches through the forward model: they come nearer than the simplex, learn from each outcome, keep to a region."""

from functools import partial

import numpy as np
import pytest
import torch

from models import ARM, problem_of
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model import search as module
from sgimd_torch.forward_model.anchored import Anchored
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.proved import ProvedModel
from sgimd_torch.forward_model.search import GradientSearch
from sgimd_torch.forward_model.shared import model_of
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.spaces import Estimate, stream
from worlds import NO_CONTEXT, drive, executed


@pytest.fixture(scope="module")
def biased(model):
    """Wrong by 20 cm, everywhere alike, and sure of itself."""
    biased = ForwardModel(0, 7, 2)
    biased.load_state_dict(model.state_dict())
    biased.outcome_mean += torch.tensor([0.2, 0.0])
    return biased


@pytest.fixture(scope="module")
def few(memory):
    """A tenth of what the model has learnt from, so that estimates can be improved on."""
    return executed(ARM, memory.thetas[:60])


@pytest.fixture(scope="module")
def inverse(few):
    return LocallyLinear(problem_of(few))


@pytest.fixture
def fine(monkeypatch):
    """Descents in many small steps."""
    monkeypatch.setattr(module, "_STEPS", 20)
    monkeypatch.setattr(module, "_STEP", 0.005)


@pytest.fixture
def descents(monkeypatch):
    """Arguments and results of each descent: (starts, results, radius, anchored)."""
    calls, descend = [], Anchored.descend

    def recorded(anchored, starts, goals, *, radius, **options):
        results = descend(anchored, starts, goals, radius=radius, **options)
        calls.append((starts.double().numpy(), results.double().numpy(), radius, anchored))
        return results

    monkeypatch.setattr(Anchored, "descend", recorded)
    return calls


def pursue(search, estimate, goal, n=10):
    """At most ``n`` movements, and the distances (m) of their outcomes from the goal."""
    thetas = np.array(
        drive(search(estimate, goal), lambda theta: ARM.execute(estimate.context, theta, stream(0, "any")), n)
    )
    return thetas, np.linalg.norm(executed(ARM, thetas).outcomes - goal, axis=1)


def nearest(make, memory, model, estimate, goals, n=10):
    """Distances of the best of ``n`` movements for each goal."""
    searches = [make(problem_of(memory, model, seed=k)) for k in range(len(goals))]
    pairs = zip(searches, goals, strict=True)
    return np.array([pursue(search, estimate(NO_CONTEXT, goal), goal, n)[1].min() for search, goal in pairs])


def test_it_comes_nearer_than_the_simplex_in_as_many_movements(few, model, inverse, goals, fixed):
    fixed(share=0.0)  # this arm has no noise
    makers = partial(GradientSearch, noise=0.01), partial(NelderMead, noise=0.01)
    found, simplex = (nearest(make, few, model, inverse, goals[:8]) for make in makers)
    assert (found < simplex).mean() > 0.5
    assert found.mean() < 0.5 * simplex.mean()


def far_from(memory):
    """An inverse model with one exemplar, far from the goal, which says nothing of the model's error near the goal."""
    linear = LocallyLinear(problem_of(memory))

    def inverse(context, goal):
        far = [np.linalg.norm(memory.outcomes - goal, axis=1).argmax()]
        return linear(context, goal)._replace(thetas=memory.thetas[far], outcomes=memory.outcomes[far])

    return inverse


def test_outcomes_of_the_search_and_exemplars_of_the_estimate_correct_the_models_error(
    few, memory, biased, goals, fixed, fine
):
    fixed(share=0.0)
    search = partial(GradientSearch, noise=0.0)
    first, best = (nearest(search, few, biased, far_from(few), goals[:4], n).mean() for n in (1, 8))
    assert best < 0.03 < 0.1 < first
    inverses = LocallyLinear(problem_of(memory)), far_from(memory)
    near, far = (nearest(search, memory, biased, inverse, goals[:5], n=1).mean() for inverse in inverses)
    assert near < far / 2


def test_no_movement_is_planned_outside_of_the_trust_region_or_the_box(
    few, model, inverse, goals, descents, monkeypatch
):
    monkeypatch.setattr(module, "_STEPS", 20)
    monkeypatch.setattr(module, "_STEP", 0.05)
    search = GradientSearch(problem_of(few, model), noise=0.5)
    for goal in (*goals[:3], np.array([3.0, 3.0])):
        assert ARM.policies.contains(pursue(search, inverse(NO_CONTEXT, goal), goal, n=3)[0]).all()  # with the noise
    lengths = [
        np.sqrt((((found - starts) / ARM.policies.sides) ** 2).mean(axis=1)).max() / radius
        for starts, found, radius, _ in descents
    ]
    assert max(lengths) == pytest.approx(1.0, abs=1e-3)  # the far goal draws it to the border
    assert all(ARM.policies.contains(found).all() for _, found, _, _ in descents)


def test_the_trust_region_grows_where_the_prediction_is_right_and_shrinks_where_it_is_not(
    few, model, inverse, descents
):
    goal = np.array([3.0, 3.0])  # never reached, so that there is always a change to be predicted
    estimate = inverse(NO_CONTEXT, goal)

    def radii(outcome, n=5):
        """Those of ``n`` movements in a world where each lands as ``outcome`` (predicted, nearest so far) says."""
        descents.clear()
        attempt = GradientSearch(problem_of(few, model), noise=0.0)(estimate, goal)
        theta, outcomes = next(attempt), [*estimate.outcomes]
        for _ in range(n - 1):
            anchored = descents[-1][-1]
            with torch.no_grad():
                predicted = anchored.predict(anchored.tensor(theta[None]))[0][0].double().numpy()
            outcomes.append(outcome(predicted, min(outcomes, key=lambda landed: np.linalg.norm(landed - goal))))
            theta = attempt.send(outcomes[-1])
        return [radius for _, _, radius, _ in descents]

    assert radii(lambda predicted, _: predicted) == pytest.approx([0.15, 0.225, 0.3, 0.3, 0.3])
    contradicting = radii(lambda predicted, before: before - 2 * (predicted - before))
    assert contradicting == pytest.approx([0.15, 0.075, 0.0375, 0.02, 0.02])
    assert radii(lambda predicted, before: before + (predicted - before) / 4, n=3) == [0.15, 0.15, 0.15]


def test_it_starts_from_the_estimate_and_then_from_what_has_landed_nearest(memory, model, goals, descents):
    problem, goal = problem_of(memory, model), goals[0]
    estimate = NearestNeighbour(problem, k=6)(NO_CONTEXT, goal)
    attempt = GradientSearch(problem)(estimate, goal)
    first = next(attempt)
    second = attempt.send(goal + 0.001)  # nearer than all
    attempt.send(goal - 1.0)  # farther than all
    seen = [starts for starts, *_ in descents]
    np.testing.assert_allclose(seen[0], np.vstack([estimate.theta, estimate.thetas[:5]]), rtol=1e-6)
    for starts in seen[1:]:
        np.testing.assert_allclose(starts, np.vstack([first, estimate.thetas[:4]]), rtol=1e-6)
    assert not np.array_equal(first, second)


UNTRUSTED = {
    "not trained": lambda few, model: problem_of(few),
    "wrong": lambda few, model: problem_of(few, model, trust=0.9 * model.relative_error),
    "not proved": lambda few, model: problem_of(few, model, inverse=ProvedModel),
}


@pytest.mark.parametrize("why", UNTRUSTED)
def test_until_the_model_is_trusted_the_search_is_the_simplex_bit_for_bit(few, model, inverse, goals, why):
    estimate = inverse(NO_CONTEXT, goals[0])
    search, simplex = GradientSearch(UNTRUSTED[why](few, model)), NelderMead(problem_of(few))
    np.testing.assert_array_equal(*(pursue(one, estimate, goals[0], n=6)[0] for one in (search, simplex)))
    if why == "not trained":  # a model that becomes good enough is used for the next goal
        search.model.load_state_dict(model.state_dict())
        trusted = GradientSearch(problem_of(few, model))
        search.noise = trusted.noise = 0.0
        thetas = [next(one(estimate, goals[0])) for one in (search, trusted)]
        np.testing.assert_array_equal(*thetas)
        assert not np.isclose(thetas[0], pursue(simplex, estimate, goals[0], n=1)[0]).all()


def test_a_seed_makes_the_same_movements_and_the_model_does_not_change(few, model, inverse, goals):
    problems, random = [problem_of(few, model, seed=k) for k in (3, 3, 4)], torch.random.get_rng_state()
    searches = [GradientSearch(problem) for problem in problems]
    one, same, other = (pursue(search, inverse(NO_CONTEXT, goals[0]), goals[0], 4)[0] for search in searches)
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert all(map(torch.equal, model.state_dict().values(), model_of(problems[0]).state_dict().values()))
    assert torch.equal(torch.random.get_rng_state(), random)


def test_contexts_reach_the_model(fine):
    arm = PlanarArm(3, context=True)
    memory = executed(arm, 0.3 + 0.4 * stream(0, "thetas").random((1000, 3)))
    problem, goal = problem_of(memory, environment=arm), memory.outcomes[0]
    search = GradientSearch(problem, noise=0.0)
    search.model.refresh(memory)
    far = memory.thetas[np.linalg.norm(memory.outcomes - goal, axis=1).argsort()[-5:]]

    def error(context, asked):
        """Distance from the goal when a movement that is planned in one context is executed in another one."""
        landed = np.array([arm.execute(asked, theta, stream(0, "any")) for theta in far])
        theta = next(search(Estimate(problem.inverse(context, goal).theta, far, landed, asked), goal))
        return np.linalg.norm(arm.execute(context, theta, stream(0, "any")) - goal)

    for context in (memory.contexts[0] / 2, memory.contexts[0] / 2 - 0.3):
        assert error(context, context) < 0.06 < error(context, context + 0.5) / 2


@pytest.mark.parametrize("noise", [-0.1, 0.6, np.nan])
def test_a_noise_out_of_its_range_is_refused(few, noise):
    with pytest.raises(ValueError, match="noise"):
        GradientSearch(problem_of(few), noise=noise)
