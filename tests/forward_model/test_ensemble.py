"""The ensemble: many networks in one pass are what each is alone, and each learns from its own batch."""

import math

import numpy as np
import pytest
import torch
from scipy.stats import norm

from sgimd_torch.forward_model.ensemble import Ensemble, nll
from sgimd_torch.spaces import stream

MEMBERS = 3


def ensemble(seed=0, **options):
    return Ensemble(4, 2, torch.Generator().manual_seed(seed), MEMBERS, **options)


def alone(networks, member):
    """That member, made of torch's own layers."""
    layers = []
    for weight, bias in zip(networks.weights, networks.biases, strict=True):
        layer = torch.nn.Linear(*weight.shape[1:])
        layer.weight.data, layer.bias.data = weight[member].T, bias[member, 0]
        layers += [layer, torch.nn.SiLU()]
    return torch.nn.Sequential(*layers[:-1])


def random(*shape):
    return torch.tensor(stream(0, "values").standard_normal(shape), dtype=torch.float32)


@pytest.mark.parametrize("shape", [(6, 4), (MEMBERS, 6, 4)], ids=["one batch for all", "a batch for each"])
def test_one_pass_of_all_members_is_a_pass_of_each(shape):
    networks, inputs = ensemble(), random(*shape)
    for bias in networks.biases:
        bias.data += 0.1 * random(*bias.shape)
    means, log_variances = networks(inputs)
    assert means.shape == log_variances.shape == (MEMBERS, 6, 2)
    for member in range(MEMBERS):
        mean, log_variance = alone(networks, member)(inputs.expand(MEMBERS, 6, 4)[member]).chunk(2, dim=-1)
        torch.testing.assert_close(means[member], mean)
        torch.testing.assert_close(log_variances[member], log_variance)  # between the bounds, for these


def test_every_member_starts_from_other_weights_and_all_come_from_the_generator():
    before = torch.random.get_rng_state()
    weights = [[*ensemble(seed).weights] for seed in (0, 0, 1)]
    assert all(torch.equal(one, same) for one, same in zip(*weights[:2], strict=True))
    assert not any(torch.equal(one, other) for one, other in zip(weights[0], weights[2], strict=True))
    assert not torch.equal(weights[0][0][0], weights[0][0][1])
    assert torch.equal(torch.random.get_rng_state(), before)


def test_a_member_learns_from_its_own_batch_only():
    networks, inputs, outputs = ensemble(), random(MEMBERS, 6, 4), random(MEMBERS, 6, 2)

    def gradients():
        return torch.autograd.grad(networks.training_step((inputs, outputs)), [*networks.weights])

    before = gradients()
    outputs[1] += 1.0
    for was, now in zip(before, gradients(), strict=True):
        torch.testing.assert_close(now[[0, 2]], was[[0, 2]], rtol=0, atol=0)
        assert not torch.equal(now[1], was[1])


def test_the_noise_it_predicts_lies_between_one_and_four_hundred_and_fifty_percent():
    _, log_variances = ensemble()(1000 * random(50, 4))
    deviations = (log_variances / 2).exp()
    assert deviations.min().item() == pytest.approx(0.01, rel=0.12)
    assert deviations.max().item() == pytest.approx(4.5, rel=0.01)


def test_without_noise_heads_the_noise_is_a_number_of_its_own_for_each_output():
    networks = ensemble(noise_heads=False)
    networks.biases[-1].data[..., 2:] = torch.tensor([-1.0, 0.5])
    means, log_variances = networks(random(6, 4))
    assert torch.equal(log_variances, torch.tensor([-1.0, 0.5]).expand(MEMBERS, 6, 2))
    torch.testing.assert_close(means[0], alone(networks, 0)(random(6, 4))[:, :2])
    (gradient,) = torch.autograd.grad(log_variances.sum(), networks.biases[-1])
    assert (gradient[..., 2:] == 6).all()  # it is learnt from all six


def test_the_likelihood_is_that_of_a_gaussian_up_to_a_constant():
    mean, log_variance, values = random(3, 5, 2)
    expected = -norm.logpdf(values.numpy(), mean.numpy(), np.exp(log_variance.numpy() / 2)) - math.log(2 * math.pi) / 2
    np.testing.assert_allclose(nll(mean, log_variance, values).numpy(), expected, rtol=1e-5)


@pytest.mark.parametrize(("beta", "given_up"), [(0.0, 4.0), (0.5, 2.0), (1.0, 1.0)])
def test_with_beta_outputs_taken_for_noise_keep_a_larger_gradient(beta, given_up):
    networks, outputs = ensemble(beta=beta), random(MEMBERS, 6, 2)
    networks.weights[-1].data[:] = 0.0
    networks.biases[-1].data[..., 2:] = math.log(4.0)  # a variance of 4, everywhere, and a mean of 0
    (gradient,) = torch.autograd.grad(networks.training_step((random(MEMBERS, 6, 4), outputs)), networks.biases[-1])
    of_means = -outputs.sum(dim=1, keepdim=True) / outputs.numel()  # of half the mean squared distance
    torch.testing.assert_close(gradient[..., :2], of_means / given_up)
    of_log_variances = (1 - outputs**2 / 4).sum(dim=1, keepdim=True) / 2 / outputs.numel()
    torch.testing.assert_close(gradient[..., 2:], of_log_variances * 4 / given_up)  # its minimum stays where it was
