"""Sinusoids: what they play, and what a recording of them means."""

import numpy as np
import pytest

from sgimd_torch.extras.gymnasium.controllers import Sinusoids
from sgimd_torch.spaces import Box, stream


def swinging(frequencies: tuple[float, float] = (0.2, 2.0)) -> Sinusoids:
    return Sinusoids(Box(np.array([-1.0, 0.0]), np.array([1.0, 4.0])), frequencies)


TIMES = 0.05 * np.arange(100)


def test_a_sinusoid_has_the_amplitude_phase_offset_and_frequency_of_its_theta() -> None:
    theta = np.array([0.5, 0.25, 0.5, 0.0, 0.0, 1.0, 0.5])  # half a range from its top; still, at .5 above the middle
    commands = swinging((0.5, 1.5)).at(theta, np.array([0.0, 0.25, 0.5, 1.0]))  # 1 Hz
    np.testing.assert_allclose(commands[:, 0], [0.5, 0, -0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(commands[:, 1], 3.0)


@pytest.mark.parametrize("seed", range(3))
def test_what_a_sinusoid_plays_gives_its_theta_back(seed: int) -> None:
    theta = 0.25 + 0.5 * swinging().policies.sample(stream(seed, "theta"))  # so that nothing is clipped
    np.testing.assert_allclose(swinging().correspondence(TIMES, swinging().at(theta, TIMES)), theta, atol=1e-4)


def test_a_recording_out_of_range_is_translated_to_the_nearest_sinusoid_in_pi() -> None:
    theta = swinging().correspondence(TIMES, 10 * np.sin(np.outer(TIMES, [1.0, 2.0])))
    assert swinging().policies.contains(theta)


def test_frequencies_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="frequencies"):
        swinging((2.0, 1.0))
