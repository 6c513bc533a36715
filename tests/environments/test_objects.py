"""Objects that have to be touched: what is missed stays, what is hit follows the laws of physics."""

import numpy as np
import pytest

from sgimd_torch.environments.objects import fetch, puck
from sgimd_torch.environments.toys import GRAVITY
from sgimd_torch.spaces import stream

AHEAD = np.array([0.5, 0.0])  # where the puck lies in most of these tests, in the middle of the table
PUSH = np.array([0.5, 0.0, 0.5, 0.9, 1.0])  # straight ahead, from .3 m to .84 m, as fast as it can


@pytest.mark.parametrize(("make", "missed"), [(puck, 0.6), (fetch, 0.9)])
def test_most_movements_do_not_touch_the_object_which_then_stays(make, missed):
    robot, rng = make(), stream(0, "objects")
    thetas = rng.uniform(size=(4000, robot.policies.dim))
    contexts = np.array([robot.observe(rng) for _ in thetas])
    lies = contexts if robot.contexts.dim else robot.rest
    assert missed < (robot.effect(contexts, thetas) == lies).all(axis=1).mean() < 0.99


def test_not_moving_leaves_the_puck_where_it_lies():
    robot = puck()
    thetas = np.random.default_rng(0).uniform(size=(100, 5))
    thetas[:, 2:4] = thetas[:, :2]
    assert (robot.effect(np.tile(AHEAD, (100, 1)), thetas) == AHEAD).all()


def slides(lies):
    """How far (m) ``PUSH``, .54 m in .5 s, sends a puck that lies so far ahead: restitution .5, friction .3."""
    times = np.roots([-2, 3, 0, -(lies - 0.1 - 0.3) / 0.54])
    time = times[(times > 0) & (times < 1)].item()
    return (1.5 * 0.54 * 6 * time * (1 - time) / 0.5) ** 2 / (2 * 0.3 * GRAVITY)


def test_a_push_sends_the_puck_straight_ahead_as_far_as_friction_lets_it():
    assert puck().effect(AHEAD, PUSH) == pytest.approx([0.5 + slides(0.5), 0], abs=0.02)  # 50 straight steps in a swing


def test_a_swing_three_times_slower_sends_the_puck_a_ninth_as_far():
    far, near = (puck().effect(AHEAD, theta) - AHEAD for theta in (PUSH, PUSH * [1, 1, 1, 1, 0]))
    assert far == pytest.approx(9 * near)


def test_a_wall_reflects_the_puck_without_loss():
    assert 0.6 + slides(0.6) > 1.3  # the wall is at 1.2 m
    assert puck().effect(np.array([0.6, 0.0]), PUSH) == pytest.approx([2 * 1.2 - 0.6 - slides(0.6), 0], abs=0.02)


def test_a_mirrored_swing_at_a_mirrored_puck_ends_mirrored():
    robot, rng = puck(), stream(0, "mirror")
    contexts, thetas = np.array([robot.observe(rng) for _ in range(500)]), rng.uniform(size=(500, 5))
    mirrored = np.where([True, False, True, False, False], 1 - thetas, thetas)
    ends = robot.effect(contexts, thetas)
    assert (ends != contexts).any()
    assert robot.effect(contexts * [1, -1], mirrored) == pytest.approx(ends * [1, -1])


def test_a_hand_that_is_lowered_onto_the_puck_holds_it():
    onto = np.array([0.5, 0.3, 0.5, 1.0, 1.0])  # .48 m ahead
    assert (puck().effect(AHEAD, onto) == AHEAD).all()


def test_the_ball_goes_where_the_hand_opens_if_it_was_grasped():
    robot, rng = fetch(), stream(0, "fetch")
    nothing = np.zeros(0)
    closes = rng.uniform(size=(4000, 4))
    opens = np.array([0.5, 0.5, 0.5, 0.5])  # the arm is straight
    ends = robot.effect(np.zeros((4000, 0)), np.column_stack([closes, np.tile(opens, (4000, 1))]))
    came = (ends == [1, 0]).all(axis=1)
    assert 0 < came.mean() < 0.1
    assert (ends[~came] == robot.rest).all()
    back = robot.effect(nothing, np.concatenate([closes[came][0], closes[came][0]]))
    assert np.linalg.norm(back - robot.rest) < 0.15
