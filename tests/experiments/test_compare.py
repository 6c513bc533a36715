"""The comparison with tiny variants, in real processes: what is run, what is harvested, what a bad end does to it."""

import csv
import re
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import compare as compare_module
from overview import Overview
from read_results import GOALS_HEADER, HEADER, read_goals, read_results
from runs import signal_after, start
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.runs.children import in_use
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run, read_run
from tables import Table
from tasks import COLUMNS, RESULTS, Task, goal_row, tasks_of, tiles_reached
from variants import EXPERIMENTS, TABLES, make_subsets, shipped, teacher_of

# Two variants that live for 40 movements, and one, of an experiment of its own, whose demonstrations are missing.
TINY = """
import sys, variants
from pathlib import Path
tiny = dict(movements=40, evaluate_at=(20,), repeats=2, benchmark=Path(sys.argv.pop(1)))
variants.EXPERIMENTS.clear()
variants.EXPERIMENTS["learners"] = {"random": dict(algorithm="random", **tiny)}
variants.EXPERIMENTS["large-space"] = {"sgim-d-large": dict(algorithm="sgim-d", task_space=100.0, **tiny)}
variants.EXPERIMENTS["broken"] = {"untaught": dict(algorithm="sgim-d", demonstrations=Path("nowhere.npz"), **tiny)}
variants.EXPERIMENTS["long"] = {"long-life": dict(algorithm="random", **{**tiny, "movements": 600})}
variants.EXPERIMENTS["forward-model"] = variants.EXPERIMENTS["learners"]
arm = dict(environment="planar-arm-7", movements=40, evaluate_at=(20,))
variants.EXPERIMENTS["planar-arm-7"] = {"sgim-d-arm-7": dict(algorithm="sgim-d", **arm)}
import compare
sys.exit(compare.main())
"""


@pytest.fixture
def compare(benchmark, tmp_path):
    """Starts a comparison in ``tmp_path``."""

    def compare(*options):
        places = ["--out", tmp_path / "runs", "--results", tmp_path / "results"]
        return start(TINY, benchmark, *places, "--seeds", 1, "--processes", 2, *options)

    return compare


@pytest.fixture
def handlers():
    """A comparison in this process leaves its signals as they were."""
    before = {signum: signal.getsignal(signum) for signum in (signal.SIGINT, signal.SIGTERM)}
    yield
    for signum, handler in before.items():
        signal.signal(signum, handler)


def ended(process):
    said, errors = process.communicate(timeout=600)
    return process.returncode, said, errors


def table(path):
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return tuple(header), rows


def keys_of(path, name="paper.csv"):
    """(variant, movements) of each row."""
    return [(row[1], int(row[5])) for row in table(path / "results" / name)[1]]


WHOLE = [("random", 20), ("random", 40), ("sgim-d-large", 20), ("sgim-d-large", 40)]


def test_each_evaluation_is_a_row_the_failed_are_reported_and_a_second_start_does_nothing(compare, tmp_path):
    code, _, errors = ended(compare("learners", "large-space", "broken"))
    assert code == 1
    assert sorted(keys_of(tmp_path)) == WHOLE
    assert "untaught seed 0 failed: error: demonstrations: there is no file nowhere.npz" in errors
    assert "2 runs ended well, 1 failed" in errors
    assert "Traceback" not in errors
    header, rows = table(tmp_path / "results/paper.csv")
    assert header == HEADER
    for variant, experiment, teacher, space in (
        ("random", "learners", "", "1.0"),
        ("sgim-d-large", "large-space", "3", "100.0"),
    ):
        run = read_run(tmp_path / "runs" / variant / "seed-000")
        theirs = [row for row in rows if row[1] == variant]
        assert [row[:5] for row in theirs] == 2 * [[experiment, variant, teacher, space, "0"]]
        assert [float(row[6]) for row in theirs] == run.evaluation["mean_error_m"].tolist()
        assert [row[7] for row in theirs] == ["", ""]  # the noise floor is measured at 5000 only
    run = read_run(tmp_path / "runs/sgim-d-large/seed-000")
    header, rows = table(tmp_path / "results/goals.csv")
    assert header == GOALS_HEADER
    assert rows == [["sgim-d-large", "0", str(len(run.chosen_goals())), "0"]]  # of 40000 m², 7 are near
    assert set(read_results(tmp_path / "results/paper.csv")) == {"random", "sgim-d-large"}
    assert read_goals(tmp_path / "results/goals.csv")["sgim-d-large"].shape == (1, 2)

    files = [*tmp_path.glob("runs/*/*/e*.csv"), *tmp_path.glob("results/*")]
    contents = [path.read_bytes() for path in files]
    code, _, errors = ended(compare("learners", "large-space"))
    assert code == 0
    assert "2 runs, 2 of them in" in errors
    assert "0 runs ended well, 0 failed" in errors
    assert [path.read_bytes() for path in files] == contents


