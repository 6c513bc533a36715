"""An arm on a table moves as its model does in MuJoCo, within its limits; torque is off after anything goes wrong."""

import io
import re
import warnings
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import arms
from arms import interrupt, on_table, write
from sgimd_torch import MujocoRobot, SimulationError, stream
from sgimd_torch.__main__ import _call
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.protocol import check_robot
from sgimd_torch.extras.lerobot.arm import LeRobotArm
from sgimd_torch.runs.directory import code_of
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

NONE, RNG = np.zeros(0), stream(0, "arm")
FAR = np.append(np.repeat([1.0, 0.8, 0.6], 4), 0.0)  # a theta that bends all joints at once
QUIET = 0.1  # s until torque must be off
LATE = 0.05  # s, delay of the stand-in, which a stall is given, too


@pytest.fixture
def model(tmp_path):
    return write(tmp_path / "arm.xml")


def motion(table):
    """Times (s), commands and measured positions (rad) of all that was sent."""
    times, values, measured = zip(*table.sent, strict=True)
    return np.array(times), np.radians(values), np.radians(measured)


# What the motors read, and how many degrees one unit is: also ranges of the joints' -100 to 100 degrees.
UNITS = {"deg": 1.0, "-100:100": 1.0, "50:-50": -2.0, "deg,joint1=rad": np.array([1, 180 / np.pi, 1])}


@pytest.mark.parametrize("units", UNITS)
def test_an_arm_without_faults_does_what_its_model_does_in_mujoco_in_any_unit(model, units):
    arm, _ = on_table(model, units=units, speed=30.0, step=2.0, of_arm={"unit": UNITS[units]})
    simulated = MujocoRobot(model, outcome="site:tip:xy", low=(-0.7, -0.7), high=(0.7, 0.7), durations=(1.0, 2.0))
    check_robot(arm)
    for theta in [arm.policies.sample(RNG) for _ in range(4)]:
        outcome = arm.execute(NONE, theta, RNG)
        assert outcome == pytest.approx(simulated.execute(NONE, theta, RNG), abs=1e-3)


def test_the_arm_keeps_rate_speed_and_step_and_goes_back_to_rest(model):
    arm, on = on_table(model, rate=40.0, speed=1.5, step=0.1)
    arm.execute(NONE, FAR, RNG)
    times, commands, measured = motion(on)
    assert np.diff(times) == pytest.approx(1 / 40, abs=1e-5)
    assert np.abs(np.diff(commands, axis=0)).max() == pytest.approx(1.5 / 40, rel=1e-5)
    assert np.abs(commands - measured).max() == pytest.approx(0.1)
    assert on.data.qpos[:3] == pytest.approx(0, abs=0.01)
    assert on.torque


def test_a_slow_arm_keeps_the_times_of_a_movement_and_tells_its_rate_once(model):
    arm, _ = on_table(model, speed=30.0, step=2.0, of_arm={"answers": 0.02})
    outcome = on_table(model, speed=30.0, step=2.0)[0].execute(NONE, FAR, RNG)
    with pytest.warns(RuntimeWarning, match="the arm takes 25 commands a second, not 50") as told:
        again = [arm.execute(NONE, FAR, RNG) for _ in range(2)]
    assert len(told) == 1
    assert again == pytest.approx(np.array([outcome, outcome]), abs=0.01)


