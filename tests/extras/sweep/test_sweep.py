"""Many runs at once: which runs a command line means, what is left to do, and how runs can fail.

What processes do to each other is tried with a robot that stops itself, so that no test waits for a clock.
"""

import os
import re
import shutil
import signal
from pathlib import Path

import pytest

from boards import hparams_of
from marks import slow
from odd import ODD, SWEEP, as_alone, odd_place, said_by
from runs import content_of, start
from sgimd_torch.extras.sweep import parallel
from sgimd_torch.extras.sweep.command import main, variants_of
from sgimd_torch.options.config import Config
from sgimd_torch.runs.command import main as run
from sgimd_torch.runs.program import Failed, command
from sgimd_torch.runs.read import finished, movements_on_disk

# An arm without physics; 40 movements and one evaluation take a moment.
ARM = "--environment planar-arm-7 --movements 40 --evaluate-at 20 --repeats 0 --inverse linear"
ALONE = ARM.split()


def short(out, **changes):
    fixed = {"environment": "planar-arm-7", "algorithm": "random", "inverse": "linear", "movements": 40, "repeats": 0}
    return Config.from_settings({**fixed, "evaluate_at": (20,), "out": out, **changes})


def swept(*options):
    """In this process; the exit code."""
    return command(main, [str(option) for option in options])


def names(varied, *options):
    return [variant.variant for variant in variants_of(varied, options)]


def listed(capsys, *options):
    """The runs that are still to be done, and what else is said."""
    capsys.readouterr()
    assert swept(*options, "--dry-run") == 0
    found = capsys.readouterr()
    return found.out.splitlines(), found.err


def test_options_are_crossed_and_each_combination_has_its_name():
    assert names(["goals=interest-map,uniform", "budget=5,15"]) == [
        *("budget=5,goals=interest-map", "budget=15,goals=interest-map"),
        *("budget=5,goals=uniform", "budget=15,goals=uniform"),
    ]
    assert names(["algorithm=random,sgim-d"]) == ["random", "sgim-d"]
    assert names([], "--algorithm", "sagg-riac") == ["sagg-riac"]
    assert names(["goals=uniform,uniform"]) == ["goals=uniform"]
    assert names(["environment.noise=1,1.5"]) == ["environment.noise=1", "environment.noise=1.5"]
    assert names(["demonstrations=/far/away/mine.npz"], "--algorithm", "sgim-d") == ["demonstrations=mine.npz"]
    # Their order does not change where runs go.
    assert names(["goals=uniform", "algorithm=sgim-d"]) == ["sgim-d,goals=uniform"]
    assert names(["algorithm=sgim-d", "goals=uniform"]) == ["sgim-d,goals=uniform"]


def test_values_and_further_options_become_those_of_the_runs():
    few, many = variants_of(["floor-at=[],[20,40]"], ["--movements", "60", "--resume"])
    assert (few.floor_at, many.floor_at) == ((), (20, 40))
    assert few.movements == many.movements == 60


def test_seeds_are_one_or_a_range_or_a_list(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for seeds, wanted in (("5", [5]), ("0-2", [0, 1, 2]), ("0,3,7-9", [0, 3, 7, 8, 9]), ("1,0-1", [1, 0])):
        lines, _ = listed(capsys, "--algorithm", "random", "--seeds", seeds)
        assert lines == [f"runs/random/seed-{seed:03d}: 0 of 5000 movements" for seed in wanted]
    assert not list(tmp_path.iterdir())


def test_every_run_is_what_it_would_be_alone_and_a_second_start_does_nothing(tmp_path, capsys):
    options = [*ALONE, "--vary", "algorithm=random,sagg-riac", "--processes", 2, "--out", tmp_path / "study"]
    assert swept(*options) == 0
    said = capsys.readouterr().err
    assert "2 runs, 0 of them finished" in said
    assert "2 runs ended well, 0 failed" in said
    for name in ("random", "sagg-riac"):
        assert command(run, [*ALONE, "--algorithm", name, "--out", str(tmp_path / "alone")]) == 0
        place = tmp_path / "study" / name / "seed-000"
        assert content_of(place) == content_of(tmp_path / "alone" / name / "seed-000")
        assert f"{place}: 40 movements" in place.with_suffix(".log").read_text()
    files = [path for path in (tmp_path / "study").rglob("*") if path.is_file()]  # to read a record touches its folder
    before = {path: path.stat().st_mtime_ns for path in files}
    capsys.readouterr()
    assert swept(*options) == 0
    assert "2 of them finished" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "study").rglob("*") if path.is_file()} == before


def test_a_file_of_goals_that_has_changed_makes_a_run_unfinished(benchmark, tmp_path, go):
    goals = tmp_path / "goals.npz"
    shutil.copy(benchmark, goals)
    options = ["--movements", 20, "--evaluate_at", "[]", "--algorithm", "random", "--benchmark", goals]
    assert go(tmp_path, *options) == 0
    config = Config("random", seed=3, movements=20, evaluate_at=(), repeats=2, benchmark=goals, out=tmp_path)
    assert finished(config)
    goals.write_bytes(b"others")
    assert not finished(config)