def test_a_variant_of_two_experiments_is_one_run_in_the_table_of_each(compare, tmp_path):
    code, _, errors = ended(compare("learners", "forward-model", "planar-arm-7"))
    assert code == 0, errors
    assert {path.name for path in (tmp_path / "results").iterdir()} == {"paper.csv", "forward_model.csv"}
    run, arm = (read_run(tmp_path / "runs" / name / "seed-000") for name in ("random", "sgim-d-arm-7"))
    header, rows = table(tmp_path / "results/forward_model.csv")
    assert header == HEADER
    for experiment, teacher, theirs in (("forward-model", "", run), ("planar-arm-7", "structured", arm)):
        variant, errors_m = theirs.path.parent.name, theirs.evaluation["mean_error_m"].tolist()
        wanted = [[experiment, variant, teacher, "1.0", "0", str(20 * k), str(errors_m[k - 1]), ""] for k in (1, 2)]
        assert [row[:8] for row in rows if row[1] == variant] == wanted
    tiles = [int(row[8]) for row in rows if row[1] == "sgim-d-arm-7"]
    assert 0 < tiles[0] <= tiles[1] <= 40  # at most one a movement
    again = table(tmp_path / "results/paper.csv")[1]
    assert again == [["learners", *row[1:]] for row in rows if row[1] == "random"]


def test_what_is_in_one_table_is_still_to_be_done_for_the_other(tmp_path, monkeypatch, capsys, handlers):
    results = Table(tmp_path / "paper.csv", *RESULTS)
    results.append([["learners", "sgim-d", 3, 1.0, 0, 5000, 0.1, "", 7]])
    results.close()
    monkeypatch.chdir(tmp_path)
    options = "learners forward-model --only sgim-d --seeds 1 --dry-run --results ."
    monkeypatch.setattr(sys, "argv", ["compare.py", *options.split()])
    assert compare_module.main() == 0
    said = capsys.readouterr()
    assert said.out == "forward-model: sgim-d seed 0\n"
    assert "2 runs, 1 of them in paper.csv and forward_model.csv already" in said.err


def test_after_ctrl_c_it_goes_on(compare, tmp_path):
    log = tmp_path / "runs/long-life/seed-000/episodes.csv"
    code, errors = signal_after(compare("long", "learners"), log, 5, signal.SIGINT)
    assert code == 130
    assert "Stopped; the same command goes on from here." in errors
    assert "Traceback" not in errors
    assert not in_use(log.parent)
    lived = log.read_bytes()
    assert 0 < lived.count(b"\n") < 601
    code, _, errors = ended(compare("long", "learners"))
    assert code == 0, errors
    assert log.read_bytes().startswith(lived)
    assert sorted(keys_of(tmp_path)) == [("long-life", 20), ("long-life", 600), ("random", 20), ("random", 40)]


def test_killed_it_leaves_a_run_that_the_next_start_waits_for_and_harvests_once(compare, tmp_path):
    log = tmp_path / "runs/long-life/seed-000/episodes.csv"
    first = compare("long", "--processes", 1)
    while first.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") >= 5):
        time.sleep(0.01)
    first.kill()
    ended(first)
    assert in_use(log.parent)
    code, _, errors = ended(compare("long"))
    assert code == 0, errors
    assert "waiting for 1 of an earlier start" in errors
    assert keys_of(tmp_path) == [("long-life", 20), ("long-life", 600)]


def test_a_run_that_lost_its_rows_is_harvested_again_and_no_goal_is_counted_twice(go, benchmark, tmp_path):
    name = "sgim-d-large"
    config = Config(seed=3, movements=30, name=name, task_space=100.0, benchmark=benchmark, out=tmp_path)
    assert go(tmp_path, "--movements", 30, "--evaluate_at", "20", "--name", name, "--task_space", 100) == 0
    task, paths = Task("large-space", config), [tmp_path / "paper.csv", tmp_path / "goals.csv"]

    def harvest():
        tables = {path.name: Table(path, *COLUMNS[path.name]) for path in paths}
        known = task.last_row in tables[task.table].keys
        task.harvest(tables)
        for each in tables.values():
            each.close()
        return known

    assert not harvest()
    whole = [path.read_bytes() for path in paths]
    assert harvest()
    paths[0].write_bytes(whole[0][: whole[0].rindex(b"sgim-d-large") + 5])  # the power went while it was written
    assert not harvest()
    assert [path.read_bytes() for path in paths] == whole


def test_a_run_that_ended_without_its_last_evaluation_is_no_result(go, benchmark, tmp_path):
    assert go(tmp_path, "--movements", 30, "--evaluate_at", "[]") == 0
    task = Task("learners", Config(seed=3, movements=30, benchmark=benchmark, out=tmp_path))
    with pytest.raises(RunError, match="seed-003 has no evaluation after 30 movements, though it ended"):
        task.harvest({})


