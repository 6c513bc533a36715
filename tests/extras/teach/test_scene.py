"""The scene: the map of T lies where outcomes are, with numbers at its edges; objects are drawn where they begin."""

import numpy as np
import pytest
from viser.transforms import SO3

from sgimd_torch import FishingRod, MujocoRobot, PlanarArm
from sgimd_torch.extras.teach.chart import Chart, picture_of
from sgimd_torch.extras.teach.command import serving
from sgimd_torch.extras.teach.leading import Leading
from sgimd_torch.extras.teach.led import hand_led_of
from sgimd_torch.extras.teach.scene import Scene
from sgimd_torch.spaces import Box
from sgimd_torch.tasks import Task

ARM = """<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="upper" pos="0 0 .05"><joint name="shoulder" axis="0 0 1" range="-120 120"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><geom type="box" size=".1 .1 .1" group="3"/>
    <body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="tip" pos=".3 0 0"/></body></body>
  <body name="puck" pos=".4 .3 .03"><freejoint/><geom type="cylinder" size=".04 .03"/></body></worldbody>
  <actuator><position joint="shoulder"/><position joint="elbow"/></actuator></mujoco>"""
PUCK = {"context": "body:puck:x:.3:.4", "low": (-1.0, -0.6), "high": (0.4, 0.5)}


@pytest.fixture
def server():
    with serving(8300, "secret") as server:
        yield server


def scene_of(server, robot, correspondence=None):
    led = hand_led_of(Task(robot, correspondence=correspondence))
    leading = Leading(led)
    scene = Scene(server, led, leading.arm, robot.outcomes, robot.outcomes.low[None])
    scene.draw_arm(leading.arm.data, leading.hand)
    return scene


@pytest.fixture
def model(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    return tmp_path / "arm.xml"


def corners(scene):
    """``(2, 3)`` m, where the first and the last point of the picture's diagonal from low to high lie."""
    image = scene.map
    half = np.array([image.render_width, -image.render_height, 0]) / 2  # its rows begin above
    return np.stack([image.position + sign * SO3(image.wxyz).apply(half) for sign in (-1, 1)])


@pytest.mark.parametrize(
    ("outcome", "options", "low", "high"),
    [
        ("body:puck:xy", {}, [-1, -0.6, 0.03], [0.4, 0.5, 0.03]),
        ("body:puck:yx", {}, [-0.6, -1, 0.03], [0.5, 0.4, 0.03]),
        ("body:puck:xy", {"displacement": True}, [-0.65, -0.3, 0.03], [0.75, 0.8, 0.03]),
        ("site:tip:xz", {}, [-1, 0, -0.6], [0.4, 0, 0.5]),
        ("site:tip", {"low": (-1, -0.6, 0), "high": (0.4, 0.5, 0.3)}, [-1, -0.6, 0], [0.4, 0.5, 0]),
    ],
)
def test_the_map_lies_where_outcomes_are(server, model, outcome, options, low, high):
    scene = scene_of(server, MujocoRobot(model, outcome=outcome, **{**PUCK, **options}))
    assert corners(scene) == pytest.approx(np.array([low, high]), abs=1e-6)
    assert scene._goals.points[0] == pytest.approx(low, abs=0.01)


def test_the_picture_of_the_map_is_light_where_an_outcome_came_near_with_y_upwards():
    distances = np.full((60, 60), 9.0)
    distances[50, 10] = 0.0  # y is large, x is small
    picture = picture_of(Chart(distances, 9.0, np.zeros(0, dtype=bool)), Box.cube(0, 1, 2)).sum(axis=2)
    assert np.unravel_index(picture.argmax(), picture.shape) == (9, 10)


def test_a_strip_is_the_map_of_one_dimension(server, model):
    scene = scene_of(server, MujocoRobot(model, outcome="site:tip:z", low=(0.0,), high=(0.5,)))
    assert corners(scene)[:, 2] == pytest.approx([0, 0.5])
    scene_of(server, PlanarArm())


def test_objects_are_drawn_where_they_begin_and_only_the_arm_can_be_dragged(server, model):
    scene = scene_of(server, MujocoRobot(model, outcome="body:puck:xy", **PUCK))
    assert scene._geoms.keys() == {1, 3, 4}  # neither the floor nor what a viewer of MuJoCo hides
    assert scene._geoms[4].position == pytest.approx([0.35, 0.3, 0.03])
    assert [name for name, _ in scene.grips] == ["tip", "upper", "fore"]


def test_numbers_and_names_stand_at_the_edges_of_the_map(server, model):
    labels, add = {}, server.scene.add_label

    def add_noted(name, text, *, position, **options):
        labels[text] = position
        return add(name, text, position=position, **options)

    server.scene.add_label = add_noted
    scene_of(server, MujocoRobot(model, outcome="body:puck:xy", **PUCK))
    assert labels.keys() == {"-1", "-0.5", "0", "0.5", "puck x (m)", "puck y (m)"}
    assert labels["-1"][0] == pytest.approx(-1)
    assert labels["0.5"][1] == pytest.approx(0.5)


def test_the_line_of_the_rod_which_a_hand_does_not_move_is_not_drawn(server):
    rod = FishingRod(threads=1)
    geoms = scene_of(server, rod, rod.primitive.correspondence)._geoms
    bodies = {rod.model.body(rod.model.geom_bodyid[k]).name for k in geoms}
    assert {"rod", "hand", "base"} <= bodies
    assert not any(name.startswith(("line", "float")) for name in bodies)
