"""A robot from its model file: its outcome is where the model says, whatever the file; slips are told in a line."""

import os
import re
import sys
from functools import partial

import numpy as np
import pytest

from runs import about_of
from sgimd_torch import MujocoRobot, SimulationError, check_environment, stream
from sgimd_torch.extras.check.command import main as check
from sgimd_torch.extras.gymnasium.controllers import Sinusoids
from sgimd_torch.extras.recordings.units import moving
from sgimd_torch.extras.teach.leading import Leading
from sgimd_torch.extras.teach.led import hand_led_of
from sgimd_torch.extras.teach.lessons import lesson_by_hand
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import config_of, finished, read_run
from sgimd_torch.tasks import Task
from urdf import URDF

# An arm of two links of .3 m in the plane z = .05, a puck of radius .04 beside it, and a door.
ARM = """<mujoco>
  <option timestep=".005" integrator="implicitfast"/>
  <default><geom density="500"/><joint damping="1"/></default>
  <asset><mesh name="tooth" file="tooth.obj"/></asset>
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body name="upper" pos="0 0 .05"><joint name="shoulder" axis="0 0 1" range="-120 120"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
      <body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 0 1" range="-90 90"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
        <geom type="mesh" mesh="tooth" contype="0" conaffinity="0"/>
        <site name="tip" pos=".3 0 0"/></body></body>
    <body name="puck" pos=".4 .3 .03"><freejoint/><geom type="cylinder" size=".04 .03"/></body>
    <body name="door" pos="-1 0 .1"><joint name="hinge" axis="0 0 1"/><geom name="leaf" size=".1 .01 .05"/></body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="60" kv="6"/><position joint="elbow" kp="60" kv="6"/>
  </actuator>
  <keyframe><key name="bent" qpos="1 .5 .4 .3 .03 1 0 0 0 0"/></keyframe>
</mujoco>"""
TOOTH = "v 0 0 0\nv .01 0 0\nv 0 .01 0\nv 0 0 .01\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
LIMITS = np.deg2rad([120, 90])
CORNERS = {"low": (-1.0, -1.0), "high": (1.0, 1.0)}
IN_DEGREES = 'gainprm="1.047" biastype="affine" biasprm="0 -60 -6" ctrlrange="-90 90"'
NONE = np.zeros(0)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    absurd = {
        f"{name}.xml": ARM.replace("<worldbody>", f'<option timestep="{step}"/><worldbody>')
        for name, step in (("still", 0), ("fine", 1e-9))
    }
    absurd["slow.urdf"] = URDF.replace('velocity="5"', 'velocity="1e-6"')
    for name, text in {"arm.xml": ARM, "arm.urdf": URDF, "tooth.obj": TOOTH, **absurd}.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture
def here(files, monkeypatch):
    monkeypatch.chdir(files)
    return files


def steady(*angles, pace=0.5, limits=LIMITS):
    """The movement all of whose knots are at these angles (rad)."""
    return np.append(np.repeat([0.5 + angle / limit / 2 for angle, limit in zip(angles, limits, strict=True)], 4), pace)


@pytest.mark.parametrize(
    "options",
    [
        {"outcome": "site:tip:xy", "noise": 0.01, "durations": (0.3, 0.5)},
        {"outcome": "body:puck:xy", "context": "body:puck:x:.35:.45,body:puck:y:.2:.35", "threads": 2},
        {"outcome": "body:puck:yx,site:tip:x", "displacement": True, "keyframe": "bent"},
        {"outcome": "joint:elbow", "joints": ("elbow",), "n_knots": 6, "context": "joint:hinge:-.1:.1"},
        {"outcome": "geom:leaf:x", "low": (-2.0,), "high": (0.0,)},
        {"outcome": "site:tip:xy", "controller": partial(Sinusoids, frequencies=(0.2, 2.0)), "durations": (0.5, 0.8)},
        {"model": "arm.urdf", "outcome": "body:tool:xz"},
    ],
)
def test_a_robot_from_a_file_keeps_every_promise(here, options):
    check_environment(MujocoRobot(**{"model": "arm.xml", **options}))


