"""Films show what was simulated: where the float flies, when it lands, what the run's own memory infers."""

import itertools
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image, ImageSequence

from marks import slow
from runs import ROOT
from sgimd_torch import Sketch
from sgimd_torch.environments.fishing_rod import HOLD, FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.check import command as check
from sgimd_torch.extras.film import command as film
from sgimd_torch.extras.film.model_camera import viewing
from sgimd_torch.extras.film.reel import PAUSE, RATES, Shot, write_film
from sgimd_torch.extras.film.sketch import Sketchbook, panel
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.runs import command as run_command
from sgimd_torch.runs.program import command
from sgimd_torch.spaces import Box, stream

THETAS = stream(0, "film").random((100, 25))[40:]  # some reach the water before the line is let out
RATE = RATES[".mp4"]
FRAMES = [np.full((48, 64, 3), 4 * k, np.uint8) for k in range(30)]


@pytest.fixture(scope="module")
def rod():
    return FishingRod(max_wind=0.05, threads=1)


@pytest.fixture(scope="module")
def movements(rod):
    """Arguments of movements, every other one in the wind: context, theta, and the name of a stream."""
    winds = [k % 2 * rod.contexts.sample(stream(2, "context", k)) for k in range(len(THETAS))]
    return [(wind, theta, ("noise", 40 + k)) for k, (wind, theta) in enumerate(zip(winds, THETAS, strict=True))]


@pytest.fixture(scope="module")
def recordings(rod, movements):
    return [rod.trace(context, theta, stream(1, *name)) for context, theta, name in movements]


