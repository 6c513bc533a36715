"""The local Gaussian process: its laws, and answers with the least expected error."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from experiments.toys import Toy, toss, two_elbows
from sgimd_torch.inverses.gaussian_process import choose_kernel, fit_lengths, one_thread
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.inverses.tuples import GaussianProcess, Kernel, Movements
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, stream
from worlds import NO_CONTEXT, problem, remember

kernels = compiled("sgimd_torch.inverses.kernels")  # an import would leave machine code of its own beside the module

SMOOTH = Kernel(scale=1.0, finer=1.0, share=0.0, noise=1e-6)
ROUGH = Kernel(scale=0.5, finer=4.0, share=0.3, noise=0.1)


def covariances(kernel: Kernel, distances: Array) -> Array:
    """Smooth plus rough part of a kernel, both rational quadratic with alpha = 3."""
    parts = [(1 + (kernel.scale * finer * distances) ** 2 / 6) ** -3.0 for finer in (1.0, kernel.finer)]
    found: Array = (1 - kernel.share) * parts[0] + kernel.share * parts[1]
    return found


def remembering(thetas: Array, outcomes: Array, contexts: Array | None = None, **options) -> Problem:
    return problem(memory=remember(thetas, outcomes, contexts), **options)


def played(toy: Toy, n: int, seed: int = 0, **options) -> Problem:
    """Uniform movements, each in a context of its own, without noise."""
    rng = stream(seed, "test process")
    thetas = rng.uniform(size=(n, toy.policies.dim))
    contexts = np.array([toy.observe(rng) for _ in range(n)]).reshape(n, toy.contexts.dim)
    return remembering(thetas, toy.effect(contexts, thetas), contexts, **options)


def waves(n: int = 30) -> tuple[Array, Array]:
    inputs = stream(0, "waves").uniform(0, 3, (n, 2))
    return inputs, np.stack([np.sin(inputs.sum(axis=1)), np.cos(inputs[:, 0])], axis=1)


def fitted(inputs: Array, outcomes: Array, kernel: Kernel) -> GaussianProcess:
    process, _ = kernels.fitted_process(np.arange(len(inputs)), inputs, outcomes, kernel)
    return process


def predicted(inputs: Array, outcomes: Array, kernel: Kernel, point: Array) -> tuple[Array, float]:
    near = np.arange(len(inputs))[None]
    (outcome,), (variance,), *_ = kernels.predictions(inputs, outcomes, near, point[None], kernel)
    return outcome, variance


def test_without_noise_it_knows_what_it_was_given_and_far_away_only_the_mean() -> None:
    inputs, outcomes = waves()
    variance = fitted(inputs, outcomes, SMOOTH).variance
    for point, outcome in zip(inputs, outcomes, strict=True):
        expected, doubt = predicted(inputs, outcomes, SMOOTH, point)
        assert expected == pytest.approx(outcome, abs=1e-3)
        assert doubt == pytest.approx(0, abs=1e-4 * variance)
    expected, doubt = predicted(inputs, outcomes, SMOOTH, np.full(2, 1e3))
    assert expected == pytest.approx(outcomes.mean(axis=0))
    assert doubt == pytest.approx(variance)


@pytest.mark.parametrize("kernel", [SMOOTH, ROUGH])
def test_the_compiled_kernel_is_a_sum_of_two_and_its_slope_the_derivative(kernel: Kernel) -> None:
    inputs, step = waves()[0], 1e-3
    point, covariance, slope = np.array([1.3, 0.9]), np.empty(30), np.empty(30)

    def at(place: Array) -> Array:
        kernels.covariances(np.ascontiguousarray(inputs.T), kernel, place, covariance, slope)
        return covariance.copy()

    assert at(point) == pytest.approx(covariances(kernel, np.linalg.norm(inputs - point, axis=1)))
    by_input = slope[:, None] * (point - inputs)
    for k, along in enumerate(step * np.eye(2)):
        once, twice = at(point + along) - at(point - along), at(point + 2 * along) - at(point - 2 * along)
        assert by_input[:, k] == pytest.approx((8 * once - twice) / (12 * step), abs=1e-8)


@pytest.mark.parametrize("kernel", [SMOOTH, ROUGH])
def test_steps_reach_the_goal_where_the_process_can_reach_it(kernel: Kernel) -> None:
    inputs, outcomes = waves()
    process, point, goal = fitted(inputs, outcomes, kernel), np.array([1.3, 0.9]), np.array([0.5, -0.4])
    units, box = np.stack((np.zeros(2), np.ones(2))), np.stack((np.zeros(2), np.full(2, 3.0)))
    known = Movements(inputs, inputs, outcomes, units, np.ones(2), box)
    _, theta = kernels.descend(process, point, NO_CONTEXT, goal, known, 1e-9)
    missed, reached = (np.linalg.norm(predicted(inputs, outcomes, kernel, at)[0] - goal) for at in (point, theta))
    assert reached < 0.1 * missed


def test_an_outcome_without_its_noise_is_what_the_process_predicts_there() -> None:
    inputs, outcomes = waves()
    process = fitted(inputs, outcomes, ROUGH)
    precision = kernels.precisions(process.factor)[-5:]
    for row in range(25, 30):
        expected, doubt = predicted(inputs, outcomes, ROUGH, inputs[row])
        assert outcomes[row] - ROUGH.noise * process.weights[:, row] == pytest.approx(expected)
        assert process.variance * ROUGH.noise * (1 - ROUGH.noise * precision[row - 25]) == pytest.approx(doubt)


def test_weights_and_precisions_give_the_error_of_predicting_each_from_all_others() -> None:
    inputs, outcomes = waves()
    outcomes -= outcomes.mean(axis=0)
    process = fitted(inputs, outcomes, ROUGH)
    precision = kernels.precisions(process.factor)[-5:]
    for row in range(25, 30):
        others = np.delete(np.arange(30), row)
        covariance = covariances(ROUGH, np.linalg.norm(inputs[:, None] - inputs, axis=2)) + ROUGH.noise * np.eye(30)
        gains = np.linalg.solve(covariance[np.ix_(others, others)], covariance[others, row])
        assert process.weights[:, row] / precision[row - 25] == pytest.approx(outcomes[row] - gains @ outcomes[others])
        assert 1 / precision[row - 25] == pytest.approx(covariance[row, row] - gains @ covariance[others, row])


def test_the_length_of_an_input_that_matters_is_the_shortest() -> None:
    inputs = stream(0, "inputs").normal(size=(80, 4))
    lengths = fit_lengths(inputs, np.sin(2 * inputs[:, 2:3]))
    assert lengths.argmin() == 2
    assert (np.delete(lengths, 2) > 3 * lengths[2]).all()


@pytest.mark.parametrize("noise", [0.01, 0.3])
def test_the_kernel_takes_about_as_much_for_noise_as_is_stated(noise: float) -> None:
    rng = stream(0, "noisy")
    inputs = rng.uniform(0, 3, (60, 2))
    outcomes = np.sin(inputs.sum(axis=1, keepdims=True)) + rng.normal(0, noise, (60, 1))
    kernel = choose_kernel([(inputs, outcomes)], noise)
    assert noise / 3 < np.sqrt(kernel.noise * fitted(inputs, outcomes, kernel).variance) < 3 * noise
    assert choose_kernel([(inputs, outcomes)], 0.0).noise == 1e-6


def mean_error(toy: Toy, inverse: Inverse, goals: Array, contexts: Array) -> float:
    thetas = np.stack([estimate.theta for estimate in inverse.answer_many(contexts, goals)])
    return float(np.linalg.norm(toy.effect(contexts, thetas) - goals, axis=1).mean())


def test_where_several_families_of_movements_lead_to_a_place_it_beats_the_nearest_and_the_linear() -> None:
    toy = two_elbows().environment
    given, goals = played(toy, 300), played(toy, 40, seed=1).memory.outcomes
    process, nearest, linear = (
        mean_error(toy, make(given), goals, np.zeros((40, 0)))
        for make in (LocalProcess, NearestNeighbour, LocallyLinear)
    )
    assert process < 0.6 * min(nearest, linear)


def test_an_answer_beside_a_fold_does_not_land_on_its_other_side() -> None:
    task, toy = two_elbows(), two_elbows().environment
    inverse, goals = LocalProcess(played(toy, 600, seed=1, noise=0.01)), task.benchmark().goals
    missed = [toy.effect(NO_CONTEXT, inverse(NO_CONTEXT, goal).theta) - goal for goal in goals]
    assert np.linalg.norm(missed, axis=1).max() < 0.2


def test_in_a_context_that_never_came_it_beats_the_nearest() -> None:
    toy = toss().environment
    given, asked = played(toy, 200), played(toy, 40, seed=1).memory
    process, nearest = (
        mean_error(toy, make(given), asked.outcomes, asked.contexts) for make in (LocalProcess, NearestNeighbour)
    )
    assert process < 0.4 * nearest


def test_where_nothing_can_be_predicted_the_nearest_exemplar_answers() -> None:
    rng = stream(0, "chaos")
    given = remembering(rng.uniform(size=(200, 3)), rng.normal(size=(200, 2)))
    inverse, nearest = LocalProcess(given), NearestNeighbour(given)
    same = [
        np.array_equal(inverse(NO_CONTEXT, g).theta, nearest(NO_CONTEXT, g).theta) for g in rng.normal(size=(30, 2))
    ]
    assert np.mean(same) > 0.8


def test_stated_noise_is_averaged_out() -> None:
    rng = stream(0, "noisy line")
    thetas = rng.uniform(size=(300, 1))
    given = remembering(thetas, thetas + rng.normal(0, 0.2, thetas.shape), noise=0.2)
    goals = np.linspace(0.2, 0.8, 30)
    nearest, process = (
        np.mean([abs(make(given)(NO_CONTEXT, np.array([goal])).theta[0] - goal) for goal in goals])
        for make in (NearestNeighbour, LocalProcess)
    )
    assert process < 0.4 * nearest


def test_an_answer_says_what_it_expects_and_how_far_off_that_is() -> None:
    toy, rng = two_elbows().environment, stream(0, "told")
    given = played(toy, 200, noise=0.05)
    given = remembering(given.memory.thetas, rng.normal(given.memory.outcomes, 0.05), noise=0.05)
    inverse, goals = LocalProcess(given), played(toy, 100, seed=1).memory.outcomes
    answers = [inverse(NO_CONTEXT, goal) for goal in goals]
    found = rng.normal(toy.effect(np.zeros((100, 0)), np.stack([each.theta for each in answers])), 0.05)
    scaled = [(outcome - each.expected) / each.sd for outcome, each in zip(found, answers, strict=True)]
    assert np.square(scaled).mean() == pytest.approx(1, abs=0.3)  # four sd of the mean of 200 squares
    assert min(each.sd for each in answers if each.sd is not None) > 0.04


def test_units_do_not_matter() -> None:
    toy = two_elbows().environment
    given, goals = played(toy, 120, noise=0.01), played(toy, 5, seed=1).memory.outcomes
    other = LocalProcess(remembering(given.memory.thetas * 7 + 3, given.memory.outcomes * 1000, noise=10.0))
    inverse = LocalProcess(given)
    for goal in goals:
        theta = inverse(NO_CONTEXT, goal).theta
        assert other(NO_CONTEXT, 1000 * goal).theta == pytest.approx(7 * theta + 3, abs=1e-3)


def in_wind(contexts: Array) -> float:
    """The median error of a robot that does not feel the wind that it remembers."""
    toy = two_elbows().environment
    memory, goals = played(toy, 200).memory, played(toy, 60, seed=1).memory.outcomes
    inverse = LocalProcess(remembering(memory.thetas, memory.outcomes, contexts[:200]))
    thetas = np.stack([estimate.theta for estimate in inverse.answer_many(contexts[200:], goals)])
    return float(np.median(np.linalg.norm(toy.effect(np.zeros((60, 0)), thetas) - goals, axis=1)))


@pytest.mark.parametrize("value", [0.3, 0.5, 101325.0, 1e9])
def test_it_does_not_matter_how_far_from_0_an_input_is(value: float) -> None:
    wind = stream(0, "wind").uniform(-1, 1, size=(260, 1))
    assert in_wind(value * (1 + 1e-9 * wind)) == pytest.approx(in_wind(1e-9 * value * wind), rel=0.1)
    assert in_wind(np.full((260, 1), value)) == pytest.approx(in_wind(np.zeros((260, 0))), rel=0.1)


@pytest.mark.parametrize("rows", [[7], [7, 20, 41]])
def test_a_gross_error_is_explained_by_noise_and_predictions_hardly_change(rows: list[int]) -> None:
    (inputs, outcomes), kernel = waves(60), Kernel(1.0, 1.0, 0.0, 1e-4)
    wrong = outcomes.copy()
    wrong[rows] += [2.0, -3.0]
    process, precision = kernels.fitted_process(np.arange(60), inputs, wrong, kernel)
    assert np.flatnonzero(process.noises > kernel.noise).tolist() == rows
    covariance = covariances(kernel, np.linalg.norm(inputs[:, None] - inputs, axis=2)) + np.diag(process.noises)
    deviations, inverse = (wrong - wrong.mean(axis=0)).T, np.linalg.inv(covariance)
    assert process.factor @ process.factor.T == pytest.approx(covariance)
    assert process.weights == pytest.approx(deviations @ inverse)
    assert process.variance == pytest.approx((deviations @ inverse * deviations).mean())
    assert precision == pytest.approx(np.diag(inverse))
    for row in rows:
        assert predicted(inputs, wrong, kernel, inputs[row])[0] == pytest.approx(outcomes[row], abs=0.2)


def test_gross_errors_do_not_decide_lengths_and_kernel() -> None:
    inputs, outcomes = waves(200)
    points = stream(0, "points").uniform(0, 3, (50, 2))
    expected = np.stack([np.sin(points.sum(axis=1)), np.cos(points[:, 0])], axis=1)
    wrong = outcomes.copy()
    wrong[::20] = stream(0, "gross errors").uniform(-1, 1, (10, 2))
    inverse = LocalProcess(remembering(inputs, wrong))
    errors = [np.linalg.norm(inverse.predict(NO_CONTEXT, point) - y) for point, y in zip(points, expected, strict=True)]
    assert np.mean(errors) < 0.01
    assert inverse.fitted().kernel.share == 0  # no rough part


@pytest.mark.parametrize("far", [25.0, 50.0])
def test_a_wide_movement_after_many_nearly_alike_is_answered(far: float) -> None:
    rng = np.random.default_rng(0)
    thetas = np.concatenate((1e-4 * rng.uniform(size=(120, 3)), rng.uniform(size=(4, 3))))
    outcomes = np.stack([np.sin(3 * thetas.sum(axis=1)), np.cos(2 * thetas[:, 0])], axis=1)
    thetas += far
    inverse = LocalProcess(remembering(thetas, outcomes))
    expected = inverse.predict(NO_CONTEXT, thetas[-1])
    assert expected == pytest.approx(outcomes[-1], abs=0.01)
    assert inverse(NO_CONTEXT, outcomes[-1]).theta == pytest.approx(thetas[-1])


def test_an_answer_depends_on_the_memory_and_not_on_when_it_was_asked() -> None:
    whole = played(two_elbows().environment, 200)
    thetas, outcomes, goal = whole.memory.thetas, whole.memory.outcomes, np.array([0.3, 0.2])
    inverse = LocalProcess(remembering(thetas[:50], outcomes[:50]))
    inverse(NO_CONTEXT, goal)
    for row in range(50, 200):
        inverse.memory.add(NO_CONTEXT, thetas[row], outcomes[row])
        if row % 40 == 0:
            inverse(NO_CONTEXT, goal)
    assert np.array_equal(inverse(NO_CONTEXT, goal).theta, LocalProcess(whole)(NO_CONTEXT, goal).theta)


def test_outcomes_that_are_all_the_same_teach_it_nothing() -> None:
    thetas = stream(0, "still").uniform(size=(40, 2))
    inverse = LocalProcess(remembering(thetas, np.ones((40, 2))))
    assert inverse(NO_CONTEXT, np.zeros(2)).theta.tolist() == thetas[0].tolist()
    predicted = inverse.predict(NO_CONTEXT, thetas[0])
    assert predicted is not None
    assert predicted.tolist() == [1, 1]


def test_its_linear_algebra_takes_one_thread_and_leaves_the_others_as_they_were():
    @one_thread
    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    before = threadpool_info()
    assert threads() == {1}
    assert threadpool_info() == before


@pytest.mark.parametrize("code", [60.0, -1e6])
def test_outcomes_far_outside_t_count_in_no_answer_and_in_no_prediction(code: float) -> None:
    inputs, outcomes = waves(200)
    wrong = outcomes.copy()
    wrong[5::10] = code
    right = np.arange(200) % 10 != 5
    inverse, clean = (LocalProcess(remembering(inputs[rows], wrong[rows])) for rows in (slice(None), right))
    points = stream(0, "points").uniform(0.5, 2.5, (20, 2))
    expected = np.stack([np.sin(points.sum(axis=1)), np.cos(points[:, 0])], axis=1)
    for process in (inverse, clean):
        missed = [process.predict(NO_CONTEXT, point) - outcome for point, outcome in zip(points, expected, strict=True)]
        assert np.linalg.norm(missed, axis=1).max() < 0.03
    assert len(inverse.memory) == 180
    assert len(inverse.problem.memory) == 200
    assert inverse(NO_CONTEXT, expected[0]).expected == pytest.approx(expected[0], abs=0.01)
