"""Runs where there are contexts: their evaluations draw them, and say the error by context."""

import numpy as np
import pytest

from runs import csv_of
from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import contexts_of_goals
from sgimd_torch.runs.build import build, task_of
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.report import command as report

TOSS = "--environment toss --algorithm sagg-riac --movements 60 --evaluate-at 30 --repeats 2 --evaluated-by own,nearest"


def live(out, *options):
    return command(main, [*TOSS.split(), "--out", str(out), *map(str, options)])


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("toss")
    assert live(out) == 0
    return read_run(out / "sagg-riac/seed-000")


def test_the_errors_by_context_are_those_of_the_evaluation(run):
    by, n = run.by_context, len(build(Config(algorithm="sagg-riac", parts={"environment": "toss"})).benchmark.goals)
    assert list(by) == ["movements", "answer", "context", "low", "high", "goals", "mean_error_m"]
    for answer in ("own", "nearest"):
        for k, movements in enumerate((30, 60)):
            rows = (by["answer"] == answer) & (by["movements"] == movements)
            assert by["context"][rows].tolist() == [0, 0, 0]
            assert by["low"][rows] == pytest.approx([-1, -1 / 3, 1 / 3])
            assert by["goals"][rows].sum() == n
            mean = np.average(by["mean_error_m"][rows], weights=by["goals"][rows])
            assert mean == pytest.approx(run.answers[answer]["mean_error_m"][k])


def test_a_run_with_contexts_ends_the_same_however_often_it_was_stopped(run, tmp_path):
    assert live(tmp_path, "--movements", 40) == 0
    assert live(tmp_path, "--resume") == 0
    again = tmp_path / "sagg-riac/seed-000"
    assert csv_of(again) == csv_of(run.path)
    assert (again / "by_context.csv").read_bytes() == (run.path / "by_context.csv").read_bytes()


def test_a_damaged_row_is_told_and_made_again(run, tmp_path, capsys):
    assert live(tmp_path) == 0
    table = tmp_path / "sagg-riac/seed-000/by_context.csv"
    whole = table.read_bytes()
    table.write_bytes(whole[:-20])
    assert read_run(table.parent).damage == {"by_context.csv": 13}
    capsys.readouterr()
    assert live(tmp_path, "--resume") == 0
    assert "by_context.csv: dropped" in capsys.readouterr().err
    assert table.read_bytes() == whole


def test_an_evaluation_of_an_earlier_version_in_the_middle_of_c_is_made_again(run, tmp_path):
    assert live(tmp_path) == 0
    directory = tmp_path / "sagg-riac/seed-000"
    (directory / "by_context.csv").unlink()
    assert live(tmp_path, "--resume") == 0
    assert (directory / "by_context.csv").read_bytes() == (run.path / "by_context.csv").read_bytes()


def test_a_run_without_contexts_has_no_such_table(tmp_path):
    words = "--environment crawler --algorithm random --movements 20 --evaluate-at 10 --repeats 0"
    assert command(main, [*words.split(), "--out", str(tmp_path)]) == 0
    found = read_run(tmp_path / "random/seed-000")
    assert found.by_context is None
    assert not (found.path / "by_context.csv").exists()


def test_the_report_tells_the_error_by_context(run):
    assert report.main([str(run.path)]) == 0
    text = (run.path / "report.html").read_text(encoding="utf-8")
    assert "The last error by context (m)" in text
    own = (run.by_context["answer"] == "own") & (run.by_context["movements"] == 60)
    for error in run.by_context["mean_error_m"][own]:
        assert f"<td>{error:.3f}</td>" in text
    assert "context 0: -0.333 to 0.333" in text


@pytest.mark.parametrize(("word", "reach"), [("rod-wind", 0.05), ("rod-yaw", 0.5)])
def test_the_contexts_of_the_rod_are_tasks(word, reach):
    assert word in CATALOGUE["environment"]
    config = Config(algorithm="sgim-d", parts={"environment": word, "environment.noise": 0.01})
    robot = task_of(config).environment
    assert (robot.contexts.low.tolist(), robot.contexts.high.tolist()) == ([-reach], [reach])
    assert robot.noise == 0.01
    parts = build(config)
    assert {shown.context.tolist()[0] for shown in parts.demonstrations} == {0.0}
    assert len(parts.demonstrations) == 127
    contexts = contexts_of_goals(robot, 200)
    assert np.ptp(contexts) > 1.8 * reach


def test_the_long_rod_is_a_task_without_context():
    robot = task_of(Config(parts={"environment": "rod-long", "environment.noise": 0.01})).environment
    assert (robot.noise, robot.contexts.dim) == (0.01, 0)
    assert robot.model.body("line_07").mass == pytest.approx(1.5 * FishingRod().model.body("line_07").mass)


def test_the_rod_in_the_wind_is_run_taught_and_resumed(tmp_path, benchmark):
    words = "--algorithm sgim-d --environment rod-wind --movements 45 --evaluate-at 35 --repeats 2"
    both = [*words.split(), "--benchmark", str(benchmark)]
    assert command(main, [*both, "--out", str(tmp_path / "whole")]) == 0
    assert command(main, [*both, "--out", str(tmp_path / "cut"), "--movements", "36"]) == 0
    assert command(main, [*both, "--out", str(tmp_path / "cut"), "--resume"]) == 0
    whole, cut = (tmp_path / name / "sgim-d/seed-000" for name in ("whole", "cut"))
    assert csv_of(whole) == csv_of(cut)
    run = read_run(whole)
    assert run.contexts.shape == (45, 1)
    assert np.abs(run.contexts).max() <= 0.05
    assert (run.demonstration >= 0).any()
    assert run.by_context["goals"].sum() == 2 * 2 * 3  # evaluations, answers, goals
