"""An arm that reads what it is not commanded in, or late, is stopped and cannot run away; a good one is not stopped."""

import re
import threading
import time

import numpy as np
import pytest

from arms import interrupt, on_table, upright, write
from marks import slow
from sgimd_torch import SimulationError, random_exploration, run, stream
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import NotExecutedError
from sgimd_torch.runs.signals import Overdue

NONE, RNG = np.zeros(0), stream(0, "arm")
MOVEMENTS = [stream(k, "bad arm").random(13) for k in range(4)]


def joint1(read):
    """A frame in which ``joint1`` reads ``read(time, degrees)``."""
    return lambda time, degrees: np.array([degrees[0], read(time, degrees[1]), degrees[2]])


FRAMES = {  # what joint1, or all joints, read
    "90 degrees off": joint1(lambda time, x: x + 90),
    "-90 degrees off": joint1(lambda time, x: x - 90),
    "20 degrees off": joint1(lambda time, x: x + 20),
    "raw ticks": joint1(lambda time, x: 2048 + x * 4096 / 360),
    "radians": joint1(lambda time, x: np.radians(x)),
    "wrong sign": joint1(lambda time, x: -x),
    "wraps in a first step": joint1(lambda time, x: x + 360 * (time > 1.5)),
    "wraps in a movement": joint1(lambda time, x: x - 360 * (time > 7)),
    "jumps within its range": joint1(lambda time, x: x + np.copysign(60, -x) * (time > 7)),
    "wrong sign later": joint1(lambda time, x: x if time < 7 else -x),
    "stands still": joint1(lambda time, x: 12.0),
    "drifts": joint1(lambda time, x: x + 20 * max(0.0, time - 7)),
    "is another joint": lambda time, degrees: degrees[[0, 2, 1]],
}


@pytest.mark.parametrize("delay", [0.05, slow(0.0), slow(0.1)])
@pytest.mark.parametrize("frame", FRAMES)
def test_no_command_leaves_the_range_and_no_movement_is_endless_in_another_frame(tmp_path, frame, delay):
    for begin in (0, 50):
        of_arm = {"delay": delay, "noise": 0.2, "frame": FRAMES[frame]}
        arm, on = on_table(write(tmp_path / "arm.xml"), of_arm=of_arm)
        on.data.qpos[:3], failed = np.radians(begin), []
        for theta in MOVEMENTS:
            began = on.clock.now
            try:
                arm.execute(NONE, theta, RNG)
            except SimulationError as error:
                failed.append(str(error))
                assert not on.torque
            assert on.clock.now - began < 20
        assert failed
        assert all(re.match("(joint1|the movement has not ended .*joint1)", told) for told in failed)
        assert all(np.abs(command).max() < 100 + 1e-9 for _, command, _ in on.sent)


SOFT = {  # servos and links as those of an SO-101, with their weight
    'damping="1"': 'damping=".6" armature=".028" frictionloss=".052"',
    'gravity="0 0 0"': 'gravity="0 -9.81 0"',
    'size=".02"': 'size=".02" mass=".1"',
}


@pytest.mark.parametrize("delay", [0.1, slow(0.0), slow(0.05)])
@pytest.mark.parametrize("kp", [17.8, 100])
def test_a_soft_and_late_arm_does_not_stall_where_nothing_is_in_its_way(tmp_path, kp, delay):
    built = write(tmp_path / "built.xml", offsets=(3, -3, 2), kp=kp)
    text = re.sub(' kv=".*?"', "", built.read_text())
    for old, new in SOFT.items():
        text = text.replace(old, new)
    built.write_text(text)
    arm, on = on_table(write(tmp_path / "arm.xml"), built, of_arm={"delay": delay, "noise": 0.2})
    on.data.qpos[:3] = 1.0
    for k in range(12):
        arm.execute(NONE, arm.policies.sample(stream(k, "soft")), RNG)
    assert on.torque


