"""The forward model: what it learns, how sure it is, and what it refuses."""

import os
import pickle

import numpy as np
import pytest
import torch

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.shared import coverage
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import stream
from worlds import NO_CONTEXT, remember

ARM = PlanarArm(3)


def remembered(n, *, noise=0.0, seed=0):
    """``n`` movements of an arm; their noise grows with theta_0."""
    rng = stream(seed, "exemplars")
    thetas = 0.3 + 0.4 * rng.random((n, 3))
    landed = np.array([ARM.execute(NO_CONTEXT, theta, rng) for theta in thetas])
    return remember(thetas, landed + noise * thetas[:, :1] * rng.standard_normal((n, 2)))


def taught(memory, **options):
    model = ForwardModel(memory.contexts.shape[1], memory.thetas.shape[1], 2, **options)
    model.refresh(memory)
    return model


def weights(model):
    return torch.cat([parameter.flatten() for parameter in model.parameters()]).detach().clone()


@pytest.fixture(scope="module")
def model():
    return taught(remembered(400), rate=1.9)


@pytest.fixture(scope="module")
def unseen():
    return remembered(200, seed=1)


def test_it_predicts_unseen_movements_far_better_than_their_mean_by_its_relative_error(model, unseen):
    errors = np.linalg.norm(model.predict(NO_CONTEXT, unseen.thetas).mean - unseen.outcomes, axis=1)
    spread = np.linalg.norm(unseen.outcomes - unseen.outcomes.mean(axis=0), axis=1)
    assert model.relative_error == pytest.approx(errors.mean() / spread.mean(), rel=0.5)  # of 40 held out
    assert model.relative_error < 0.05


def test_batch_axes_lead_and_change_nothing(model, unseen):
    together = model.predict(NO_CONTEXT, unseen.thetas[:6].reshape(2, 3, 3))
    one_by_one = [model.predict(NO_CONTEXT, theta) for theta in unseen.thetas[:6]]
    for part, parts in zip(together, zip(*one_by_one, strict=True), strict=True):
        assert part.shape == (2, 3, 2)
        np.testing.assert_allclose(part.reshape(6, 2), np.stack(parts), rtol=1e-4, atol=1e-6)


def test_members_disagree_more_far_from_executed_movements(model, unseen):
    far, near = (model.predict(NO_CONTEXT, thetas).epistemic.mean() for thetas in (np.zeros((50, 3)), unseen.thetas))
    assert far > 3 * near


def test_the_predicted_noise_is_that_of_each_movement_and_without_noise_heads_their_mean():
    memory, unseen = remembered(3000, noise=0.3), remembered(1000, noise=0.3, seed=1)  # noise of .3 * theta_0
    model = taught(memory, rate=0.5)
    thetas = np.array([[0.35, 0.5, 0.5], [0.65, 0.5, 0.5]])
    np.testing.assert_allclose(model.predict(NO_CONTEXT, thetas).aleatoric.mean(axis=1), 0.3 * thetas[:, 0], rtol=0.3)
    mean, epistemic, aleatoric = model.predict(NO_CONTEXT, unseen.thetas)
    assert 0.7 < coverage(unseen.outcomes, mean, np.hypot(epistemic, aleatoric), 0.8) < 0.9
    alike = taught(remembered(1000, noise=0.3), noise_heads=False, rate=0.4).predict(NO_CONTEXT, memory.thetas)
    np.testing.assert_allclose(alike.aleatoric, np.tile(alike.aleatoric[0], (3000, 1)), rtol=1e-6)
    np.testing.assert_allclose(alike.aleatoric[0], 0.3 * np.sqrt((memory.thetas[:, 0] ** 2).mean()), rtol=0.3)


N = 20_000
FOUR_ERRORS = 4 * 0.5 / np.sqrt(N)  # standard errors of a share of N, at most; failure odds 6e-5 for each


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_outcomes_drawn_from_the_predicted_gaussian_fill_each_region_to_its_level(dim):
    mean = np.zeros((N, dim))
    spread = np.broadcast_to(np.array([0.02, 0.5, 3.0])[:dim], mean.shape)
    outcomes = stream(0, "outcomes").normal(mean, spread)
    for level in (0.1, 0.5, 0.8, 0.95, 0.99):
        assert coverage(outcomes, mean, spread, level) == pytest.approx(level, abs=FOUR_ERRORS)


