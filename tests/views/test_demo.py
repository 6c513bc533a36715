"""The demo as a new user starts it, with runs of a few movements and a benchmark of a few goals."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runs import ROOT
from sgimd_torch.__main__ import COMMANDS
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.views.demo_cast import GOALS, answers
from sgimd_torch.views.demo_figure import draw, table
from sgimd_torch.views.report.data import read_life


@pytest.fixture(scope="module")
def benchmark_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "small.npz"
    save_benchmark(path, Benchmark("FishingRod", np.array([[0.0, 0.5], [0.4, 0.3], [-0.5, 0.2]]), 0.1))
    return path


LEARNERS = ("random", "sgim-d", "practice-taught")
DEMO = [sys.executable, "-m", "sgimd_torch", "demo"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}


def start(out, benchmark_file, movements, *more, extra=()):
    command = [*DEMO, "--out", str(out), "--movements", str(movements), *more]
    command += ["--", "--benchmark", str(benchmark_file), "--repeats", "2", "--evaluate_at", "30", *extra]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT, process_group=0
    )


def ended(demo):
    out, errors = demo.communicate(timeout=300)
    return demo.returncode, out, errors


@pytest.fixture(scope="module")
def finished(tmp_path_factory, benchmark_file):
    out = tmp_path_factory.mktemp("demo")
    return out, *ended(start(out, benchmark_file, 60))


@pytest.fixture(scope="module")
def runs(finished):
    return {algorithm: read_life(finished[0] / algorithm / "seed-000") for algorithm in LEARNERS}


def is_whole_png(path):
    content = path.read_bytes()
    return content.startswith(b"\x89PNG\r\n\x1a\n") and content.endswith(b"IEND\xaeB`\x82")


def test_the_demo_ends_well_with_all_runs_and_a_figure(finished, runs):
    out, code, said, errors = finished
    assert code == 0, errors
    assert [len(run.index) for run in runs.values()] == [60, 60, 60]
    assert is_whole_png(out / "demo.png")
    assert (out / "demo.png").stat().st_size > 50_000  # an empty figure of this size has a tenth of that
    assert not list(out.glob("*.part"))
    assert str(out / "demo.png") in said
    assert "SGIM-D chooses goals" in errors  # what it is doing
    commands = said.partition("Next, try\n")[2].splitlines()
    assert len(commands) == 3
    for command in commands:
        name, *words = shlex.split(command.partition("sgimd")[2].removeprefix("_torch"), comments=True)
        assert name in COMMANDS
        assert any(Path(word).exists() for word in words)


def test_the_table_compares_the_algorithms_in_error_noise_and_seconds(runs):
    head, *lines, ratios = table(runs).splitlines()
    assert head.split() == ["error", "60", "noise", "floor", "physics", "learning", "evaluation"]
    for line, name, run in zip(lines, ("Random", "SGIM-D", "Practice, taught"), runs.values(), strict=True):
        error, floor = run.evaluation["mean_error_m"][-1], run.evaluation["noise_floor_m"][-1]
        assert line.startswith(name)
        assert line.removeprefix(name).split()[:4] == [f"{error:.3f}", "m", f"{floor:.3f}", "m"]
    random, *others = (run.evaluation["mean_error_m"][-1] for run in runs.values())
    assert f"SGIM-D {others[0] / random:.2f} and Practice, taught {others[1] / random:.2f}." in ratios


def test_the_table_of_long_runs_has_columns_on_the_way_too(runs):
    when = np.array([500, 1000, 2000, 3000])
    columns = {"movements": when, "mean_error_m": 100.0 / when, "noise_floor_m": np.full(4, 0.01)}
    longer = {algorithm: replace(run, answers=dict.fromkeys(run.answers, columns)) for algorithm, run in runs.items()}
    head, random, *_ = table(longer).splitlines()
    assert re.findall(r"error (\d+)", head) == ["1000", "2000", "3000"]
    assert random.split()[1:7:2] == ["0.100", "0.050", "0.033"]


def test_the_table_is_shown(finished, runs):
    assert table(runs) in finished[2]


def test_the_figure_shows_the_data_of_the_runs(runs):
    curves, above, side, *landed = draw(runs).axes[:6]
    for line, run in zip(curves.lines, runs.values(), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [30, 60])
        np.testing.assert_array_equal(line.get_ydata(), run.evaluation["mean_error_m"])
    paths = [line for line in above.lines if line.get_linestyle() == ":"]
    assert len(paths) == len(GOALS) * len(runs)
    assert len([line for line in side.lines if line.get_linestyle() == ":"]) == len(runs)  # for the first goal
    shown = [text.get_text() for text in above.get_legend().get_texts()]
    for name, run, of_run in zip(("Random", "SGIM-D", "Practice, taught"), runs.values(), (0, 4, 8), strict=True):
        ends = np.array([[line.get_xdata()[-1], line.get_ydata()[-1]] for line in paths[of_run : of_run + 4]])
        missed = 100 * np.linalg.norm(ends - GOALS, axis=1).mean()
        assert f"{name}: misses by {missed:.0f} cm" in shown
        np.testing.assert_array_equal([cast.path[-1, :2] for cast in answers(run.path)], ends)
    for ax, run in zip(landed, runs.values(), strict=True):
        assert ax.collections[0].get_array().sum() == (np.abs(run.outcomes) <= 1).all(axis=1).sum()
    assert len({ax.collections[0].norm.vmax for ax in landed}) == 1
    assert [len(ax.lines) for ax in landed] == [1, 2, 2]  # the base, and demonstrated outcomes


def test_a_second_start_uses_what_is_there(finished, benchmark_file, tmp_path):
    out = tmp_path / "again"
    shutil.copytree(finished[0], out)
    logs = {path: path.read_bytes() for path in out.glob("*/*/e*.csv")}
    assert len(logs) == 6
    figure = (out / "demo.png").read_bytes()
    (out / "demo.png").unlink()
    code, _, errors = ended(start(out, benchmark_file, 60))
    assert code == 0, errors
    assert logs == {path: path.read_bytes() for path in logs}
    assert (out / "demo.png").read_bytes() == figure


def test_stopped_it_says_how_to_go_on_and_leaves_no_process(benchmark_file, tmp_path):
    demo = start(tmp_path, benchmark_file, 100_000)
    log = tmp_path / "practice-taught/seed-000/episodes.csv"
    began = time.monotonic()
    while not (log.exists() and log.read_bytes().count(b"\n") > 5):
        assert time.monotonic() < began + 60
        time.sleep(0.1)
    demo.send_signal(signal.SIGINT)
    code, _, errors = ended(demo)
    assert code == 130
    assert "goes on from here" in errors
    assert "Traceback" not in errors
    size = log.stat().st_size
    time.sleep(1.5)  # a run flushes its log every second
    assert log.stat().st_size == size


@pytest.mark.parametrize(
    ("more", "extra", "message"),
    [
        (("--seed", "-1"), (), "seed must be at least 0"),
        (("--movements", "0"), (), "movements must be at least 1"),
        ((), ("--environment.noise", "-1"), "noise must be finite and at least 0"),
        ((), ("--evaluate_at", "[]"), "leaves nothing to draw"),
        ((), ("--environment", "planar-arm-7"), "--environment cannot be given here"),
        ((), ("--seed", "3"), "--seed is the demo's own"),
        ((), ("--movements=3",), "--movements is the demo's own"),
        ((), ("--out", "x"), "--out is the demo's own"),
        ((), ("--algorithm", "x"), "--algorithm cannot be given here"),
        ((), ("--name", "x"), "--name cannot be given here"),
        ((), ("stray",), "'stray' belongs to no option"),
    ],
)
def test_impossible_requests_end_with_a_reason_and_no_traceback(benchmark_file, tmp_path, more, extra, message):
    code, said, errors = ended(start(tmp_path, benchmark_file, 20, *more, extra=extra))
    assert code == 2
    assert message in errors
    assert "Traceback" not in errors
    assert not said
    assert not list(tmp_path.iterdir())


def test_asking_for_fewer_movements_does_not_delete_the_run(finished, benchmark_file):
    code, _, errors = ended(start(finished[0], benchmark_file, 40))
    assert code == 2
    assert "60 movements already" in errors
    assert "delete" not in errors


def test_when_one_run_fails_the_other_is_stopped(benchmark_file, tmp_path):
    foreign = tmp_path / "sgim-d/seed-000/thesis.txt"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("not a run")
    code, _, errors = ended(start(tmp_path, benchmark_file, 100_000))
    assert code == 2
    assert "sgim-d seed 0 failed: " in errors
    assert "thesis.txt" in errors
    assert "Traceback" not in errors
    assert foreign.read_text() == "not a run"


def test_the_help_teaches():
    shown = subprocess.run([*DEMO, "--help"], capture_output=True, text=True, check=True, env=ENVIRONMENT)
    assert "sgimd demo --seed 1" in shown.stdout
    assert "demo.png" in shown.stdout
