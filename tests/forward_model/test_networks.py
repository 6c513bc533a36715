"""Networks: many in one pass are what each is alone, each learns from its own batch, and they may be a user's own."""

import copy
import math
import re
import threading
from functools import partial

import numpy as np
import pytest
import torch
from lightning import Trainer
from scipy.stats import norm
from torch.utils.data import DataLoader, TensorDataset

from marks import slow
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.networks import Network, nll
from sgimd_torch.forward_model.shared import model_of
from sgimd_torch.inverses.nearest import NearestNeighbour as Nearest
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Box, stream
from worlds import Boxes

MEMBERS = 3


def ensemble(seed=0, **options):
    return ForwardModel(1, 3, 2, seed=seed, members=MEMBERS, **options)


def alone(networks, member):
    """That member, made of torch's own layers."""
    layers = []
    for weight, bias in zip(networks.networks.weights, networks.networks.biases, strict=True):
        layer = torch.nn.Linear(*weight.shape[1:])
        layer.weight.data, layer.bias.data = weight[member].T, bias[member, 0]
        layers += [layer, torch.nn.SiLU()]
    return torch.nn.Sequential(*layers[:-1])


def random(*shape):
    return torch.tensor(stream(0, "values").standard_normal(shape), dtype=torch.float32)


@pytest.mark.parametrize("shape", [(6, 4), (MEMBERS, 6, 4)], ids=["one batch for all", "a batch for each"])
def test_one_pass_of_all_members_is_a_pass_of_each(shape):
    networks, inputs = ensemble(), random(*shape)
    for bias in networks.networks.biases:
        bias.data += 0.1 * random(*bias.shape)
    means, log_variances = networks(inputs)
    assert means.shape == log_variances.shape == (MEMBERS, 6, 2)
    for member in range(MEMBERS):
        mean, log_variance = alone(networks, member)(inputs.expand(MEMBERS, 6, 4)[member]).chunk(2, dim=-1)
        torch.testing.assert_close(means[member], mean)
        torch.testing.assert_close(log_variances[member], log_variance)  # between the bounds, for these


def test_a_member_learns_from_its_own_batch_only():
    networks, inputs, outputs = ensemble(), random(MEMBERS, 6, 4), random(MEMBERS, 6, 2)

    def gradients():
        return torch.autograd.grad(networks.training_step((inputs, outputs)), [*networks.networks.weights])

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
    networks.networks.biases[-1].data[..., 2:] = torch.tensor([-1.0, 0.5])
    means, log_variances = networks(random(6, 4))
    assert torch.equal(log_variances, torch.tensor([-1.0, 0.5]).expand(MEMBERS, 6, 2))
    torch.testing.assert_close(means[0], alone(networks, 0)(random(6, 4))[:, :2])
    (gradient,) = torch.autograd.grad(log_variances.sum(), networks.networks.biases[-1])
    assert (gradient[..., 2:] == 6).all()  # it is learnt from all six


def test_the_likelihood_is_that_of_a_gaussian_up_to_a_constant():
    mean, log_variance, values = random(3, 5, 2)
    expected = -norm.logpdf(values.numpy(), mean.numpy(), np.exp(log_variance.numpy() / 2)) - math.log(2 * math.pi) / 2
    np.testing.assert_allclose(nll(mean, log_variance, values).numpy(), expected, rtol=1e-5)


@pytest.mark.parametrize(("beta", "given_up"), [(0.0, 4.0), (0.5, 2.0), (1.0, 1.0)])
def test_with_beta_outputs_taken_for_noise_keep_a_larger_gradient(beta, given_up):
    networks, outputs = ensemble(beta=beta), random(MEMBERS, 6, 2)
    networks.networks.weights[-1].data[:] = 0.0
    networks.networks.biases[-1].data[..., 2:] = math.log(4.0)  # a variance of 4, everywhere, and a mean of 0
    (gradient,) = torch.autograd.grad(
        networks.training_step((random(MEMBERS, 6, 4), outputs)), networks.networks.biases[-1]
    )
    of_means = -outputs.sum(dim=1, keepdim=True) / outputs.numel()  # of half the mean squared distance
    torch.testing.assert_close(gradient[..., :2], of_means / given_up)
    of_log_variances = (1 - outputs**2 / 4).sum(dim=1, keepdim=True) / 2 / outputs.numel()
    torch.testing.assert_close(gradient[..., 2:], of_log_variances * 4 / given_up)  # its minimum stays where it was


