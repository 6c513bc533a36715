"""The page of the arm works from the simulator to the table; its camera sees where a puck is."""

import io
import re
import runpy
import shlex
from pathlib import Path

import numpy as np
import pytest

from arms import Clock, on_table, write
from sgimd_torch import stream
from sgimd_torch.__main__ import _call
from sgimd_torch.extras.lerobot.arm import LeRobotArm
from sgimd_torch.runs.program import command

SO101 = ("shoulder_pan", "shoulder_lift", "elbow_flex")
ROOT = Path(__file__).parents[2]
SMALLER = {
    "--environment lerobot ...": "--environment arms:bench {}",
    "--environment lerobot --environment.robot so101_follower": "--environment arms:bench",
    "--environment.port /dev/ttyACM0": "",
    "--movements 1000": "--movements 40",
    "--movements 100": "--movements 4",
    "--movements 30": "--movements 2",
    "--execute": "--execute --trust",
}
CAMERA = ROOT / "docs/how-to/camera.py"


def picture(cv2, camera, puck, rng):
    """What a tilted camera sees of a table with markers of 6 cm, with noise and uneven light."""
    scale, origin = 1000, np.array([0.1, 0.4])  # pixels for a metre of the drawing, whose corner is at -origin
    drawn = np.full((800, 700), 200, np.uint8)
    for number, place in {**camera["TABLE"], camera["PUCK"]: puck}.items():
        x, y = np.rint((np.array(place) + origin) * scale).astype(int)
        drawn[y - 40 : y + 40, x - 40 : x + 40] = 255
        drawn[y - 30 : y + 30, x - 30 : x + 30] = cv2.aruco.generateImageMarker(camera["DICTIONARY"], number, 60)
    corners = np.float32([[0, 0], [700, 0], [700, 800], [0, 800]])
    seen = np.float32([[110, 60], [560, 30], [620, 460], [40, 430]])
    warped = cv2.warpPerspective(drawn, cv2.getPerspectiveTransform(corners, seen), (640, 480), borderValue=90)
    light = np.linspace(0.6, 1.0, 640)
    return np.clip(warped * light + rng.normal(0, 4, warped.shape), 0, 255).astype(np.uint8)


def test_the_camera_sees_a_puck_in_a_stream_of_pictures_to_two_millimetres():
    cv2 = pytest.importorskip("cv2")
    camera, rng = runpy.run_path(str(CAMERA)), np.random.default_rng(0)
    for turn in np.linspace(0, 5, 20):
        puck = 0.25 + 0.12 * np.cos(turn), 0.15 * np.sin(turn)
        assert camera["puck"]({"above": picture(cv2, camera, puck, rng)}) == pytest.approx(puck, abs=0.002)
    with pytest.raises(LookupError, match=r"the markers \[0, 1, 2, 3, 4\] are not seen"):
        camera["puck"]({"above": np.zeros((480, 640), np.uint8)})


def test_the_driver_of_the_page_moves_an_arm_by_its_six_calls(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs/how-to")
    model = write(tmp_path / "arm.xml", names=("shoulder", "elbow", "wrist"))
    options = {"outcome": "site:tip:xy", "units": "rad", "low": (-0.7, -0.7), "high": (0.7, 0.7), "durations": (1, 2)}
    arm = LeRobotArm("driver:make", model=str(model), clock=Clock(), **options)
    theta = np.append(np.repeat([0.9, 0.5, 0.5], 4), 0.0)
    angle = np.radians(80)
    outcome = arm.execute(np.zeros(0), theta, stream(0, "driver"))
    assert outcome == pytest.approx([0.6 * np.cos(angle), 0.6 * np.sin(angle)], abs=1e-6)
    assert arm.robot.is_connected
    arm.release()
    assert not arm.robot.is_connected


@pytest.mark.slow
def test_the_page_leads_from_the_simulator_to_a_goal_on_the_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    write(tmp_path / "so101.xml", names=SO101)
    built = write(tmp_path / "built.xml", (0.21, 0.19, 0.2), (2, -3, 1), SO101)
    _, on = on_table(tmp_path / "so101.xml", built, of_arm={"noise": 0.2, "lost": 0.01})
    page = (ROOT / "docs/how-to/arm.md").read_text(encoding="utf-8").replace("\\\n", " ")
    lead = np.radians([40, 30, 20])
    commands = [line for line in page.splitlines() if line.startswith("sgimd ")]
    robot = re.search("--environment.units .*?--environment.durations [^ ]*", page)[0]
    for line in commands:
        for written, carried_out in SMALLER.items():
            line = line.replace(written, carried_out.format(robot))
        on.hand = (lambda time: lead * np.clip((time - on.switched_off) / 2 - 1, 0, 1)) if "record" in line else None
        assert command(_call, shlex.split(line)[1:]) == 0, line
    assert len(commands) == 5
    printed = capsys.readouterr().out
    reached = re.search(r"reached ([-.\d]+),([-.\d]+)", printed)
    assert reached is not None, printed
    assert np.array(reached.groups(), float) == pytest.approx([0.3, 0.2], abs=0.3)
    assert on.torque
