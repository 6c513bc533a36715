"""Whole runs on the fishing rod: what they write, that they can be repeated, and what they refuse."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys

import numpy as np
import pytest

import sgimd_torch
from runs import MOVEMENTS, ROOT, arguments, csv_of
from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.runs import run as run_script
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.process import Stopped, Stopping
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.spaces import Demonstration, stream

MODEL_SEARCHES = ["gradient", "gauss-newton"]


@pytest.mark.parametrize("algorithm", CATALOGUE["algorithm"])
def test_every_algorithm_writes_a_whole_run_directory(tmp_path, go, capsys, algorithm):
    assert go(tmp_path, "--algorithm", algorithm) == 0
    directory = tmp_path / algorithm / "seed-003"
    assert str(directory) in capsys.readouterr().out
    run = read_run(directory)
    assert run.index.tolist() == list(range(MOVEMENTS))
    assert run.thetas.shape == (MOVEMENTS, 25)
    assert (run.regions is not None) == (algorithm in ("sagg-riac", "sgim-d", "sgim-im", "sgim-acts"))
    header = (directory / "evaluation.csv").read_text().splitlines()[0]
    assert header == "movements,answer,mean_error_m,median_error_m,p90_error_m,noise_floor_m,goals_met,crc32"
    # Observation has seen nothing before movement 30, so it has nothing to be evaluated by after 30 movements.
    wanted = [60, 90] if algorithm in ("observation", "imitation") else [30, 60, 90]
    assert run.evaluation["movements"].tolist() == wanted
    assert list(run.summary)[:3] == ["movements", "mean_error_m", "noise_floor_m"]
    assert {"seconds_physics", "seconds_learner", "seconds_evaluation"} < set(run.summary)
    assert run.summary["movements"] == MOVEMENTS
    assert run.summary["finished"] is True
    assert run.summary["mean_error_m"] == run.evaluation["mean_error_m"][-1]
    assert run.config["algorithm"] == algorithm
    assert {"python", "numpy", "scipy", "faiss", "mujoco", "sgimd_torch", "platform", "commit"} == set(run.versions)
    assert not list(directory.glob("*.part"))


def test_the_log_shows_who_rested_imitated_and_was_taught(tmp_path, go):
    assert go(tmp_path, "--algorithm", "imitation") == 0
    run = read_run(tmp_path / "imitation" / "seed-003")
    assert np.flatnonzero(run.demonstration >= 0).tolist() == [30, 60]
    assert run.origin.tolist() == [""] * 30 + ["imitate"] * 60
    assert np.isnan(run.outcomes[:30]).all()
    assert not np.isnan(run.outcomes[30:]).any()


def test_the_same_seed_makes_the_same_bytes(tmp_path, go, reference):
    assert go(tmp_path) == 0
    assert csv_of(tmp_path / "sgim-d" / "seed-003") == reference


def test_another_seed_makes_another_run(tmp_path, go, reference):
    assert go(tmp_path, "--seed", 4) == 0
    assert csv_of(tmp_path / "sgim-d" / "seed-004")["episodes.csv"] != reference["episodes.csv"]


@pytest.mark.parametrize("evaluations", ["[]", "[1,2,7,30,31,89]"])
def test_evaluating_more_or_not_at_all_leaves_the_log_as_it_is(tmp_path, go, reference, evaluations):
    assert go(tmp_path, "--evaluate_at", evaluations) == 0
    written = csv_of(tmp_path / "sgim-d" / "seed-003")
    assert written["episodes.csv"] == reference["episodes.csv"]
    assert written["evaluation.csv"].count(b"\n") == (1 if evaluations == "[]" else 1 + 2 * 7)


def test_floor_at_names_the_evaluations_that_measure_the_noise_and_changes_nothing_else(tmp_path, go, reference):
    for floor_at, measured in (("60", [60]), ("30,90,1000", [30, 90]), ("[]", []), ("null", [30, 60, 90])):
        assert go(tmp_path / floor_at, "--floor_at", floor_at) == 0
        directory = tmp_path / floor_at / "sgim-d" / "seed-003"
        evaluation = read_run(directory).evaluation
        assert evaluation["movements"][np.isfinite(evaluation["noise_floor_m"])].tolist() == measured
        written = csv_of(directory)
        for name in ("episodes.csv", "regions.csv"):
            assert written[name] == reference[name]
        lines = zip(written["evaluation.csv"].splitlines(), reference["evaluation.csv"].splitlines(), strict=True)
        for line, full in lines:
            movements, *errors, _, met, _ = full.split(b",")
            if movements == b"movements" or int(movements) in measured:
                assert line == full
            else:
                assert line.split(b",")[:-1] == [movements, *errors, b"nan", met]


def answers_of(out, go, *options):
    assert go(out, *options) == 0
    (path,) = out.glob("*/seed-003")
    return read_run(path).answers, csv_of(path)["episodes.csv"]


def test_an_inverse_answers_alike_whether_it_is_the_runs_own_or_another(tmp_path, go):
    """Imitators with different inverses remember the same, so nearest and linear land at the same places."""
    found, logs = zip(
        *(
            answers_of(
                tmp_path / own, go, "--algorithm", "imitation", "--inverse", own, "--evaluated-by", f"own,{other}"
            )
            for own, other in (("nearest", "linear"), ("linear", "nearest"))
        ),
        strict=True,
    )
    assert logs[0] == logs[1]
    for mine, theirs in ((found[0]["own"], found[1]["nearest"]), (found[1]["own"], found[0]["linear"])):
        assert mine["mean_error_m"].tolist() == theirs["mean_error_m"].tolist()
        assert mine["goals_met"].tolist() == theirs["goals_met"].tolist()
        assert np.isfinite(mine["noise_floor_m"]).all()
        assert np.isnan(theirs["noise_floor_m"]).all()
    assert found[0]["own"]["mean_error_m"].tolist() != found[0]["linear"]["mean_error_m"].tolist()


def test_what_a_run_learns_with_answers_once_for_both_of_its_names(tmp_path, go):
    found, _ = answers_of(
        tmp_path, go, "--algorithm", "sgim-d", "--inverse", "linear", "--evaluated-by", "own,nearest,linear"
    )
    assert found["linear"]["mean_error_m"].tolist() == found["own"]["mean_error_m"].tolist()
    assert np.isfinite(found["own"]["noise_floor_m"]).all()
    assert np.isnan(found["linear"]["noise_floor_m"]).all()
    parts = build(config_of(read_run(next(tmp_path.glob("*/seed-003")))))
    assert parts.answers["linear"] is parts.inverse is parts.learner.inverse
    assert parts.answers["nearest"] is not parts.inverse


def test_a_run_has_the_answers_that_were_asked_for_and_its_log_does_not_depend_on_them(tmp_path, go, reference):
    found, log = answers_of(tmp_path, go, "--evaluated-by", "own,nearest,paper,model")
    assert list(found) == ["own", "nearest", "paper"]  # there is no model
    assert log == reference["episodes.csv"]


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ("linear", "evaluated_by must begin with own, got linear"),
        ("process,own", "evaluated_by must begin with own, got process,own"),
        ("own,own", "evaluated_by must name at least one, and each once, got own,own"),
        ("own,liner", "unknown inverse 'liner'; did you mean linear"),
    ],
)
def test_answers_that_make_no_sense_are_refused(tmp_path, go, capsys, answers, message):
    assert go(tmp_path, "--evaluated-by", answers) == 2
    assert re.search(message, capsys.readouterr().err)


def test_threads_change_no_byte(tmp_path, go, reference):
    assert go(tmp_path, "--environment.threads", 2) == 0
    assert csv_of(tmp_path / "sgim-d" / "seed-003") == reference


def test_with_and_without_the_teacher_the_environment_makes_the_same_noise(tmp_path, go):
    assert go(tmp_path, "--algorithm", "sagg-riac") == go(tmp_path, "--algorithm", "sgim-d") == 0
    alone, taught = (read_run(tmp_path / name / "seed-003") for name in ("sagg-riac", "sgim-d"))
    assert np.array_equal(alone.outcomes[:30], taught.outcomes[:30])  # until the first demonstration they are one
    assert not np.array_equal(alone.thetas[30:], taught.thetas[30:])
    rod = FishingRod(threads=1)
    for run in (alone, taught):
        for k in (40, 75):
            noise = stream(3, "environment", k)
            assert np.array_equal(rod.execute(run.contexts[k], run.thetas[k], noise), run.outcomes[k])


def test_a_directory_with_other_files_is_left_alone(tmp_path, go, capsys):
    directory = tmp_path / "sgim-d" / "seed-003"
    directory.mkdir(parents=True)
    (directory / "thesis.tex").touch()
    assert go(tmp_path) == go(tmp_path, "--resume") == 2
    assert "thesis.tex" in capsys.readouterr().err
    assert os.listdir(directory) == ["thesis.tex"]


def test_a_damaged_config_is_named(tmp_path, go, capsys):
    assert go(tmp_path, "--movements", 10) == 0
    (tmp_path / "sgim-d" / "seed-003" / "config.json").write_text('{"algorithm": ')
    assert go(tmp_path, "--resume") == 2
    assert "config.json cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--algorithm ''", "unknown algorithm"),
        ("--out ''", "--out must be a path, got an empty one"),
        ("--benchmark=", "--benchmark must be a path, got an empty one"),
        ("--benchmark /", "/ is a directory, a file was wanted"),
        ("--name a/b", "name must be that of one directory"),
        ("--benchmark nowhere.npz", "benchmark: there is no file nowhere.npz"),
        ("--benchmark {text}", "is no benchmark"),
        ("--demonstrations nowhere.npz", "demonstrations: there is no file nowhere.npz"),
        ("--demonstrations {text}", "is no demonstration file"),
        ("--out {text}", "text is no folder"),
        ("stray", "'stray' belongs to no option"),
    ],
)
def test_what_makes_no_sense_is_refused_clearly_and_leaves_nothing_behind(tmp_path, go, capsys, options, message):
    text = tmp_path / "text"
    text.write_text("not what you look for")
    assert go(tmp_path / "out", *shlex.split(options.format(text=text))) == 2
    errors = capsys.readouterr().err
    assert len(errors) < 1000
    assert "Traceback" not in errors
    assert "error: " in errors
    assert re.search(message, errors)
    assert os.listdir(tmp_path) == ["text"]


def test_a_benchmark_for_another_environment_is_refused(tmp_path, go, capsys):
    save_benchmark(tmp_path / "arm.npz", Benchmark("PlanarArm", np.zeros((3, 2)), 0.1))
    assert go(tmp_path / "out", "--benchmark", tmp_path / "arm.npz") == 2
    assert "made for PlanarArm" in capsys.readouterr().err


def test_a_diverging_simulation_is_reported_with_its_theta_and_leaves_a_whole_log(tmp_path, monkeypatch, go, capsys):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes a log of its own
    assert go(tmp_path, "--environment.noise", "1e4") == 1  # commands of thousands of rad
    errors = capsys.readouterr().err
    assert "theta=[0." in errors
    assert "Traceback" not in errors
    directory = tmp_path / "sgim-d" / "seed-003"
    lines = (directory / "episodes.csv").read_bytes().count(b"\n")
    assert len(read_run(directory).index) == lines - 1 < MOVEMENTS
    assert read_run(directory).summary["finished"] is False


@pytest.mark.parametrize(
    ("kind", "table"), [item for item in CATALOGUE.items() if item[0] not in ("algorithm", "environment", "explore")]
)
def test_every_choice_runs_and_differs_from_the_others(tmp_path, go, kind, table):
    logs = set()
    option = {"progress": "goals.progress", "choose": "teacher.choose"}.get(kind, kind)
    # Short attempts and a short window, so that the map is split, and has its say, before the run is over.
    common = ["--movements", 240, "--evaluate_at", "[]"]
    common += ["--algorithm", "sgim-im"] if kind in ("teachers", "base") else ["--budget", 3]
    common += ["--teacher.every", 20] if kind == "choose" else []
    common += ["--goals.window", 4] if kind == "progress" else []
    # See the next two tests; a person who is not there is like no teacher, and demonstrator 3 is all there are.
    left_out = *MODEL_SEARCHES, "model", "model-proved", "by-hand", "demonstrator-3"
    choices = [choice for choice in table if choice not in left_out]
    asking = {"teachers": "sgim-im", "base": "sgim-im"}  # the others ask nobody
    learner = ("--algorithm", asking[option]) if option in asking else ()
    for choice in choices:
        assert go(tmp_path, "--name", choice, f"--{option}", choice, *common) == 0
        logs.add((tmp_path / choice / "seed-003" / "episodes.csv").read_bytes())
    assert len(logs) == len(choices)


ON_THE_ARM = (
    "--environment",
    "planar-arm-7",
    "--benchmark",
    "null",
    "--movements",
    400,
    "--evaluate_at",
    200,
    "--repeats",
    0,
)
QUICK = ("--model.rate", 4)


def test_every_search_through_the_model_runs_and_differs_from_the_others(tmp_path, go):
    searches = ("nelder-mead", *MODEL_SEARCHES)
    for search in searches:
        assert (
            go(
                tmp_path,
                "--name",
                search,
                "--search",
                search,
                *ON_THE_ARM,
                *(QUICK if search in MODEL_SEARCHES else ()),
            )
            == 0
        )
    assert len({(tmp_path / search / "seed-003" / "episodes.csv").read_bytes() for search in searches}) == len(searches)


def test_the_inverse_through_the_model_lives_as_the_linear_one_and_answers_better(tmp_path, go):
    runs = {}
    for inverse in ("linear", "model"):
        assert (
            go(tmp_path, "--name", inverse, "--inverse", inverse, *ON_THE_ARM, *(QUICK if "model" in inverse else ()))
            == 0
        )
        runs[inverse] = read_run(tmp_path / inverse / "seed-003")
    np.testing.assert_array_equal(runs["model"].thetas, runs["linear"].thetas)
    assert runs["model"].evaluation["mean_error_m"][-1] < 0.7 * runs["linear"].evaluation["mean_error_m"][-1]


def test_the_model_that_proves_itself_lives_as_the_process_and_answers_no_worse(tmp_path, go):
    runs = {}
    for inverse in ("process", "model-proved"):
        assert (
            go(tmp_path, "--name", inverse, "--inverse", inverse, *ON_THE_ARM, *(QUICK if "model" in inverse else ()))
            == 0
        )
        runs[inverse] = read_run(tmp_path / inverse / "seed-003")
    np.testing.assert_array_equal(runs["model-proved"].thetas, runs["process"].thetas)
    errors = [run.evaluation["mean_error_m"][-1] for run in runs.values()]
    assert errors[0] != errors[1] < 1.03 * errors[0]


def test_config_defaults_are_the_librarys(benchmark):
    learner = build(Config("sgim-d", benchmark=benchmark)).learner
    shipped = sgimd_torch.sgim_d(FishingRod(), 0, correspondence=FishingRod().primitive.correspondence)
    for name in ("budget", "tolerance", "global_range", "give_up"):
        assert getattr(learner.autonomous, name) == getattr(shipped.autonomous, name)
    for part in ("goals", "inverse", "judge"):
        assert type(getattr(learner.autonomous, part)) is type(getattr(shipped.autonomous, part))
    for name in ("repeats", "epsilon"):
        assert getattr(learner.social, name) == getattr(shipped.social, name)


def test_json_files_are_plain_json(tmp_path, go):
    assert go(tmp_path, "--repeats", 0, "--movements", 10) == 0  # no repeats: no noise floor, NaN in the csv
    directory = tmp_path / "sgim-d" / "seed-003"
    for path in directory.glob("*.json"):
        json.loads(path.read_text(), parse_constant=pytest.fail)  # called for NaN, which is no json
    assert read_run(directory).summary["noise_floor_m"] is None
    assert np.isnan(read_run(directory).evaluation["noise_floor_m"]).all()


def test_the_misfit_of_the_demonstrations_is_reported(tmp_path, go, capsys):
    assert go(tmp_path) == 0
    assert re.search(
        r"127 demonstrations; correspondence misses them by 0\.\d+ rad \(median\)", capsys.readouterr().err
    )


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
    assert re.search(r"recording 1 lands at \(.*\) m, outside T; were they recorded in cm\?", capsys.readouterr().err)


def test_a_link_to_nowhere_is_named(tmp_path, go, capsys):
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    assert go(tmp_path / "link") == 2
    assert f"{tmp_path / 'link'} is no folder" in capsys.readouterr().err


def test_an_error_while_running_is_one_line(tmp_path, go, capsys, monkeypatch):
    def fail(*_, **__):
        raise ValueError("this cannot be evaluated")

    monkeypatch.setattr(run_script, "evaluate", fail)
    assert go(tmp_path) == 1
    assert "error: this cannot be evaluated\n" in capsys.readouterr().err


def test_evaluate_at_may_be_joined_by_an_equals_sign(tmp_path, go):
    assert go(tmp_path, "--evaluate-at=5,6", "--movements=8") == 0
    assert read_run(tmp_path / "sgim-d" / "seed-003").evaluation["movements"].tolist() == [5, 6, 8]


@pytest.mark.parametrize("after_another", [False, True])
def test_a_signal_waits_for_the_next_check_but_where_it_may_come_at_once(after_another):
    with Stopping() as stopping:
        if after_another:
            with stopping.at_once():
                pass
        try:
            signal.raise_signal(signal.SIGTERM)
        except Stopped:
            pytest.fail("a signal interrupts what it should not")
        with pytest.raises(Stopped), stopping.at_once():
            pass
    with Stopping() as stopping, pytest.raises(Stopped), stopping.at_once():
        signal.raise_signal(signal.SIGTERM)


def test_a_second_signal_ends_a_movement_that_does_not_end(capsys):
    with Stopping() as stopping, stopping.at_once(2):
        signal.raise_signal(signal.SIGINT)
        assert "once more stops at once" in capsys.readouterr().err
        with pytest.raises(Stopped):
            signal.raise_signal(signal.SIGINT)
    with Stopping() as stopping:
        with stopping.at_once(2):
            signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Stopped):
            stopping.check()


SCRIPTS = {**os.environ, "PYTHONPATH": str(ROOT)}


@pytest.mark.parametrize(
    "script",
    [
        *(f"-m sgimd_torch {words}" for words in ("run --out", "demo --out", "table", "report")),
        *(f"experiments/{name}.py" for name in ("compare", "claims", "figures", "model_figures")),
    ],
)
def test_ctrl_c_while_python_imports_shows_no_traceback(script, tmp_path):
    command = [sys.executable, "-X", "importtime", *script.split(), str(tmp_path)]
    said = ""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=SCRIPTS, cwd=ROOT) as process:
        for line in process.stderr:  # importtime tells what is loaded, as it goes
            said += line
            if " numpy." in line:
                process.send_signal(signal.SIGINT)
                break
        said += process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("redirection", "code"), [("| true", 0), (">/dev/full", 1), ("2>/dev/full", 0), ("2>&-", 0), (">&-", 0), ("", 0)]
)
def test_a_run_finishes_whatever_happens_to_its_output(tmp_path, benchmark, redirection, code):
    script = [sys.executable, "-m", "sgimd_torch", "run", *arguments(tmp_path, benchmark)]
    command = shlex.join([*script, "--movements", "5", "--name", "Å"])
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{command} {redirection}"],
        capture_output=True,
        text=True,
        env={**SCRIPTS, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    )
    assert done.returncode == code, done
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert read_run(tmp_path / "Å" / "seed-003").summary["finished"] is True


@pytest.mark.parametrize(("chosen", "threads"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_small_matrices_get_one_thread_unless_the_user_chose(chosen, threads):
    program = "import os, sys; from sgimd_torch.__main__ import main; main(); print(os.environ['OMP_NUM_THREADS'])"
    others = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    said = subprocess.run(
        [sys.executable, "-c", program, "--version"], env=others | chosen, capture_output=True, text=True, check=True
    ).stdout
    assert said.split()[-1] == threads


def test_practice_learns_and_answers_by_the_same_inverse(tmp_path):
    learning = ["--algorithm", "practice", "--environment", "two-elbows", "--movements", "60", "--evaluate-at", "60"]
    options = [*learning, "--repeats", "0", "--evaluated-by", "own,process,nearest", "--out", str(tmp_path)]
    errors = {}
    for name, more in (("default", []), ("named", ["--inverse", "nearest"])):
        assert main([*options, "--name", name, *more]) == 0
        answers = read_run(tmp_path / name / "seed-000").answers
        errors[name] = {answer: float(table["mean_error_m"][-1]) for answer, table in answers.items()}
    assert errors["default"]["own"] == errors["default"]["process"] != errors["default"]["nearest"]
    assert errors["named"]["own"] == errors["named"]["nearest"]
    assert errors["named"]["process"] != errors["default"]["process"]  # it remembers other movements
