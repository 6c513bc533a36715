"""Model files that nobody made for this library: where movements begin, what the servos do, what a user is told."""

import re
import warnings

import mujoco
import numpy as np
import pytest

from marks import slow
from sgimd_torch import MujocoRobot, check_environment, stream
from sgimd_torch.__main__ import _call
from sgimd_torch.extras.models.posture import NEAR, nearest_posture
from sgimd_torch.runs.program import command
from sgimd_torch.tasks import Task, benchmark_of
from sgimd_torch.tasks.goals import goals_all_over, goals_within_reach
from urdf import URDF

# Two links of .3 m under gravity, with motors; the second one begins outside its range, and carries a pole that swings.
ARM = """<mujoco><option timestep=".004"/>
  <worldbody><body name="base"><geom size=".03"/><site name="root"/>
    <body name="upper arm"><joint name="r:1" axis="0 1 0" range="-150 150"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
      <body name="fore" pos=".3 0 0"><joint name="r:2" axis="0 1 0" range="20 150"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="r:tip:x" pos=".3 0 0"/>
        <body name="pole" pos=".3 0 0"><joint name="swing" axis="0 1 0" damping=".01"/>
          <geom size=".01" pos="0 0 -.05" contype="0" conaffinity="0"/></body></body></body></body></worldbody>
  <actuator><motor joint="r:1" ctrlrange="-20 20"/><motor joint="r:2" ctrlrange="-10 10"/></actuator></mujoco>"""
PULLED = """<mujoco><worldbody>
    <body name="cart"><joint name="x" type="slide" axis="1 0 0" range="-1 1"/><geom size=".1"/>
    <site name="hand"/><body name="claw"><joint name="grip" range="0 1"/><geom size=".02" pos=".2 0 0"/></body></body>
    <body name="puller" mocap="true"/></worldbody>
  <equality><weld body1="puller" body2="cart"/></equality>
  <actuator><position joint="grip" kp="5"/></actuator></mujoco>"""
CART = """<mujoco><worldbody><body name="cart"><joint name="x" type="slide" axis="1 0 0"/><geom size=".1"/></body>
  </worldbody><actuator><motor joint="x" ctrlrange="-1 1"/></actuator></mujoco>"""
BALL = '<link name="tool"><collision><geometry><sphere radius="0"/></geometry></collision></link>'
LOST = (
    '<link name="x"><collision><geometry><mesh filename="package://lost/a.stl"/></geometry></collision></link>'
    '<joint name="y" type="fixed"><parent link="upper"/><child link="x"/></joint></robot>'
)
# A wheel that its motor turns slowly, for its damping, and a light one with more damping than a stiff servo would bear.
SLOW = """<mujoco><option timestep=".0025"/><worldbody>
    <body name="wheel"><joint name="wheel" range="-90 90" damping="4"/><geom size=".1"/>
      <site name="rim" pos=".1 0 0"/></body>
    <body pos="1 0 0"><joint name="light" range="-90 90" damping="10"/><geom size=".02"/></body></worldbody>
  <actuator><motor joint="wheel" ctrlrange="-5 5"/><motor joint="light"/></actuator></mujoco>"""
# A ship that floats, with a mast on a ball joint and a flap that a tendon pulls.
SHIP = """<mujoco><compiler settotalmass="1"/><option gravity="0 0 0"/><worldbody>
    <body name="ship"><freejoint name="afloat"/><geom size=".1"/>
      <body pos="0 0 .2"><joint name="mast" type="ball"/><geom size=".02"/>
        <body><joint name="flap" range="-60 60" axis="0 1 0"/><geom size=".01" pos=".1 0 0"/></body></body></body>
  </worldbody><tendon><fixed name="rope"><joint joint="flap" coef="1"/></fixed></tendon>
  <actuator><motor tendon="rope" ctrlrange="-1 1"/></actuator></mujoco>"""
