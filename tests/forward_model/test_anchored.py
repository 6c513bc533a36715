"""Anchored predictions: exact at executed movements, the network's far away, and uncertain in between."""

import copy

import numpy as np
import pytest
import torch

from models import ARM
from sgimd_torch.forward_model.anchored import Anchored, within
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, executed, remember


@pytest.fixture(scope="module")
def memory():
    return executed(ARM, stream(0, "exemplars").random((300, 7)))


def anchored(model, memory, rows, policies=ARM.policies):
    thetas, outcomes = memory.thetas[rows][None], memory.outcomes[rows][None]
    return Anchored(model, policies, NO_CONTEXT, np.zeros((1, len(rows), 0)), thetas, outcomes)


def network(model, thetas):
    """Landing points by the network alone, and a tenth of the spread that it predicts."""
    predicted = model.predict(NO_CONTEXT, thetas)
    return predicted.mean, 0.1 * (predicted.epistemic**2 + predicted.aleatoric**2).sum(axis=-1)


def predict(near, thetas):
    with torch.no_grad():
        return [part.numpy() for part in near.predict(near.tensor(thetas))]


def test_at_an_anchor_the_prediction_is_its_outcome_and_near_it_changes_as_the_network_says(model, memory, fixed):
    fixed(share=0.0)
    for n in (20, 1):
        near = anchored(model, memory, np.arange(n))
        assert np.linalg.norm(network(model, memory.thetas[:n])[0] - memory.outcomes[:n], axis=1).max() > 0.01
        np.testing.assert_allclose(predict(near, memory.thetas[:n])[0], memory.outcomes[:n], atol=2e-3)
    fixed(share=0.0, reach=1.0)
    near, theta = anchored(model, memory, [0]), memory.thetas[0]
    thetas = theta + 0.02 * stream(0, "steps").standard_normal((10, 7))
    change = network(model, thetas)[0] - network(model, theta)[0]
    assert np.abs(change).max() > 0.02
    np.testing.assert_allclose(predict(near, thetas)[0], memory.outcomes[0] + change, atol=1e-3)


def test_an_anchor_tells_something_over_eight_hundredths_of_the_diagonal(model, memory, fixed):
    fixed(share=0.0)
    near, theta = anchored(model, memory, [0]), memory.thetas[0]
    missed = memory.outcomes[0] - network(model, theta)[0]
    beyond = theta + 0.08 * np.sqrt(7) * np.eye(7)[0]
    correction = predict(near, beyond[None])[0][0] - network(model, beyond)[0]
    np.testing.assert_allclose(correction, missed * np.exp(-0.5), rtol=5e-3)  # a Gaussian, one deviation away


@pytest.mark.parametrize("error", [0.001, 0.5])
def test_far_from_all_anchors_the_network_counts_alone_with_all_the_doubt(model, memory, error, fixed):
    fixed(caution=3.0)
    rows, far, model = np.arange(20), np.full((1, 7), 5.0), copy.deepcopy(model)
    model.missed.fill_(error)
    near = anchored(model, memory, rows)
    landing, spread = predict(near, far)
    expected_landing, expected_spread = network(model, far)
    np.testing.assert_allclose(landing, expected_landing, rtol=1e-5)
    missed = np.sqrt(((memory.outcomes[rows] - network(model, memory.thetas[rows])[0]) ** 2).mean())
    doubt = error * np.sqrt((memory.outcomes.var(axis=0)).mean())  # of what it was never trained on
    assert 0.001 < missed < 0.2 < max(doubt, 0.21)  # where it misses the anchors by more, that counts
    np.testing.assert_allclose(spread - expected_spread, 3.0 * 2 * max(doubt, missed) ** 2, rtol=1e-3)


