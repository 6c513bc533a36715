"""The comparison with tiny variants, in real processes: what is run, what is collected, what happens when runs fail."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compare import collect, compared, jobs_of, last_rows, made_rows, main
from made_up import row
from runs import ROOT, start
from sgimd_torch import run, sgim_d_letter
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from sgimd_torch.options.config import Config, words
from sgimd_torch.options.parse import parse
from sgimd_torch.record import RunError
from sgimd_torch.runs.build import build
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import Run, read_run
from table import CORNER, LEARNING, explored_rows, merge, read_table, result_rows, tiles_reached
from variants import EXPERIMENTS, VARIANTS

# Two variants that live for 40 movements, and one, of an experiment of its own, whose demonstrations are missing.
TINY = """
import sys
sys.path.insert(0, "EXPERIMENTS")
import variants
from pathlib import Path
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from sgimd_torch.runs.program import command
tiny = dict(movements=40, evaluate_at=(20,), repeats=2, benchmark=Path(sys.argv.pop(1)))
variants.EXPERIMENTS.clear()
variants.EXPERIMENTS["paper"] = {"random": dict(algorithm="random", **tiny)}
large = {"algorithm": "sgim-d", "environment.task_space": 100.0, **tiny}
variants.EXPERIMENTS["large"] = {"sgim-d-large": large}
variants.EXPERIMENTS["broken"] = {"untaught": dict(algorithm="sgim-d", demonstrations=Path("nowhere.npz"), **tiny)}
arm = dict(environment="planar-arm-7", movements=40, evaluate_at=(20,))
variants.EXPERIMENTS["model"] = {"sgim-d.planar-arm-7": dict(algorithm="sgim-d", **arm)}
import random_robots
random_robots.COUNTS = (10,)
import compare
sys.exit(command(compare.main))
""".replace("EXPERIMENTS", str(ROOT / "experiments"), 1)


@pytest.fixture
def compare(benchmark, tmp_path):
    """Starts a comparison in ``tmp_path``."""

    def compare(*options):
        places = ["--out", tmp_path / "runs", "--results", tmp_path / "results"]
        return start(TINY, benchmark, *places, "--seeds", 0, "--processes", 2, *options)

    return compare


def ended(process):
    said, errors = process.communicate(timeout=600)
    return process.returncode, said, errors


@pytest.mark.slow
def test_each_evaluation_is_a_row_the_failed_are_reported_and_a_second_start_does_nothing(compare, tmp_path):
    code, _, errors = ended(compare("paper", "large", "model", "broken"))
    assert code == 1
    assert "untaught seed 0 failed: nowhere.npz cannot be read or written: No such file" in errors
    assert "3 runs ended well, 1 failed" in errors
    assert "Traceback" not in errors
    table = read_table(tmp_path / "results")
    for variant in ("random", "sgim-d-large", "sgim-d.planar-arm-7"):
        theirs = table[table.variant == variant]
        assert [*zip(theirs.movements, theirs.answer, strict=True)] == [(when, "process") for when in (20, 40)]
        run = read_run(tmp_path / "runs" / LEARNING / variant / "seed-000")
        assert [*theirs.error] == run.evaluations["own"]["mean_error"].tolist()
        assert theirs.floor.isna().all()  # the noise floor is measured only where a variant says so
    explored = read_table(tmp_path / "results", "explored.csv").set_index("variant")
    assert explored.goals["random"] == 0
    assert 0 < explored.tiles["random"] <= 40
    n_goals = len(read_run(tmp_path / "runs" / LEARNING / "sgim-d-large/seed-000").chosen_goals())
    assert (explored.goals["sgim-d-large"], explored.near["sgim-d-large"]) == (n_goals, 0)  # of 40000 m², 7 are near

    contents = [path.read_bytes() for path in tmp_path.glob("results/*.csv")]
    code, _, errors = ended(compare("paper", "large"))
    assert code == 0
    assert "paper: 1 of 1 runs made, 0.0 of 0.0 processor hours left" in errors
    assert "0 runs, 0.0 processor hours left" in errors
    assert "nothing is left to run: --verify 10 makes ten of these rows again" in errors
    assert [path.read_bytes() for path in tmp_path.glob("results/*.csv")] == contents


def test_a_run_that_lost_its_rows_is_collected_again_and_no_goal_is_counted_twice(go, benchmark, tmp_path):
    name = "sgim-d-large"
    parts = {"environment.task_space": 100.0}
    config = Config("sgim-d", seed=3, movements=30, name=name, benchmark=benchmark, out=tmp_path, parts=parts)
    large = ("--environment.task_space", 100)
    assert go(tmp_path, "--movements", 30, "--evaluate_at", "20", "--name", name, *large) == 0
    paths = [tmp_path / "results.csv", tmp_path / "explored.csv"]

    def collected():
        before = last_rows(config) <= made_rows(tmp_path)
        collect(config, tmp_path)
        return before

    assert not collected()
    whole = [path.read_bytes() for path in paths]
    assert collected()
    assert [path.read_bytes() for path in paths] == whole
    paths[0].unlink()
    assert not collected()
    assert [path.read_bytes() for path in paths] == whole


def test_a_run_that_ended_without_its_last_evaluation_is_no_result(go, benchmark, tmp_path):
    assert go(tmp_path, "--movements", 30, "--evaluate_at", "[]") == 0
    config = Config("sgim-d", seed=3, movements=30, benchmark=benchmark, out=tmp_path)
    with pytest.raises(RunError, match="seed-003 has no evaluation after 30 movements, though it ended"):
        collect(config, tmp_path / "results")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["papre"], "papre.*paper"),
        (["cma-me"], "cma-me is a variant of rivals; write rivals --only cma-me"),
        (["rivals", "--only", "cma-em"], "cma-em.*cma-me"),
        (["paper", "--only", "cma-me"], "cma-me is a variant of rivals"),
        (["--only", "cma-me", "rivals"], "rivals is an experiment"),
        (["--seeds", ""], "--seeds: must be like 5, 0-19 or 0,3,7-9, got ''"),
        (["--seeds=-1"], "--seeds: must be like 5, 0-19 or 0,3,7-9, got '-1'"),
        (["--processes", "0"], "--processes: must be a whole number of at least 1, got '0'"),
        (["--out", "file/runs"], f"file/runs/{LEARNING}/random cannot be made: Not a directory"),
        (["--results", "file"], "file cannot be made: File exists; is a file in its place?"),
        (["--results", "foreign"], "foreign/results.csv.*must begin with variant,seed"),
    ],
)
def test_impossible_requests_are_refused_with_their_reason(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    Path("foreign").mkdir()
    Path("foreign/results.csv").write_text("my,thesis\n")
    before = sorted(tmp_path.rglob("*"))
    assert command(main, options) == 2
    said = capsys.readouterr().err
    assert re.search(message.replace("?", r"\?"), said)
    assert "Traceback" not in said
    written = set(tmp_path.rglob("*")) - set(before)
    assert not [path for path in written if path.suffix in (".csv", ".log")]


def test_every_variant_is_a_valid_run_with_its_own_name(tmp_path):
    wanted = [config for experiment in EXPERIMENTS for config in jobs_of(experiment, [], range(1), tmp_path)]
    assert len({config.variant for config in wanted}) == len(wanted)
    for config in wanted:
        assert parse(words(config))[0] == config


def test_shipped_rows_are_of_variants_that_are_there():
    assert {*read_table(ROOT / "results").variant} <= {*VARIANTS}


def test_a_run_is_evaluated_by_its_own_inverse_and_by_the_one_that_answers_for_all(tmp_path):
    wanted = {
        config.variant: config
        for experiment in ("letter", "suite", "paper")
        for config in jobs_of(experiment, [], range(1), tmp_path)
    }
    assert wanted["sgim-d-letter"].evaluated_by == ("own", "process")
    assert wanted["uniform-nearest.toss"].evaluated_by == ("own", "process")
    assert wanted["sgim-d"].evaluated_by == ("own",)
    assert last_rows(wanted["sgim-d-letter"]) == {("sgim-d-letter", 0, 5000, answer) for answer in ("paper", "process")}


LETTER = (  # spelled out
    "inverse=paper goals.progress=absolute goals.max_aspect=1e9 search.noise=0 search.complete=true "
    "search.xatol=1e-4 search.fatol=1e-4 budget=60 give_up=-1 global_range=0,1"
)


def arm_life(algorithm, learner_of=None, **options):
    """Movements of an arm."""
    arm = {"environment": "planar-arm-7", "teacher.every": 20, "seed": 3}
    parts = build(Config.from_settings({"algorithm": algorithm, **arm, **options}))
    learner = learner_of(parts.environment) if learner_of else parts.learner
    episodes = run(learner, parts.environment, 3, movements=60, teacher=parts.teacher)
    return np.stack([episode.move.theta for episode in episodes])


def test_the_letter_is_one_word_for_eleven_options():
    spelled = dict(option.split("=") for option in LETTER.split())
    letter, varied = Config("sagg-riac-letter").values, {"social.exact_first": "false"}
    assert letter == Config.from_settings({"algorithm": "sagg-riac", **spelled}).values | {
        "algorithm": letter["algorithm"]
    }
    life = arm_life("sgim-d-letter")
    assert np.array_equal(life, arm_life("sgim-d", **spelled, **varied))
    in_python = arm_life("sgim-d-letter", lambda arm: sgim_d_letter(arm, 3, correspondence=arm.correspondence))
    assert np.array_equal(life, in_python)


def test_rows_of_the_letter_are_made_by_one_word(go, tmp_path):
    letters = ["sagg-riac-letter", "sgim-d-letter"]
    assert [(job.algorithm, dict(job.parts)) for job in jobs_of("letter", letters, [3], tmp_path)] == [
        (letter, {}) for letter in letters
    ]
    arm = ("--environment", "planar-arm-7", "--teacher.every", 20, "--movements", 60, "--evaluate-at", "[]")
    assert go(tmp_path, "--algorithm", "sgim-d-letter", *arm, "--benchmark", "null") == 0
    assert np.array_equal(read_run(tmp_path / "sgim-d-letter" / "seed-003").thetas, arm_life("sgim-d-letter"))


def test_tiles_of_the_benchmark_that_were_reached_are_counted_once():
    """Tiles of 0.5 m from (-1, -1); goals on two of them."""
    assert CORNER == -1
    benchmark = Benchmark("FishingRod", np.array([[0.1, 0.1], [-0.9, 0.4]]), 0.5)
    at_rest, elsewhere = [np.nan, np.nan], [0.6, 0.1]
    assert tiles_reached(np.array([at_rest, elsewhere]), benchmark) == 0
    assert tiles_reached(np.array([[0.49, 0.0], [0.2, 0.3], elsewhere]), benchmark) == 1
    assert tiles_reached(np.array([[0.49, 0.0], [-0.51, 0.49], [-0.51, 0.51]]), benchmark) == 2


def run_with(origins, goals):
    nothing = np.empty((len(goals), 0))
    return Run(
        *(Path("nowhere"), {}, {}, {}, "Robot", [], {}, {}, []),
        *(np.arange(len(goals)), np.array(origins), np.full(len(goals), -1)),
        *(nothing, nothing, np.array(goals, dtype=np.float64), nothing, {"own": {}}),
    )


def test_a_goal_counts_once_imitation_and_rest_not_at_all_and_near_is_within_a_metre_and_a_half():
    none, near, edge, far, shown = [np.nan] * 2, [0.0, 1.0], [0.9, 1.2], [1.0, 1.2], [0.3, 0.3]
    origins = ["babble", "local", "global", "imitate", "imitate", "local", "local", "local", ""]
    run = run_with(origins, [none, near, near, shown, shown, edge, far, near, none])
    np.testing.assert_array_equal(run.chosen_goals(), [near, edge, far, near])
    (found,) = explored_rows(Config(name="sgim-d-large", seed=7), run)
    assert (found["variant"], found["seed"], found["goals"], found["near"]) == ("sgim-d-large", 7, 4, 3)
    assert explored_rows(Config(name="random", seed=7), run_with(["babble"], [none]))[0]["goals"] == 0


def test_rows_made_again_are_equal_but_for_rounding_or_differ():
    shipped_row = row("sgim-d", 0, 5000, "process", 0.0426)
    assert compared(shipped_row, dict(shipped_row)) == "equal"
    assert compared(shipped_row, {**shipped_row, "error": 0.04260000000001}) == "rounding"
    changes = [{"error": 0.0427}, {"floor": 0.03}, {"movements": 4000}, {"answer": "linear"}]
    for now in (*({**shipped_row, **change} for change in changes), {}):
        assert compared(shipped_row, now) == "DIFFERS"


@pytest.mark.slow
def test_rows_are_drawn_by_lot_and_made_again_in_a_folder_of_their_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    config = Config(algorithm="sgim-d", name="sgim-d.planar-arm-7", movements=20, parts={"environment": "planar-arm-7"})
    again = replace(config, evaluate_at=(20,), floor_at=(), evaluated_by=("own",), out=tmp_path / "first")
    assert sweep([again], Machine(1)) == []
    made = result_rows(again, read_run(again.directory))
    merge(tmp_path, "results.csv", [made[-1], {**made[-1], "seed": 1, "error": 0.5}])
    words = ["model", "--only", "sgim-d.planar-arm-7", "--seeds", "0-1", "--results", ".", "--processes", "1"]
    code = command(main, [*words, "--verify", "2"])
    said = capsys.readouterr()
    assert code == 1
    assert sorted(line.split()[0] for line in said.out.splitlines()) == ["DIFFERS", "equal"]  # the second was made up
    assert "1 equal, 0 equal but for rounding" in said.err
    assert [path.name for path in (tmp_path / "runs" / LEARNING).iterdir()] == ["verify-0"]


def test_a_cluster_is_asked_for_as_by_a_sweep(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command(main, ["paper", "--only", "random", "--seeds", "0", "--results", "mine", "--on", "head"]) == 2
    assert "error: no Dask scheduler answers at head" in capsys.readouterr().err