GATE = """<mujoco><option gravity="0 0 0"/><worldbody>
    <body name="turner"><joint name="turn" range="-60 60" damping="1"/>
      <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01"/></body>
    <body pos=".1 .155 0"><joint name="gate" damping=".1"/>
      <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01"/></body></worldbody>
  <actuator><motor joint="turn"/></actuator></mujoco>"""
KEY = '<keyframe><key name="Home" qpos=".3 .7 0"/></keyframe>'
NONE = np.zeros(0)
WIDE = {"low": (-1.0, -1.0), "high": (1.0, 1.0)}


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pieces = ("arm.xml", ARM), ("arm.urdf", URDF), ("pulled.xml", PULLED), ("arm.sdf", "<sdf/>")
    pieces += ("slow.xml", SLOW), ("ship.xml", SHIP), ("gate.xml", GATE), ("cart.xml", CART)
    for name, text in pieces:
        (tmp_path / name).write_text(text)
    return tmp_path


def test_an_arm_with_motors_begins_within_its_ranges_holds_still_and_goes_where_it_is_told(here):
    robot = MujocoRobot("arm.xml", outcome="joint:r:1,joint:r:2", low=(-3, -3), high=(3, 3), durations=(0.5, 1.0))
    assert robot.start == pytest.approx([0, np.deg2rad(20)])
    assert robot.joints == robot.primitive.joints.names == ("r:1", "r:2")
    assert robot.rest == pytest.approx(robot.start, abs=0.01)
    theta = robot.policies.sample(stream(0, "theta"))
    commands = robot.primitive.at(theta, np.array([0.0, 100.0]))
    assert commands[0] == pytest.approx(robot.start)
    assert robot.execute(NONE, theta, stream(0, "x")) == pytest.approx(commands[1], abs=0.05)
    said = "\n".join(robot.remarks)
    for words in ("motors that are no servos: position servos were made for r:1, r:2", "r:2 outside the range",
                  "without an actuator, so they move freely: swing", "equal parts of T"):  # fmt: skip
        assert words in said
    check_environment(robot)
    kept = MujocoRobot("arm.xml", outcome="joint:r:1,joint:r:2", durations=(0.5, 1.0), **robot.found_options)
    assert kept.execute(NONE, theta, stream(0, "x")).tolist() == robot.execute(NONE, theta, stream(0, "x")).tolist()


def test_the_motors_of_the_file_let_it_fall_and_a_remark_says_so(here):
    robot = MujocoRobot("arm.xml", outcome="site:r:tip:x:xz", servos="file", low=(-1, -1), high=(1, 1))
    assert robot.joints == ()
    (falls,) = (remark for remark in robot.remarks if "holding still, what is measured moves by" in remark)
    assert falls.endswith("--environment.servos made holds it")


def test_a_free_base_that_falls_and_an_outcome_that_never_changes_are_told_before_the_first_movement(here):
    (here / "ship.xml").write_text(SHIP.replace("0 0 0", "0 0 -9.81", 1))
    ship, arm = (
        " ".join(MujocoRobot(name, outcome=place, low=[-9] * 3, high=[9] * 3).remarks)
        for name, place in (("ship.xml", "body:ship"), ("arm.xml", "site:r:tip:x:xyz"))
    )
    assert "its base is free: write a floor into the model" in ship
    assert "its base is free" not in arm
    assert "r:tip:x y (m) never changes; leave it out" in arm


def test_an_attribute_whose_prefix_has_no_namespace_is_read_as_mujoco_reads_it(here):
    (here / "arm.urdf").write_text(URDF.replace('effort="30"', 'drake:acceleration="2" effort="30"'))
    robot = MujocoRobot("arm.urdf", outcome="body:tool:xz", low=(-1, -1), high=(1, 1))
    assert robot.joints == ("shoulder", "elbow")