@pytest.fixture(scope="module")
def run_path(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("film")
    assert go(out, "--movements", 40, "--evaluate_at", "35", "--repeats", 0) == 0
    return out / "sgim-d" / "seed-003"


def decoded(path, height, width):
    """The pictures of a film, and what the decoder says about it."""
    words = [get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    ended = subprocess.run(words, capture_output=True, check=True)
    return np.frombuffer(ended.stdout, np.uint8).reshape(-1, height, width, 3).astype(int), ended.stderr.decode()


def positions_along(recording, times):
    return np.stack([recording.float_at(time) for time in times])


def test_the_float_flies_without_a_jump_to_where_the_executed_movement_lands(rod, movements, recordings):
    assert {recording.let_out is None for recording in recordings} == {True, False}  # both ways of landing
    for (context, theta, name), recording in zip(movements, recordings, strict=True):
        np.testing.assert_array_equal(recording.outcome, rod.execute(context, theta, stream(1, *name)))
        before = recording.float_at(recording.landed - 1e-9)
        np.testing.assert_allclose(before, [*recording.outcome, 0.0], atol=1e-7)  # at less than 100 m/s
        np.testing.assert_array_equal(recording.float_at(recording.landed + 1), [*recording.outcome, 0.0])
        earlier = positions_along(recording, np.linspace(0, recording.landed, 50)[:-1])
        assert (earlier[:, 2] > 0).all()


def test_the_line_is_let_out_when_the_posture_has_been_held_and_then_the_float_falls_freely(rod, movements, recordings):
    for (wind, theta, _), recording in zip(movements, recordings, strict=True):
        let_out = rod.primitive.duration(theta) + HOLD
        if recording.let_out is None:
            assert recording.landed <= let_out
            continue
        assert recording.let_out == let_out
        around = positions_along(recording, [let_out - 1e-9, let_out + 1e-9])
        np.testing.assert_allclose(around[0], around[1], atol=1e-6)
        if recording.landed > let_out + 0.1:
            pull = np.diff(positions_along(recording, let_out + 0.01 * np.arange(1, 10)), 2, axis=0) / 0.01**2
            np.testing.assert_allclose(pull, [[wind.any() * pull[0, 0], 0, -9.81]] * 7, atol=1e-6)  # a steady wind


def test_states_and_floats_of_a_recording_belong_together_and_the_line_bends(rod, recordings):
    data, bent = mujoco.MjData(rod.model), []
    recording = recordings[0]
    assert len(recording.states) == len(recording.floats) == np.ceil(recording.landed / recording.step) + 1
    for state, seen in zip(recording.states[::10], recording.floats[::10], strict=True):
        mujoco.mj_setState(rod.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(rod.model, data)
        np.testing.assert_allclose(data.site("float").xpos, seen[:3], atol=1e-12)
        tip, middle = data.site("tip").xpos, data.body("line_16").xpos
        bent.append(np.linalg.norm(middle - (tip + seen[:3]) / 2))
    assert max(bent) > 0.02  # m off the straight line


def test_the_panel_counts_the_goals_that_are_met():
    goals = np.stack(np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5)), axis=-1).reshape(-1, 2)
    space, curve = Box.cube(-1, 1, 2, unit="m"), (np.array([10, 100]), np.array([0.5, 0.05]))
    early = panel(space, goals, np.full(25, 0.5), 10, curve, "#d55e00")
    late = panel(space, goals, np.linspace(0, 0.1, 25), 100, curve, "#d55e00")
    assert early.shape == late.shape == (480, 360, 3)
    dark = [((p[..., 0] < 90) & (p[..., 1] < 30) & (p[..., 2] > 60)).sum() for p in (early, late)]
    assert dark[0] - dark[1] > 25 * 5  # of each goal, which is far away at first


def test_the_caption_says_when_the_line_is_let_out_and_how_far_the_goal_was_missed(recordings):
    recording = next(r for r in recordings if r.let_out is not None)
    shot = Shot(recording, recording.outcome + np.array([0.03, 0.04]))
    assert shot.missed == pytest.approx(0.05)
    before, after = recording.let_out, (recording.let_out + recording.landed) / 2
    assert [shot.caption(time).endswith(" s   line let out") for time in (before, after)] == [False, True]
    assert shot.caption(recording.landed).endswith("missed by 0.05")


def test_a_film_holds_every_frame_in_a_format_that_all_players_know(tmp_path):
    write_film(tmp_path / "film.mp4", iter(FRAMES))
    pictures, about = decoded(tmp_path / "film.mp4", 48, 64)
    assert pictures.mean(axis=(1, 2, 3)) == pytest.approx([frame.mean() for frame in FRAMES], abs=3)  # it is lossy
    for words in ("Video: h264", "yuv420p", "64x48", f"{RATE:g} fps"):
        assert words in about
    write_film(tmp_path / "film.webp", iter(FRAMES))
    with Image.open(tmp_path / "film.webp") as moving:  # for a page
        assert (moving.format, moving.size) == ("WEBP", (64, 48))
        lasts = [
            each.load() and each.info["duration"] for each in ImageSequence.Iterator(moving)
        ]  # ms; equal frames are one
        assert sum(lasts) == pytest.approx(1000 * len(FRAMES) / RATES[".webp"], abs=100)
        assert moving.info["loop"] == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.mp4", "film.webp"]


def test_an_interrupted_film_leaves_the_old_one_and_nothing_else(tmp_path):
    def interrupted():
        yield from FRAMES
        raise KeyboardInterrupt

    (tmp_path / "film.mp4").write_text("old")
    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / "film.mp4", interrupted())
    with pytest.raises(OSError, match="not encoded"):
        write_film(tmp_path / "film.mp4", [np.zeros((47, 63, 3), np.uint8)])  # odd
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_without_ffmpeg_nothing_is_replayed(run_path, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "none"))
    assert command(film.main, [str(run_path), "--out", str(tmp_path / "film.mp4")]) == 2
    assert "films need the program ffmpeg" in capsys.readouterr().err


def python(*words, gl="egl"):
    """Another process, since MuJoCo chooses how to draw when it is imported."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": gl}
    return subprocess.run([sys.executable, *map(str, words)], env=environment, capture_output=True, text=True)


def filmed(run_path, gl, *options):
    return python("-m", "sgimd_torch", "film", run_path, *options, gl=gl)


def drawn_in_space(program, *words):
    """What a program says that draws by OpenGL; on a machine without EGL, its test is skipped."""
    done = python("-c", program, *words)
    if "MuJoCo finds no OpenGL" in done.stderr:
        pytest.skip("this machine has no EGL")
    assert done.returncode == 0, done.stderr
    return done.stdout


SEEN = """
import sys
from dataclasses import replace
import numpy as np
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.spaces import stream
from sgimd_torch.extras.film.camera import Camera
from sgimd_torch.extras.film.reel import Shot

