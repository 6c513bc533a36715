"""Diagnostics of the forward model, on Gaussians that are known."""

import numpy as np
import pytest

from sgimd_torch.forward_model.shared import coverage
from sgimd_torch.spaces import stream

LEVELS = (0.1, 0.5, 0.8, 0.95, 0.99)
N = 20_000
FOUR_ERRORS = 4 * 0.5 / np.sqrt(N)  # standard errors of a share of N, at most; failure odds 6e-5 each


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_outcomes_drawn_from_the_predicted_gaussian_fill_each_region_to_its_level(dim):
    mean = np.zeros((N, dim))
    spread = np.broadcast_to(np.array([0.02, 0.5, 3.0])[:dim], mean.shape)  # the ellipse is as long as each dimension
    outcomes = stream(0, "outcomes").normal(mean, spread)
    for level in LEVELS:
        assert coverage(outcomes, mean, spread, level) == pytest.approx(level, abs=FOUR_ERRORS)


def test_the_region_is_an_ellipse_along_the_axes_not_a_box_or_circle():
    mean, spread = np.zeros((5, 2)), np.tile([0.1, 1.0], (5, 1))
    edge = np.sqrt(-2 * np.log(1 - 0.8))  # of the 80 % region, in standard deviations
    outcomes = np.array([[0.99 * edge, 0], [1.01 * edge, 0], [0, 9.9 * edge], [0, 10.1 * edge], [0.8 * edge, 8 * edge]])
    for row, inside in zip(outcomes * 0.1, [1, 0, 1, 0, 0], strict=True):
        assert coverage(row[None], mean[:1], spread[:1], 0.8) == inside
    assert coverage(outcomes * 0.1, mean, spread, 0.8) == pytest.approx(2 / 5)