@pytest.mark.parametrize(("shoulder", "elbow"), [(0.0, 0.0), (np.pi / 2, 0.0), (-0.5, 1.0)])
def test_the_tip_ends_where_the_joints_put_it(here, shoulder, elbow):
    robot = MujocoRobot("arm.xml", outcome="site:tip", low=(-1, -1, 0), high=(1, 1, 1))
    ended = robot.execute(NONE, steady(shoulder, elbow), stream(0, "x"))
    turned = np.cumsum([shoulder, elbow])
    assert ended == pytest.approx([0.3 * np.cos(turned).sum(), 0.3 * np.sin(turned).sum(), 0.05], abs=0.01)
    assert robot.outcomes.axis(2) == "tip z (m)"
    assert robot.rest == pytest.approx([0.6, 0, 0.05], abs=0.001)


def test_servos_are_made_for_a_urdf_and_hold_the_arm_against_gravity(here):
    robot = MujocoRobot("arm.urdf", outcome="joint:shoulder,joint:elbow", **CORNERS)
    assert robot.remarks[0] == "arm.urdf has no actuators: position servos were made for shoulder, elbow"
    ended = robot.execute(NONE, steady(0.6, -0.4, limits=(1, 1)), stream(0, "x"))
    assert ended == pytest.approx([0.6, -0.4], abs=0.06)
    assert robot.outcomes.axis(0) == "shoulder (rad)"


def test_a_command_in_another_unit_is_not_taken_for_the_position_of_its_joint(here):
    scaled = ARM.replace('<position joint="elbow" kp="60" kv="6"/>', f'<general joint="elbow" {IN_DEGREES}/>')
    (here / "scaled.xml").write_text(scaled)
    robots = {file: MujocoRobot(file, outcome="site:tip:xy", **CORNERS) for file in ("arm.xml", "scaled.xml")}
    assert [(robot.joints, robot.carries_outcome) for robot in robots.values()] == [
        (("shoulder", "elbow"), True),
        ((), False),
    ]


def test_meshes_of_a_ros_package_are_found_from_its_folder_on(here):
    (here / "urdf").mkdir()
    mesh = '<collision><geometry><mesh filename="package://arm/tooth.obj"/></geometry></collision>'
    (here / "urdf/toothed.urdf").write_text(URDF.replace('<link name="fore">', f'<link name="fore">{mesh}'))
    robot = MujocoRobot("urdf/toothed.urdf", outcome="body:tool:xz", **CORNERS)
    assert [path.name for path in robot.files] == ["tooth.obj", "toothed.urdf"]


def test_an_object_begins_where_its_context_says_and_stays_there_if_missed(here):
    place = "body:puck:x:.3:.5,body:puck:y:-.4:.4,joint:hinge:-1:1"
    robot = MujocoRobot("arm.xml", outcome="body:puck:xy,body:door:x", context=place, low=(-1, -1, -2), high=(1, 1, 1))
    assert robot.contexts.names == ("puck x", "puck y", "hinge (rad)")
    away = robot.execute([0.45, 0.35, 0.2], steady(-1.5, 0.0), stream(0, "x"))
    assert away == pytest.approx([0.45, 0.35, -1], abs=1e-3)
    hit = robot.execute([0.45, 0.1, 0.2], np.append([0, 0.3, 0.7, 1, 0.5, 0.5, 0.5, 0.5], 0.5), stream(0, "x"))
    assert hit[1] > 0.15
    shifted = MujocoRobot("arm.xml", outcome="body:puck:xy", context=place, displacement=True, **CORNERS)
    assert shifted.execute([0.45, 0.35, 0.2], steady(-1.5, 0.0), stream(0, "x")) == pytest.approx([0, 0], abs=1e-3)
    moved = shifted.execute([0.45, 0.1, 0.2], np.append([0, 0.3, 0.7, 1, 0.5, 0.5, 0.5, 0.5], 0.5), stream(0, "x"))
    assert moved == pytest.approx(hit[:2] - [0.45, 0.1])