def test_doubt_grows_from_nothing_at_an_anchor_and_counts_by_caution(model, memory, fixed):
    thetas = memory.thetas[0] + np.outer([0.0, 0.05, 0.1, 0.2, 0.4, 2.0], np.eye(7)[0])
    fixed(share=0.0, caution=0.0)
    _, careless = predict(anchored(model, memory, [0]), thetas)
    fixed(caution=7.0)
    _, careful = predict(anchored(model, memory, [0]), thetas)
    assert (careless == 0).all()
    doubt = careful - careless
    assert (np.diff(doubt) > 0).all()
    assert doubt[0] < 0.001 * doubt[-1]


def test_a_share_of_the_predicted_spread_counts_and_a_noisy_anchor_by_doubt_over_doubt_and_noise(memory, fixed):
    model = ForwardModel(0, 7, 2)
    model.networks.weights[-1].data[:] = 0.0  # untrained: it says 0
    model.networks.biases[-1].data[..., 2:] = np.log(0.5)  # with a noise of .5 m^2
    model.missed.fill_(2.0)
    for share, caution in ((0.0, 0.0), (0.3, 0.0), (1.0, 0.0), (1.0, 1.0)):
        fixed(share=share, caution=caution)
        counts = 4 / (4 + share * 0.5)
        landing, spread = predict(anchored(model, memory, [0]), memory.thetas[:1])
        np.testing.assert_allclose(landing, memory.outcomes[:1] * counts, rtol=1e-5)
        np.testing.assert_allclose(spread, 2 * (share * 0.5 + caution * (1 - counts) * 4), rtol=1e-4)


def test_each_candidate_has_its_own_anchors(model, memory):
    rows = np.arange(12).reshape(3, 4)
    thetas = memory.thetas[rows[:, 0]] + 0.03
    near = memory.thetas[rows], memory.outcomes[rows]
    together = Anchored(model, ARM.policies, NO_CONTEXT, np.zeros((3, 4, 0)), *near)
    for k, (landing, spread) in enumerate(zip(*predict(together, thetas), strict=True)):
        alone = predict(anchored(model, memory, rows[k]), thetas[k : k + 1])
        np.testing.assert_allclose(landing, alone[0][0], atol=1e-5)
        np.testing.assert_allclose(spread, alone[1][0], rtol=1e-3)


def test_an_anchor_counts_in_its_own_context_and_the_candidate_in_its_own(fixed):
    fixed(share=0.0)
    model = ForwardModel(1, 7, 2)  # untrained, but the context matters
    theta, contexts = np.full((1, 7), 0.5), np.array([[0.3], [-0.3]])
    near = Anchored(model, ARM.policies, contexts[0], contexts[None, 1:], theta[None], np.array([[[0.4, 0.2]]]))
    with torch.no_grad():
        ours, anchors = (model.landing(*map(model.tensor, (c, theta)))[0].mean(dim=0).numpy() for c in contexts)
    assert np.abs(ours - anchors).max() > 0.01
    np.testing.assert_allclose(predict(near, theta)[0], ours - anchors + np.array([0.4, 0.2]), atol=1e-3)


def test_the_gradient_of_the_expected_distance_equals_finite_differences(model, memory):
    near = anchored(model, memory, np.arange(40))
    theta, goals, step = near.tensor(memory.thetas[38:42] + 0.02), near.tensor(memory.outcomes[50:54]), 3e-3
    gradient = gradient_at(near, theta, goals)
    with torch.no_grad():
        for k, ahead in enumerate(step * torch.eye(7)):
            slope = (near.expected(theta + ahead, goals) - near.expected(theta - ahead, goals)) / (2 * step)
            torch.testing.assert_close(gradient[:, k], slope, atol=5e-3, rtol=5e-3)  # in float32
    assert gradient.abs().max() > 1


def gradient_at(near, theta, goals):
    theta = theta.detach().requires_grad_(True)
    return torch.autograd.grad(near.expected(theta, goals).sum(), theta)[0]


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_the_gradient_is_finite_at_the_goal_itself_and_at_an_anchor(model, memory, share, fixed):
    fixed(share=share)
    near = anchored(model, memory, np.arange(5))
    theta = near.tensor(memory.thetas[:5])
    goals = near.predict(theta)[0].detach()
    assert torch.isfinite(gradient_at(near, theta, goals)).all()
    with torch.no_grad():
        landing, spread = near.predict(theta)
        torch.testing.assert_close(near.expected(theta, landing), spread)  # no distance is left
        torch.testing.assert_close(near.expected(theta, landing + 0.3), spread + 2 * 0.09)


