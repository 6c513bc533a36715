"""Rivals with tuned settings."""

import numpy as np
import pytest

import parts
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.session import run


def test_map_elites_may_begin_around_the_middle_and_goes_on_from_its_elites():
    arm = PlanarArm()
    learner = parts.map_elites_middle(arm, 0)
    thetas = np.array([episode.move.theta for episode in run(learner, arm, 0, movements=150)])
    assert thetas[:100].std() == pytest.approx(0.1, rel=0.1)
    assert abs(thetas[:100].mean() - 0.5) < 0.02
    away = np.abs(thetas[100:, None] - thetas[:100]).max(axis=2).min(axis=1)
    assert np.median(away) < 0.35  # of a movement from the nearest first one
