"""An arm that is led by the hand follows, within its limits, and stays where it is let go."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.teach.arm import STEP
from sgimd_torch.extras.teach.leading import Leading
from sgimd_torch.extras.teach.led import HandLed, arm_led, hand_led_of, planar_model, rod_led
from sgimd_torch.spaces import Box, stream
from sgimd_torch.tasks import Task

ROUNDING = 1e-6  # relative: a speed is a difference of angles, an acceleration one of speeds
NO_CONTEXT = np.zeros(0)


@pytest.fixture(scope="module")
def rod():
    return FishingRod(noise=0.0)


@pytest.fixture
def leading(rod):
    return Leading(rod_led(rod))


@pytest.fixture
def flat():
    """Two links of 1 m that start stretched along x, and can turn by a radian either way."""
    return Leading(HandLed(planar_model(2, 1.0), ("joint_0", "joint_1"), "end", Box.cube(-1, 1, 2)))


def model_of(body):
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")


def led_to(leading, target, seconds, **grip):
    """The arm after a hand has pulled it to a target for some seconds."""
    leading.grab(**grip)
    leading.drag(target)
    leading.step(seconds)
    return leading


def test_the_held_point_comes_to_the_hand_and_stays_where_it_is_let_go(leading):
    target = leading.point + np.array([0.1, -0.1, -0.2])
    np.testing.assert_allclose(led_to(leading, target, 3).point, target, atol=1e-3)
    led_to(leading, [0.4, 0.3, 0.6], 0.3).release()
    leading.step(0.5)
    rested = leading.q
    leading.step(5)
    np.testing.assert_allclose(leading.q, rested, atol=1e-9)
    assert not leading.held


def test_of_a_planar_arm_the_end_is_where_the_arm_itself_says_it_is():
    arm, rng = PlanarArm(), stream(0, "thetas")
    leading = Leading(arm_led(arm))
    np.testing.assert_allclose(leading.point[:2], arm.rest)
    np.testing.assert_allclose(led_to(leading, [0.3, 0.6, 0.0], 3).point[:2], [0.3, 0.6], atol=1e-3)
    theta = arm.correspondence([0.0], leading.q[None])
    np.testing.assert_allclose(arm.execute(NO_CONTEXT, theta, rng), leading.point[:2], atol=1e-9)
    leading.release()
    for theta in arm.policies.low + arm.policies.sides * rng.random((20, 7)):
        leading.arm.pose(arm.angles(theta))
        np.testing.assert_allclose(leading.hand, [*arm.execute(NO_CONTEXT, theta, rng), 0], atol=1e-12)


@pytest.mark.parametrize("body", ["tip", "forearm"])
def test_a_hand_that_tears_cannot_exceed_ranges_speeds_and_accelerations(leading, body):
    rng = stream(0, "a wild hand")
    for _ in range(10):
        leading.home()
        leading.grab(body)
        leading.begin_recording()
        for _ in range(40):
            leading.drag(rng.normal(0, 1, 3))
            leading.step(0.05)
        leading.release()
        leading.step(0.5)
        _, joints = leading.end_recording()
        speeds = np.diff(joints, axis=0) / STEP
        accelerations = np.diff(np.concatenate([np.zeros((1, 6)), speeds]), axis=0) / STEP
        assert leading.arm.ranges.contains(joints).all()
        assert (np.abs(speeds) <= leading.arm.speeds * (1 + ROUNDING)).all()
        assert (np.abs(accelerations) <= leading.arm.accelerations * (1 + ROUNDING)).all()
    assert np.abs(speeds / leading.arm.speeds).max() > 0.9  # it was torn hard enough for the limits to count


def test_a_joint_at_the_end_of_its_range_leaves_the_rest_to_the_others(flat):
    target = [np.cos(1.0) + np.cos(1.4), np.sin(1.0) + np.sin(1.4), 0.0]  # only with the first joint at its end
    led_to(flat, target, 5)
    np.testing.assert_allclose(flat.q, [1.0, 0.4], atol=5e-3)
    np.testing.assert_allclose(flat.point, target, atol=5e-3)


def test_any_link_can_be_grabbed_at_any_place(leading):
    assert leading.arm.links == ("base", "upper_arm", "forearm", "roll", "wrist", "hand", "rod", "tip")
    touched = leading.arm.data.body("forearm").xpos + np.array([0.0, 0.02, 0.01])
    leading.grab("forearm", touched)
    np.testing.assert_allclose(leading.point, touched, atol=1e-12)
    x, y, z = touched
    turned = [x * np.cos(0.3) - y * np.sin(0.3), x * np.sin(0.3) + y * np.cos(0.3), z]
    led_to(leading, turned, 3, body="forearm", point=touched)
    np.testing.assert_allclose(leading.point, turned, atol=1e-3)
    np.testing.assert_allclose(leading.q - leading.arm.start, [0.3, 0, 0, 0, 0, 0], atol=0.02)  # the yaw does it


def test_time_may_come_in_pieces_of_any_size(leading, rod):
    other = led_to(Leading(rod_led(rod)), [0.3, 0.3, 0.5], 0)
    for _ in range(75):
        other.step(0.004)
    np.testing.assert_array_equal(led_to(leading, [0.3, 0.3, 0.5], 0.3).q, other.q)


@pytest.mark.parametrize("target", [[-0.2, 0.7], [0.3, -0.8]])
def test_a_hand_that_jumps_takes_the_arm_to_where_one_that_moves_slowly_takes_it(target):
    leading = Leading(arm_led(PlanarArm()))
    for seconds in (0.0, 1.0):
        leading.home()
        leading.grab()
        start = leading.point
        for time in np.arange(0, 5, 0.05):
            leading.drag(start + min(1.0, time / max(seconds, 0.01)) * ([*target, 0.0] - start))
            leading.step(0.05)
        np.testing.assert_allclose(leading.point[:2], target, atol=1e-3)


def test_a_recording_begins_where_the_arm_was_and_has_every_step(leading):
    leading.begin_recording()
    led_to(leading, [0.2, 0.3, 0.6], 0.5)
    assert leading.recording
    times, joints = leading.end_recording()
    np.testing.assert_allclose(times, np.arange(51) * STEP)
    np.testing.assert_array_equal(joints[0], leading.arm.start)
    np.testing.assert_array_equal(joints[-1], leading.q)
    assert not leading.recording


def test_limits_of_the_rod_are_those_of_its_motor_primitive(rod):
    """Random movements come near to the largest speeds and accelerations, none exceeds them."""
    led, rng, largest = rod_led(rod), stream(0, "movements"), np.zeros((2, 6))
    for _ in range(500):
        theta = np.append(rng.integers(0, 2, 24).astype(float), 0.0)  # corners of Pi, of the shortest duration
        times, joints = rod.primitive.trajectory(theta, rate=1000)
        speeds = np.diff(joints, axis=0) / np.diff(times)[:, None]
        accelerations = np.diff(speeds, axis=0) / times[1]
        largest = np.maximum(largest, [np.abs(values).max(axis=0) for values in (speeds, accelerations)])
    shares = largest / [led.speeds, led.accelerations]
    assert (shares <= 1 + ROUNDING).all()
    assert (shares >= 0.99).all()


def test_without_limits_of_its_own_a_joint_crosses_its_range_in_about_a_second(flat):
    np.testing.assert_allclose(flat.arm.speeds, [3.0, 3.0])
    np.testing.assert_allclose(flat.arm.accelerations, [12.0, 12.0])
    body = '<body name="arm"><joint name="a" axis="0 0 1" range="-30 90"/><geom size="1"/></body>'
    ranges = Leading(HandLed(model_of(body), ("a",), "arm")).arm.ranges  # those of the model
    np.testing.assert_allclose([ranges.low, ranges.high], [[-np.pi / 6], [np.pi / 2]])


BALL = '<body name="tip"><joint name="a" type="ball"/><geom size="1"/></body>'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": ("yaw", "elbo")}, "no joint 'elbo'; is it spelt"),
        ({"hand": "hnad"}, "no body or site 'hnad'"),
        ({"hand": "float"}, "float cannot be grabbed: joints not led move it, too; links to grab are base, upper_arm"),
        ({"ranges": None}, "joint yaw has no range in the model; give ranges"),
        ({"start": [9.0] * 6}, "start must lie in its box"),
        ({"speeds": [1, 1, 1, 1, 1, 0]}, "speeds must be above 0"),
        ({"model": model_of(BALL), "joints": ("a",)}, "joint a is neither a hinge nor a slide"),
    ],
)
def test_an_arm_that_cannot_be_led_is_refused(rod, change, message):
    with pytest.raises(ValueError, match=message):
        Leading(replace(rod_led(rod), **change))


def test_what_is_out_of_order_is_refused(leading):
    with pytest.raises(RuntimeError, match=r"call grab\(\) first"):
        leading.drag([0, 0, 0])
    with pytest.raises(RuntimeError, match=r"begin_recording\(\) comes first"):
        leading.end_recording()
    leading.begin_recording()
    with pytest.raises(RuntimeError, match="a recording is under way"):
        leading.begin_recording()
    with pytest.raises(RuntimeError, match="cannot jump home during a recording"):
        leading.home()
    with pytest.raises(ValueError, match="was it too short"):
        leading.end_recording()
    leading.begin_recording()  # the short one is gone


@pytest.mark.parametrize(("name", "value"), [("grab", "water"), ("grab", "pillar"), ("drag", [0, 0]), ("step", -1)])
def test_nonsense_is_refused_and_changes_nothing(leading, name, value):
    leading.grab()
    before = leading.point
    with pytest.raises(ValueError):  # noqa: PT011, each message has a test where it is made
        getattr(leading, name)(value)
    leading.step(1)
    np.testing.assert_allclose(leading.point, before, atol=1e-9)


def test_tasks_say_what_can_be_led(rod):
    assert hand_led_of(Task(rod, correspondence=rod.primitive.correspondence)).joints == JOINTS
    assert hand_led_of(Task(PlanarArm(3))).joints == ("joint_0", "joint_1", "joint_2")
    with pytest.raises(ValueError, match="FishingRod has no correspondence"):
        hand_led_of(Task(rod))