def test_a_definition_of_xacro_that_nothing_refers_to_does_no_harm(here):
    (here / "arm.urdf").write_text(URDF.replace("<link", '<xacro:property name="width" value=".2"/><link', 1))
    assert MujocoRobot("arm.urdf", outcome="body:tool:xz", low=(-1, -1), high=(1, 1)).joints == ("shoulder", "elbow")


def test_an_error_of_an_included_file_is_told_with_the_file(here):
    (here / "options.xml").write_text('<mujoco><option apirate="200"/></mujoco>')
    (here / "assets.xml").write_text('<mujoco><asset><texture name="sky" file="sky.png"/></asset></mujoco>')
    included = '<mujoco><include file="options.xml"/><include file="assets.xml"/>'
    (here / "arm.xml").write_text(ARM.replace("<mujoco>", included))
    with pytest.raises(ValueError, match=r"unrecognized attribute: 'apirate'.*; see the included file options\.xml$"):
        MujocoRobot("arm.xml", outcome="site:r:tip:x:xz")


def test_what_slides_without_a_range_is_not_said_to_be_held_by_servos(here):
    (here / "cart.xml").write_text(CART.replace("<worldbody>", '<option gravity="1 0 0"/><worldbody>'))
    robot = MujocoRobot("cart.xml", outcome="body:cart:x", servos="file", low=(-1,), high=(1,))
    (falls,) = (remark for remark in robot.remarks if "holding still" in remark)
    assert "servos" not in falls


def test_a_keyframe_named_home_is_the_start(here):
    (here / "arm.xml").write_text(ARM.replace("<actuator>", KEY + "<actuator>"))
    robot = MujocoRobot("arm.xml", outcome="site:r:tip:x:xz", low=(-1, -1), high=(1, 1))
    assert robot.start == pytest.approx([0.3, 0.7])


@pytest.mark.parametrize("around", [b"%s", b'\n<?xml version="1.0"?>\n%s\r\n\0'])
def test_no_movement_exceeds_the_speeds_of_a_urdf_whatever_blanks_are_around_it(here, around):
    (here / "arm.urdf").write_bytes(around % URDF.encode())
    robot = MujocoRobot(
        "arm.urdf", outcome="joint:shoulder", joints=("shoulder",), low=(-1,), high=(1,), durations=(0.05, 0.1)
    )
    times, commands = robot.primitive.trajectory(np.array([0, 0, 1, 1, 0.0]), rate=500)
    speeds = np.abs(np.diff(commands, axis=0)).max(axis=0) / np.diff(times)[0]
    assert (speeds < 5.01).all()
    assert speeds.max() > 2


def test_a_joint_with_more_than_a_turn_begins_where_the_file_says_and_reaches_each_posture_once(here):
    free = ARM.replace('range="-150 150"', "").replace('range="20 150"', 'range="-600 600"')
    (here / "arm.xml").write_text(free.replace("<actuator>", KEY.replace(".3 .7", "4 10") + "<actuator>"))
    robot = MujocoRobot("arm.xml", outcome="site:r:tip:x:xz", low=(-1, -1), high=(1, 1))
    box = robot.primitive.joints
    assert robot.start == pytest.approx([4, 10])
    assert box.low == pytest.approx([4 - np.pi, np.deg2rad(600) - 2 * np.pi])
    assert box.high == pytest.approx([4 + np.pi, np.deg2rad(600)])


def test_damping_neither_leaves_a_light_joint_behind_nor_asks_a_motor_for_more_than_it_has(here):
    robot = MujocoRobot("slow.xml", outcome="joint:wheel,joint:light", low=(-2, -2), high=(2, 2))
    theta = np.array([0.5, 0.5, 0.9, 0.9] * 2 + [0.0])
    times, commands = robot.primitive.trajectory(theta, rate=500)
    assert np.abs(np.diff(commands[:, 0])).max() / np.diff(times)[0] < 5 / 4  # force over damping
    assert robot.execute(NONE, theta, stream(0, "x")) == pytest.approx(commands[-1], abs=0.02)


