"""The toy robots: each keeps the contract, and is hard in the way that it says."""

import numpy as np
import pytest

from sgimd_torch.environments.check import check_environment
from sgimd_torch.environments.objects import fetch, puck
from sgimd_torch.environments.toys import GRAVITY, Toy, crawler, spatial_arm, toss, two_elbows
from sgimd_torch.options.build import task_of
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.options.config import Config
from sgimd_torch.runs.tasks import benchmark_of
from sgimd_torch.spaces import stream

TOYS = [toss, crawler, two_elbows, spatial_arm, puck, fetch]
NO_CONTEXT, NO_WIND = np.zeros(0), np.zeros(1)


@pytest.mark.parametrize("make", TOYS)
def test_toy_keeps_the_contract(make):
    check_environment(make())
    check_environment(make(noise=0.0))


@pytest.mark.parametrize("make", TOYS)
def test_all_that_it_reaches_lies_in_its_task_space_and_scatters_as_stated(make):
    toy, rng = make(), stream(0, "toy")
    thetas = rng.uniform(size=(2000, toy.policies.dim))
    contexts = np.array([toy.observe(rng) for _ in thetas])
    assert toy.outcomes.contains(toy.effect(contexts, thetas)).all()
    landed = np.array([toy.execute(contexts[0], thetas[0], rng) for _ in range(400)])
    assert landed.std(axis=0) == pytest.approx(toy.outcome_noise, rel=0.15)  # 4 standard errors of 400


def test_without_wind_a_high_throw_and_a_flat_one_land_in_one_place():
    ball = toss()
    flat, high = np.array([0.5, 0.2, 0.9, 0.0]), np.linspace(0.5, 1, 2001)
    wanted = ball.effect(NO_WIND, flat)
    found = ball.effect(np.zeros((2001, 1)), np.column_stack([np.full(2001, 0.5), high, np.full((2001, 2), [0.9, 0])]))
    best = np.abs(found[:, 1] - wanted[1]).argmin()
    assert found[best] == pytest.approx(wanted, abs=0.01)
    blown = [ball.effect(np.ones(1), theta)[0] for theta in (flat, np.array([0.5, high[best], 0.9, 0.0]))]
    assert blown[1] > 2 * blown[0] > 0


def test_a_level_throw_falls_for_as_long_as_gravity_says():
    ball = toss()
    lowest = np.array([0.5, 0.0, 0.0, 0.0])  # 10 degrees, 1 m/s, from .5 m
    up, ahead = np.sin(np.pi / 18), np.cos(np.pi / 18)
    duration = (up + np.sqrt(up**2 + 2 * GRAVITY * 0.5)) / GRAVITY
    assert ball.effect(np.ones(1), lowest) == pytest.approx([duration**2 / 2, ahead * duration])


def test_phases_of_the_crawler_are_periodic_and_without_swing_it_stays():
    legs = crawler()
    theta = np.array([0.0, 0.3, 0.6, 0.2, 0.7])
    around = theta + np.array([1, 0, 0, 0, 0])
    assert legs.effect(NO_CONTEXT, theta) == pytest.approx(legs.effect(NO_CONTEXT, around))
    assert legs.effect(NO_CONTEXT, theta * [1, 1, 1, 1, 0]) == pytest.approx([0, 0])
    assert np.linalg.norm(legs.effect(NO_CONTEXT, theta)) > 0.1


def test_both_elbows_reach_the_same_place_and_a_movement_between_them_does_not():
    arm = two_elbows()
    right, left = np.array([0.7, 0.2, 0.5]), np.array([0.3, 0.8, 0.5])  # mirror images
    assert arm.effect(NO_CONTEXT, right) * [1, -1] == pytest.approx(arm.effect(NO_CONTEXT, left))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 401), [0.8], [0.5], indexing="ij"), axis=-1).reshape(-1, 3)
    ends = arm.effect(np.zeros((401, 0)), grid)
    same = grid[np.linalg.norm(ends - arm.effect(NO_CONTEXT, right), axis=1).argmin()]
    assert arm.effect(NO_CONTEXT, same) == pytest.approx(arm.effect(NO_CONTEXT, right), abs=0.01)
    between = arm.effect(NO_CONTEXT, (same + right) / 2)
    assert np.linalg.norm(between - arm.effect(NO_CONTEXT, right)) > 0.2


def test_the_stretched_spatial_arm_reaches_a_metre_ahead_in_cm():
    assert spatial_arm().rest == pytest.approx([100, 0, 0])


@pytest.mark.parametrize("word", ["half-reached", "toss", "crawler", "two-elbows", "spatial-arm", "puck", "fetch"])
def test_a_toy_comes_with_goals_of_which_each_can_be_reached(word):
    assert word in WORDS["environment"]
    task = task_of(Config(algorithm="random", parts={"environment": word}))
    benchmark, *_ = benchmark_of(task, None)
    assert 100 <= len(benchmark.goals) <= 400
    robot, rng = task.environment, stream(0, "reach")
    if isinstance(robot, Toy):
        middle = (robot.contexts.low + robot.contexts.high) / 2
        reached = robot.effect(np.tile(middle, (20_000, 1)), rng.uniform(size=(20_000, robot.policies.dim)))
        distances = [np.linalg.norm(reached - goal, axis=1).min() for goal in benchmark.goals]
        assert max(distances) < np.sqrt(robot.outcomes.dim) * benchmark.side
    else:  # the disc within reach fills pi / 8 of T
        assert robot.reachable(benchmark.goals).all()
        assert 0.3 < robot.reachable(rng.uniform(*(robot.outcomes.low, robot.outcomes.high), (4000, 2))).mean() < 0.5