def test_a_joint_that_was_not_chosen_holds_its_start_in_the_keyframe(here):
    robot = MujocoRobot("arm.xml", outcome="joint:shoulder", joints=("elbow",), keyframe="bent", low=(-2,), high=(2,))
    assert robot.policies.dim == 5
    assert robot.execute(NONE, np.array([0.0, 0.9, 0.1, 0.9, 0.3]), stream(0, "x")) == pytest.approx([1.0], abs=0.02)


def test_most_movements_end_in_the_task_space_that_was_found_and_a_remark_tells_it(here):
    robot = MujocoRobot("arm.xml", outcome="site:tip:xy", durations=(0.3, 0.5))
    rngs = [stream(7, "x", k) for k in range(60)]
    ended = robot.execute_many(np.zeros((60, 0)), np.stack([robot.policies.sample(rng) for rng in rngs]), rngs)
    assert robot.outcomes.contains(ended).mean() > 0.85
    low, high = (",".join(f"{x:g}" for x in corner) for corner in (robot.outcomes.low, robot.outcomes.high))
    assert f"--environment.low {low} --environment.high {high}" in robot.remarks[0]
    assert (robot.outcomes.sides < 1.6).all()


def test_noise_shifts_the_commands_by_its_share_of_their_range(here):
    robot = MujocoRobot("arm.xml", outcome="joint:elbow", noise=0.02, low=(-2,), high=(2,))
    ends = [robot.execute(NONE, steady(0, 0), stream(k, "x"))[0] for k in range(100)]
    assert np.std(ends) == pytest.approx(0.02 * np.pi, rel=0.25)
    assert robot.outcome_noise == pytest.approx(0.02 * np.pi, rel=0.3)


def test_a_thing_that_trembles_at_rest_was_not_moved(here):
    robot = MujocoRobot("arm.xml", outcome="body:puck:xy", **CORNERS)
    assert robot.outcome_noise == 1e-6  # m; with 0, a learner would take the trembling for effects of its movements
    rested = [robot.execute(NONE, steady(angle, 0), stream(0, "x")) for angle in (-1.0, -1.5, -2.0)]
    assert np.ptp(rested, axis=0) == pytest.approx(0, abs=robot.outcome_noise)
    check_environment(robot)


@pytest.mark.parametrize("options", [{}, {"displacement": True}])
def test_the_arm_is_drawn_from_its_base_to_the_outcome(here, options):
    robot = MujocoRobot("arm.xml", outcome="site:tip:xy", **CORNERS, **options)
    drawn = robot.trace(NONE, steady(0.5, 0.5), stream(0, "x"))
    assert drawn.chains[0][-1, -1] == pytest.approx(drawn.outcome)
    assert np.linalg.norm(np.diff(drawn.chains[0], axis=1)[:, 0], axis=1) == pytest.approx(0.3, abs=1e-3)


def test_the_thing_that_is_pushed_is_drawn_where_it_begins_and_where_it_ends(here):
    place = "body:puck:x:.3:.5,body:puck:y:-.4:.4"
    robot = MujocoRobot("arm.xml", outcome="body:puck:xy", context=place, **CORNERS)
    drawn = robot.trace([0.45, 0.1], np.append([0, 0.3, 0.7, 1, 0.5, 0.5, 0.5, 0.5], 0.5), stream(0, "x"))
    arm, puck, door, measured = drawn.chains
    assert [each.shape[1] for each in drawn.chains] == [3, 1, 1, 1]
    assert puck[0, 0] == pytest.approx([0.45, 0.1], abs=1e-3)
    assert puck[-1, 0] == pytest.approx(drawn.outcome)
    assert puck == pytest.approx(measured)
    assert door == pytest.approx(np.tile([-1, 0], (*door.shape[:2], 1)))
    assert np.linalg.norm(np.diff(arm, axis=1), axis=2) == pytest.approx(0.3, abs=1e-3)
    assert drawn.path[:, 0, :2] == pytest.approx(puck[:, 0])


