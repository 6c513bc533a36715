"""Whole runs on the fishing rod: what they write, that they can be repeated, and what they refuse."""

import os
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest

from marks import slow
from runs import ROOT, content_of
from sgimd_torch.__main__ import _call
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.runs import evaluations
from sgimd_torch.runs.build import build
from sgimd_torch.runs.messages import ProgressBar
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.spaces import Demonstration

SCRIPTS = {**os.environ, "PYTHONPATH": str(ROOT)}


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_seed_makes_the_same_record_whatever_the_threads(tmp_path, go, reference, capsys, threads):
    assert go(tmp_path, "--environment.threads", threads) == 0
    assert content_of(tmp_path / "sgim-d" / "seed-003") == reference
    assert "127 demonstrations" in capsys.readouterr().err


def test_a_run_has_the_answers_that_were_asked_for_and_its_movements_do_not_depend_on_them(tmp_path, go, reference):
    """What the run learns with answers once for both of its names."""
    assert go(tmp_path, "--evaluated-by", "own,nearest,process") == 0
    run = read_run(tmp_path / "sgim-d" / "seed-003")
    found = run.evaluations
    assert list(found) == ["own", "nearest", "process"]
    assert content_of(run.path)["events"] == reference["events"]
    assert found["process"]["mean_error"].tolist() == found["own"]["mean_error"].tolist()
    assert np.isfinite(found["own"]["noise_floor"]).tolist() == [False, False, True]  # only the last one measures it
    assert np.isnan(found["process"]["noise_floor"]).all()
    parts = build(config_of(run))
    assert parts.inverses["process"] is parts.inverses["own"] is parts.learner.inverse
    assert parts.inverses["nearest"] is not parts.inverses["own"]


@pytest.mark.parametrize("slip", ["three samples", "degrees", "milliseconds", "a few milliseconds"])
def test_recordings_that_the_robot_cannot_play_are_refused_before_anything_is_written(tmp_path, go, capsys, slip):
    shown = load_demonstrations()[5]
    times, trajectory = shown.times, shown.trajectory
    if slip == "three samples":
        times, trajectory = np.linspace(0, 1, 3), trajectory[:3]
    elif slip == "degrees":
        trajectory = np.degrees(trajectory)
    else:
        times = 1000 * times if slip == "milliseconds" else times / 1000
    save_demonstrations(tmp_path / "own.npz", [shown, Demonstration(shown.context, times, trajectory, shown.outcome)])
    assert go(tmp_path / "runs", "--demonstrations", tmp_path / "own.npz") == 2
    said = capsys.readouterr().err
    assert "own.npz: recording 1" in said
    assert slip.split()[-1] in said
    assert not (tmp_path / "runs").exists()


def test_recordings_whose_float_lands_outside_the_task_space_are_noted(tmp_path, go, capsys):
    shown = load_demonstrations()[5]
    far = Demonstration(shown.context, shown.times, shown.trajectory, 100 * shown.outcome)
    save_demonstrations(tmp_path / "own.npz", [shown, far])
    assert go(tmp_path, "--demonstrations", tmp_path / "own.npz", "--movements", 5) == 0
    assert re.search(r"recording 1 lands outside T; were they not recorded in m\?", capsys.readouterr().err)


def test_an_error_of_a_part_keeps_its_traceback_and_says_how_to_go_on(tmp_path, go, capsys, monkeypatch):
    def fail(*_, **__):
        raise ValueError("this cannot be evaluated")

    monkeypatch.setattr(evaluations, "evaluate", fail)
    assert go(tmp_path) == 1
    errors = capsys.readouterr().err.splitlines()
    assert errors[-1].startswith("error: ValueError: this cannot be evaluated; 30 movements are kept; to go on: ")
    assert "Traceback (most recent call last):" in errors


@pytest.mark.parametrize(("redirection", "code"), [("| true", 0), (">/dev/full", 1), slow("2>&-", 0), slow(">&-", 0)])
def test_a_run_finishes_whatever_happens_to_its_output(tmp_path, redirection, code):
    script = [sys.executable, "-m", "sgimd_torch", "run", "--environment", "planar-arm-7", "--out", str(tmp_path)]
    command = shlex.join([*script, "--algorithm", "random", "--movements", "5", "--repeats", "0", "--name", "Å"])
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{command} {redirection}"],
        capture_output=True,
        text=True,
        env={**SCRIPTS, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    )
    assert done.returncode == code, done
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert read_run(tmp_path / "Å" / "seed-000").summary["finished"] is True


@pytest.mark.parametrize(("chosen", "threads"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_small_matrices_get_one_thread_unless_the_user_chose(chosen, threads):
    program = "import os, sys; from sgimd_torch.__main__ import main; main(); print(os.environ['OMP_NUM_THREADS'])"
    others = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    said = subprocess.run(
        [sys.executable, "-c", program, "--version"], env=others | chosen, capture_output=True, text=True, check=True
    ).stdout
    assert said.split()[-1] == threads


def test_the_time_that_is_left_counts_evaluations(monkeypatch, capsys):
    clock = [0.0]
    monkeypatch.setattr("sgimd_torch.runs.messages.time.monotonic", lambda: clock[0])
    with ProgressBar("run", 100) as progress:
        clock[0] = 60.0  # 50 movements in 50 s, and evaluations of 10 s
        progress.show(50)
    assert "50 of 100 movements, 0.833/s, 01:00 left" in capsys.readouterr().err


def test_a_run_most_of_whose_movements_failed_says_so_and_fails(own, capsys):
    words = "run --environment sliders:OftenLost --algorithm random --movements 20 --evaluate-at null --failures 99"
    assert command(_call, words.split()) == 1
    assert re.search(r"\((1[1-9]|20) failed\).*most movements failed, so little was learnt", capsys.readouterr().err)
    assert read_run("runs/random/seed-000").summary["movements"] == 20


def test_the_last_line_gives_the_error_at_goals_within_reach_too(own, capsys):
    words = "run --environment sliders:Slider2 --algorithm random --movements 60 --evaluate-at 60 --repeats 0"
    assert command(_call, words.split()) == 0  # T is [-1, 3]^2, and outcomes lie in [0, 1]^2
    all_of_t, n, goals, within = re.search(
        r"mean error ([\d.]+), .*; (\d+) of (\d+) goals look out of reach, mean error at the others ([\d.]+)",
        capsys.readouterr().out,
    ).groups()
    assert 0.8 < int(n) / int(goals) < 0.97
    assert float(within) < 0.2 < 1 < float(all_of_t)
