"""Whether outcomes depend on the movement before: noticed within 100 movements, and no false alarm."""

import numpy as np
import pytest

from experiments.toys import puck
from finger import Finger
from sgimd_torch.algorithms.paper import random_exploration
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.previous.carried_over import error_knowing_previous
from sgimd_torch.extras.previous.with_previous import with_previous
from sgimd_torch.session import run
from worlds import ArmThat


def shares(robot, *moments, seed=0, algorithm=practice):
    """What is known after each of these numbers of movements of one life."""
    learner = algorithm(robot, seed)
    return [
        error_knowing_previous(learner)
        for episode in run(learner, robot, seed, movements=max(moments))
        if episode.index + 1 in moments
    ]


@pytest.mark.parametrize("seed", range(3))
def test_a_finger_that_keeps_a_third_or_a_tenth_of_its_bend_is_noticed(seed):
    assert shares(Finger(), 50, seed=seed)[0] < 0.7
    assert shares(Finger(0.1), 100, seed=seed)[0] < 0.5


@pytest.mark.parametrize(
    "robot",
    [
        Finger(kept=0.0),
        with_previous(Finger()),  # what it remembers is in the context
        PlanarArm(5),
        PlanarArm(7, noise=0.2),
        PlanarArm(5, context=True, noise=0.02),
        ArmThat(lambda n, rng: rng.normal(size=2)),  # nothing but noise
        ArmThat(lambda n, rng: np.zeros(2)),
    ],
)
def test_no_other_robot_has_a_memory(robot):
    assert shares(robot, 8, 60, 100) == [None, None, None]


def test_a_gain_that_another_fit_of_the_kernel_would_make_too_is_no_memory():
    # Most random movements miss the puck: their tiny errors fall, T is 6, but the error is .97 of what it was.
    assert shares(puck().environment, 200, seed=1001, algorithm=random_exploration) == [None]