rod = FishingRod(noise=0.0, threads=1)
moved = rod.trace([], stream(0, "film").random(25), stream(1, "noise"))
still = replace(moved, states=np.repeat(moved.states[:1], len(moved.states), axis=0))
with Camera(rod.model) as camera:
    half, landed = moved.landed / 2, moved.landed
    shots = {"moved": Shot(moved, moved.outcome), "still": Shot(still, moved.outcome)}
    seen = {name: camera.frame(shot, half) for name, shot in shots.items()}
    seen |= {"landed": camera.frame(shots["moved"], landed)}
    seen |= {"past": camera.frame(Shot(moved, moved.outcome, past=np.array([[0.3, -0.6], [-0.6, -0.4]])), landed)}
    np.savez(sys.argv[1], **seen)
"""


def test_a_frame_shows_the_arm_as_it_was_and_rings_on_the_water_about_base_and_goal(tmp_path):
    drawn_in_space(SEEN, tmp_path / "seen.npz")
    seen = {name: frame.astype(int) for name, frame in np.load(tmp_path / "seen.npz").items()}
    assert (np.abs(seen["moved"] - seen["still"]).max(axis=2) > 30).sum() > 800  # pixels, of which the arm has several
    red, green, blue = np.moveaxis(seen["landed"], 2, 0)
    row, column = np.median(np.argwhere((red > 150) & (green < 100)), axis=0)  # of the float, which landed at its goal
    ring = np.argwhere((red > 180) & (green > 170) & (blue < 110))
    assert ring[:, 1].min() < column < ring[:, 1].max()
    assert ring[:, 0].max() > row + 5  # also between float and camera
    white = np.flatnonzero((seen["landed"][:420].min(axis=2) > 180).any(axis=0))  # above the caption
    assert np.ptp(white) > 640 / 2  # the ring one metre from the base; all else that is white stands near the middle
    assert ((red > 200) & (abs(green - 150) < 40) & (blue < 140)).sum() > 300  # the path of the float, orange
    assert 0 < (np.abs(seen["past"] - seen["landed"]).max(axis=2) > 30).sum() < 200  # two small tiles


@pytest.mark.parametrize("gl", ["disable", slow("bogus")])
def test_without_opengl_the_error_says_what_to_set(run_path, tmp_path, gl):
    done = filmed(run_path, gl, "--out", str(tmp_path / "film.mp4"))
    assert done.returncode == 2
    assert f"MUJOCO_GL={gl}" in done.stderr
    assert "set MUJOCO_GL=egl" in done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
    assert not list(tmp_path.iterdir())


ARM = "--environment planar-arm-7 --algorithm sagg-riac --movements 60 --evaluate-at [] --out runs"


def live(words):
    assert command(run_command.main, words.split()) == 0


def test_a_recorded_movement_of_an_arm_ends_where_the_executed_one_does():
    arm, context = PlanarArm(5, noise=0.1, context=True), np.array([0.3])
    for k in range(5):
        theta = stream(0, "arm", k).random(5)
        sketch = arm.trace(context, theta, stream(1, "noise", k))
        np.testing.assert_array_equal(sketch.outcome, arm.execute(context, theta, stream(1, "noise", k)))
        (chain,) = sketch.chains
        np.testing.assert_allclose(chain[-1, -1], sketch.outcome, atol=1e-12)
        np.testing.assert_allclose(chain[:, 0], 0)
        links = np.linalg.norm(np.diff(chain, axis=1), axis=2)
        np.testing.assert_allclose(links, 0.2)  # of five links of an arm of 1 m, at every moment
        np.testing.assert_allclose(chain[0, -1], [np.cos(0.3), np.sin(0.3)])  # straight, turned by the context
        assert np.linalg.norm(np.diff(chain, axis=0), axis=2).max() < 0.6  # without a jump
    assert sketch.landed == pytest.approx(1.0)


def test_an_arm_is_filmed_without_opengl(own):
    live(ARM)
    process = filmed("runs/sagg-riac/seed-000", "bogus", "--goals", "0.5,0.5")
    assert process.returncode == 0, process.stderr
    assert "after 60 movements: mean distance to the goal" in process.stdout
    pictures, _ = decoded(own / "runs/sagg-riac/seed-000.mp4", 480, 640 + 360)
    pictures = pictures[:, :, :640]
    assert len(pictures) == np.ceil((1.0 + PAUSE) * RATE)
    yellow = (pictures[-1, ..., 0] > 180) & (pictures[-1, ..., 2] < 100) & (pictures[-1, ..., 1] > 180)
    assert np.argwhere(yellow)[:, 0].mean() < 240  # the ring
    assert np.abs(pictures[0] - pictures[-1]).max() > 100
    assert np.abs(pictures[-15] - pictures[-1]).mean() < 2  # it has arrived


PUSHING = """<mujoco><option timestep=".005" integrator="implicitfast"/><default><joint damping="1"/></default>
  <worldbody><geom type="plane" size="2 2 .1"/>{}
    <body pos="0 0 .05"><joint name="turn" axis="0 0 1" range="-120 120"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body>
    <body name="puck" pos=".2 .2 .03"><freejoint/><geom type="cylinder" size=".04 .03"/></body></worldbody>
  <actuator><position joint="turn" kp="20" kv="4"/></actuator></mujoco>"""
PUCK = "--environment mujoco --environment.model push.xml --environment.outcome body:puck:xy"
PUCK += " --environment.context body:puck:x:.1:.2,body:puck:y:.1:.2 --environment.low=-.5,-.5 --environment.high .6,.6"


@pytest.mark.slow
def test_a_robot_from_a_file_is_filmed_in_space_and_without_opengl_in_the_plane(own):
    (own / "push.xml").write_text(PUSHING.format(""))
    live(f"{PUCK} --algorithm random --movements 20 --evaluate-at [] --out runs")
    rest = ["--goals", "-0.4,0.5", "--context", "0.2,0.1"]
    frames = {}
    for gl in ("egl", "bogus"):
        process = filmed("runs/random/seed-000", gl, *rest, "--out", f"{gl}.mp4")
        assert process.returncode == 0, process.stderr
        assert ("drawn in the plane: MuJoCo finds no OpenGL" in process.stderr) == (gl == "bogus")
        assert "Traceback" not in process.stderr
        frames[gl], _ = decoded(own / f"{gl}.mp4", 480, 640 + 360)
        red, green, blue = np.moveaxis(frames[gl][-1, 60:420, :640], -1, 0)
        assert ((red > 150) & (green > 130) & (blue < 100)).sum() > 50  # the goal, yellow
    assert len(frames["egl"]) == len(frames["bogus"])
    assert np.abs(frames["egl"][0, :, :640] - frames["bogus"][0, :, :640]).mean() > 50


CONTRAST = """
import sys
import numpy as np
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.spaces import stream
from sgimd_torch.extras.film.model_camera import ModelCamera
from sgimd_torch.extras.film.reel import Shot

