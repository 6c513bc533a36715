"""``sgimd ask``: the answers of a run, as its learner gives them, in lines or in tables."""

import csv
import math
import re
import signal
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from marks import slow
from sgimd_torch import FishingRod, load_learner, practice, run
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.ask.command import DISTANCES, main
from sgimd_torch.runs.command import main as run_main
from sgimd_torch.runs.program import command

SHORT = ["--environment=planar-arm-7", "--algorithm=practice", "--seed=4", "--movements=80", "--evaluate-at=[]"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    out = tmp_path_factory.mktemp("asked")
    assert command(run_main, [*SHORT, "--out", str(out)]) == 0
    return out / "practice" / "seed-004"


@pytest.fixture(scope="module")
def lived():
    """A learner that has made the movements of the run."""
    arm = PlanarArm(7)
    learner = practice(arm, 4)
    for _ in run(learner, arm, 4, movements=80):
        pass
    return learner


def table_of(file):
    with file.open() as lines:
        return list(csv.DictReader(lines))


def test_a_goal_is_answered_in_a_line_and_executed_if_wanted(path, lived, capsys):
    assert command(main, [str(path), "--goal", "0.3,0.4", "--execute"]) == 0
    printed = capsys.readouterr().out.strip().split("; ")
    assert [part.split(" ")[0] for part in printed if part.endswith(" m")] == [*DISTANCES]
    said = dict(part.removesuffix(" m").split(" ") for part in printed)
    estimate = lived.inverse(np.zeros(0), np.array([0.3, 0.4]))
    theta, goal = estimate.theta, [0.3, 0.4]
    assert [float(x) for x in said["expected"].split(",")] == pytest.approx(estimate.expected, rel=1e-3)
    assert float(said["expected_distance"]) == pytest.approx(math.dist(estimate.expected, goal), rel=1e-3)
    assert float(said["expected_deviation"]) == pytest.approx(estimate.expected_deviation, rel=1e-3)
    assert [float(x) for x in said["theta"].split(",")] == pytest.approx(theta, abs=1e-3)
    reached = PlanarArm(7).execute(np.zeros(0), theta, np.random.default_rng(0))  # an arm without noise
    assert [float(x) for x in said["reached"].split(",")] == pytest.approx(reached, abs=1e-3)
    assert float(said["error"]) == pytest.approx(math.dist(reached, goal), rel=1e-3)
    assert float(said["error"]) < 0.3


def test_many_goals_go_in_and_out_as_tables_whose_numbers_are_exact(path, lived, tmp_path, capsys):
    (tmp_path / "goals.csv").write_text("0.3,0.4\n\n-0.5,0.1\n", encoding="utf-8-sig")  # Excel begins with a BOM
    out = tmp_path / "answers.csv"
    assert command(main, [str(path), "--goals", str(tmp_path / "goals.csv"), "--out", str(out)]) == 0
    rows = table_of(out)
    assert [float(row["goal_0"]) for row in rows] == [0.3, -0.5]
    for row in rows:
        estimate = lived.inverse(np.zeros(0), np.array([float(row["goal_0"]), float(row["goal_1"])]))
        assert [float(row[f"theta_{k}"]) for k in range(7)] == estimate.theta.tolist()
        assert [float(row[f"expected_{k}"]) for k in range(2)] == estimate.expected.tolist()
        assert float(row["expected_deviation"]) == estimate.expected_deviation


def test_a_goal_beyond_all_outcomes_is_said_to_look_out_of_reach(path, capsys):
    assert command(main, [str(path), "--goal", "0.3,0.4", "--goal", "1,1"]) == 0
    said = capsys.readouterr().err
    assert "goal 1,1 looks out of reach" in said
    assert "goal 0.3" not in said


ROBOT = """
import os
import numpy as np
from sgimd_torch import PlanarArm

class Arm(PlanarArm):
    habit = None

    def execute(self, context, theta, rng):
        return {"nan": lambda: np.array([np.nan, 0]), "three": lambda: np.zeros(3), "exits": lambda: exit(0),
                "raises": lambda: {}["jam"], "masked": lambda: np.ma.masked_array([0, 1], [1, 0]),
                None: lambda: super(Arm, self).execute(context, theta, rng)}[self.habit]()
"""
LOST = [
    ("raises", "KeyError"),
    slow("nan", "must be finite"),
    slow("three", "must have shape (..., 2)"),
    slow("exits", "SystemExit: 0"),
    slow("masked", "a masked array"),
]


@pytest.mark.parametrize(("habit", "reason"), LOST)
def test_an_answer_that_the_robot_cannot_execute_has_failed_as_in_a_run(module, capsys, monkeypatch, habit, reason):
    module("lost", ROBOT)
    run_main(["--environment=lost:Arm", "--algorithm=random", "--movements=20", "--evaluate-at=[]", "--out=runs"])
    monkeypatch.setattr(sys.modules["lost"].Arm, "habit", habit)
    asked = ["runs/random/seed-000", "--trust", "--goal", "0.3,0.4", "--execute"]
    assert command(main, asked) == 1
    said = capsys.readouterr()
    assert "error: 1 of 1 movements failed, the first for goal 0.3,0.4: " in said.err
    assert reason in said.err
    assert "Traceback" not in said.err
    assert said.out.splitlines()[-1].startswith("goal 0.3,0.4; theta ")
    assert "reached" not in said.out
    assert command(main, [*asked, "--goal", "0.1,0.2", "--out", "out.csv"]) == 1
    assert [row["reached_0"] + row["error"] for row in table_of(Path("out.csv"))] == ["", ""]


def test_the_joints_over_time_are_those_of_the_primitive(tmp_path, capsys):
    words = ["--algorithm=random", "--movements=5", "--evaluate-at=[]", f"--out={tmp_path}"]
    assert command(run_main, words) == 0
    path, out = tmp_path / "random" / "seed-000", tmp_path / "joints.csv"
    assert command(main, [str(path), "--goal", "0.3,0.4", "--trajectory", str(out)]) == 0
    times, joints = FishingRod().primitive.trajectory(load_learner(path).inverse(np.zeros(0), [0.3, 0.4]).theta)
    rows = np.array([[float(x) for x in row.values()] for row in table_of(out)])
    np.testing.assert_array_equal(rows, np.column_stack([times, joints]))


def test_a_distance_is_told_with_its_unit(path, capsys):
    assert command(main, [str(path), "--goal", "1,1"]) == 0  # beyond the reach of 1 m
    said = capsys.readouterr().out
    away = re.search(r"; expected_distance (\S+) m; expected_deviation \S+ m\n", said)
    assert float(away[1]) == pytest.approx(math.sqrt(2) - 1, abs=0.05)


def test_a_signal_that_numba_loses_while_it_compiles_stops_before_the_robot_moves(path, monkeypatch, capsys):
    def compile_and_lose_a_signal():
        with suppress(BaseException):
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("sgimd_torch.extras.ask.command.compile_all", compile_and_lose_a_signal)
    assert command(main, [str(path), "--goal", "0.3,0.4", "--execute"]) == 143
    assert capsys.readouterr().out == ""