def test_a_floating_base_and_a_ball_joint_move_freely_and_a_joint_that_a_tendon_pulls_does_not(here):
    robot = MujocoRobot("ship.xml", outcome="body:ship:x", low=(-1,), high=(1,))
    assert "without an actuator, so they move freely: afloat, mast" in robot.remarks
    with warnings.catch_warnings(record=True) as heard:  # MuJoCo 3.11 does not warn of settotalmass
        warnings.simplefilter("always")
        mujoco.MjSpec.from_string(SHIP).compile()
    told = [remark.partition(": ")[2] for remark in robot.remarks if remark.startswith("warning: ")]
    assert told == [*dict.fromkeys(str(warning.message) for warning in heard)]


def test_a_place_that_moves_by_millimetres_keeps_every_promise(here):
    (here / "slow.xml").write_text(SLOW.replace('pos=".1 0 0"', 'pos=".003 0 0"'))
    check_environment(MujocoRobot("slow.xml", outcome="site:rim:xy", durations=(0.2, 0.4), settle=0.2))


def test_a_thing_that_few_movements_reach_is_told(here):
    robot = MujocoRobot("gate.xml", outcome="joint:gate")
    assert any("random movements of gate.xml move gate, so little is learnt: put" in line for line in robot.remarks)


def test_links_that_touch_are_moved_apart_by_the_shortest_way():
    balls = "".join(
        f'<body pos="{x} 0 0"><joint type="slide" axis="1 0 0"/><geom size=".05"/></body>' for x in (0, 0.06)
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")
    found = nearest_posture(model, np.zeros(2), [0, 1], [1, 2], set())
    assert found == pytest.approx([-0.02 - NEAR / 2, 0.02 + NEAR / 2], abs=1e-3)


def test_servos_that_are_made_take_the_place_of_tendons_too(here):
    tendon = '<tendon><fixed name="t"><joint joint="r:1" coef="1"/></fixed></tendon>'
    pulls = f'{tendon}<actuator><motor tendon="t" ctrlrange="-1 1"/>'
    (here / "arm.xml").write_text(ARM.replace("<actuator>", pulls))
    robot = MujocoRobot("arm.xml", outcome="site:r:tip:x:xz", servos="made", low=(-1, -1), high=(1, 1))
    assert robot.joints == ("r:1", "r:2")


def test_links_that_touch_in_every_posture_do_not_move_the_start(here):
    (here / "fat.xml").write_text("""<mujoco><worldbody><body name="base"><geom size=".05"/>
        <body name="one" pos=".02 0 0"><joint name="a"/><geom size=".01"/>
          <body name="two" pos=".02 0 0"><joint name="b"/><geom type="capsule" fromto="0 0 0 .2 0 0" size=".03"/>
        </body></body></body></worldbody></mujoco>""")
    robot = MujocoRobot("fat.xml", outcome="body:two:xy", low=(-1, -1), high=(1, 1))
    assert robot.start == pytest.approx(0)
    assert "contacts in the start posture are left out: base and two" in robot.remarks


def test_an_arm_that_a_mocap_body_pulls_is_moved_by_its_joints_if_asked_for(here):
    robot = MujocoRobot("pulled.xml", outcome="site:hand:x", servos="made", low=(-1,), high=(1,))
    assert robot.joints == ("grip", "x")
    ended = robot.execute(NONE, np.array([0.5] * 4 + [0.9] * 4 + [1.0]), stream(0, "x"))
    assert ended == pytest.approx([0.8], abs=0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"outcome": "site:root"}, "no joint moves it, is it on the base? A place of the arm is site:r:tip:x"),
        ({"outcome": "site:r:tup:x"}, "the model has no site 'r:tup'; did you mean r:tip:x?"),
        ({"joints": ("r:1", "r:1")}, "joints names 'r:1' 2 times"),
        ({"model": "pulled.xml", "outcome": "site:hand:x"}, "a mocap body holds cart; --environment.servos made moves"),
        ({"model": "arm.sdf"}, "arm.sdf is an SDF file; MuJoCo reads MJCF and URDF"),
        ({"servos": "mad"}, "unknown servos 'mad'; did you mean made?"),
        ({"posture": (0.0,)}, "posture must have shape (..., 3)"),
        ({"model": "cart.xml", "outcome": "body:cart:x"}, "slides without a range stay where they are: x;"),
        ({"model": "gate.xml", "outcome": "body:turner", "low": (), "high": ()}, "does it lie on the axis"),
        ({"outcome": "site:r:tip:x:x,site:r:tip:x:xz"}, "names a coordinate twice"),
        ({"outcome": "joint:r:1,joint:r:1"}, "names a coordinate twice"),
        ({"context": "joint:swing:0:1,joint:swing:0:1"}, "names a position twice"),
    ],
)  # fmt: skip
def test_a_slip_is_told_with_its_cause(here, options, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        MujocoRobot(**{"model": "arm.xml", "outcome": "site:r:tip:x:xz", "low": (-1, -1), "high": (1, 1), **options})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('ixx=".01"', 'ixx=".1"'), 'write <mujoco><compiler balanceinertia="true"/></mujoco> into arm.urdf'),
        (
            ('mass value="1"', 'mass value="0"'),
            'write <mujoco><compiler boundmass="1e-4" boundinertia="1e-6"/></mujoco>',
        ),
        (("</robot>", LOST), "put the folder lost there"),
        (("</robot>", LOST.replace("package://lost/a.stl", "tool.dae")), "convert it, or leave it out"),
        (("</robot>", LOST.replace("package://lost/a.stl", "tool.stl")), "put it beside the model, or into"),
        (("0.3 0 0", "${length} 0 0"), "is a template of xacro; give its result: xacro arm.urdf > robot.urdf"),
        (('<link name="base"/>', '<xacro:base/><link name="base"/>'), "is a template of xacro"),
        (('<link name="base"/>', ""), 'each parent and child needs a link, also the world: <link name="world"/>'),
        (('iyy=".01" izz=".01"', 'iyy=".01" izz="-.01"'), "correct its ixx, iyy and izz"),
        (('<link name="tool"/>', BALL), 'leave out what has no size, such as <sphere radius="0"/>'),
    ],
)
def test_what_mujoco_refuses_in_a_urdf_is_told_with_where_to_write_the_cure(here, change, said):
    (here / "tool.dae").write_text("<COLLADA/>")
    (here / "arm.urdf").write_text(URDF.replace(*change))
    with pytest.raises(ValueError, match=re.escape(said)):
        MujocoRobot("arm.urdf", outcome="body:upper:xz")


