"""The comparison with tiny variants, in real processes: what is run, what is collected, what happens when runs fail."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compare import RUN, collect, compared, last_rows, main, runs_of
from made_up import row, write
from runs import ROOT, start
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.record import RunError
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.config import Config, words
from sgimd_torch.runs.parallel import sweep
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import Run, read_run
from table import CORNER, explored_rows, merge, read_table, result_rows, task_name, tiles_reached
from variants import EXPERIMENTS, make_subsets

# Two variants that live for 40 movements, and one, of an experiment of its own, whose demonstrations are missing.
TINY = """
import sys
sys.path.insert(0, "EXPERIMENTS")
import variants
from pathlib import Path
from sgimd_torch.runs.parallel import sweep
from sgimd_torch.runs.process import command
tiny = dict(movements=40, evaluate_at=(20,), repeats=2, benchmark=Path(sys.argv.pop(1)))
variants.EXPERIMENTS.clear()
variants.EXPERIMENTS["learners"] = {"random": dict(algorithm="random", **tiny)}
large = {"algorithm": "sgim-d", "environment.task_space": 100.0, **tiny}
variants.EXPERIMENTS["large-space"] = {"sgim-d-large": large}
variants.EXPERIMENTS["broken"] = {"untaught": dict(algorithm="sgim-d", demonstrations=Path("nowhere.npz"), **tiny)}
variants.EXPERIMENTS["forward-model"] = variants.EXPERIMENTS["learners"]
arm = dict(environment="planar-arm-7", movements=40, evaluate_at=(20,))
variants.EXPERIMENTS["planar-arm-7"] = {"sgim-d-arm-7": dict(algorithm="sgim-d", **arm)}
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


def test_each_evaluation_is_a_row_for_each_experiment_the_failed_are_reported_and_a_second_start_does_nothing(
    compare, tmp_path
):
    code, _, errors = ended(compare("learners", "forward-model", "large-space", "planar-arm-7", "broken"))
    assert code == 1
    assert "untaught seed 0 failed: nowhere.npz cannot be read or written: No such file" in errors
    assert "3 runs ended well, 1 failed" in errors
    assert "Traceback" not in errors
    table = read_table(tmp_path / "results")
    tasks = {"learners": "fishing-rod", "large-space": "fishing-rod task_space=100", "planar-arm-7": "planar-arm-7"}
    for experiment, task in tasks.items():
        theirs = table[table.experiment == experiment]
        (variant,) = {*theirs.variant}
        assert [*zip(theirs.task, theirs.movements, theirs.answer, strict=True)] == [
            (task, when, "process") for when in (20, 40)
        ]
        run = read_run(tmp_path / "runs" / variant / "seed-000")
        assert [*theirs.error] == run.answers["own"]["mean_error"].tolist()
        assert theirs.floor.isna().all()  # the noise floor is measured at 5000 only
    first, second = (
        table[table.experiment == each].drop(columns="experiment") for each in ("learners", "forward-model")
    )
    assert first.to_csv(index=False) == second.to_csv(index=False)  # one run, of two experiments
    explored = read_table(tmp_path / "results", "explored.csv").set_index("variant")
    assert explored.goals["random"] == 0
    assert 0 < explored.tiles["random"] <= 40
    n_goals = len(read_run(tmp_path / "runs/sgim-d-large/seed-000").chosen_goals())
    assert (explored.goals["sgim-d-large"], explored.near["sgim-d-large"]) == (n_goals, 0)  # of 40000 m², 7 are near

    contents = [path.read_bytes() for path in tmp_path.glob("results/*.csv")]
    code, _, errors = ended(compare("learners", "large-space"))
    assert code == 0
    assert "2 runs, 2 of them in" in errors
    assert "nothing is left to run: --verify 10 makes ten of these rows again" in errors
    assert [path.read_bytes() for path in tmp_path.glob("results/*.csv")] == contents