@pytest.mark.slow
def test_failures_are_named_in_the_order_of_the_list_and_the_others_go_on(tmp_path):
    configs, ended_well = [short(tmp_path, seed=seed) for seed in range(4)], []
    for seed in (1, 3):
        configs[seed].directory.parent.mkdir(parents=True, exist_ok=True)
        configs[seed].directory.write_text("a file in the place of a folder")

    def on_end(config):
        ended_well.append(config.seed)
        if config.seed == 2:
            raise ValueError("its rows are damaged")

    failures = parallel.sweep(configs, parallel.Machine(2), on_end=on_end)
    assert failures[1] == "random seed 2 failed: its rows are damaged"
    for failure, seed in zip(failures[::2], (1, 3), strict=True):
        assert re.match(f"random seed {seed} failed: .*seed-00{seed} cannot be made", failure)
    assert sorted(ended_well) == [0, 2]


def test_two_runs_with_one_directory_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"two runs would be written to .*seed-000"):
        parallel.sweep([short(tmp_path), short(tmp_path, inverse="nearest")], parallel.Machine(1))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("code", "said", "words"),
    [
        (2, "reading\nerror: no such goal\nmore on it\n", "no such goal\nmore on it"),
        (1, "error: earlier\nerror: the arm broke", "the arm broke"),
        (1, "a traceback\nMemoryError", "MemoryError"),
        (3, "", "it printed nothing"),
        (-9, "error: earlier", "stopped by SIGKILL; the same command continues the run"),
    ],
)
def test_a_run_that_ends_badly_is_told_by_its_last_words(tmp_path, code, said, words):
    with pytest.raises(Failed) as caught:
        parallel.check_end(short(tmp_path), code, said.encode())
    assert str(caught.value) == f"{words}\nFull log: {tmp_path}/random/seed-000.log"
    parallel.check_end(short(tmp_path), 0, said.encode())


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """The working directory with a robot that behaves as AT_20 says, and its runs when it does nothing special."""
    return odd_place(tmp_path_factory.mktemp("odd"))


@pytest.fixture
def begun(odd, tmp_path, monkeypatch):
    """Start a program there, with runs of that robot in ``tmp_path``."""
    monkeypatch.setenv("PYTHONPATH", str(odd), prepend=os.pathsep)

    def begun(program, *options, at_20=""):
        monkeypatch.setenv("AT_20", at_20)
        return start(program, *ODD, "--out", tmp_path, *options)

    return begun


@pytest.mark.slow
def test_a_run_that_is_killed_is_named_and_goes_on_next_time(odd, begun, tmp_path):
    foreign = tmp_path / "random/seed-001/run.sqlite"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("not a run")
    options = ["--seeds", "0-1", "--processes", 1]
    said = said_by(begun(SWEEP, *options, at_20="dies"), 1)
    assert "0 runs ended well, 2 failed" in said
    assert "random seed 0 failed: stopped by SIGKILL; the same command continues the run" in said
    assert re.search(r"random seed 1 failed: \S*seed-001/run.sqlite cannot be read as a record", said)
    assert f"Full log: {tmp_path / 'random/seed-001.log'}" in said
    assert foreign.read_text() == "not a run"
    shutil.rmtree(foreign.parent)
    said_by(begun(SWEEP, *options), 0)
    assert as_alone(odd, tmp_path)


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGINT, 130), slow(signal.SIGTERM, 143)])
def test_stopped_it_stops_its_runs_and_goes_on_as_if_nothing_had_happened(
    odd, begun, tmp_path, monkeypatch, signum, code
):
    monkeypatch.setenv("SIGNAL", str(int(signum)))
    options = ["--seeds", "0-1", "--processes", 1]
    assert "stopping all runs; the same command continues them" in said_by(
        begun(SWEEP, *options, at_20="stops the sweep"), code
    )
    assert "stopped after 20 movements" in (tmp_path / "random/seed-000.log").read_text()
    assert movements_on_disk(tmp_path / "random/seed-000") == 20
    assert not (tmp_path / "random/seed-001").exists()
    said_by(begun(SWEEP, *options), 0)
    assert as_alone(odd, tmp_path)


def test_no_library_for_figures_or_learning_is_loaded_to_watch_processes(tmp_path):
    program = (
        "import sys, sgimd_torch.extras.sweep.command as sweep; sweep.main(sys.argv[1:]);"
        "print(sorted({'distributed', 'matplotlib', 'mujoco', 'torch', 'tensorboard'} & {*sys.modules}))"
    )
    code = start(program, "--dry-run", "--out", tmp_path)
    assert code.communicate()[0].splitlines()[-1] == "[]"


@pytest.mark.slow
def test_hyperparameters_of_a_sweep_are_what_tells_its_runs_apart_defaults_included(own):
    words = "--environment planar-arm-7 --movements 50 --seeds 0 --repeats 0 --board true --out sweep"
    vary = ["--vary", "algorithm=sagg-riac,practice", "--vary", "budget=1,15"]  # 1 is the default of practice
    assert command(main, [*words.split(), *vary]) == 0
    found = {path.parent.name: hparams_of(path) for path in Path("sweep").glob("*/seed-000")}
    same = {"environment": "planar-arm-7", "seed": 0, "memory": "graph", "social": "none", "changed": "nothing"}
    sagg = {"inverse": "process", "search": "nelder-mead", "goals": "interest-map", "explore": "anywhere"}
    practice = {"inverse": "among-effects", "search": "vary", "goals": "within-reach", "explore": "returning"}
    assert found == {
        f"{algorithm},budget={budget}": (
            {"algorithm": algorithm, "budget": budget, **same, **parts},
            ["error/mean"],
        )
        for algorithm, parts in (("sagg-riac", sagg), ("practice", practice))
        for budget in (1, 15)
    }