def test_joints_are_drawn_in_the_plane_of_their_angles(here):
    robot = MujocoRobot("arm.xml", outcome="joint:elbow,joint:shoulder", low=(-2, -2), high=(2, 2), displacement=True)
    drawn = robot.trace(NONE, steady(0.5, -0.4), stream(0, "x"))
    (angles,) = drawn.chains
    assert angles[-1, 0] == pytest.approx(drawn.outcome)
    assert drawn.outcome == pytest.approx([-0.4, 0.5], abs=0.01)
    assert drawn.path.shape[1] == 0


def test_outcomes_are_located_in_the_world_from_where_the_movement_begins(here):
    places, context = "body:puck:yx,site:tip:z", "body:puck:x:.3:.5"
    there = MujocoRobot("arm.xml", outcome=places, low=(-1, -1, 0), high=(1, 1, 1), context=context)
    (puck, tip), _ = there.located([[0.2, 0.7, 0.4], [0.0, 0.0, 0.0]] @ np.eye(3), there.start_in([0.35]))
    assert puck == pytest.approx([0.7, 0.2, 0.03])
    assert tip == pytest.approx([0.6, 0, 0.4])
    shift = MujocoRobot("arm.xml", outcome=places, low=(-1, -1, -1), high=(1, 1, 1), context=context, displacement=True)
    ((puck, tip),) = shift.located(np.array([[0.2, 0.7, 0.4]]), shift.start_in([0.35]))
    assert puck == pytest.approx([0.35 + 0.7, 0.3 + 0.2, 0.03])
    assert tip == pytest.approx([0.6, 0, 0.05 + 0.4])


def test_what_was_found_is_given_to_the_next_robot_which_makes_no_movement(here, monkeypatch):
    options = {"model": "arm.xml", "outcome": "site:tip:xy", "noise": 0.01, "durations": (0.2, 0.4), "settle": 0.1}
    first = MujocoRobot(**options)
    assert first.found_options.keys() == {*MujocoRobot.FOUND_OPTIONS}
    monkeypatch.setattr(MujocoRobot, "_simulate", lambda *_: pytest.fail("it moved"))
    second = MujocoRobot(**options, **first.found_options)
    assert second.found_options == first.found_options
    assert second.outcome_noise == first.outcome_noise > 0
    assert second.remarks == []


@pytest.mark.slow
def test_a_run_needs_no_code_keeps_what_was_found_and_tells_which_file_of_the_model_has_changed(
    here, capsys, monkeypatch
):
    robot = "--environment mujoco --environment.model arm.xml --environment.outcome site:tip:xy --name kept"
    words = f"{robot} --algorithm random --repeats 0 --evaluate-at 20".split()
    assert command(main, [*words, "--movements", "20"]) == 0
    assert "T was found by 300 random movements" in capsys.readouterr().err
    folder = here / "runs/kept/seed-000"
    run = read_run(folder)
    assert {"file arm.xml", "file tooth.obj"} <= about_of(folder)["versions"].keys()
    assert config_of(run)["environment.outcome"] == "site:tip:xy"  # a text with a colon, but no code
    assert run.config["environment.low"] == run.spaces["outcomes"].low.tolist()
    monkeypatch.setattr(MujocoRobot, "_explored", lambda *_: pytest.fail("it explored"))
    assert finished(parse([*words, "--movements", "20"])[0])
    assert build(config_of(run)).environment.rest.tolist() == run.config["environment.rest"]
    (here / "tooth.obj").write_text(f"{TOOTH}# sharper\n")
    resume = [*words, "--movements", "30", "--resume"]
    assert command(main, resume) == 0
    assert "resumed with other versions: file tooth.obj crc32" in capsys.readouterr().err
    assert command(main, [*resume, "--environment.low=-2,-2", "--environment.high=2,2"]) == 2
    assert "environment.low was [" in capsys.readouterr().err
    assert command(check, ["mujoco", "--environment.model", "lost.xml"]) == 2
    assert "lost.xml cannot be read or written" in capsys.readouterr().err