def test_shards_share_out_the_runs_and_one_of_two_experiments_stays_together(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    wanted = ["learners", "forward-model", "--seeds", "0-1", "--results", ".", "--dry-run"]
    parts = []
    for shard in ("1/1", "1/3", "2/3", "3/3"):
        assert command(main, [*wanted, "--shard", shard]) == 0
        parts.append(capsys.readouterr().out.splitlines())
    whole, *parts = parts
    assert sorted(line for part in parts for line in part) == sorted(whole)
    runs = [{line.partition(": ")[2] for line in part} for part in parts]
    assert len(set.union(*runs)) == sum(map(len, runs)) < len(whole)


def test_rows_of_one_experiment_are_still_to_be_made_for_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(write(tmp_path, [row("learners", "sgim-d", 0, 5000, "process", 0.1)]))
    words = ["learners", "forward-model", "--only", "sgim-d", "--seeds", "0", "--dry-run", "--results", "."]
    assert command(main, words) == 0
    said = capsys.readouterr()
    assert said.out == "forward-model: sgim-d seed 0\n"
    assert "2 runs, 1 of them in results.csv already" in said.err


def test_a_run_that_lost_its_rows_is_collected_again_and_no_goal_is_counted_twice(go, benchmark, tmp_path):
    name = "sgim-d-large"
    parts = {"environment.task_space": 100.0}
    config = Config("sgim-d", seed=3, movements=30, name=name, benchmark=benchmark, out=tmp_path, parts=parts)
    large = ("--environment.task_space", 100)
    assert go(tmp_path, "--movements", 30, "--evaluate_at", "20", "--name", name, *large) == 0
    paths = [tmp_path / "results.csv", tmp_path / "explored.csv"]

    def collected():
        known = {*read_table(tmp_path)[RUN].itertuples(index=False, name=None)}
        before = last_rows("large-space", config) <= known
        collect("large-space", config, tmp_path)
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
        collect("learners", config, tmp_path / "results")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["learnres"], "learnres.*learners"),
        (["grid"], "grid is a variant of ablations; write ablations --only grid"),
        (["ablations", "--only", "gird"], "gird.*grid"),
        (["learners", "--only", "grid"], "grid is a variant of ablations"),
        (["--only", "grid", "ablations"], "ablations is an experiment"),
        (["--seeds", ""], "--seeds: must be like 5, 0-19 or 0,3,7-9, got ''"),
        (["--seeds=-1"], "--seeds: must be like 5, 0-19 or 0,3,7-9, got '-1'"),
        (["--processes", "0"], "--processes: must be a whole number of at least 1, got '0'"),
        (["--out", "file/runs"], "file/runs/demonstrations cannot be made: Not a directory"),
        (["--results", "file"], "file cannot be made: File exists; is a file in its place?"),
        (["--results", "foreign"], "foreign/results.csv.*must begin with experiment,variant"),
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


def test_every_variant_is_a_valid_run_with_its_own_name_in_its_table(tmp_path):
    wanted = runs_of(list(EXPERIMENTS), [], range(1), tmp_path)
    assert len({tuple(sorted(last_rows(name, config))) for name, config in wanted}) == len(wanted)
    configs = {config.directory: config for _, config in wanted}
    assert all(config == configs[config.directory] for _, config in wanted)  # one directory, one run
    for _, config in wanted:
        assert parse(words(config))[0] == config


def test_without_seeds_each_experiment_has_those_that_its_shipped_rows_are_of(tmp_path):
    wanted = {}
    for name, config in runs_of(list(EXPERIMENTS), [], None, tmp_path):
        wanted.setdefault((name, config.variant), []).append(config.seed)
    assert wanted["learners", "sgim-d"] == wanted["forward-model", "sgim-d"] == [*range(100, 120)]
    assert wanted["forward-model", "gradient"] == [*range(100, 110)]
    table = read_table(ROOT / "results")
    assert {*table.experiment} <= {*EXPERIMENTS}
    runs = {*table[["experiment", "variant", "seed"]].itertuples(index=False, name=None)}
    assert runs == {
        (experiment, variant, seed)
        for (experiment, variant), seeds in wanted.items()
        for seed in seeds
        if (experiment, variant) in {(name, each) for name, each, _ in runs}  # claims.py names those without rows
    }


def test_a_task_is_the_robot_and_what_is_not_as_usual_about_it():
    names = {
        "fishing-rod": {},
        "fishing-rod task_space=100": {"environment.task_space": 100.0},
        "fishing-rod noise=0": {"environment.noise": 0.0},
        "planar-arm-50": {"environment": "planar-arm-50"},
    }
    assert [task_name(Config(parts=parts)) for parts in names.values()] == [*names]


