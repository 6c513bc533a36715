"""The toy robots: each keeps the contract, and is hard in the way that it says."""

import numpy as np
import pytest

from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.spaces import stream
from sgimd_torch.tasks import benchmark_of
from toys import (
    GRAVITY,
    BlindToss,
    Toy,
    blind_toss,
    crawler,
    fetch,
    half_reached,
    puck,
    spatial_arm,
    toss,
    two_elbows,
)

TOYS = [toss, crawler, two_elbows, spatial_arm, puck, fetch]
NO_CONTEXT, NO_WIND = np.zeros(0), np.zeros(1)
AHEAD = np.array([0.5, 0.0])  # where the puck lies in most of these tests, in the middle of the table
PUSH = np.array([0.5, 0.0, 0.5, 0.9, 1.0])  # straight ahead, from .3 m to .84 m, as fast as it can


@pytest.mark.parametrize("make", TOYS)
def test_toy_keeps_the_contract(make):
    check_environment(make().environment)
    check_environment(make(noise=0.0).environment)


@pytest.mark.parametrize("make", TOYS)
def test_all_that_it_reaches_lies_in_its_task_space_and_scatters_as_stated(make):
    toy, rng = make().environment, stream(0, "toy")
    thetas = rng.uniform(size=(2000, toy.policies.dim))
    contexts = np.array([toy.observe(rng) for _ in thetas])
    assert toy.outcomes.contains(toy.effect(contexts, thetas)).all()
    landed = np.array([toy.execute(contexts[0], thetas[0], rng) for _ in range(400)])
    assert landed.std(axis=0) == pytest.approx(toy.outcome_noise, rel=0.15)  # 4 standard errors of 400


def test_without_wind_a_high_throw_and_a_flat_one_land_in_one_place():
    ball = toss().environment
    flat, high = np.array([0.5, 0.2, 0.9, 0.0]), np.linspace(0.5, 1, 2001)
    wanted = ball.effect(NO_WIND, flat)
    found = ball.effect(np.zeros((2001, 1)), np.column_stack([np.full(2001, 0.5), high, np.full((2001, 2), [0.9, 0])]))
    best = np.abs(found[:, 1] - wanted[1]).argmin()
    assert found[best] == pytest.approx(wanted, abs=0.01)
    blown = [ball.effect(np.ones(1), theta)[0] for theta in (flat, np.array([0.5, high[best], 0.9, 0.0]))]
    assert blown[1] > 2 * blown[0] > 0


def test_a_level_throw_falls_for_as_long_as_gravity_says():
    ball = toss().environment
    lowest = np.array([0.5, 0.0, 0.0, 0.0])  # 10 degrees, 1 m/s, from .5 m
    up, ahead = np.sin(np.pi / 18), np.cos(np.pi / 18)
    duration = (up + np.sqrt(up**2 + 2 * GRAVITY * 0.5)) / GRAVITY
    assert ball.effect(np.ones(1), lowest) == pytest.approx([duration**2 / 2, ahead * duration])


def test_phases_of_the_crawler_are_periodic_and_without_swing_it_stays():
    legs = crawler().environment
    theta = np.array([0.0, 0.3, 0.6, 0.2, 0.7])
    around = theta + np.array([1, 0, 0, 0, 0])
    assert legs.effect(NO_CONTEXT, theta) == pytest.approx(legs.effect(NO_CONTEXT, around))
    assert legs.effect(NO_CONTEXT, theta * [1, 1, 1, 1, 0]) == pytest.approx([0, 0])
    assert np.linalg.norm(legs.effect(NO_CONTEXT, theta)) > 0.1


def test_both_elbows_reach_the_same_place_and_a_movement_between_them_does_not():
    arm = two_elbows().environment
    right, left = np.array([0.7, 0.2, 0.5]), np.array([0.3, 0.8, 0.5])  # mirror images
    assert arm.effect(NO_CONTEXT, right) * [1, -1] == pytest.approx(arm.effect(NO_CONTEXT, left))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 401), [0.8], [0.5], indexing="ij"), axis=-1).reshape(-1, 3)
    ends = arm.effect(np.zeros((401, 0)), grid)
    same = grid[np.linalg.norm(ends - arm.effect(NO_CONTEXT, right), axis=1).argmin()]
    assert arm.effect(NO_CONTEXT, same) == pytest.approx(arm.effect(NO_CONTEXT, right), abs=0.01)
    between = arm.effect(NO_CONTEXT, (same + right) / 2)
    assert np.linalg.norm(between - arm.effect(NO_CONTEXT, right)) > 0.2