def test_a_robot_made_by_a_function_of_the_user_has_no_options_to_keep(here):
    made_by = Config(parts={"environment": "planar-arm-7"})
    assert made_by.with_found(MujocoRobot("arm.xml", outcome="site:tip:xy", **CORNERS).found_options) == made_by


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"rest": (0.0,)}, "rest must have shape (..., 2)"),
        ({"rest": (5.0, 0.0), **CORNERS}, "rest of the environment"),
        ({"outcome_noise": -1.0, **CORNERS}, "outcome_noise of the environment must be a standard deviation"),
        ({"outcome": "site:tp"}, "outcome 'site:tp': the model has no site 'tp'; did you mean tip?"),
        ({"outcome": "site:puck"}, "the model has no site 'puck'; write body:puck"),
        ({"outcome": "tip"}, "write KIND:NAME, such as site:tip; kinds are site, body, geom, joint"),
        ({"outcome": ""}, "outcome is missing: it names what goals are about, such as site:tip, body:upper"),
        ({"outcome": "site:tip:xw"}, "'xw' are no axes"),
        ({"outcome": "site:tip"}, "tip z never changes; leave it out"),
        ({"outcome": "site:tip:x,joint:elbow"}, "mixes lengths (m) and angles (rad)"),
        ({"outcome": "geom:leaf"}, "0 of 300 random movements of arm.xml move leaf x, leaf y, leaf z, 0 diverge; put"),
        ({"joints": ("elbo",)}, "joints: 'elbo' is no joint with an actuator; did you mean elbow?"),
        ({"joints": ("hinge",)}, "'hinge' is no joint with an actuator"),
        ({"keyframe": "bend"}, "unknown keyframe of arm.xml 'bend'; did you mean bent?"),
        ({"context": "body:puck:0:1"}, "write body:NAME:AXIS:LOW:HIGH"),
        ({"context": "body:door:x:0:1"}, "only a body with a free joint has an axis x, y or z; else write joint:NAME"),
        ({"context": "joint:hinge:1:0"}, "1 and 0 must be two numbers, the lower one first"),
        ({"model": ""}, "model is missing: the path of an MJCF or URDF file"),
        ({"model": "tooth.obj"}, "tooth.obj cannot be used: "),
        ({"settle": -1.0}, "settle must be finite and >= 0"),
        ({"context": "joint:hinge:0:\u0661"}, "0 and \u0661 must be two numbers, the lower one first"),
        ({"joints": ("elbow", "elbow")}, "joints names 'elbow' 2 times"),
        ({"n_knots": 1}, "n_knots must be a whole number from 2 to 100, got 1"),
        ({"threads": 10**5}, "threads must be a whole number from 1 to 1024, got 100000"),
        ({"durations": (500.0, 1500.0)}, "1500 s and settle 0.5 s take 3e+05 steps at the model's timestep 0.005,"),
        ({"durations": (0.5, np.inf)}, "a movement of inf s and settle 0.5 s take inf steps"),
        ({"settle": 1e9}, "a movement of 1.5 s and settle 1e+09 s take 2e+11 steps"),
        ({"model": "still.xml"}, "take inf steps at the model's timestep 0, more than 100000"),
        ({"context": "joint:hinge:1_0:20"}, "1_0 and 20 must be two numbers, the lower one first"),
        ({"n_knots": 10**9}, "n_knots must be a whole number from 2 to 100, got 1000000000"),
        ({"model": "fine.xml"}, "take 2e+09 steps at the model's timestep 1e-09, more than 100000; durations, settle"),
        (
            {"model": "slow.urdf", "outcome": "body:tool:xz"},
            "more than 100000; durations, settle and timestep are in s",
        ),
        ({"low": (0.0, 0.0, 0.0), "high": (1.0, 1.0)}, "low must have shape (..., 2)"),
    ],
)
def test_a_slip_is_told_in_one_line(here, options, said):
    with pytest.raises(ValueError, match=re.escape(said)) as raised:
        MujocoRobot(**{"model": "arm.xml", "outcome": "site:tip:xy", **options})
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("model", "element"),
    [
        ("arm.xml", '<include file="{}"/>'),
        ("arm.xml", '<include file="deeper.xml"/>'),
        ("arm.xml", '<compiler assetdir="parts"/><asset><mesh name="m" file="../{}"/></asset>'),
        ("arm.xml", '<asset><texture type="cube" fileright="{}"/></asset>'),
        ("arm.urdf", '<link name="more"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'),
    ],
)
def test_a_pipe_in_a_model_is_refused_and_keeps_nobody_waiting(here, tmp_path, monkeypatch, model, element):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "deeper.xml").write_text('<mujocoinclude><include file="pipe.stl"/></mujocoinclude>')
    text, last = (here / model).read_text(), "</mujoco>" if model == "arm.xml" else "</robot>"
    (tmp_path / model).write_text(text.replace(last, element.format("pipe.stl") + last))
    with pytest.raises(OSError, match=r"pipe\.stl is a pipe or a device, not a file"):
        MujocoRobot(model, outcome="site:tip:xy")