@pytest.mark.parametrize(
    "huge",
    [
        '<worldbody><replicate count="3000"><replicate count="1000"><body/></replicate></replicate></worldbody>',
        '<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>',
        "<worldbody>" + '<body><geom size=".1"/></body>' * 300_000 + "</worldbody>",
    ],
)
def test_a_model_that_is_too_large_for_memory_or_patience_is_refused_before_it_is_made(here, huge):
    (here / "huge.xml").write_text(f"<mujoco>{huge}</mujoco>")
    with pytest.raises(ValueError, match=r"huge\.xml has more than 100000 elements, or 1e\+08 heights of a field"):
        MujocoRobot("huge.xml", outcome="body:arm")


def test_goals_lie_where_postures_without_contacts_put_the_place(here):
    walled = ARM.replace("</worldbody>", '<geom type="plane" size="2 2 .1" pos="0 0 -.1"/></worldbody>')
    (here / "walled.xml").write_text(walled, encoding="utf-8")
    made, shifted = (MujocoRobot("walled.xml", outcome="site:r:tip:x:xz", displacement=d, **WIDE) for d in (0, 1))
    benchmark, notes, _ = benchmark_of(Task(made), None)
    distances = np.linalg.norm(benchmark.goals, axis=1)
    assert 0.1 < distances.min() < 0.25 < 0.55 < distances.max() < 0.6  # an elbow of 20 to 150 degrees
    assert benchmark.goals[:, 1].min() > -0.1
    assert len(benchmark.goals) > 100
    assert f"use {len(benchmark.goals)} points, one in each tile of T that random postures reach" in notes[-1]
    start = made.within_reach() - shifted.within_reach()
    assert np.abs(start - start[0]).max() < 1e-9


