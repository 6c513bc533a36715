"""An arm that is led by the hand follows, within its limits, and stays where it is let go."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from experiments.toys import toss
from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Box, stream
from sgimd_torch.teach.arm import STEP
from sgimd_torch.teach.leading import Leading
from sgimd_torch.teach.led import HandLed, arm_led, hand_led_of, planar_model, rod_led

ROUNDING = 1e-6  # relative: a speed is a difference of angles, an acceleration one of speeds


@pytest.fixture(scope="module")
def rod():
    return FishingRod(noise=0.0)


@pytest.fixture
def leading(rod):
    return Leading(rod_led(rod))


@pytest.fixture
def flat():
    """Two links of 1 m that start stretched along x, and can turn by a radian either way."""
    return Leading(HandLed(planar_model([1.0, 1.0]), ("joint_0", "joint_1"), "end", Box.cube(-1, 1, 2)))


def model_of(body):
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")


def test_the_held_point_comes_to_the_hand(leading):
    goal = leading.point + np.array([0.1, -0.1, -0.2])
    leading.grab()
    leading.drag(goal)
    leading.step(3)
    np.testing.assert_allclose(leading.point, goal, atol=1e-3)


def test_of_a_planar_arm_the_end_is_where_the_arm_itself_says_it_is():
    arm = PlanarArm()
    leading = Leading(arm_led(arm))
    np.testing.assert_allclose(leading.point[:2], arm.rest)
    leading.grab()
    leading.drag([0.3, 0.6, 0.0])
    leading.step(3)
    np.testing.assert_allclose(leading.point[:2], [0.3, 0.6], atol=1e-3)
    theta = arm.correspondence([0.0], leading.q[None])
    np.testing.assert_allclose(arm.execute(np.zeros(0), theta, stream(0, "test")), leading.point[:2], atol=1e-9)


def test_where_it_is_let_go_it_stays(leading):
    leading.grab()
    leading.drag([0.4, 0.3, 0.6])
    leading.step(0.3)
    leading.release()
    leading.step(0.5)
    rested = leading.q
    leading.step(5)
    np.testing.assert_allclose(leading.q, rested, atol=1e-9)
    assert not leading.held


@pytest.mark.parametrize("grabbed", ["tip", "forearm"])
def test_a_hand_that_tears_cannot_exceed_ranges_speeds_and_accelerations(leading, grabbed):
    rng = stream(0, "a wild hand")
    for _ in range(10):
        leading.home()
        leading.grab(grabbed)
        leading.begin_recording()
        for _ in range(40):
            leading.drag(rng.normal(0, 1, 3))
            leading.step(0.05)
        leading.release()
        leading.step(0.5)
        _, joints = leading.end_recording()
        speeds = np.diff(joints, axis=0) / STEP
        starts = np.diff(np.concatenate([np.zeros((1, 6)), speeds]), axis=0) / STEP
        assert leading.arm.ranges.contains(joints).all()
        assert (np.abs(speeds) <= leading.arm.speeds * (1 + ROUNDING)).all()
        assert (np.abs(starts) <= leading.arm.accelerations * (1 + ROUNDING)).all()
    assert np.abs(speeds / leading.arm.speeds).max() > 0.9  # it was torn hard enough for the limits to count


def test_a_joint_at_the_end_of_its_range_leaves_the_rest_to_the_others(flat):
    flat.grab()
    goal = [np.cos(1.0) + np.cos(1.4), np.sin(1.0) + np.sin(1.4), 0.0]  # only with the first joint at its end
    flat.drag(goal)
    flat.step(5)
    np.testing.assert_allclose(flat.q, [1.0, 0.4], atol=5e-3)
    np.testing.assert_allclose(flat.point, goal, atol=5e-3)


def test_any_link_can_be_grabbed_at_any_place(leading):
    assert leading.arm.links == ("base", "upper_arm", "forearm", "roll", "wrist", "hand", "rod", "tip")
    touched = leading.arm.data.body("forearm").xpos + np.array([0.0, 0.02, 0.01])
    leading.grab("forearm", touched)
    np.testing.assert_allclose(leading.point, touched, atol=1e-12)
    x, y, z = touched
    turned = [x * np.cos(0.3) - y * np.sin(0.3), x * np.sin(0.3) + y * np.cos(0.3), z]
    leading.drag(turned)
    leading.step(3)
    np.testing.assert_allclose(leading.point, turned, atol=1e-3)
    np.testing.assert_allclose(leading.q - leading.arm.start, [0.3, 0, 0, 0, 0, 0], atol=0.02)  # the yaw does it


def test_time_may_come_in_pieces_of_any_size(leading, rod):
    other = Leading(rod_led(rod))
    for each, pieces in ((leading, [0.3]), (other, [0.004] * 75)):
        each.grab()
        each.drag([0.3, 0.3, 0.5])
        for piece in pieces:
            each.step(piece)
    np.testing.assert_array_equal(leading.q, other.q)


@pytest.mark.parametrize("goal", [[-0.2, 0.7], [0.3, -0.8]])
def test_a_hand_that_jumps_takes_the_arm_to_where_one_that_moves_slowly_takes_it(goal):
    leading = Leading(arm_led(PlanarArm()))
    for seconds in (0.0, 1.0):
        leading.home()
        leading.grab()
        start = leading.point
        for time in np.arange(0, 5, 0.05):
            leading.drag(start + min(1.0, time / max(seconds, 0.01)) * ([*goal, 0.0] - start))
            leading.step(0.05)
        np.testing.assert_allclose(leading.point[:2], goal, atol=1e-3)


def test_a_recording_begins_where_the_arm_was_and_has_every_step(leading):
    leading.grab()
    leading.begin_recording()
    leading.drag([0.2, 0.3, 0.6])
    leading.step(0.5)
    assert leading.recording
    times, joints = leading.end_recording()
    np.testing.assert_allclose(times, np.arange(51) * STEP)
    np.testing.assert_array_equal(joints[0], leading.arm.start)
    np.testing.assert_array_equal(joints[-1], leading.q)
    assert not leading.recording


def test_limits_of_the_rod_are_those_of_its_motor_primitive(rod):
    """Random movements come near to the largest speeds and accelerations, none exceeds them."""
    speeds, accelerations = rod_led(rod).speeds, rod_led(rod).accelerations
    rng, fastest, hardest = stream(0, "movements"), np.zeros(6), np.zeros(6)
    for _ in range(500):
        theta = np.append(rng.integers(0, 2, 24).astype(float), 0.0)  # corners of Pi, of the shortest duration
        times, joints = rod.primitive.trajectory(theta, rate=1000)
        speed = np.diff(joints, axis=0) / np.diff(times)[:, None]
        fastest = np.maximum(fastest, np.abs(speed).max(axis=0))
        hardest = np.maximum(hardest, np.abs(np.diff(speed, axis=0) / times[1]).max(axis=0))
    for most, found in ((speeds, fastest), (accelerations, hardest)):
        assert (found <= most * (1 + ROUNDING)).all()
        assert (found >= 0.99 * most).all()


def test_without_limits_of_its_own_a_joint_crosses_its_range_in_about_a_second(flat):
    np.testing.assert_allclose(flat.arm.speeds, [3.0, 3.0])
    np.testing.assert_allclose(flat.arm.accelerations, [12.0, 12.0])


def test_ranges_are_those_of_the_model_if_none_are_given():
    body = '<body name="arm"><joint name="a" axis="0 0 1" range="-30 90"/><geom size="1"/></body>'
    leading = Leading(HandLed(model_of(body), ("a",), "arm"))
    np.testing.assert_allclose([leading.arm.ranges.low, leading.arm.ranges.high], [[-np.pi / 6], [np.pi / 2]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": ("yaw", "elbo")}, "no joint 'elbo'; is it spelt"),
        ({"hand": "hnad"}, "no body or site 'hnad'"),
        ({"hand": "float"}, "float cannot be grabbed: joints not led move it, too; links to grab are base, upper_arm"),
        ({"ranges": None}, "joint yaw has no range in the model; give ranges"),
        ({"start": [9.0] * 6}, "start must lie in its box"),
        ({"speeds": [1, 1, 1, 1, 1, 0]}, "speeds must be above 0"),
    ],
)
def test_an_arm_that_cannot_be_led_is_refused(rod, change, message):
    with pytest.raises(ValueError, match=message):
        Leading(replace(rod_led(rod), **change))


def test_a_ball_joint_cannot_be_led():
    body = '<body name="arm"><joint name="a" type="ball"/><geom size="1"/></body>'
    with pytest.raises(ValueError, match="joint a is neither a hinge nor a slide"):
        Leading(HandLed(model_of(body), ("a",), "arm"))


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


@pytest.mark.parametrize(("name", "value"), [("grab", "water"), ("grab", "pillar"), ("drag", [0, 0])])
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
    ball = toss().environment
    with pytest.raises(ValueError, match=r"Toy cannot be led by the hand.*give it an attribute hand_led"):
        hand_led_of(Task(ball))
    with pytest.raises(ValueError, match="FishingRod has no correspondence"):
        hand_led_of(Task(rod))
