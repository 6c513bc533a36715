"""The environment protocol, and the planar arm whose reachable set and inverse are known exactly."""

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import (
    BatchEnvironment,
    Environment,
    SimulationError,
    check_movement,
    check_recording,
    execute_many,
    moves_in_batches,
)
from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.evaluation import evaluate
from sgimd_torch.spaces import Array, Box, Failure, stream
from worlds import problem, remember

NO_CONTEXT = np.empty(0)


def end_of(arm: PlanarArm, theta: ArrayLike, context: ArrayLike = NO_CONTEXT) -> Array:
    return arm.execute(context, theta, stream(0, "environment"))


class Slope:
    """The least that a user writes: one parameter, and an outcome of twice its value."""

    contexts, policies, outcomes = Box.cube(0, 1, 0), Box.cube(0, 1, 1), Box.cube(0, 2, 1)
    rest, outcome_noise = np.zeros(1), 0.0

    def observe(self, rng: np.random.Generator) -> Array:
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        context, theta = check_movement(self, context, theta)
        return 2 * theta


def slope(base: type = Slope, **methods: object) -> Any:
    """A slope, or another ``base``, of which the user writes some methods anew."""
    return type("Other", (base,), methods)()


def together(steepness: float, seen: Callable[[Array], ArrayLike] = np.array) -> Callable[..., ArrayLike]:
    return lambda self, contexts, thetas, rngs: seen(steepness * thetas)


