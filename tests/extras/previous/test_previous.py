"""A robot with memory learns if the movement before is its context; without, it learns nothing."""

import numpy as np
import pytest

from finger import Finger
from sgimd_torch.algorithms.paper import random_exploration
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.evaluation import evaluate, tile_goals, tile_side
from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.extras.previous.with_previous import with_previous
from sgimd_torch.session import run
from sgimd_torch.spaces import stream

MIDDLE = [0.5, 0.5, 0.5]


class Logged(Finger):
    """It keeps its thetas, and fails at thetas of which the first number is .9."""

    def __init__(self):
        super().__init__()
        self.made = []

    def execute(self, context, theta, rng):
        self.made.append(theta.tolist())
        if theta[0] == 0.9:
            raise SimulationError("it slipped")
        return super().execute(context, theta, rng)


def test_the_context_is_the_last_movement_and_another_one_is_made_first():
    logged = Logged()
    robot, rng = with_previous(logged), stream(0, "any")
    assert robot.contexts.names == ("previous theta 0", "previous theta 1", "previous theta 2")
    assert robot.observe(rng).tolist() == MIDDLE  # nobody knows what was before
    one, two = [0.1, 0.2, 0.3], [0.4, 0.5, 0.6]
    robot.execute(MIDDLE, one, rng)
    assert robot.observe(rng).tolist() == one
    robot.execute(one, two, rng)
    assert logged.made == [MIDDLE, one, two]
    robot.execute(one, two, rng)  # as in an attempt of several movements, which keeps its context
    assert logged.made[3:] == [one, two]
    with pytest.raises(SimulationError):
        robot.execute(two, [0.9, 0, 0], rng)
    assert robot.observe(rng).tolist() == MIDDLE


def test_the_movement_that_comes_first_takes_no_noise_from_the_one_that_counts():
    robot, theta = with_previous(Finger(kept=0.0)), [0.1, 0.2, 0.3]
    first = robot.execute(MIDDLE, theta, stream(0, "noise"))
    assert np.array_equal(first, Finger(kept=0.0).execute([], theta, stream(0, "noise")))


def error_over_random_movements(seed, make):
    rng, finger = stream(seed, "goals"), Finger()
    reached = np.array([finger.execute([], finger.policies.sample(rng), rng) for _ in range(2000)])
    goals = tile_goals(reached, finger.outcomes, tile_side(reached, finger.outcomes, 100), rng)
    errors = []
    for algorithm, robot in ((practice, make()), (random_exploration, Finger())):
        learner = algorithm(robot, seed)
        for _ in run(learner, robot, seed, movements=150):
            pass
        errors.append(evaluate(learner.inverse, robot, goals, seed, 150, repeats=0).mean_error)
    return errors[0] / errors[1]


def test_knowing_the_movement_before_practice_errs_less_than_half_as_much_as_random_movements():
    assert max(error_over_random_movements(seed, lambda: with_previous(Finger())) for seed in (1000, 1001)) < 0.5
    assert error_over_random_movements(1000, Finger) > 0.9


def test_check_names_the_memory_and_accepts_the_context_where_nothing_older_counts_for_much():
    with pytest.raises(ValueError, match=r"on the movement before: give it as context \(--context previous\)"):
        check_environment(Finger())
    *_, remark = check_environment(with_previous(Finger(kept=0.03)))
    assert "on older movements than the one before, too" in remark
    with pytest.raises(ValueError, match=r"outcome_noise is 0\.5, but outcomes of a movement scatter by 1\d"):
        check_environment(with_previous(Finger()))  # the second time in another order, so that it shows
