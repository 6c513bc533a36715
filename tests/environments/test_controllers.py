"""Controllers: knots and sinusoids give the commands that their theta says, and a recording gives the theta back."""

import numpy as np
import pytest

from sgimd_torch.environments.controllers import Knots, Sinusoids
from sgimd_torch.spaces import Box, stream

TORQUES = Box(np.array([-1.0, 0.0]), np.array([1.0, 4.0]))
TIMES = 0.05 * np.arange(100)


def test_knots_are_met_and_joined_by_straight_lines():
    skill = Knots(TORQUES, 2.0, n_knots=3)
    theta = np.array([0.0, 1.0, 0.5, 0.25, 0.25, 0.5])  # -1, 1, 0 and 1, 1, 2
    found = skill.at(theta, np.array([0.0, 0.5, 1.0, 1.5, 2.0, 9.0]))
    np.testing.assert_allclose(found[:, 0], [-1, 0, 1, 0.5, 0, 0], atol=1e-15)
    np.testing.assert_allclose(found[:, 1], [1, 1, 1, 1.5, 2, 2], atol=1e-15)


def test_a_sinusoid_has_the_amplitude_phase_offset_and_frequency_of_its_theta():
    skill = Sinusoids(TORQUES, (0.5, 1.5), steer=0.5)
    theta = np.array([0.5, 0.25, 0.5, 0.0, 0.0, 1.0, 0.5])  # half a range from its top; still, at .5 above the middle
    found = skill.at(theta, np.array([0.0, 0.25, 0.5, 1.0]))  # 1 Hz
    np.testing.assert_allclose(found[:, 0], [0.5, 0, -0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(found[:, 1], 3.0)


@pytest.mark.parametrize("seed", range(5))
def test_what_knots_play_gives_their_theta_back(seed):
    skill = Knots(TORQUES, TIMES[-1], n_knots=4)
    theta = skill.policies.sample(stream(seed, "theta"))
    np.testing.assert_allclose(skill.correspondence(3.0 + TIMES, skill.at(theta, TIMES)), theta, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_what_a_sinusoid_plays_gives_its_theta_back(seed):
    skill = Sinusoids(TORQUES, (0.2, 2.0))
    theta = 0.25 + 0.5 * skill.policies.sample(stream(seed, "theta"))  # so that nothing is clipped
    found = skill.correspondence(TIMES, skill.at(theta, TIMES))
    np.testing.assert_allclose(found, theta, atol=1e-4)


@pytest.mark.parametrize("skill", [Knots(TORQUES, 5.0), Sinusoids(TORQUES, (0.2, 2.0))])
def test_a_recording_out_of_range_is_translated_to_the_nearest_in_pi(skill):
    theta = skill.correspondence(TIMES, 10 * np.sin(np.outer(TIMES, [1.0, 2.0])))
    assert skill.policies.contains(theta)


def test_knots_after_the_end_of_a_recording_stay_in_the_middle():
    skill = Knots(TORQUES, 4.0, n_knots=5)
    theta = skill.correspondence([0.0, 1.0], [[1.0, 4.0], [1.0, 4.0]])
    np.testing.assert_allclose(theta, [1, 1, 0.5, 0.5, 0.5] * 2, atol=1e-4)


def test_a_recording_longer_than_the_longest_movement_is_refused():
    with pytest.raises(ValueError, match="lasts 5 s at most"):
        Knots(TORQUES, 5.0).correspondence([0.0, 6.0], np.zeros((2, 2)))


def test_numbers_out_of_range_are_refused():
    for make in (
        lambda: Knots(TORQUES, 0.0),
        lambda: Knots(TORQUES, 1.0, n_knots=1),
        lambda: Sinusoids(TORQUES, (2.0, 1.0)),
        lambda: Sinusoids(TORQUES, (0.1, 1.0), steer=0.0),
    ):
        with pytest.raises(ValueError, match="needs"):
            make()