for path in sys.argv[1:]:
    robot = MujocoRobot(path, outcome="site:tip:xy", low=(-0.4, -0.4), high=(0.4, 0.4))
    shot = Shot(robot.trace([], robot.policies.sample(stream(0, "theta")), stream(0, "noise")), np.array([0.3, 0.3]))
    with ModelCamera(robot, [shot]) as camera:
        frame, renderer = np.asarray(camera.frame(shot, 0.5)).mean(axis=2), camera._renderer
        renderer.update_scene(camera._data, camera=camera._camera)
        renderer.enable_segmentation_rendering()
        arm = renderer.render()[..., 0] == robot.model.geom("arm").id
    around = ~arm & (np.hypot(*np.gradient(frame)) < 1)  # no lines and no edges
    print(arm.sum(), np.median(frame[arm]) - np.median(frame[around]))
"""
ARM_OF_GREY = """<mujoco><worldbody>{}<body><joint name='turn' axis='0 0 1' range='-120 120'/><geom name='arm'
  type='capsule' fromto='0 0 0 .3 0 0' size='.03' rgba='{} {} {} 1'/><site name='tip' pos='.3 0 0'/></body></worldbody>
  <actuator><position joint='turn' kp='20' kv='4'/></actuator></mujoco>"""


@pytest.mark.slow
def test_an_arm_of_any_brightness_stands_out_from_what_is_behind_it(tmp_path):
    paths, plane, light = [], "<geom type='plane' size='.1 .1 .1'/>", "<light pos='0 0 2'/>"
    for grey, around in itertools.product((0.05, 0.6, 1.0), ("", plane, light)):
        paths.append(tmp_path / f"{len(paths)}.xml")
        paths[-1].write_text(ARM_OF_GREY.format(around, grey, grey, grey))
    pixels, differences = np.loadtxt(drawn_in_space(CONTRAST, *paths).splitlines()).T
    assert pixels.min() > 1000
    assert np.abs(differences).min() > 50, differences  # of 255


@pytest.mark.parametrize("own_camera", ["", "<camera name='far' pos='0 0 3' fovy='40'/>"])
def test_the_camera_sees_all_of_the_task_space_and_the_arm(own, own_camera):
    near = "<camera name='near' pos='0 0 .5'/>"
    (own / "push.xml").write_text(PUSHING.format(near + own_camera))
    robot = MujocoRobot("push.xml", outcome="body:puck:xy", low=(-0.5, -0.5), high=(0.6, 0.6))
    data, scene = mujoco.MjData(robot.model), mujoco.MjvScene(robot.model, 100)
    mujoco.mj_forward(robot.model, data)
    points = np.array([[x, y, 0.03] for x in (-0.5, 0.6) for y in (-0.5, 0.6)])
    seen = viewing(robot.model, data, points)
    camera = seen if isinstance(seen, mujoco.MjvCamera) else mujoco.MjvCamera()
    if own_camera:
        assert seen == 1
        camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, seen
    option, every = mujoco.MjvOption(), mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(robot.model, data, option, None, camera, every, scene)
    eye = scene.camera[0]  # of the left eye, which MuJoCo itself computed
    away = points - eye.pos
    depth, up = away @ eye.forward, away @ eye.up
    across = away @ np.cross(eye.forward, eye.up)
    slope = eye.frustum_top / eye.frustum_near
    assert (np.abs(up) < slope * depth).all()
    assert (np.abs(across) < 640 / 480 * slope * depth).all()
    if not own_camera:  # and it is no farther than it has to be
        assert max((np.abs(up) / slope / depth).max(), (np.abs(across) / slope / depth * 480 / 640).max()) > 0.75


def test_the_plane_shows_all_of_the_task_space_and_every_chain_but_objects_may_leave():
    space = Box(np.array([-1.0, -2.0]), np.array([3.0, 2.0]))
    arm, lost = np.zeros((3, 2, 2)), np.full((3, 1, 2), 50.0)
    arm[:, 1] = [4, 0]
    shot = Shot(Sketch(np.zeros(2), 0.1, [arm, lost]), np.zeros(2))
    book = Sketchbook(space, [shot])
    book.frame(shot, 0)
    low, high = np.transpose([book._ax.get_xlim(), book._ax.get_ylim()])
    assert (low < [-1, -2]).all()
    assert (high > [4, 2]).all()
    assert (high < 10).all()


@pytest.mark.parametrize(("word", "goal"), [("Slider", "0.4"), ("Slider3", "0.4,0.2,0.9")])
def test_a_picture_of_ones_own_is_filmed_for_outcomes_of_any_dimension(own, word, goal):
    live(f"--environment sliders:{word} --algorithm random --movements 30 --evaluate-at [] --out runs")
    run = "runs/random/seed-000"
    assert command(film.main, f"{run} --trust --out one.webp --goals {goal}".split()) == 0
    with Image.open("one.webp") as moving:
        assert moving.size == (640 + 360, 480)


def test_code_that_somebody_elses_run_names_is_executed_only_with_trust(own, capsys, monkeypatch):
    live("--environment sliders:Slider --algorithm random --movements 20 --evaluate-at [] --out runs --name one")
    monkeypatch.setattr("sgimd_torch.options.config.load_word", lambda *_: pytest.fail("it was imported"))
    assert command(film.main, ["runs/one/seed-000"]) == 2
    assert (
        "names code outside this library, sliders:Slider; read it, then execute it with --trust"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("word", ["sliders:Slider", "fishing-rod"])
def test_the_check_of_an_environment_looks_at_its_picture(own, word):
    """Pictures that it refuses are in the table of wrong commands."""
    assert command(check.main, [word]) == 0
