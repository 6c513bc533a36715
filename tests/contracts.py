"""What every environment promises, checked on a real one: ``check_environment(PlanarArm())``."""

import numpy as np
import pytest

from sgimd_torch.environments.protocol import Environment, execute_many
from sgimd_torch.spaces import Array, stream


def check_environment(environment: Environment, n: int = 3) -> None:
    """Everything `Environment` and `execute_many` promise; executes about 8 + 3 n movements."""
    movements = [
        (environment.observe(stream(seed, "observe")), environment.policies.sample(stream(seed, "theta")))
        for seed in range(n)
    ]
    check_spaces(environment)
    check_contexts_come_from_c_and_the_stream(environment)
    check_outcome_is_finite_and_comes_from_the_stream(environment, *movements[0])
    check_nothing_carries_over_between_movements(environment, movements)
    check_noise_is_as_announced(environment, *movements[0])
    check_a_batch_row_equals_a_single_movement(environment, movements)
    check_invalid_movements_raise(environment, *movements[0])
    check_invalid_batches_raise(environment, *movements[0])


def check_spaces(environment: Environment) -> None:
    assert environment.rest.shape == (environment.outcomes.dim,)
    assert environment.outcomes.contains(environment.rest)
    assert 0 <= environment.outcome_noise < np.inf


def check_contexts_come_from_c_and_the_stream(environment: Environment) -> None:
    context = environment.observe(stream(1, "observe"))
    assert context.shape == (environment.contexts.dim,)
    assert context.dtype == np.float64
    assert environment.contexts.contains(context)
    np.testing.assert_array_equal(context, environment.observe(stream(1, "observe")))


def check_outcome_is_finite_and_comes_from_the_stream(environment: Environment, context: Array, theta: Array) -> None:
    arguments = context.copy(), theta.copy()
    numpy_state = str(np.random.get_state())  # noqa: NPY002 - the global stream, which nobody may touch
    outcome = environment.execute(context, theta, stream(1, "execute"))
    assert outcome.shape == (environment.outcomes.dim,)
    assert outcome.dtype == np.float64
    assert np.isfinite(outcome).all()
    np.testing.assert_array_equal(outcome, environment.execute(context, theta, stream(1, "execute")))
    np.testing.assert_array_equal(context, arguments[0])
    np.testing.assert_array_equal(theta, arguments[1])
    assert str(np.random.get_state()) == numpy_state, "drew from numpy's global stream"  # noqa: NPY002


def check_nothing_carries_over_between_movements(
    environment: Environment, movements: list[tuple[Array, Array]]
) -> None:
    first = environment.execute(*movements[0], stream(1, "execute"))
    environment.execute(*movements[1], stream(2, "execute"))
    np.testing.assert_array_equal(first, environment.execute(*movements[0], stream(1, "execute")))


def check_noise_is_as_announced(environment: Environment, context: Array, theta: Array) -> None:
    one, other = (environment.execute(context, theta, stream(seed, "execute")) for seed in (1, 2))
    assert (environment.outcome_noise == 0) == np.array_equal(one, other), "outcome_noise is 0 if and only if no noise"


def check_a_batch_row_equals_a_single_movement(environment: Environment, movements: list[tuple[Array, Array]]) -> None:
    contexts, thetas = (np.stack(part) for part in zip(*movements, strict=True))
    outcomes = execute_many(environment, contexts, thetas, [stream(seed, "row") for seed in range(len(thetas))])
    assert outcomes.shape == (len(thetas), environment.outcomes.dim)
    for row, (context, theta) in enumerate(movements):
        single = environment.execute(context, theta, stream(row, "row"))
        np.testing.assert_array_equal(outcomes[row], single, err_msg="row differs from execute()")
    last = execute_many(environment, contexts[-1:], thetas[-1:], [stream(len(thetas) - 1, "row")])
    np.testing.assert_array_equal(last, outcomes[-1:], err_msg="a row depends on the others in its batch")
    assert execute_many(environment, contexts[:0], thetas[:0], []).shape == (0, environment.outcomes.dim)


def invalid(name: str, point: Array) -> list[tuple[str, Array]]:
    """(what the message must name, value): another length, a batch, and NaN, infinite or far entries at the end."""
    values = [np.append(point, 0.0), np.stack((point, point))]
    if len(point) > 0:
        values += [point[:-1], *(np.append(point[:-1], entry) for entry in (np.nan, np.inf, 1e6))]
    return [(name, value) for value in values]


def check_invalid_movements_raise(environment: Environment, context: Array, theta: Array) -> None:
    for name, value in invalid("theta", theta):
        with pytest.raises(ValueError, match=f"{name}|one movement"):
            environment.execute(context, value, stream(1, "execute"))
    for name, value in invalid("context", context):
        with pytest.raises(ValueError, match=f"{name}|one movement"):
            environment.execute(value, theta, stream(1, "execute"))


def check_invalid_batches_raise(environment: Environment, context: Array, theta: Array) -> None:
    rngs = [stream(1, "row"), stream(2, "row")]
    contexts, thetas = np.stack((context, context)), np.stack((theta, theta))
    bad = np.stack((theta, np.append(theta[:-1], np.nan)))
    for batch in (
        (contexts, bad, rngs),
        (contexts, thetas, rngs[:1]),
        (contexts[:1], thetas, rngs),
        (context, theta, []),
    ):
        with pytest.raises(ValueError, match="thetas"):
            execute_many(environment, *batch)