def steeper(self: object, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
    """As a user who knows `Environment` alone begins: another robot, from one that moves in batches."""
    return 3 * np.asarray(theta)


FAST = slope(execute_many=together(2))
THETAS, RNGS = np.array([[0.25], [0.75]]), [stream(seed, "row") for seed in range(2)]


def executed(environment: Environment) -> list[Array | Failure]:
    """The outcomes of two movements."""
    return execute_many(environment, np.empty((2, 0)), THETAS, RNGS)


def test_a_batch_is_executed_at_once_where_the_environment_can():
    batches: list[int] = []

    def counted(outcomes: Array) -> Array:
        batches.append(len(outcomes))
        return outcomes

    environment = slope(execute_many=together(2, counted))
    assert isinstance(environment, BatchEnvironment)
    assert not isinstance(Slope(), BatchEnvironment)
    assert executed(environment) == [[0.5], [1.5]]
    assert execute_many(environment, np.empty((0, 0)), np.empty((0, 1)), []) == []
    assert batches == [2]


class Delegating:
    """A wrapper that passes on all but ``execute``."""

    execute = steeper

    def __getattr__(self, name: str) -> object:
        return getattr(FAST, name)


def patched() -> Slope:
    fast = slope(type(FAST))
    fast.execute = partial(steeper, fast)
    return fast


SUBCLASS, WHOLE = slope(type(FAST), execute=steeper), slope(type(FAST), execute=steeper, execute_many=together(3))


@pytest.mark.parametrize("environment", [SUBCLASS, WHOLE, Delegating(), patched()])
def test_what_a_parent_does_with_a_batch_does_not_count_for_an_execute_of_ones_own(environment):
    outcomes = 3 * THETAS
    assert executed(environment) == outcomes.tolist()
    inverse = problem(environment, memory=remember(THETAS, outcomes)).inverse
    assert evaluate(inverse, environment, outcomes, 0, 0).errors.tolist() == [0, 0]
    assert moves_in_batches(environment) == (environment is WHOLE)


def test_what_a_mask_hides_is_no_outcome():
    hiding = slope(execute_many=together(2, lambda outcomes: np.ma.masked_array(outcomes, outcomes > 1.4)))
    assert all("got a masked array" in outcome.reason for outcome in executed(hiding))


def test_an_outcome_in_a_batch_that_is_not_finite_is_a_failure_of_its_movement_alone():
    first, second = executed(slope(execute=lambda self, context, theta, rng: np.where(theta > 0.7, np.nan, theta)))
    assert first == [0.25]
    assert "outcome must be finite" in second.reason


def test_an_environment_that_writes_into_a_batch_leaves_the_callers_arrays_as_they_were():
    careless = slope(execute=lambda self, context, theta, rng: np.multiply(theta, 2, out=theta))
    before = THETAS.copy()
    assert executed(careless) == [[0.5], [1.5]]
    assert np.array_equal(THETAS, before)


def test_a_diverged_simulation_names_its_theta_even_from_another_process():
    error = pickle.loads(pickle.dumps(SimulationError("NaN in qpos", np.array([0.25, 0.5]))))
    assert str(error) == "NaN in qpos; theta=[0.25, 0.5]"
    assert error.theta.tolist() == [0.25, 0.5]


def test_rest_is_the_end_of_the_straight_arm():
    arm = PlanarArm(5)
    np.testing.assert_allclose(end_of(arm, np.full(5, 0.5)), [1.0, 0.0], atol=1e-15)
    assert arm.rest.tolist() == [1.0, 0.0]


def test_two_links_up_and_then_right_end_at_half_a_metre_each():
    arm = PlanarArm(2)
    np.testing.assert_allclose(end_of(arm, [0.75, 0.25]), [0.5, 0.5], atol=1e-15)  # pi/2, then -pi/2


@given(n_joints=st.integers(2, 50), seed=st.integers(0, 1000))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_correspondence_finds_the_theta_whose_angles_a_trajectory_ends_with(n_joints, seed):
    arm, rng = PlanarArm(n_joints), stream(seed, "postures")
    theta = arm.policies.sample(rng)
    somewhere = rng.uniform(-9, 9, size=(3, n_joints))  # on the way the joints may be anywhere
    found = arm.correspondence([0.0, 0.2, 0.9, 1.0], [*somewhere, arm.angles(theta)])
    np.testing.assert_allclose(found, theta, atol=1e-15)
    assert arm.policies.contains(found)


def test_a_posture_at_its_limits_is_accepted_also_with_rounding():
    assert PlanarArm(4).correspondence([0.0], [[np.pi * (1 + 1e-15), -np.pi / 2 - 1e-15, 0, 0]])[:2].tolist() == [1, 0]


def test_a_context_turns_the_whole_arm():
    arm = PlanarArm(context=True)
    theta, turn = stream(1, "theta").uniform(size=7), np.pi / 6
    x, y = end_of(arm, theta, [0.0])
    turned = [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y]
    np.testing.assert_allclose(end_of(arm, theta, [turn]), turned, atol=1e-15)


@given(
    n_joints=st.integers(2, 12),
    radius=st.floats(0, 1),
    direction=st.floats(-np.pi, np.pi),
    turn=st.floats(-np.pi / 4, np.pi / 4),
)
@settings(max_examples=50, deadline=None, derandomize=True)
def test_solve_reaches_every_goal_of_the_disc_in_every_context(n_joints, radius, direction, turn):
    arm = PlanarArm(n_joints, context=True)
    goal = radius * np.array([np.cos(direction), np.sin(direction)])
    assert arm.reachable(goal)
    theta = arm.solve([turn], goal)
    assert arm.policies.contains(theta)
    np.testing.assert_allclose(end_of(arm, theta, [turn]), goal, atol=1e-12)


def test_the_arm_reaches_its_whole_disc_and_nothing_beyond():
    arm = PlanarArm(5)
    points = [[0.0, 0.0], [0.0, -1.0], [0.7, 0.7], [0.71, 0.71], [1.01, 0.0]]  # radii 0, 1, .99, 1.004, 1.01
    assert arm.reachable(points).tolist() == [True, True, True, False, False]
    straight = [end_of(arm, [turn, *[0.5] * 4]) for turn in np.linspace(0, 1, 50)]
    assert arm.reachable(straight).all()  # some are 4e-16 beyond the length


def test_outcome_noise_is_that_of_movements_executed_again():
    arm, rng = PlanarArm(5, noise=0.01), stream(3, "environment")
    thetas = stream(3, "theta").uniform(size=(4000, 5))
    difference = [arm.execute(NO_CONTEXT, theta, rng) - arm.execute(NO_CONTEXT, theta, rng) for theta in thetas]
    measured = np.sqrt(np.mean(np.square(difference)) / 2)  # a difference has twice the variance
    # 8000 squares, their spread about 2 relative: one standard error is 1.1 %, so 5 % is more than four of them.
    assert measured == pytest.approx(arm.outcome_noise, rel=0.05)


def recorded(times: Array, trajectory: Array) -> tuple[Array, Array]:
    return check_recording(times, trajectory, 2, longest=9.0)


CHAIN, TAU = np.zeros((5, 3, 2)), np.zeros(2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: recorded(np.arange(10.0), np.zeros((10, 3))), "trajectory"),
        (lambda: recorded(np.arange(2.0), np.zeros(2)), "trajectory"),
        (lambda: recorded(np.arange(10.0), np.full((10, 2), np.nan)), "trajectory"),
        (lambda: recorded(np.arange(9.0), np.zeros((10, 2))), "times"),
        (lambda: recorded(np.zeros(10), np.zeros((10, 2))), "times must increase"),
        (lambda: recorded(1000 * np.arange(10.0), np.zeros((10, 2))), "lasts 9 s at most, the recording 9000 s"),
        (lambda: PlanarArm(1), "n_joints must"),
        (lambda: PlanarArm(noise=-0.1), "noise must"),
        (lambda: PlanarArm(outcomes=Box.cube(-1, 1, 3)), "T has 2 dimensions"),
        (lambda: PlanarArm(outcomes=Box.cube(2, 3, 2)), "rest, where the straight arm ends, must"),
        (lambda: PlanarArm(3).solve(NO_CONTEXT, [1.01, 0.0]), "goal must"),
        (lambda: PlanarArm(3).solve(NO_CONTEXT, [0.1, 0.0, 0.0]), "goal must"),
        (lambda: PlanarArm(4).correspondence([0.0, 1.0], [[0] * 4, [0, 1.6, 0, 0]]), "in the last posture entry"),
        (lambda: PlanarArm(4).correspondence([0.0, 1.0], [[0] * 4, [-3.2, 0, 0, 0]]), "in the last posture entry"),
        (lambda: Sketch(TAU, 0.1, [CHAIN[0]]), r"each chain of a Sketch must be finite .* got shape \(3, 2\)"),
        (lambda: Sketch(TAU, 0.1, CHAIN), r"\(n_steps, n_points, 2\), got shape \(3, 2\)"),  # not a list of chains
        (lambda: Sketch(TAU, 0.1, [np.zeros((5, 3, 3))]), r"or more, got shapes \[\(5, 3, 3\)\]"),
        (lambda: Sketch(TAU, 0.1, [CHAIN, CHAIN[:4]]), r"or more, got shapes \[\(5, 3, 2\), \(4, 3, 2\)\]"),
        (lambda: Sketch(TAU, 0.1, []), r"must be one array \(n_steps, n_points, 2\) or more, got shapes \[\]"),
        (lambda: Sketch(TAU, 0.1, [np.full((5, 3, 2), np.nan)]), "each chain of a Sketch must be finite"),
        (lambda: Sketch(TAU[None], 0.1, [CHAIN]), r"outcome of a Sketch must be finite numbers \(outcome_dim,\)"),
        (lambda: Sketch(TAU, 0.0, [CHAIN]), "step of a Sketch must be above 0 s, got 0.0"),
    ],
)
def test_what_makes_no_sense_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
