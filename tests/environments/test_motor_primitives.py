"""Eqs. (5) and (6), and sinusoids: commands worked out by hand, and theta found again from the commands it made."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.spaces import Array, Box, stream

JOINTS = Box(np.array([-1.0, 0.0]), np.array([1.0, 10.0]))
DURATIONS = (0.8, 1.6)


def primitive(*, sharpness: float = 9.0, joints: Box = JOINTS) -> GaussianPrimitive:
    return GaussianPrimitive(joints, DURATIONS, sharpness=sharpness)


def unit_joint(sharpness: float) -> GaussianPrimitive:
    return primitive(sharpness=sharpness, joints=Box.cube(0, 1, 1))


def test_the_knots_are_blended_by_the_gaussians_of_equation_5() -> None:
    # With s = 9 ln 3 a knot that is k thirds of the duration away weighs 3^-(k^2): 1, 1/3, 1/81, 1/19683.
    trajectory = unit_joint(9 * np.log(3.0)).at(np.array([0.0, 1.0, 0.0, 0.0, 0.5]), np.array([0.0, 0.4, 0.8]))
    assert trajectory.ravel() == pytest.approx([6561 / 26488, 81 / 136, 27 / 136])


def test_a_longer_movement_is_the_same_movement_played_slower() -> None:
    short, long = stream(0, "theta").random(9), stream(0, "theta").random(9)
    short[-1], long[-1] = 0.0, 1.0
    times = np.linspace(0, 0.8, 30)
    assert primitive().at(long, 2 * times) == pytest.approx(primitive().at(short, times))


def test_after_its_end_a_movement_holds_its_last_posture() -> None:
    theta = stream(0, "theta").random(9)
    duration = primitive().duration(theta)
    held = primitive().at(theta, np.array([duration, duration + 0.1, 100.0]))
    assert held == pytest.approx(np.tile(held[0], (3, 1)))


def test_a_recording_ends_with_the_movement_and_has_at_least_the_rate_asked_for() -> None:
    times, trajectory = primitive().trajectory(np.full(9, 0.123), rate=50)
    assert times[0] == 0
    assert times[-1] == pytest.approx(0.8 + 0.123 * 0.8)
    assert len(times) == len(trajectory) == 46  # 0.8984 s: 45 steps of 19.96 ms
    assert np.diff(times) == pytest.approx(times[1])


def corner_or_inside(dim: int) -> st.SearchStrategy[list[float]]:
    """Thetas with entries on the faces of the box, near them and inside."""
    entry = st.one_of(st.sampled_from([0.0, 1.0, 1e-9, 1 - 1e-9]), st.floats(0, 1))
    return st.lists(entry, min_size=dim, max_size=dim)


@given(theta=corner_or_inside(9), sharpness=st.sampled_from([5.0, 6.0, 9.0, 12.0]), rate=st.sampled_from([10.0, 50.0]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_correspondence_finds_theta_again(theta: list[float], sharpness: float, rate: float) -> None:
    skill = primitive(sharpness=sharpness)
    times, trajectory = skill.trajectory(np.array(theta), rate)
    found = skill.correspondence(times, trajectory)
    assert found == pytest.approx(np.array(theta), abs=1e-6)
    assert skill.policies.contains(found)
    assert np.abs(skill.at(found, times) - trajectory).max() < 1e-6


def test_a_recording_with_an_uneven_rate_and_a_late_start_is_the_same_demonstration() -> None:
    skill, theta = primitive(), stream(2, "theta").random(9)
    times = np.sort(stream(2, "times").uniform(0, skill.duration(theta), 40))
    times[[0, -1]] = 0.0, skill.duration(theta)
    assert skill.correspondence(times + 7.0, skill.at(theta, times)) == pytest.approx(theta, abs=1e-6)


def recorded(bend: float) -> tuple[Array, Array]:
    """Both joints from their low ends to ``bend`` times their sides, in a straight line of 1.2 s."""
    times = np.linspace(0, 1.2, 61)
    return times, JOINTS.low + np.outer(times / 1.2, bend * JOINTS.sides)


def test_a_recording_beyond_the_joint_ranges_is_fitted_inside_them() -> None:
    skill = primitive()
    times, trajectory = recorded(bend=2.0)
    theta = skill.correspondence(times, trajectory)
    assert skill.policies.contains(theta)
    assert theta[[3, 7]] == pytest.approx([1.0, 1.0], abs=1e-6)  # the last knots, twice as far in the recording


@pytest.mark.parametrize("beyond", [0.001, 0.01, 0.05])
def test_however_little_a_knot_would_lie_outside_the_others_make_up_for_its_bound(beyond: float) -> None:
    skill = unit_joint(9.0)
    times = np.linspace(0, 1.2, 40)
    one, zero = (skill.at(np.array([knot, 0.5, 0.2, 0.8, 0.5]), times) for knot in (1.0, 0.0))
    shown = one + beyond * (one - zero)  # the first knot would be 1 + beyond
    found = skill.correspondence(times, shown)
    assert found[0] == pytest.approx(1.0, abs=1e-6)

    def misfit(theta: Array) -> float:
        return float(np.sum((skill.at(theta, times) - shown) ** 2))

    # A minimum in the box: no knot inside can be moved to a better place.
    for knot in (1, 2, 3):
        for step in (-0.1 * beyond, 0.1 * beyond):
            assert misfit(found + step * np.eye(5)[knot]) > misfit(found)


@pytest.mark.parametrize(("duration", "pace"), [(0.2, 0.0), (0.8, 0.0), (1.2, 0.5), (1.6, 1.0)])
def test_a_demonstration_is_played_at_its_own_pace_or_the_fastest_allowed(duration: float, pace: float) -> None:
    skill, theta = primitive(), stream(1, "theta").random(9)
    _, trajectory = skill.trajectory(theta)
    found = skill.correspondence(np.linspace(0, duration, len(trajectory)), trajectory)
    assert found[-1] == pytest.approx(pace)
    assert found[:-1] == pytest.approx(theta[:-1], abs=1e-6)  # the shape is kept


def lasting(duration: float) -> Array:
    """theta_d of a recording."""
    return primitive().correspondence(np.linspace(0, duration, 10), np.full((10, 2), 0.5))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        *((lambda n=n: lasting(n), f"lasts 1.6 s at most, the recording {n:g} s; is") for n in (1.61, 1400.0)),
        (lambda: primitive().correspondence(np.arange(3.0), np.zeros((3, 2))), "trajectory needs 4 samples"),
        *((lambda x=x: primitive().trajectory(np.full(9, x)), "theta must") for x in (1.1, np.nan, -1e-9)),
        (lambda: primitive().trajectory(np.full(8, 0.5)), "theta must"),
        *(
            (lambda x=x: GaussianPrimitive(JOINTS, x), "durations")
            for x in ((0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (np.nan, 1.0))
        ),
        *((lambda x=x: primitive(sharpness=x), "sharpness") for x in (0.0, np.nan)),
    ],
)
def test_what_makes_no_sense_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
