"""The table of what runs came to."""

import shutil

import numpy as np
import pytest

from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.runs.command_line import main as live
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.table import main


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    save_benchmark(out / "tiny.npz", Benchmark("FishingRod", np.array([[0.0, 0.6], [0.3, 0.5]]), 0.1))
    for algorithm, seed in (("random", 0), ("random", 1), ("sgim-d", 0)):
        options = f"--algorithm {algorithm} --seed {seed} --movements 40 --repeats 2 --evaluate_at 20"
        assert live([*options.split(), "--benchmark", str(out / "tiny.npz"), "--out", str(out)]) == 0
    return out


def test_the_table_gives_mean_and_deviation_over_seeds(runs, capsys):
    assert main([str(runs), "--at", "40"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    errors = [read_run(runs / "random" / f"seed-00{seed}").evaluation["mean_error_m"][-1] for seed in (0, 1)]
    assert f"{np.mean(errors):.3f} ± {abs(errors[0] - errors[1]) / np.sqrt(2):.3f}" in lines["random"]
    assert lines["random"].split()[1] == "2"
    assert "±" not in lines["sgim-d"]


def test_a_run_that_is_too_short_is_named(runs, capsys):
    assert main([str(runs), "--at", "5000"]) == 2
    assert "seed-000 has no evaluation after 5000 movements" in capsys.readouterr().err


def test_a_folder_without_runs_is_refused(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert "holds no runs" in capsys.readouterr().err


@pytest.mark.parametrize("damage", ["no summary", "junk log", "directory", "summary is a list"])
def test_a_damaged_run_is_named_in_one_line(runs, tmp_path, capsys, damage):
    shutil.copytree(runs, tmp_path / "runs")
    run = tmp_path / "runs" / "random" / "seed-001"
    if damage == "no summary":
        (run / "summary.json").unlink()
    elif damage == "junk log":
        (run / "episodes.csv").write_text("junk")
    elif damage == "directory":
        (run / "episodes.csv").unlink()
        (run / "episodes.csv").mkdir()
    else:
        (run / "summary.json").write_text("[]")
    assert main([str(tmp_path / "runs"), "--at", "40"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert str(run) in said


def test_what_was_not_measured_is_a_dash(runs, capsys):
    assert main([str(runs), "--at", "40"]) == 0  # nothing was evaluated after 1000 movements
    said = capsys.readouterr().out
    assert "nan" not in said
    assert said.splitlines()[1].split()[2] == "-"