class Own(Network):
    """One layer; ``heads``: with a log variance."""

    def __init__(self, context_dim, theta_dim, outcome_dim, *, heads: bool = True):
        super().__init__()
        self.heads, self.layer = heads, torch.nn.Linear(context_dim + theta_dim, 2 * outcome_dim)
        self.often = torch.nn.Dropout(0.01)

    def forward(self, context, theta):
        mean, log_variance = self.layer(self.often(torch.cat([context, theta], dim=-1))).chunk(2, dim=-1)
        return (mean, log_variance) if self.heads else mean


class InUnits(Own):
    standardised = False


class Bound(torch.nn.Module):
    """A module that cannot be copied."""

    def __init__(self, *_):
        super().__init__()
        self.lock = threading.Lock()


def answering(answer):
    """A constructor of networks with this ``forward``."""

    class Answering(Own):
        def forward(self, context, theta):
            return answer(super().forward(context, theta)[0])

    return Answering


@pytest.mark.parametrize(
    ("network", "message"),
    [
        (lambda *dims: "network", "must make a torch.nn.Module, made a str"),
        (lambda: None, "cannot be called with the arguments of its kind"),
        (Bound, "cannot be copied: TypeError: cannot pickle '_thread.lock' object"),
        (torch.nn.Linear(4, 2), r"fails for context \(5, 1\) and theta \(5, 3\): TypeError"),
        (answering(lambda mean: mean[:, :1]), r"must return mean \(5, 2\), or mean and log variance, .* got \(5, 1\)"),
        (answering(lambda mean: (mean, mean, mean)), r"got \(5, 2\) and \(5, 2\) and \(5, 2\)"),
        (answering(lambda mean: 0.0), "got float"),
        (answering(lambda mean: mean * math.nan), "returns NaN or infinity"),
        (answering(lambda mean: mean.detach()), "without gradient"),
    ],
)
def test_what_is_no_network_is_refused_when_it_is_built_with_the_shapes(network, message):
    with pytest.raises(ValueError, match=message):
        ensemble(network=network)


def test_options_of_perceptrons_are_refused_for_a_network_of_ones_own_and_wrong_numbers_for_all():
    for options in ({"widths": (8,)}, {"activation": "tanh"}):
        with pytest.raises(ValueError, match=r"options of perceptrons, not of .*:Own\(heads=False\)"):
            ensemble(network=partial(Own, heads=False), **options)
    for options in ({"widths": (0,)}, {"activation": "silo"}, {"lr": 0.0}, {"beta": 1.5}, {"batch": 0}):
        with pytest.raises(ValueError, match=next(iter(options))):
            ensemble(**options)


def moved(n=200):
    """Movements in one context each, whose outcomes are linear in theta."""
    rng, memory = stream(0, "movements"), Memory(1, 3, 2)
    contexts, thetas = rng.random((n, 1)), rng.random((n, 3))
    memory.extend(contexts, thetas, thetas[:, :2] + contexts)
    return memory


@pytest.mark.parametrize("noise_heads", [True, False])
@pytest.mark.parametrize("heads", [True, False])
@pytest.mark.parametrize("kind", [Own, InUnits])
def test_own_networks_learn_standardised_or_in_units_with_a_noise_or_without(kind, heads, noise_heads):
    memory = moved()
    model = ensemble(network=partial(kind, heads=heads), rate=10.0, lr=0.03, noise_heads=noise_heads)
    for n in (60, 200):  # the second refresh scales anew
        model.refresh(moved(n=n))
    assert model.relative_error < 0.15
    mean, _, noise = model.predict(memory.contexts, memory.thetas)
    assert np.abs(mean - memory.outcomes).max() < 0.3
    assert (np.ptp(noise, axis=0).max() > 1e-6) == (heads and noise_heads)
    assert not model.training
    if kind is InUnits:
        answers = [net(model.tensor(memory.contexts), model.tensor(memory.thetas)) for net in model.networks.members]
        means = [(answer[0] if heads else answer).detach() for answer in answers]
        np.testing.assert_allclose(torch.stack(means).mean(dim=0), mean, atol=1e-5)


class Normed(Own):
    """With statistics of training, and members that differ in a number which is no weight."""

    def __init__(self, *dims, step: float = 0.0):
        super().__init__(*dims)
        self.norm, self.factor = torch.nn.BatchNorm1d(dims[1]), 1 + step * float(torch.rand(()))

    def forward(self, context, theta):
        return super().forward(self.factor * context, self.norm(theta))


class Asking(Own):
    def forward(self, context, theta):
        return super().forward(context, theta if theta.mean() > -1e9 else -theta)