def test_the_stretched_spatial_arm_reaches_a_metre_ahead_in_cm():
    assert spatial_arm().environment.rest == pytest.approx([100, 0, 0])


@pytest.mark.parametrize(("make", "missed"), [(puck, 0.6), (fetch, 0.9)])
def test_most_movements_do_not_touch_the_object_which_then_stays(make, missed):
    robot, rng = make().environment, stream(0, "objects")
    thetas = rng.uniform(size=(4000, robot.policies.dim))
    contexts = np.array([robot.observe(rng) for _ in thetas])
    lies = contexts if robot.contexts.dim else robot.rest
    assert missed < (robot.effect(contexts, thetas) == lies).all(axis=1).mean() < 0.99


def test_not_moving_leaves_the_puck_where_it_lies():
    robot = puck().environment
    thetas = np.random.default_rng(0).uniform(size=(100, 5))
    thetas[:, 2:4] = thetas[:, :2]
    assert (robot.effect(np.tile(AHEAD, (100, 1)), thetas) == AHEAD).all()


def slides(lies):
    """How far (m) ``PUSH``, .54 m in .5 s, sends a puck that lies so far ahead: restitution .5, friction .3."""
    times = np.roots([-2, 3, 0, -(lies - 0.1 - 0.3) / 0.54])
    time = times[(times > 0) & (times < 1)].item()
    return (1.5 * 0.54 * 6 * time * (1 - time) / 0.5) ** 2 / (2 * 0.3 * GRAVITY)


@pytest.mark.parametrize(
    ("lies", "theta", "ends"),
    [
        (0.5, PUSH, 0.5 + slides(0.5)),
        (0.6, PUSH, 2 * 1.2 - 0.6 - slides(0.6)),  # the wall at 1.2 m reflects it without loss
        (0.5, np.array([0.5, 0.3, 0.5, 1.0, 1.0]), 0.5),  # lowered onto it, .48 m ahead, the hand holds it
    ],
    ids=["free", "wall", "held"],
)
def test_a_puck_ends_straight_ahead_where_friction_wall_and_hand_let_it(lies, theta, ends):
    end = puck().environment.effect(np.array([lies, 0.0]), theta)
    assert end == pytest.approx([ends, 0], abs=0.02)  # 50 straight steps in a swing


def test_a_swing_three_times_slower_sends_the_puck_a_ninth_as_far():
    far, near = (puck().environment.effect(AHEAD, theta) - AHEAD for theta in (PUSH, PUSH * [1, 1, 1, 1, 0]))
    assert far == pytest.approx(9 * near)


def test_a_mirrored_swing_at_a_mirrored_puck_ends_mirrored():
    robot, rng = puck().environment, stream(0, "mirror")
    contexts, thetas = np.array([robot.observe(rng) for _ in range(500)]), rng.uniform(size=(500, 5))
    mirrored = np.where([True, False, True, False, False], 1 - thetas, thetas)
    ends = robot.effect(contexts, thetas)
    assert (ends != contexts).any()
    assert robot.effect(contexts * [1, -1], mirrored) == pytest.approx(ends * [1, -1])


def test_the_ball_goes_where_the_hand_opens_if_it_was_grasped():
    robot, rng = fetch().environment, stream(0, "fetch")
    nothing = np.zeros(0)
    closes = rng.uniform(size=(4000, 4))
    opens = np.array([0.5, 0.5, 0.5, 0.5])  # the arm is straight
    ends = robot.effect(np.zeros((4000, 0)), np.column_stack([closes, np.tile(opens, (4000, 1))]))
    came = (ends == [1, 0]).all(axis=1)
    assert 0 < came.mean() < 0.1
    assert (ends[~came] == robot.rest).all()
    back = robot.effect(nothing, np.concatenate([closes[came][0], closes[came][0]]))
    assert np.linalg.norm(back - robot.rest) < 0.15


def test_the_blind_toss_hides_its_wind_and_has_the_goals_of_the_toss():
    task = blind_toss()
    assert task.environment.contexts.dim == 0
    goals, *_ = benchmark_of(task, None)
    assert goals.environment == BlindToss.__name__
    assert np.array_equal(goals.goals, benchmark_of(toss(), None)[0].goals)


@pytest.mark.parametrize("make", [*TOYS, half_reached])
def test_a_toy_comes_with_goals_of_which_each_can_be_reached(make):
    task = make()
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