def test_the_gradient_equals_finite_differences_and_is_finite_at_the_goal_itself():
    double = taught(remembered(100)).double()
    theta = torch.full((3,), 0.45, dtype=torch.float64, requires_grad=True)
    context = torch.zeros(0, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda theta: double.landing(context, theta), theta)
    goal = double.landing(context, theta)[0].mean(dim=0).detach()
    squared_distance = ((double.landing(context, theta)[0].mean(dim=0) - goal) ** 2).sum()
    assert torch.isfinite(torch.autograd.grad(squared_distance, theta)[0]).all()


def test_the_seed_says_what_is_learnt_and_torchs_own_generator_and_threads_are_left_alone():
    memory, before, threads = remembered(100), torch.random.get_rng_state(), torch.get_num_threads()
    torch.set_num_threads(2)
    first, same, other = (weights(taught(memory, seed=seed)) for seed in (3, 3, 4))
    assert torch.equal(first, same)
    assert not torch.equal(first, other)
    assert torch.equal(torch.random.get_rng_state(), before)
    within, model = list[int](), taught(memory)
    model.before_learning.append(lambda *_: within.append(torch.get_num_threads()))
    model.refresh(remembered(200))
    assert (within, torch.get_num_threads()) == ([1], 2)
    torch.set_num_threads(threads)


def test_a_refresh_waits_for_enough_new_exemplars_and_a_first_effect():
    model, memory = ForwardModel(0, 3, 2, every=50, rate=1.0), remembered(49)
    assert model.refresh(memory) is None
    assert not model.trained
    memory = remembered(50)
    assert model.refresh(memory).fit.steps == 50
    before = weights(model)
    assert model.refresh(memory) is None
    assert torch.equal(weights(model), before)
    memory, model = remember(remembered(80).thetas, np.zeros((80, 2))), ForwardModel(0, 3, 2)
    assert model.refresh(memory) is None  # an object that was not touched
    memory.add(NO_CONTEXT, np.full(3, 0.5), np.ones(2))
    assert model.refresh(memory).first == 0


def test_what_is_held_out_is_looked_at_but_never_learnt_from():
    memory, rows = remembered(200), np.arange(200)
    held_out = (rows >= 100) & (rows % 10 == 9)
    other = remember(memory.thetas + 0.05 * held_out[:, None], memory.outcomes)
    models = [ForwardModel(0, 3, 2, every=100) for _ in range(2)]
    for model, second in zip(models, (memory, other), strict=True):
        model.refresh(remembered(100))  # the same hundred
        model.refresh(second)
    assert torch.equal(*map(weights, models))
    assert models[0].relative_error != models[1].relative_error


def test_adams_moments_survive_a_refresh():
    model = ForwardModel(0, 3, 2, rate=0.2)
    model.refresh(remembered(100))
    model.refresh(remembered(200))
    steps = {int(state["step"]) for state in model._online.optimizer.state.values()}
    assert steps == {40}


def test_learning_stops_when_held_out_exemplars_are_predicted_no_better():
    noise = stream(0, "noise").random((60, 5))
    assert ForwardModel(0, 3, 2, rate=100).refresh(remember(noise[:, :3], noise[:, 3:])).fit.steps < 2500


def test_a_refresh_says_what_was_predicted_for_the_new_exemplars_before_it_learnt_from_them():
    model, memory = ForwardModel(0, 3, 2), remembered(160)
    first = model.refresh(remembered(100))  # the same hundred
    assert (first.first, first.predicted) == (0, None)
    before = model.predict(NO_CONTEXT, memory.thetas[100:])
    second = model.refresh(memory)
    assert second.first == 100
    for told, expected in zip(second.predicted, before, strict=True):
        np.testing.assert_array_equal(told, expected)
    assert not np.array_equal(second.predicted.mean, model.predict(NO_CONTEXT, memory.thetas[100:]).mean)


@pytest.mark.parametrize("lr", [1e30, 1.0], ids=["a loss that is not finite", "finite weights with a large error"])
def test_after_a_divergence_the_weights_before_it_are_back(lr):
    model = taught(remembered(300), rate=1.0)
    before, error, usual = weights(model), model.relative_error, model.lr
    model.lr, model._online.optimizer = lr, None
    assert model.refresh(remembered(400)).fit.diverged
    assert torch.equal(weights(model), before)
    assert model.relative_error == pytest.approx(error, rel=0.2)  # of more exemplars held out
    model.lr, model._online.optimizer = usual, None
    assert not model.refresh(remembered(500)).fit.diverged