def test_a_run_is_evaluated_by_its_own_inverse_and_by_the_answers_that_pages_read(tmp_path):
    wanted = {config.variant: config for _, config in runs_of(["letter", "suite", "learners"], [], range(1), tmp_path)}
    assert wanted["sgim-d-letter"].evaluated_by == ("own", "process")
    assert wanted["practice-uniform.toss"].evaluated_by == ("own", "linear", "nearest")
    assert wanted["random-nearest.toss"].evaluated_by == ("own", "linear", "process")
    assert wanted["sgim-d"].evaluated_by == ("own",)
    assert last_rows("letter", wanted["sgim-d-letter"]) == {
        ("letter", "sgim-d-letter", 0, 5000, answer) for answer in ("paper", "process")
    }


@pytest.fixture(scope="module")
def subsets(tmp_path_factory):
    """All that is shipped, and the subsets of it by name."""
    pytest.importorskip("sgimd_torch.teach", reason="needs the room teach, which was left out")
    folder = tmp_path_factory.mktemp("subsets") / "new"
    make_subsets(folder, by_hand=True)
    parts = {path.stem: load_demonstrations(path, n_joints=6, outcome_dim=2) for path in folder.iterdir()}
    return load_demonstrations(), parts


def test_few_are_a_tenth_of_the_demonstrations_and_half_are_those_to_the_right(subsets):
    everything, parts = subsets
    few, half = parts["few"], parts["half"]
    assert len(few) == 13
    assert {tuple(shown.outcome) for shown in few + half} < {tuple(shown.outcome) for shown in everything}
    assert all(shown.outcome[0] > 0 for shown in half)
    assert len(half) == sum(shown.outcome[0] > 0 for shown in everything) > 40


def test_a_corner_is_twenty_neighbours_and_shuffled_ones_only_say_something_else(subsets):
    everything, parts = subsets
    corner, shuffled = parts["corner"], parts["shuffled"]
    assert len(corner) == 20
    assert np.ptp([shown.outcome for shown in corner], axis=0).max() < 1
    assert [shown.trajectory.tobytes() for shown in shuffled] == [shown.trajectory.tobytes() for shown in everything]
    said, done = (sorted(tuple(shown.outcome) for shown in each) for each in (shuffled, everything))
    assert said == done
    same = sum((a.outcome == b.outcome).all() for a, b in zip(shuffled, everything, strict=True))
    assert same < 10


def test_ten_lessons_by_hand_are_set_against_the_first_ten_that_are_shipped(subsets):
    everything, parts = subsets
    assert len(parts["ten"]) == len(parts["hand"]) == 10
    for shown, shipped_one in zip(parts["ten"], everything, strict=False):
        np.testing.assert_array_equal(shown.trajectory, shipped_one.trajectory)


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
    shipped_row = row("learners", "sgim-d", 0, 5000, "process", 0.0426)
    assert compared(shipped_row, dict(shipped_row)) == "equal"
    assert compared(shipped_row, {**shipped_row, "error": 0.04260000000001}) == "rounding"
    changes = [{"error": 0.0427}, {"floor": 0.03}, {"movements": 4000}, {"answer": "linear"}]
    for now in (*({**shipped_row, **change} for change in changes), {}):
        assert compared(shipped_row, now) == "DIFFERS"


def test_rows_are_drawn_by_lot_and_made_again_in_a_folder_of_their_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    config = Config(algorithm="sgim-d", name="sgim-d-arm-7", movements=20, parts={"environment": "planar-arm-7"})
    again = replace(config, evaluate_at=(20,), floor_at=(), evaluated_by=("own",), out=tmp_path / "first")
    assert sweep([again], processes=1) == []
    made = result_rows("planar-arm-7", again, read_run(again.directory))
    merge(tmp_path, "results.csv", [made[-1], {**made[-1], "seed": 1, "error": 0.5}])
    words = ["planar-arm-7", "--only", "sgim-d-arm-7", "--seeds", "0-1", "--results", ".", "--processes", "1"]
    code = command(main, [*words, "--verify", "2"])
    said = capsys.readouterr()
    assert code == 1
    assert sorted(line.split()[0] for line in said.out.splitlines()) == ["DIFFERS", "equal"]  # the second was made up
    assert "1 equal, 0 equal but for rounding" in said.err
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {"demonstrations", "verify-0"}