def test_looking_at_what_is_to_be_done_writes_nothing(tmp_path, monkeypatch, capsys, handlers):
    monkeypatch.chdir(tmp_path)
    options = "ablations --seeds 2 --dry-run --only grid uniform-goals"
    monkeypatch.setattr(sys, "argv", ["compare.py", *options.split()])
    assert compare_module.main() == 0
    wanted = [f"ablations: {name} seed {seed}" for seed in (0, 1) for name in ("uniform-goals", "grid")]
    assert capsys.readouterr().out.splitlines() == wanted
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["learnres"], "unknown experiment 'learnres', known are learners, .*did you mean learners?"),
        (["grid"], "grid is a variant, of ablations; write ablations --only grid"),
        (["ablations", "--only", "gird"], "unknown variant 'gird', known are uniform-goals, .*did you mean grid?"),
        (["learners", "--only", "grid"], "grid is a variant of ablations, asked for were learners"),
        (["sgim-d"], "sgim-d is a variant, of learners and forward-model; write learners --only sgim-d"),
        (["long", "--only", "sgim-d"], "sgim-d is a variant of learners and forward-model, asked for were long"),
        (["--only", "grid", "ablations"], "ablations is an experiment, no variant; experiments go before --only"),
        (["--seeds", "0"], "--seeds must be at least 1, got 0"),
        (["--first-seed", "-1"], "--first-seed must be at least 0, got -1"),
        (["--processes", "0"], "--processes must be at least 1, got 0"),
        (["--out", "file/runs"], "file/runs/demonstrations cannot be made: file is no folder"),
        (["--results", "file"], "--results file cannot be made: File exists; is a file in the way?"),
        (["--results", "foreign"], "foreign/paper.csv must begin with experiment,variant"),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(tmp_path, monkeypatch, capsys, handlers, options, message):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    Path("foreign").mkdir()
    Path("foreign/paper.csv").write_text("my,thesis\n")
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(sys, "argv", ["compare.py", *options])
    with pytest.raises(SystemExit) as end:  # argparse raises it, where main returns
        sys.exit(compare_module.main())
    assert end.value.code == 2
    assert re.search(message.replace("?", r"\?"), capsys.readouterr().err)
    written = set(tmp_path.rglob("*")) - set(before)
    assert not [path for path in written if path.suffix in (".csv", ".log")]


def test_two_comparisons_do_not_write_one_table(tmp_path, monkeypatch, capsys, handlers):
    (tmp_path / "results").mkdir()
    writer = Table(tmp_path / "results/paper.csv", *RESULTS)
    places = ["--out", str(tmp_path / "runs"), "--results", str(tmp_path / "results")]
    monkeypatch.setattr(sys, "argv", ["compare.py", *places, "learners"])
    assert compare_module.main() == 2
    assert "is being written by another compare.py" in capsys.readouterr().err
    writer.close()


def test_a_run_that_cannot_start_fails_alone(tmp_path):
    (tmp_path / "stuck").write_text("a file where its directory should be")
    tasks = [Task("learners", Config(algorithm="random", name="stuck", out=tmp_path))]
    results = Table(tmp_path / "paper.csv", *RESULTS)
    (failure,) = compare_module.carry_out(tasks, 0, 1, {"paper.csv": results})
    assert "stuck" in failure
    results.close()


def test_every_variant_is_a_run_that_can_be_and_in_its_table_has_a_name_of_its_own(tmp_path):
    tasks = tasks_of(list(EXPERIMENTS), [], range(1), tmp_path)
    assert len({(task.table, task.last_row) for task in tasks}) == len(tasks)
    assert not [note for task in tasks for note in task.config.without_effect if "--budget" in note]
    configs = {task.config.directory: task.config for task in tasks}
    assert all(task.config == configs[task.config.directory] for task in tasks)  # one directory, one run
    assert {task.experiment for task in tasks if task.table == "forward_model.csv"} == set(TABLES)
    for task in tasks:
        assert parse(task.options()) == (task.config, False)


def test_teachers_have_the_number_of_the_demonstrator_or_the_name_of_the_file(tmp_path):
    taught = Config(algorithm="sgim-d")
    assert teacher_of(taught) == "3"
    assert teacher_of(replace(taught, demonstrations=shipped(1))) == "1"
    assert teacher_of(replace(taught, algorithm="sagg-riac", demonstrations=shipped(1))) == ""
    assert teacher_of(replace(taught, environment="planar-arm-50")) == "structured"
    assert teacher_of(replace(taught, environment="planar-arm-50", demonstrations=shipped(1))) == "1"
    (few,) = tasks_of(["teaching"], ["few-demonstrations"], range(1), tmp_path)
    assert teacher_of(few.config) == "few"
    assert few.config.demonstrations == tmp_path / "demonstrations/few.npz"