@pytest.mark.parametrize("outcome", ["body:pole:xz", "joint:swing"])
def test_goals_lie_all_over_t_if_the_joints_alone_do_not_say_where_the_place_is(here, outcome):
    corners = WIDE if outcome.endswith("xz") else {"low": (-1.0,), "high": (1.0,)}
    robot = MujocoRobot("arm.xml", outcome=outcome, **corners)
    assert not robot.carries_outcome
    assert np.array_equal(benchmark_of(Task(robot), None)[0].goals, goals_all_over(robot).goals)


@pytest.mark.parametrize(
    ("change", "options", "known"),
    [
        ("", {}, True),
        ('<equality><joint joint1="r:2" joint2="r:1"/></equality>', {}, False),
        ('<equality><connect body1="pole" body2="fore" anchor="0 0 0"/></equality>', {}, True),  # within the hand
        slow('<equality><connect body1="fore" body2="base" anchor="0 0 0"/></equality>', {}, False),
        ("", {"displacement": True, "context": "joint:r:1:-1:1"}, False),
        slow("", {"low": (0.3, 0.3), "high": (0.31, 0.31)}, False),  # hardly a posture ends there
        slow("", {"joints": ("r:2",)}, True),
        ("", {"joints": ("r:2",), "servos": "file"}, False),  # a motor does not hold the other joint
    ],
)
def test_what_is_within_reach_is_known_if_nothing_but_the_joints_decides_it(here, change, options, known):
    (here / "changed.xml").write_text(ARM.replace("</mujoco>", change + "</mujoco>"), encoding="utf-8")
    robot = MujocoRobot("changed.xml", outcome="site:r:tip:x:xz", **(WIDE | options))
    assert (goals_within_reach(robot) is not None) == known


def test_postures_keep_within_the_ranges_of_joints_and_move_only_joints_of_the_place(here):
    wide = '<position joint="r:1" kp="50" ctrlrange="-3 3"/><position joint="r:2" kp="50" ctrlrange="-3 3"/>'
    (here / "wide.xml").write_text(re.sub("<motor.*/>", wide, ARM), encoding="utf-8")
    robot = MujocoRobot("wide.xml", outcome="joint:r:1,joint:r:2", low=(-3.0, -3.0), high=(3.0, 3.0))
    reach = np.rad2deg(robot.within_reach())
    assert (reach.min(axis=0) >= [-150.001, 19.999]).all()
    assert (reach.max(axis=0) <= 150.001).all()
    upper = MujocoRobot("wide.xml", outcome="joint:r:1", low=(-3.0,), high=(3.0,))
    robot.outcome_at(robot.start)
    assert np.ptp(upper.within_reach()) > 2
    assert upper._data[0].qpos[1] == pytest.approx(upper.start[1])


def test_a_run_whose_model_file_is_gone_says_that_it_needs_it(here, capsys):
    words = "run --environment mujoco --environment.model arm.xml --environment.outcome site:r:tip:x:xz"
    words += " --environment.low=-1,-1 --environment.high 1,1 --algorithm random --movements 3 --evaluate-at null"
    assert command(_call, words.split()) == 0
    (here / "arm.xml").unlink()
    for again in (f"{words} --resume", "ask runs/random/seed-000 --goal 0.1,0.1"):
        assert command(_call, again.split()) == 2
        assert re.search(r"error: \S*runs/random/seed-000 needs \S*arm\.xml, which is gone", capsys.readouterr().err)
