"""``sgimd ask``: the answers of a run, as its learner gives them, in lines or in tables."""

import csv

import numpy as np
import pytest

from sgimd_torch import FishingRod, load_learner, practice, run
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.options.command_line import main as run_main
from sgimd_torch.runs.signals import command
from sgimd_torch.views.ask import main

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
    said = dict(part.split(" ") for part in capsys.readouterr().out.strip().split("; "))
    estimate = lived.inverse(np.zeros(0), np.array([0.3, 0.4]))
    theta = estimate.theta
    assert [float(x) for x in said["expected"].split(",")] == pytest.approx(estimate.expected, rel=1e-3)
    assert float(said["expected_deviation"]) == pytest.approx(estimate.expected_deviation, rel=1e-3)
    assert [float(x) for x in said["theta"].split(",")] == pytest.approx(theta, abs=1e-3)
    reached = PlanarArm(7).execute(np.zeros(0), theta, np.random.default_rng(0))  # an arm without noise
    assert [float(x) for x in said["reached"].split(",")] == pytest.approx(reached, abs=1e-3)
    assert np.linalg.norm(reached - [0.3, 0.4]) < 0.3


def test_many_goals_go_in_and_out_as_tables_whose_numbers_are_exact(path, lived, tmp_path, capsys):
    (tmp_path / "goals.csv").write_text("x,y\n0.3,0.4\n\n-0.5,0.1\n")
    out = tmp_path / "answers.csv"
    assert command(main, [str(path), "--goals", str(tmp_path / "goals.csv"), "--out", str(out)]) == 0
    rows = table_of(out)
    assert [float(row["goal_0"]) for row in rows] == [0.3, -0.5]
    for row in rows:
        estimate = lived.inverse(np.zeros(0), np.array([float(row["goal_0"]), float(row["goal_1"])]))
        assert [float(row[f"theta_{k}"]) for k in range(7)] == estimate.theta.tolist()
        assert [float(row[f"expected_{k}"]) for k in range(2)] == estimate.expected.tolist()
        assert float(row["expected_deviation"]) == estimate.expected_deviation


def test_the_joints_over_time_are_those_of_the_primitive(tmp_path, capsys):
    words = ["--algorithm=random", "--movements=5", "--evaluate-at=[]", f"--out={tmp_path}"]
    assert command(run_main, words) == 0
    path, out = tmp_path / "random" / "seed-000", tmp_path / "joints.csv"
    assert command(main, [str(path), "--goal", "0.3,0.4", "--trajectory", str(out)]) == 0
    times, joints = FishingRod().primitive.trajectory(load_learner(path).inverse(np.zeros(0), [0.3, 0.4]).theta)
    rows = np.array([[float(x) for x in row.values()] for row in table_of(out)])
    np.testing.assert_array_equal(rows, np.column_stack([times, joints]))
