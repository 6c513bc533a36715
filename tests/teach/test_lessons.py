"""A lesson by hand: the file says exactly what the learner was shown, and what could not be followed is told."""

import numpy as np
import pytest

from sgimd_torch.algorithms.paper import observation
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.fit import misfit_of
from sgimd_torch.demonstrations.units import moving
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.tasks import Task
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.teach.leading import Leading
from sgimd_torch.teach.led import arm_led, rod_led
from sgimd_torch.teach.lessons import lesson_by_hand


@pytest.fixture(scope="module")
def rod():
    return FishingRod()


def led(times, joints):
    return np.asarray(times), np.asarray(joints)


def give(robot, recording):
    translate = robot.primitive.correspondence if isinstance(robot, FishingRod) else None
    return lesson_by_hand(*recording, Task(robot, correspondence=translate), stream(3, "lessons", 0))


def swung(rod, goal=(0.4, 0.3, 0.6), seconds=1.0):
    leading = Leading(rod_led(rod))
    leading.grab()
    leading.begin_recording()
    leading.drag(goal)
    leading.step(seconds)
    return leading.end_recording()


def played(rod, theta, rate=200.0):
    """A recording that the robot can play exactly, as it did."""
    return led(*rod.primitive.trajectory(theta, rate=rate))


def test_the_file_gives_the_theta_that_the_learner_was_shown_bit_for_bit(rod, tmp_path):
    lesson = give(rod, swung(rod))
    save_demonstrations(tmp_path / "mine.npz", [lesson.demonstration])
    (loaded,) = load_demonstrations(tmp_path / "mine.npz", n_joints=6, outcome_dim=2, context_dim=0)
    translated = rod.primitive.correspondence(loaded.times, loaded.trajectory)
    np.testing.assert_array_equal(translated, lesson.theta_d)
    learner = observation(rod, 0, correspondence=rod.primitive.correspondence)
    learner.watch(loaded)
    assert learner.ask(np.zeros(0)) is None  # it rests, and remembers
    np.testing.assert_array_equal(learner.memory.thetas, [lesson.theta_d])
    np.testing.assert_array_equal(learner.memory.outcomes, [lesson.demonstration.outcome])


def test_the_outcome_is_that_of_theta_executed_with_the_lessons_own_noise(rod):
    lesson = give(rod, swung(rod))
    again = rod.execute(np.zeros(0), lesson.theta_d, stream(3, "lessons", 0))
    np.testing.assert_array_equal(lesson.demonstration.outcome, again)


def test_what_the_robot_can_play_has_no_misfit_and_no_remark(rod):
    theta = rod.policies.sample(stream(0, "theta"))
    knots = theta[:-1].reshape(6, 4)
    knots[:, 0] = knots[:, 1] = 0.5  # begins where movements begin
    knots[:, 2:] = 0.3 + 0.4 * knots[:, 2:]
    lesson = give(rod, played(rod, theta))
    assert lesson.misfit == pytest.approx(0, abs=2e-3)
    np.testing.assert_allclose(lesson.theta_d, theta, atol=0.02)
    assert [remark for remark in lesson.remarks if "starts" not in remark] == []


def test_the_misfit_is_the_root_mean_square_in_radians(rod):
    theta = rod.policies.sample(stream(1, "theta"))
    times, trajectory = rod.primitive.trajectory(theta)
    off = trajectory + np.array([0.3, 0, 0, 0, 0, 0])  # one of six joints, throughout
    shown = Demonstration(np.zeros(0), times + 7, off, np.zeros(2))
    assert misfit_of(rod, theta, shown) == pytest.approx(0.3 / np.sqrt(6))


def test_a_slow_hand_is_played_in_the_longest_movement_and_told(rod):
    times, joints = swung(rod)
    slow = times * 3.2, joints  # 3.2 s
    lesson = give(rod, slow)
    assert lesson.demonstration.times[-1] == 1.6
    assert lesson.theta_d[-1] == 1.0
    assert "it is played 2 times faster: movements last 1.6 s at most" in lesson.remarks


def test_what_could_not_be_followed_is_told(rod):
    start = (rod.primitive.joints.low + rod.primitive.joints.high) / 2
    times = np.linspace(0, 1.0, 51)
    yaw = np.outer(np.clip(times / 0.1, 0, 1), [1.4, 0, 0, 0, 0, 0])  # 14 rad/s
    remarks = give(rod, led(times, start + yaw)).remarks
    assert remarks == ("yaw would turn at 14 rad/s, but movements reach 5.7 rad/s at most",)
    elsewhere = np.tile(start + np.array([0.5, 0, 0, 0, 0, 0]), (51, 1))
    (remark,) = give(rod, led(times, elsewhere)).remarks
    assert remark == "it starts 0.5 rad from where movements start, so the robot begins with a jerk"
    beyond = start + np.outer(times, [2.0, 0, 0, 0, 0, 0])
    assert any(
        "joint 0 is" in each and "its range [-1.6, 1.6]" in each for each in give(rod, led(times, beyond)).remarks
    )


def test_a_planar_arm_is_taught_by_its_last_posture():
    arm = PlanarArm()
    leading = Leading(arm_led(arm))
    leading.grab()
    leading.begin_recording()
    leading.drag([-0.2, 0.7, 0.0])
    leading.step(3.0)
    lesson = give(arm, leading.end_recording())
    np.testing.assert_allclose(lesson.demonstration.outcome, [-0.2, 0.7], atol=1e-3)
    assert np.isnan(lesson.misfit)  # its movements are not angles over time


def test_a_lesson_has_the_middle_of_c_as_its_context():
    arm = PlanarArm(context=True)
    recording = led(np.linspace(0, 1, 11), np.zeros((11, 7)))
    lesson = give(arm, recording)
    np.testing.assert_array_equal(lesson.demonstration.context, [0.0])
    np.testing.assert_allclose(lesson.demonstration.outcome, [1.0, 0.0], atol=1e-9)


def test_a_recording_of_another_robot_is_refused(rod):
    with pytest.raises(ValueError, match=r"trajectory must have shape .*one column for each joint"):
        give(rod, led(np.linspace(0, 1, 11), np.zeros((11, 7))))


def test_stillness_before_and_after_a_movement_is_left_out():
    times, turn = np.arange(201) / 100, np.clip(np.arange(201) / 100 - 0.5, 0, 0.8)
    kept, joints = moving(times, np.stack([turn, -turn], axis=1))
    np.testing.assert_allclose(kept, np.arange(81) / 100, atol=1e-12)
    np.testing.assert_allclose(joints[[0, -1], 0], [0.0, 0.8], atol=1e-12)


def test_an_arm_that_did_not_move_teaches_nothing():
    with pytest.raises(ValueError, match="no joint moved"):
        moving(np.arange(201) / 100, np.zeros((201, 2)))