def test_without_the_package_the_menagerie_is_refused_with_what_to_install(here, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(ValueError, match="menagerie:aloha needs a package that is not installed: pip install"):
        MujocoRobot("menagerie:aloha", outcome="site:tip")


def test_a_model_that_diverges_is_told(here):
    (here / "stiff.xml").write_text(ARM.replace('kp="60" kv="6"', 'kp="1e7"').replace("implicitfast", "Euler"))
    with pytest.raises(ValueError, match=r"0 of 300 random .* tip y, 300 diverge; write a shorter timestep"):
        MujocoRobot("stiff.xml", outcome="site:tip:xy")
    robot = MujocoRobot("stiff.xml", outcome="site:tip:xy", **CORNERS)
    with pytest.raises(SimulationError, match="the simulation diverged in context"):
        robot.execute(NONE, steady(1.0, 1.0), stream(0, "x"))


def test_an_arm_is_led_by_its_tip_to_where_its_movement_then_ends(here):
    robot = MujocoRobot("arm.xml", outcome="site:tip:xy", context="body:puck:x:-.5:-.4", keyframe="bent", **CORNERS)
    leading = Leading(hand_led_of(Task(robot)))
    assert leading.q == pytest.approx([1.0, 0.5], abs=1e-6)
    leading.grab()
    leading.begin_recording()
    for _ in range(60):
        leading.drag([0.45, 0.2, 0.05])
        leading.step(0.02)
    lesson = lesson_by_hand(*moving(*leading.end_recording()), Task(robot), stream(0, "x"))
    assert lesson.demonstration.outcome == pytest.approx([0.45, 0.2], abs=0.03)


@pytest.mark.parametrize(("sites", "hand"), [("", "tip"), ('<site name="wrist"/>', "wrist"), (None, "unnamed_2")])
def test_an_arm_that_pushes_is_led_by_its_outermost_site_or_else_by_its_last_body(here, sites, hand):
    arm = ARM.replace('<body name="fore" pos', "<body pos")
    tip = '<site name="tip" pos=".3 0 0"/>'
    (here / "pushing.xml").write_text(arm.replace(tip, f"{sites}{tip}" if sites is not None else ""))
    pushing = MujocoRobot("pushing.xml", outcome="body:puck:xy", **CORNERS)
    led = hand_led_of(Task(pushing))
    assert led.hand == hand
    Leading(led).grab()
