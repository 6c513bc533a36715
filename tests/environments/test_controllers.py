"""Sinusoids give the commands that their theta says, and a recording gives the theta back."""

import numpy as np
import pytest

from sgimd_torch.environments.controllers import Sinusoids
from sgimd_torch.spaces import Box, stream

TORQUES = Box(np.array([-1.0, 0.0]), np.array([1.0, 4.0]))
TIMES = 0.05 * np.arange(100)


def test_a_sinusoid_has_the_amplitude_phase_offset_and_frequency_of_its_theta():
    skill = Sinusoids(TORQUES, (0.5, 1.5))
    theta = np.array([0.5, 0.25, 0.5, 0.0, 0.0, 1.0, 0.5])  # half a range from its top; still, at .5 above the middle
    found = skill.at(theta, np.array([0.0, 0.25, 0.5, 1.0]))  # 1 Hz
    np.testing.assert_allclose(found[:, 0], [0.5, 0, -0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(found[:, 1], 3.0)


@pytest.mark.parametrize("seed", range(3))
def test_what_a_sinusoid_plays_gives_its_theta_back(seed):
    skill = Sinusoids(TORQUES, (0.2, 2.0))
    theta = 0.25 + 0.5 * skill.policies.sample(stream(seed, "theta"))  # so that nothing is clipped
    found = skill.correspondence(TIMES, skill.at(theta, TIMES))
    np.testing.assert_allclose(found, theta, atol=1e-4)


def test_a_recording_out_of_range_is_translated_to_the_nearest_in_pi():
    skill = Sinusoids(TORQUES, (0.2, 2.0))
    theta = skill.correspondence(TIMES, 10 * np.sin(np.outer(TIMES, [1.0, 2.0])))
    assert skill.policies.contains(theta)


def test_frequencies_in_no_order_are_refused():
    with pytest.raises(ValueError, match="frequencies"):
        Sinusoids(TORQUES, (2.0, 1.0))
