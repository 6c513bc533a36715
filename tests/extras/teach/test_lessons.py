"""A lesson by hand: the file says exactly what the learner was shown, and what could not be followed is told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.algorithms.paper import observation
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.teach.leading import Leading
from sgimd_torch.extras.teach.led import arm_led, rod_led
from sgimd_torch.extras.teach.lessons import lesson_by_hand
from sgimd_torch.spaces import stream
from sgimd_torch.tasks import Task

TIMES = np.linspace(0, 1.0, 51)


@pytest.fixture(scope="module")
def rod():
    return FishingRod()


def give(robot, times, joints):
    translate = robot.primitive.correspondence if isinstance(robot, FishingRod) else None
    return lesson_by_hand(times, joints, Task(robot, correspondence=translate), stream(3, "lessons", 0))


def recorded(led, target, seconds):
    leading = Leading(led)
    leading.grab()
    leading.begin_recording()
    leading.drag(target)
    leading.step(seconds)
    return leading.end_recording()


@settings(max_examples=10, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-1, 1)] * 3), st.floats(0.5, 3.0))
def test_the_file_gives_the_theta_that_the_learner_was_shown_bit_for_bit(rod, tmp_path_factory, target, seconds):
    lesson, path = give(rod, *recorded(rod_led(rod), target, seconds)), tmp_path_factory.getbasetemp() / "mine.npz"
    save_demonstrations(path, [lesson.demonstration])
    (loaded,) = load_demonstrations(path, n_joints=6, outcome_dim=2, context_dim=0)
    translated = rod.primitive.correspondence(loaded.times, loaded.trajectory)
    np.testing.assert_array_equal(translated, lesson.theta_d)
    learner = observation(rod, 0, correspondence=rod.primitive.correspondence)
    learner.watch(loaded)
    assert learner.ask(np.zeros(0)) is None  # it rests, and remembers
    np.testing.assert_array_equal(learner.memory.thetas, [lesson.theta_d])
    np.testing.assert_array_equal(learner.memory.outcomes, [lesson.demonstration.outcome])
    again = rod.execute(np.zeros(0), lesson.theta_d, stream(3, "lessons", 0))  # with the lesson's own noise
    np.testing.assert_array_equal(lesson.demonstration.outcome, again)


def test_what_the_robot_can_play_has_no_misfit_and_no_remark(rod):
    theta = rod.policies.sample(stream(0, "theta"))
    knots = theta[:-1].reshape(6, 4)
    knots[:, 0] = knots[:, 1] = 0.5  # begins where movements begin
    knots[:, 2:] = 0.3 + 0.4 * knots[:, 2:]
    lesson = give(rod, *rod.primitive.trajectory(theta, rate=200.0))
    assert lesson.misfit == pytest.approx(0, abs=2e-3)
    np.testing.assert_allclose(lesson.theta_d, theta, atol=0.02)
    assert [remark for remark in lesson.remarks if "starts" not in remark] == []


def test_a_slow_hand_is_played_in_the_longest_movement_and_told(rod):
    times, joints = recorded(rod_led(rod), [0.4, 0.3, 0.6], 1.0)
    lesson = give(rod, times * 3.2, joints)
    assert lesson.demonstration.times[-1] == 1.6
    assert lesson.theta_d[-1] == 1.0
    assert "it is played 2 times faster: movements last 1.6 s at most" in lesson.remarks


@pytest.mark.parametrize(
    ("yaw", "remark"),
    [
        (1.4 * np.clip(TIMES / 0.1, 0, 1), "yaw would turn at 14 rad/s, but movements reach 5.7 rad/s at most"),
        (0.5 + 0 * TIMES, "it starts 0.5 rad from where movements start, so the robot begins with a jerk"),
        (2.0 * TIMES, "joint 0 is 1.64 at sample 41, outside its range [-1.6, 1.6]"),
    ],
)
def test_what_could_not_be_followed_is_told(rod, yaw, remark):
    start = (rod.primitive.joints.low + rod.primitive.joints.high) / 2
    assert give(rod, TIMES, start + np.outer(yaw, [1, 0, 0, 0, 0, 0])).remarks == (remark,)


def test_a_planar_arm_is_taught_by_its_last_posture_in_the_middle_of_c():
    arm = PlanarArm()
    lesson = give(arm, *recorded(arm_led(arm), [-0.2, 0.7, 0.0], 3.0))
    np.testing.assert_allclose(lesson.demonstration.outcome, [-0.2, 0.7], atol=1e-3)
    assert np.isnan(lesson.misfit)  # its movements are not angles over time
    lesson = give(PlanarArm(context=True), TIMES, np.zeros((51, 7)))
    np.testing.assert_array_equal(lesson.demonstration.context, [0.0])
    np.testing.assert_allclose(lesson.demonstration.outcome, [1.0, 0.0], atol=1e-9)


def test_a_recording_of_another_robot_is_refused(rod):
    with pytest.raises(ValueError, match=r"trajectory must have shape .*one column for each joint"):
        give(rod, TIMES, np.zeros((51, 7)))