def test_few_are_a_tenth_of_the_demonstrations_and_half_are_those_to_the_right(tmp_path):
    make_subsets(tmp_path / "new")
    everything = load_demonstrations()
    few, half = (load_demonstrations(tmp_path / "new" / name) for name in ("few.npz", "half.npz"))
    assert len(few) == 13
    assert {tuple(shown.outcome) for shown in few + half} < {tuple(shown.outcome) for shown in everything}
    assert all(shown.outcome[0] > 0 for shown in half)
    assert len(half) == sum(shown.outcome[0] > 0 for shown in everything) > 40


def test_tiles_of_the_benchmark_that_were_reached_are_counted_once():
    """Tiles of 0.5 m from (-1, -1); goals on two of them."""
    benchmark = Benchmark("FishingRod", np.array([[0.1, 0.1], [-0.9, 0.4]]), 0.5)
    at_rest, elsewhere = [np.nan, np.nan], [0.6, 0.1]
    assert tiles_reached(np.array([at_rest, elsewhere]), benchmark) == 0
    assert tiles_reached(np.array([[0.49, 0.0], [0.2, 0.3], elsewhere]), benchmark) == 1
    assert tiles_reached(np.array([[0.49, 0.0], [-0.51, 0.49], [-0.51, 0.51]]), benchmark) == 2


def run_with(origins, goals):
    nothing = np.empty((len(goals), 0))
    return Run(
        *(Path("nowhere"), {}, {}, {}, np.arange(len(goals)), np.array(origins), np.full(len(goals), -1)),
        *(nothing, nothing, np.array(goals, dtype=np.float64), nothing, {}, None),
    )


def test_a_goal_counts_once_imitation_and_rest_not_at_all_and_near_is_within_a_metre_and_a_half():
    none, near, edge, far, shown = [np.nan] * 2, [0.0, 1.0], [0.9, 1.2], [1.0, 1.2], [0.3, 0.3]
    origins = ["babble", "local", "global", "imitate", "imitate", "local", "local", "local", ""]
    run = run_with(origins, [none, near, near, shown, shown, edge, far, near, none])
    np.testing.assert_array_equal(run.chosen_goals(), [near, edge, far, near])
    task = Task("large-space", Config(name="sgim-d-large", seed=7))
    assert goal_row(task, run) == ["sgim-d-large", 7, 4, 3]
    assert len(run_with(["babble"], [none]).chosen_goals()) == 0


def test_what_is_left_is_measured_by_the_movements_that_the_robot_has_still_to_make(tmp_path, benchmark):
    """100 movements each, 3 goals evaluated twice; the noise once, 2 times."""
    config = Config(algorithm="random", movements=100, evaluate_at=(50,), floor_at=(50,), repeats=2, out=tmp_path)
    config = replace(config, benchmark=benchmark)
    task, idle = Task("learners", config), Task("learners", replace(config, algorithm="observation"))
    assert task.work == 100 + 3 * 2 + 3 * 2
    assert idle.work == 3 * 2 + 3 * 2
    log = idle.config.directory / "episodes.csv"
    log.parent.mkdir(parents=True)
    log.write_text("index\n" + 100 * "1\n")  # it ended on disk: all that is left is to replay it
    overview = Overview([task, idle], done=3)
    assert overview.line(0) == "3 of 5 runs"
    assert overview.seconds_left() == np.inf
    overview.cannot_start(idle)
    assert overview.line(1) == "3 of 5 runs, 1 failed   waiting for 1 of an earlier start"


def test_the_time_left_is_what_as_much_work_took_and_replaying_counts_for_a_fifth(tmp_path, benchmark):
    config = Config(algorithm="random", movements=40, floor_at=(), benchmark=benchmark, out=tmp_path)
    first, second = (Task("learners", replace(config, seed=seed)) for seed in (0, 1))

    def elapsed_while_running(task, overview):
        began = time.monotonic()
        child = task.start()
        overview.started(task, child)
        child.process.wait()
        child.check()
        assert "40/40" in overview.line(0) or "done" in overview.line(0)
        overview.ended(child, failed=False)
        return time.monotonic() - began

    overview = Overview([first, second], done=0)
    elapsed = elapsed_while_running(first, overview)
    assert overview.line(0).startswith("1 of 2 runs   ")
    assert overview.seconds_left() == pytest.approx(elapsed, rel=0.2)
    overview = Overview([first, second], done=0)  # the first is on disk
    elapsed = elapsed_while_running(second, overview)
    assert overview.seconds_left() == pytest.approx(0.2 * elapsed, rel=0.2)