@pytest.mark.parametrize("delay", [0.1, slow(0.0)])
@pytest.mark.parametrize("frame", ["90 degrees off", "-90 degrees off", "20 degrees off", "wrong sign"])
def test_a_joint_that_reads_another_frame_is_stopped_within_eleven_degrees(tmp_path, frame, delay):
    for begin in (0, 50, -70):
        arm, on = on_table(write(tmp_path / "arm.xml"), of_arm={"delay": delay, "noise": 0.2, "frame": FRAMES[frame]})
        on.data.qpos[:3] = np.radians(begin)
        with pytest.raises(SimulationError, match=r"^joint1 reads"):
            arm.execute(NONE, MOVEMENTS[0], RNG)
        assert np.abs(on.degrees() - begin).max() < 11


def test_an_arm_goes_to_rest_by_a_way_that_touches_nothing_or_not_at_all(tmp_path):
    model = upright(write(tmp_path / "arm.xml"))
    arm, on = on_table(model, outcome="site:tip:xz")
    on.data.qpos[:3] = np.radians([-15, 23, 96])  # its last link would sweep over the table if all joints moved at once
    arm.execute(NONE, arm.policies.sample(RNG), RNG)
    assert on.touches == 0
    arm, on = on_table(model, outcome="site:tip:xz")
    on.data.qpos[:3] = np.radians([85, 62, -97])  # below the table
    with pytest.raises(SimulationError, match=r"on the way to rest .* and table would touch; lead the arm"):
        arm.execute(NONE, arm.policies.sample(RNG), RNG)
    assert not on.torque


def test_a_movement_that_would_touch_the_table_is_not_executed_and_few_are_tried(tmp_path):
    built = upright(write(tmp_path / "built.xml", offsets=(2, -2, 2)))
    arm, on = on_table(upright(write(tmp_path / "arm.xml")), built, outcome="site:tip:xz", of_arm={"delay": 0.05})
    touched, refused = 0, []
    for k in range(25):
        before, commands = on.touches, len(on.sent)
        try:
            arm.execute(NONE, stream(k, "anything").random(13), RNG)
        except NotExecutedError as error:
            refused.append((str(error), len(on.sent) - commands))
        touched += on.touches > before
    assert touched <= 1
    assert len(refused) >= 10
    assert all(sent == 0 and "table" in told for told, sent in refused)
    for k in range(5):
        arm.execute(NONE, arm.policies.sample(stream(k, "random")), RNG)
    assert on.touches == 0
    assert on.torque


def test_movements_that_are_not_executed_do_not_end_a_run(tmp_path):
    class Careful(PlanarArm):
        def execute(self, context, theta, rng):
            raise NotExecutedError("it would hit the table")

    robot = Careful(3)
    made = list(run(random_exploration(robot, 0), robot, 0, movements=15))
    assert [episode.failed for episode in made] == ["it would hit the table"] * 15


def hang():
    time.sleep(60)


def test_a_driver_that_hangs_is_broken_off_after_its_patience_and_torque_is_switched_off(tmp_path, capfd):
    arm, on = on_table(write(tmp_path / "arm.xml"), patience=0.3)
    arm.execute(NONE, MOVEMENTS[0], RNG)
    on.events[on.clock.now + 0.3] = hang
    with pytest.raises(Overdue, match=r"the driver has not returned for 0\.3 s"):
        arm.execute(NONE, MOVEMENTS[0], RNG)
    assert not on.torque
    assert "the driver has not returned" in capfd.readouterr().err
    arm.execute(NONE, MOVEMENTS[0], RNG)


def test_the_first_ctrl_c_says_what_helps_if_the_driver_hangs_and_the_second_one_switches_torque_off(tmp_path, capfd):
    arm, on = on_table(write(tmp_path / "arm.xml"), patience=30.0)
    arm.execute(NONE, MOVEMENTS[0], RNG)
    on.events[on.clock.now + 0.3] = hang
    keys = [threading.Timer(seconds, interrupt) for seconds in (0.3, 0.6)]
    for key in keys:
        key.start()
    with pytest.raises(KeyboardInterrupt):
        arm.execute(NONE, MOVEMENTS[0], RNG)
    assert not on.torque
    assert capfd.readouterr().err.count("if the driver does not return, Ctrl-C once more switches torque off") == 1