def interrupted(*_):
    raise KeyboardInterrupt


def test_a_refresh_that_is_interrupted_has_changed_nothing(monkeypatch):
    whole = taught(remembered(100))
    for model in (ForwardModel(0, 3, 2), whole):
        before, error = weights(model), model.relative_error
        with monkeypatch.context() as patch:
            patch.setattr(model._online, "score", interrupted)  # after the first steps
            with pytest.raises(KeyboardInterrupt):
                model.refresh(remembered(200))
        assert torch.equal(weights(model), before)
        assert model.relative_error == error
        assert model.refresh(remembered(200)).fit.steps == 200 - 100 * (model is whole)
    assert ForwardModel(0, 3, 2).relative_error == np.inf


@pytest.mark.parametrize(
    "launcher",
    [
        {"SLURM_NTASKS": "4"},
        {"LT_CLI_USED": "1", "LT_DEVICES": "2"},
        {"LT_ACCELERATOR": "cuda"},
        {"LT_STRATEGY": "ddp"},
    ],
)
def test_no_launcher_decides_how_the_model_is_trained(monkeypatch, launcher):
    for name, value in launcher.items():
        monkeypatch.setenv(name, value)
    assert torch.equal(weights(taught(remembered(100))), weights(taught(remembered(100), accelerator="cpu")))
    assert launcher.items() <= os.environ.items()


def test_a_copy_for_another_process_predicts_the_same_and_learns_on(model, unseen):
    copy = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(
        copy.predict(NO_CONTEXT, unseen.thetas).mean, model.predict(NO_CONTEXT, unseen.thetas).mean
    )
    assert copy.refresh(remembered(500)).first == 400


def untaught(**options):
    return ForwardModel(0, 3, 2, **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda model: untaught().predict(NO_CONTEXT, np.full(3, 0.5)), "not trained"),
        (lambda model: model.refresh(Memory(0, 4, 2)), "another robot's"),
        (lambda model: model.refresh(remembered(60)), "another run's"),
        (lambda model: model.predict(NO_CONTEXT, np.zeros(2)), "thetas"),
        (lambda model: untaught(members=0), "members"),
        (lambda model: untaught(accelerator="tpu"), r"auto or cpu.*, got 'tpu'; is it meant for another machine"),
        (lambda model: untaught(accelerator="cpi"), "did you mean cpu"),
        (lambda model: untaught(every=0), "every"),
        (lambda model: untaught(every=2.5), "every"),
        *((lambda model, value=value: untaught(rate=value), "rate") for value in (0.0, np.nan, np.inf)),
        *((lambda model, value=value: untaught(trust=value), "trust") for value in (0.0, np.nan, np.inf)),
    ],
)
def test_a_wrong_use_is_refused(model, call, message):
    with pytest.raises((ValueError, RuntimeError), match=message):
        call(model)


def test_it_is_trusted_up_to_the_relative_error_that_is_named(model):
    for times, trusted in ((0.99, False), (1.01, True)):
        twin = ForwardModel(0, 3, 2, trust=times * model.relative_error)
        assert not twin.trusted
        twin.load_state_dict(model.state_dict())
        assert twin.trusted == trusted


def test_other_scales_leave_what_is_predicted_as_it_is():
    model, more = taught(remembered(100)), remembered(300)
    before = model.predict(NO_CONTEXT, more.thetas)
    model._scale(0.1 + 3 * more.thetas, 7 - 2 * more.outcomes)
    after = model.predict(NO_CONTEXT, more.thetas)
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-5)


def test_the_region_is_an_ellipse_along_the_axes_not_a_box_or_circle():
    mean, spread = np.zeros((5, 2)), np.tile([0.1, 1.0], (5, 1))
    edge = np.sqrt(-2 * np.log(1 - 0.8))  # of the 80 % region, in standard deviations
    outcomes = np.array([[0.99 * edge, 0], [1.01 * edge, 0], [0, 9.9 * edge], [0, 10.1 * edge], [0.8 * edge, 8 * edge]])
    inside = [coverage(row[None], mean[:1], spread[:1], 0.8) for row in outcomes * 0.1]
    assert inside == [1, 0, 1, 0, 0]
    assert coverage(outcomes * 0.1, mean, spread, 0.8) == pytest.approx(2 / 5)