BOX = Box(np.array([0.0, -1.0, 10.0, 0.0, 0.0, 0.0, 0.0]), np.array([1.0, 1.0, 30.0, 1.0, 1.0, 1.0, 0.01]))


def test_the_trust_region_ends_at_its_radius_and_near_points_are_left_alone():
    rng = stream(0, "points")
    start = BOX.low + BOX.sides * rng.random((50, 7))
    far, near = (start + size * BOX.sides * rng.uniform(-1, 1, (50, 7)) for size in (1.0, 0.1))
    tensors = [torch.tensor(values) for values in (start, far, near, BOX.sides)]
    kept = within(tensors[0], tensors[1], tensors[3], 0.1).numpy()
    np.testing.assert_allclose(np.sqrt((((kept - start) / BOX.sides) ** 2).mean(axis=1)), 0.1)
    scale = (kept - start) / (far - start)
    np.testing.assert_allclose(scale, np.broadcast_to(scale[:, :1], scale.shape), rtol=1e-6)  # straight towards it
    torch.testing.assert_close(within(tensors[0], tensors[2], tensors[3], 0.1), tensors[2])
    torch.testing.assert_close(within(tensors[0], tensors[0], tensors[3], 0.1), tensors[0])


@pytest.mark.parametrize("radius", [None, 0.05])
def test_a_descent_comes_down_and_stays_in_the_box_and_in_the_trust_region(model, memory, radius):
    start = memory.thetas[:30]
    policies = Box.cube(start.min(), start.max(), 7)  # some begin on its border
    near = anchored(model, memory, np.arange(40), policies)
    goals = near.tensor(memory.outcomes[100:130])
    with torch.no_grad():
        before = near.expected(near.tensor(start), goals)
    found = near.descend(near.tensor(start), goals, steps=30, step=0.02, radius=radius)
    with torch.no_grad():
        assert (near.expected(found, goals) < before).all()
        assert near.expected(found, goals).mean() < 0.8 * before.mean()
    found = found.double().numpy()
    assert policies.contains(np.round(found, 7)).all()
    lengths = np.sqrt((((found - start) / policies.sides) ** 2).mean(axis=1))
    if radius is None:
        assert lengths.max() > 0.05
    else:
        assert lengths.max() == pytest.approx(radius, rel=1e-4)


def test_a_descent_takes_the_steps_of_torchs_adam(model, memory):
    near = anchored(model, memory, np.arange(5))
    start, goals = near.tensor(0.3 + 0.4 * memory.thetas[:5]), near.tensor(memory.outcomes[50:55])
    theta = start.clone().requires_grad_()
    adam = torch.optim.Adam([theta], lr=0.02, eps=1e-30)
    for _ in range(10):
        theta.grad = gradient_at(near, theta, goals)
        adam.step()
    torch.testing.assert_close(near.descend(start, goals, steps=10, step=0.02), theta.detach(), atol=1e-4, rtol=0)


def test_a_step_is_a_share_of_each_side_whatever_the_unit(memory):
    """Parameters in other units, learnt in these: the descent is the same."""
    paths = []
    for scale in (np.ones(7), BOX.sides):
        scaled, policies = remember(memory.thetas[:60] * scale, memory.outcomes[:60]), Box(np.zeros(7), scale)
        model = ForwardModel(0, 7, 2)
        model.refresh(scaled)
        near = anchored(model, scaled, np.arange(5), policies)
        goals = near.tensor(memory.outcomes[5:10])
        found = near.descend(near.tensor(scaled.thetas[:5]), goals, steps=10, step=0.02, radius=0.05)
        paths.append(found.numpy() / scale)
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-3)
