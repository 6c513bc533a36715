"""Rivals: goal babbling from home, which learns one family of movements, and MAP-Elites that begins in the middle."""

from functools import partial

import numpy as np
import pytest

from rivals import home_babbling, map_elites_middle
from sgimd_torch import PlanarArm, random_exploration, run
from sgimd_torch.spaces import stream
from toys import toss

ARM = PlanarArm(7)


def lived(make, movements, seed=0):
    learner = make(ARM, seed)
    return list(run(learner, ARM, seed, movements=movements)), learner


def test_its_first_movement_is_home_and_ways_lead_from_what_came_of_it():
    (first, second, *_), _ = lived(home_babbling, 3)
    assert np.array_equal(first.move.theta, np.full(7, 0.5))
    assert np.linalg.norm(second.move.goal - first.outcome) < 0.1 * np.linalg.norm(ARM.outcomes.sides)


def test_its_movements_stay_more_alike_than_random_ones_and_it_reaches_goals_better():
    (_, home), (_, random) = lived(partial(home_babbling, sd=0.2), 1000), lived(random_exploration, 1000)
    assert home.memory.thetas.std(axis=0).mean() < 0.95 * random.memory.thetas.std(axis=0).mean()
    goals = 0.6 * np.stack([np.cos(np.arange(12)), np.sin(np.arange(12))], axis=1)

    def error(learner):
        ends = [ARM.execute(np.empty(0), learner.inverse(np.empty(0), goal).theta, stream(0, "arm")) for goal in goals]
        return np.linalg.norm(ends - goals, axis=1).mean()

    assert error(home) < 0.5 * error(random)


def test_a_seed_makes_the_same_life_and_another_seed_another():
    (one, _), (same, _), (other, _) = (lived(home_babbling, 60, seed) for seed in (3, 3, 4))
    thetas = [np.stack([episode.move.theta for episode in life]) for life in (one, same, other)]
    assert np.array_equal(thetas[0], thetas[1])
    assert not np.array_equal(thetas[0], thetas[2])


def test_contexts_are_refused():
    with pytest.raises(ValueError, match="one context only, got contexts of dim"):
        home_babbling(toss().environment, 0)


def test_map_elites_may_begin_around_the_middle_and_goes_on_from_its_elites():
    learner = map_elites_middle(ARM, 0)
    thetas = np.array([episode.move.theta for episode in run(learner, ARM, 0, movements=150)])
    assert thetas[:100].std() == pytest.approx(0.1, rel=0.1)
    assert abs(thetas[:100].mean() - 0.5) < 0.02
    away = np.abs(thetas[100:, None] - thetas[:100]).max(axis=2).min(axis=1)
    assert np.median(away) < 0.35  # of a movement from the nearest first one