@pytest.mark.parametrize(
    ("network", "why"),
    [
        (Own, ""),
        (InUnits, ""),
        (Normed, ""),
        (Asking, "RuntimeError: vmap: .*data-dependent control flow"),
        (partial(Normed, step=1.0), "AssertionError: "),
    ],
)
def test_own_networks_are_computed_at_once_and_answer_as_each_alone_or_it_says_why_not(network, why, monkeypatch):
    model = ensemble(network=network)
    assert re.match(why or "$", model.networks.one_by_one)
    model.refresh(moved())
    calls, call = [], torch.nn.Linear.forward
    monkeypatch.setattr(torch.nn.Linear, "forward", lambda layer, x: calls.append(layer) or call(layer, x))
    context, theta = random(6, 1), random(6, 3)
    means, _ = model.landing(context, theta)
    assert len(calls) == (MEMBERS if why else 1)
    inputs = (torch.cat([context, theta], dim=-1) - model.input_mean) / model.input_scale
    if network is not InUnits:
        alone = torch.stack([net(inputs[:, :1], inputs[:, 1:])[0] for net in model.networks.members])
        torch.testing.assert_close(means, model.outcome_mean + model.outcome_scale * alone)
    problem = Problem(Boxes(Box.cube(0, 1, 1), Box.cube(0, 1, 3), Box.cube(0, 9, 2), np.zeros(2)), 0, inverse=Nearest)
    model_of(problem, network=network)
    assert len(problem.remarks) == bool(why)


def test_a_module_is_copied_with_its_weights():
    net = Own(1, 3, 2)
    copies = ensemble(network=net).networks.members
    assert all(torch.equal(one.layer.weight, net.layer.weight) and one is not net for one in copies)


@pytest.mark.parametrize("own", [{}, {"network": Own}])
def test_every_member_starts_from_other_weights_and_all_come_from_the_seed(own):
    before = torch.random.get_rng_state()
    networks = [ensemble(seed, **own).networks for seed in (0, 0, 1)]
    first, same, other = ([net.layer.weight for net in nets.members] if own else nets.weights[0] for nets in networks)
    assert all(map(torch.equal, first, same))
    assert not any(map(torch.equal, first, other))
    assert not torch.equal(first[0], first[1])
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize("network", [None, Own])
def test_a_plain_trainer_fits_it_saves_it_and_a_checkpoint_loads_it_as_it_was_made(tmp_path, network):
    own = {} if network is None else {"network": network}
    model = ensemble(lr=0.02, trust=0.5, **own)
    model.refresh(moved())
    model.train()
    loader = DataLoader(TensorDataset(*model.standardised(moved())), batch_size=50)
    trainer = Trainer(max_epochs=20, accelerator="cpu", logger=False, enable_checkpointing=False, **QUIET)
    trainer.fit(model, loader)
    trainer.save_checkpoint(tmp_path / "model.ckpt")
    loaded = ForwardModel.load_from_checkpoint(tmp_path / "model.ckpt", **own)
    assert loaded.hparams == model.hparams
    assert {"lr": 0.02, "members": MEMBERS, "trust": 0.5, "theta_dim": 3}.items() <= loaded.hparams.items()
    memory = moved()
    for one, other in zip(*(net.predict(memory.contexts, memory.thetas) for net in (model, loaded)), strict=True):
        np.testing.assert_array_equal(one, other)
    for net in (model, loaded):
        net.refresh(moved(n=300))
    assert all(map(torch.equal, model.state_dict().values(), loaded.state_dict().values()))
    if network is not None:
        with pytest.raises(ValueError, match=r"this checkpoint has .*:Own: load_from_checkpoint\(path, network=...\)"):
            ForwardModel.load_from_checkpoint(tmp_path / "model.ckpt")


QUIET = {"enable_progress_bar": False, "enable_model_summary": False}


# Torch's own command to the linker does not quote its folder.
LINKED = pytest.mark.skipif(" " in torch.__file__, reason="inductor links nothing if torch is in a path with a space")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of torch itself
@pytest.mark.parametrize("backend", ["eager", slow("inductor", more=[LINKED])])
@pytest.mark.parametrize("network", [{}, {"network": Own}])
def test_torch_compiles_it_as_one_graph(backend, network):
    model = ensemble(**network).eval()
    compiled = torch.compile(copy.deepcopy(model).forward, backend=backend, fullgraph=True)
    for ours, expected in zip(compiled(random(6, 4)), model(random(6, 4)), strict=True):
        torch.testing.assert_close(ours, expected)