FAULTS = {  # what happens in mid-movement, and the reason of the failure
    "Ctrl-C": (lambda on: interrupt(), "stopped by SIGINT"),
    "a stall": (lambda on: setattr(on, "jammed", True), "joint0 stalls at .* on its way to"),
    "a motor that is overloaded": (lambda on: setattr(on, "overloaded", True), "Overload"),
    "an error of the robot": (lambda on: setattr(on, "talk", lambda: {}["joint1.pos"]), "joint1.pos"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_torque_is_off_soon_after_anything_goes_wrong_and_the_next_movement_goes_on(model, fault):
    happens, reason = FAULTS[fault]
    arm, on = on_table(model, step=0.1, of_arm={"noise": 0.1})
    arm.execute(NONE, FAR, RNG)
    at = on.clock.now + 0.3
    on.events[at] = partial(happens, on)
    errors = KeyboardInterrupt if fault == "Ctrl-C" else (SimulationError, KeyError, RuntimeError)
    warnings.filterwarnings("ignore", "torque may be on")  # an overloaded motor does not confirm it
    with pytest.raises(errors) as failed:
        arm.execute(NONE, FAR, RNG)
    assert re.search(reason, str(failed.value.__context__ if fault == "Ctrl-C" else failed.value))
    assert not on.torque
    assert at <= on.switched_off <= at + QUIET + (fault == "a stall") * LATE
    on.jammed = on.overloaded = False
    vars(on).pop("talk", None)
    on.clock.now += 1.0
    arm.execute(NONE, FAR, RNG)
    assert np.abs(motion(on)[1] - motion(on)[2]).max() < 0.12  # no jump back, wherever it lies


def test_a_hot_motor_cools_down_without_torque_before_the_next_movement(model):
    arm, on = on_table(model)
    on.events |= {1.0: lambda: setattr(on, "temperature", 61.0), 50.0: lambda: setattr(on, "temperature", 55.0)}
    with (
        pytest.warns(RuntimeWarning, match="above 60; torque is off until it has cooled down to 55"),
        pytest.raises(SimulationError, match="joint2 is at 61 degrees C"),
    ):
        arm.execute(NONE, FAR, RNG)
    assert on.switched_off < 5
    assert 50 < on.clock.now < 53
    assert on.sent[-1][0] < 5
    arm.execute(NONE, FAR, RNG)


def test_lost_packets_do_not_matter(model):
    outcomes = [on_table(model, of_arm={"lost": lost})[0].execute(NONE, FAR, RNG) for lost in (0.0, 0.05)]
    assert outcomes[0] == pytest.approx(outcomes[1], abs=0.01)


def test_an_unplugged_arm_fails_and_says_that_torque_may_be_on_until_it_is_plugged_in_again(model):
    arm, on = on_table(model)
    on.events[0.5] = lambda: setattr(on, "unplugged", True)
    with pytest.warns(RuntimeWarning, match="torque may be on, switch off"), pytest.raises(ConnectionError):
        arm.execute(NONE, FAR, RNG)
    assert on.asked_off < 0.5 + QUIET
    with pytest.warns(RuntimeWarning), pytest.raises(ConnectionError, match="no such port"):
        arm.execute(NONE, FAR, RNG)
    on.unplugged = False
    assert arm.execute(NONE, FAR, RNG) == pytest.approx(on_table(model)[0].execute(NONE, FAR, RNG), abs=0.01)


def see(observation):
    """A camera that sees a puck where joint0 points, up to 50 degrees."""
    if observation["joint0.pos"] > 50:
        raise LookupError("the puck is hidden")
    return np.radians([observation["joint0.pos"], 0])


def test_a_function_sees_the_outcome_and_when_it_fails_the_arm_goes_back_with_its_torque(model):
    arm, on = on_table(model, outcome="body:puck:xy", seen_by=f"{__name__}:see", joints=("joint0",))
    half, all_ = (np.append(np.repeat(0.5 + degrees / 200, 4), 0.0) for degrees in (40, 60))
    assert arm.execute(NONE, half, RNG) == pytest.approx([np.radians(40), 0], abs=0.01)
    with pytest.raises(SimulationError, match="not seen: LookupError: the puck is hidden"):
        arm.execute(NONE, all_, RNG)
    assert on.torque
    assert on.data.qpos[:3] == pytest.approx(0, abs=0.01)  # the other motors held still


SOUND = {"robot": "arms:make", "units": "deg,joint2=0:100", "outcome": "site:tip:x", "low": (-1.0,), "high": (1.0,)}
REFUSED = {
    "robot is missing": {"robot": ""},
    "robot: arms has no robt": {"robot": "arms:robt"},
    "so101 is a robot of LeRobot: pip install": {"robot": "so101"},
    "units is missing": {"units": ""},
    "units has none for joint0, joint2": {"units": "joint1=deg"},
    "joint2.pos reads 0:100, not rad: units joint2=0:100": {"units": "deg,joint2=rad"},
    "no joint is named gripper": {"units": "deg,gripper=0:100"},
    "unknown motor 'turn'; known are joint0.pos": {"motors": ("joint0", "joint1", "turn")},
    "motors must name one for each of joint0, joint1, joint2": {"motors": ("joint0", "joint1")},
    "the joints do not say where body:puck:x is; seen_by": {"outcome": "body:puck:x"},
    "speed must be finite and above 0, got 0": {"speed": 0.0},
}


def test_code_that_drives_or_sees_the_arm_is_executed_only_if_it_is_trusted():
    settings = {"environment": "lerobot", "environment.robot": "lab:make", "environment.seen_by": "camera:puck"}
    assert code_of(settings) == ["camera:puck", "lab:make"]


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_work_is_refused_before_anything_moves(model, message):
    _, on = on_table(model)
    on.motors = {"joint2": SimpleNamespace(norm_mode=SimpleNamespace(value="range_0_100"))}  # as of LeRobot's buses
    with pytest.raises((ValueError, ImportError), match=message):
        LeRobotArm(model=str(model), **SOUND | REFUSED[message])
    assert not on.is_connected


def sgimd(*words):
    return command(_call, [*map(str, words)])


def hand(time):
    """Somebody leads the arm after a second, for 1.5 s (degrees)."""
    return np.radians(np.array([40, 30, 20]) * np.sin(np.pi / 2 * np.clip((time - 1) / 1.5, 0, 1)))


def test_a_movement_led_by_hand_becomes_a_lesson(model, tmp_path, monkeypatch, capsys):
    arm, on = on_table(model)
    monkeypatch.setattr(arms, "led", lambda: arm, raising=False)
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    on.hand = hand
    assert sgimd("demonstrations", "record", "--environment", "arms:led", "--out", tmp_path / "led.npz") == 0
    assert "led.npz: movement 1, 1.38 s, outcome (0.222, 0.516), misfit 0.007 rad" in capsys.readouterr().out
    assert not on.torque
    (shown,) = load_demonstrations(tmp_path / "led.npz")
    assert shown.trajectory[-1] == pytest.approx(hand(9.0), abs=0.01)
    on.hand = None
    assert arm.execute(NONE, arm.correspondence(shown.times, shown.trajectory), RNG) == pytest.approx(
        shown.outcome, abs=0.02
    )


@pytest.mark.slow
def test_a_run_that_begins_with_its_simulator_and_is_stopped_in_mid_movement_goes_on(tmp_path, monkeypatch):
    model = write(tmp_path / "model.xml")
    arm, on = on_table(model, write(tmp_path / "real.xml", (0.21, 0.19, 0.2), (2.0, -3.0, 1.0)))
    monkeypatch.setattr(arms, "lab", lambda: arm, raising=False)
    monkeypatch.chdir(tmp_path)
    often = "--evaluate-at [] --movements"
    simulated = "--environment.model model.xml --environment.outcome site:tip:xy --environment.durations 1,2"
    box = "--environment.low=-0.7,-0.7 --environment.high=0.7,0.7"
    assert sgimd(*f"run --environment mujoco {simulated} {box} {often} 60 --out simulated".split()) == 0
    past = "--begin-with simulated/practice/seed-000/run.sqlite"
    words = f"run --environment arms:lab {often} 12 {past} --name real".split()
    on.events[20.0] = interrupt
    assert sgimd(*words) == 130
    assert on.switched_off == pytest.approx(20.0, abs=QUIET)
    before = read_run("runs/real/seed-000")
    assert [*before.failed] == [False] * (len(before.failed) - 1) + [True]
    assert sgimd(*words, "--resume") == 0
    after = read_run("runs/real/seed-000")
    assert (len(after.failed), after.failed.sum()) == (12, 1)
    np.testing.assert_array_equal(after.outcomes[: len(before.outcomes)], before.outcomes)
