"""Whoever opens a run finds the learner that lived it, whatever happened in the run.

Each kind of run is made once. While it is made, the living learner is asked what it would do at three goals, after 30
movements and at the end. Then the run is opened in every way.
"""

import csv
import io
import shutil
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from arms import write
from boards import curves_of
from runs import LIVE, start
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.extras.ask import command as ask
from sgimd_torch.extras.benchmark import command as benchmark
from sgimd_torch.extras.film import command as film
from sgimd_torch.extras.film.traced import traced
from sgimd_torch.extras.forget import command as forget
from sgimd_torch.extras.report import command as report
from sgimd_torch.extras.table import command as table
from sgimd_torch.extras.teach.command import options_of
from sgimd_torch.extras.teach.taught import ALONE, TaughtRun
from sgimd_torch.learner import Learner
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import RunLoop
from sgimd_torch.spaces import stream
from worlds import executed

EARLY = 30
GOALS = np.array([[0.4, 0.3], [-0.2, 0.5], [0.1, -0.4]])
ROBOTS = """
import numpy as np
from sgimd_torch import PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.tasks import Task

class Failing(PlanarArm):
    def execute(self, context, theta, rng):
        if rng.random() < 0.2:
            raise RuntimeError("it fell")
        return super().execute(context, theta, rng)

    def trace(self, context, theta, rng):
        return super().trace(context, theta, rng)

class Slipping(PlanarArm):
    made = 0
    def execute(self, context, theta, rng):
        self.made += 1
        return super().execute(context, theta if self.made <= 150 else 1 - theta[::-1] ** 2, rng)
    def trace(self, context, theta, rng):
        return super().trace(context, theta, rng)

def task(arm):
    return Task(arm, lambda: Benchmark(type(arm).__name__, np.array([[0.0, 0.6], [0.3, -0.5], [-0.4, 0.4]]), 0.1))

def turning():
    return task(PlanarArm(3, noise=0.02, context=True))

def failing():
    return task(Failing(3))

def slipping():
    return task(Slipping(3))
"""
ARM = "--environment planar-arm-7 --benchmark {files}/goals.npz"
FROM_FILE = "--environment mujoco --environment.model {files}/arm.xml --environment.outcome site:tip:xy"
FROM_FILE += " --environment.low -1,-1 --environment.high 1,1 --benchmark {files}/model.npz"
KINDS = {
    "plain": f"{ARM} --algorithm practice",
    "taught": f"{ARM} --algorithm sgim-d --teacher.every 7",
    "asking": f"{ARM} --algorithm sgim-acts --teachers low-half,high-half",
    "contexts": "--environment opened:turning --algorithm practice",
    "failures": "--environment opened:failing --algorithm sagg-riac",
    "prior": f"{ARM} --algorithm practice --begin-with {{files}}/mirrored.sqlite",
    "noticed change": "--environment opened:slipping --algorithm practice --movements 220",
    "several robots": f"{ARM} --algorithm practice-taught --at-once 4",
    "forward model": f"{ARM} --algorithm sagg-riac --inverse model-alone --inverse.trust 1 --movements 70",
    "model file": f"{FROM_FILE} --algorithm random",
}


def some(*kinds):
    """The kinds of runs, for a test that takes two seconds of each; all but ``kinds`` are slow tests."""
    return [pytest.param(kind, marks=[] if kind in kinds else pytest.mark.slow) for kind in KINDS]


LED = {"taught", "several robots"}  # kinds of runs that sgimd teach can go on with


def answers_of(parts):
    """The thetas at ``GOALS``, in the middle of C."""
    contexts = parts.environment.contexts
    middle = (contexts.low + contexts.high) / 2
    return np.stack([parts.learner.inverse(middle, goal).theta for goal in GOALS])


def miss_of(parts, thetas):
    """How far the film's movement at the first of ``GOALS`` lands from it, as the film says it."""
    contexts, robot = parts.environment.contexts, parts.environment
    middle = (contexts.low + contexts.high) / 2
    landed = traced(robot, middle, thetas[0], stream(parts.config.seed, "film", 0)).outcome
    return robot.outcomes.amount(float(np.linalg.norm(landed - GOALS[0])))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files that the runs need, and the module of their robots."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "opened.py").write_text(ROBOTS)
    write(folder / "arm.xml")
    for name, robot in (("goals", "PlanarArm"), ("model", "MujocoRobot")):
        save_benchmark(folder / f"{name}.npz", Benchmark(robot, GOALS + 0.1, 0.1))
    thetas, arm = stream(0, "past").random((200, 7)), PlanarArm(7)
    past = build(parse(["--environment=planar-arm-7"])[0]).learner
    for theta, outcome in zip(thetas, executed(arm, thetas).outcomes, strict=True):
        past.add(np.zeros(0), theta, outcome * [-1, 1])  # a mirrored arm
    save_life(past, folder / "mirrored.sqlite")
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))
    sys.modules.pop("opened", None)


@pytest.fixture(scope="module")
def lived(files, tmp_path_factory):
    """A function that makes a run of a kind, once, and tells what the living learner answered."""
    made = {}

    def live(kind):
        if kind not in made:
            short = (
                f"--movements 60 --repeats 0 --evaluate-at {EARLY} --name run --out {tmp_path_factory.mktemp('out')}"
            )
            config, _ = parse(f"{short} {KINDS[kind]}".format(files=files).split())
            parts, early = build(config), None
            with RunLoop(parts, resume=False) as life:
                for _ in life.episodes():
                    n = parts.learner.movements
                    if early is None and n >= EARLY and life.movements == n:
                        early = n, answers_of(parts)
                error = life.evaluations.last.mean_error
            path, answers = config.directory, answers_of(parts)
            made[kind] = SimpleNamespace(path=path, parts=parts, early=early, answers=answers, error=error)
        return made[kind]

    return live


@pytest.fixture(params=KINDS)
def run(request, lived):
    return lived(request.param)


@pytest.fixture
def answered_from_memory(run, monkeypatch):
    """Whatever the test does, no movement of the recorded life may be asked for again."""
    asked = []
    monkeypatch.setattr(Learner, "ask_many", lambda learner, contexts: asked.append(contexts))
    yield
    assert not asked


def test_the_runs_are_of_their_kinds(lived):
    """Otherwise the other tests would show nothing."""
    recorded = {kind: read_run(lived(kind).path) for kind in KINDS}
    assert (recorded["taught"].demonstration >= 0).sum() > 5
    assert "shown" in recorded["asking"].requests["reply"]
    assert np.ptp(recorded["contexts"].contexts) > 0
    assert len(recorded["contexts"].errors["context_0"]) == 2 * 3  # evaluations, goals
    assert recorded["failures"].failed.sum() > 5
    assert not np.array_equal(lived("prior").answers, lived("plain").answers)
    assert len(recorded["noticed change"].changes) == 1
    assert recorded["several robots"].config["at_once"] == 4
    assert recorded["forward model"].refreshes["relative_error"][-1] < 1  # so its answers are asked for


@pytest.mark.usefixtures("answered_from_memory")
def test_the_loaded_learner_is_the_one_that_lived(run):
    learner = load_learner(run.path, trust=True)
    np.testing.assert_array_equal(answers_of(replace(run.parts, learner=learner)), run.answers)
    assert learner.movements == run.parts.learner.movements


def test_a_run_of_relative_paths_and_own_code_is_opened_from_another_folder(tmp_path, monkeypatch, capsys):
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    (tmp_path / "one/placed.py").write_text(
        "from pathlib import Path\nfrom sgimd_torch.extras.models.mujoco_robot import MujocoRobot\n"
        "def make(*, file: Path = Path(), **more):\n    return MujocoRobot(file, outcome='site:tip:xy')\n"
    )
    write(tmp_path / "one/arm.xml")
    save_benchmark(tmp_path / "one/model.npz", Benchmark("MujocoRobot", GOALS + 0.1, 0.1))
    of_file = "--environment mujoco --environment.model {}arm.xml --environment.outcome site:tip:xy"
    common = "--algorithm random --movements 20 --repeats 0 --out {} --benchmark {}model.npz"
    monkeypatch.chdir(tmp_path / "one")
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert command(main, f"{of_file.format('')} {common.format('runs', '')}".split()) == 0
    own = f"--environment placed:make --environment.file arm.xml --name own {common.format('runs', '')}"
    own_process = start(LIVE, *own.split())  # so that this process does not know the module
    own_process.communicate()
    assert own_process.returncode == 0
    monkeypatch.chdir(tmp_path / "other")
    for name in ("random", "own"):
        words = [f"../one/runs/{name}/seed-000", "--goal=0.3,0.3", "--trust"]
        assert command(ask.main, words) == 0, capsys.readouterr().err
    again = f"{of_file.format('../one/')} {common.format('../one/runs', '../one/')} --resume"
    assert command(main, [*again.split(), "--movements", "25"]) == 0
    assert read_run(tmp_path / "one/runs/random/seed-000").summary["movements"] == 25
    write(tmp_path / "other/arm.xml")
    again = f"{of_file.format('')} {common.format('../one/runs', '../one/')} --resume"
    assert command(main, again.split()) == 2  # another file, though of the same name
    assert "environment.model was ../one/arm.xml, now arm.xml" in capsys.readouterr().err


@pytest.mark.usefixtures("answered_from_memory")
def test_ask_gives_the_movements_of_the_learner_that_lived(run, tmp_path):
    (tmp_path / "goals.csv").write_text("\n".join(f"{x},{y}" for x, y in GOALS))
    words = [str(run.path), "--trust", f"--goals={tmp_path}/goals.csv", f"--out={tmp_path}/answers.csv"]
    assert command(ask.main, words) == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "answers.csv").read_text())))
    thetas = [[float(row[f"theta_{k}"]) for k in range(run.answers.shape[1])] for row in rows]
    np.testing.assert_array_equal(thetas, run.answers)


@pytest.mark.parametrize("run", some("contexts", "failures", "prior", "noticed change"), indirect=True)
def test_of_a_run_that_forgot_the_loaded_learner_is_the_one_that_lives_it_again(run, tmp_path, capsys):
    path = tmp_path / "seed-000"
    shutil.copytree(run.path, path)
    wrong = np.flatnonzero(np.isfinite(read_run(path).outcomes[:, 0]))[-9:-4]
    code = command(forget.main, [str(path), "--trust", "--movements", ",".join(map(str, wrong))])
    if run.parts.learner.problem.trained:
        assert (code, "a forward model cannot forget" in capsys.readouterr().err) == (2, True)
        return
    again, loaded = build(run.parts.config), load_learner(path, trust=True)
    load_life(again.learner, path / "run.sqlite", teacher=again.teacher)
    answers = [answers_of(replace(run.parts, learner=learner)) for learner in (again.learner, loaded)]
    np.testing.assert_array_equal(*answers)
    assert not np.array_equal(answers[0], run.answers)
    assert len(loaded.memory) == len(run.parts.learner.memory) - 5


@pytest.mark.usefixtures("answered_from_memory")
@pytest.mark.parametrize("run", some("taught", "prior", "noticed change", "forward model"), indirect=True)
def test_a_film_shows_the_learner_that_lived_early_and_at_the_end(run, tmp_path, capsys):
    goal, last = ",".join(map(str, GOALS[0])), run.parts.learner.movements
    words = f"{run.path} --trust --goals {goal} --after {EARLY} {last} --out {tmp_path}/film.webp"
    assert command(film.main, words.split()) == 0
    said = capsys.readouterr().out
    for movements, thetas in (run.early, (last, run.answers)):
        assert f"after {movements} movements: mean distance to the goal {miss_of(run.parts, thetas)}," in said


@pytest.mark.parametrize("kind", KINDS)
def test_teaching_goes_on_with_the_learner_that_lived_or_says_that_it_learns_alone(kind, lived):
    run = lived(kind)
    config, _ = options_of([str(run.path), "--trust"])
    if kind in LED:
        taught = TaughtRun(config)
        taught.go_on(config.movements)
        np.testing.assert_array_equal(answers_of(taught.parts), run.answers)
        taught.close()
    else:
        with pytest.raises(ValueError, match=ALONE.format(config.algorithm)[:40]):
            TaughtRun(config)


def test_a_resumed_run_has_the_learner_that_lived_and_the_board_its_errors(run):
    parts = build(Config.from_settings({**run.parts.config.settings, "board": True}))
    with RunLoop(parts, resume=True) as life:
        for _ in life.episodes():
            pass
        life.commit()
    np.testing.assert_array_equal(answers_of(parts), run.answers)
    assert curves_of(run.path)["error/mean"][parts.learner.movements] == pytest.approx(run.error, rel=1e-6)


@pytest.mark.usefixtures("answered_from_memory")
def test_the_table_shows_the_error_of_the_learner_that_lived(run, capsys):
    assert command(table.main, [str(run.path), "--format=csv"]) == 0
    (row,) = csv.DictReader(io.StringIO(capsys.readouterr().out))
    (error,) = (float(value) for name, value in row.items() if name.startswith("error"))
    assert error == run.error


@pytest.mark.usefixtures("answered_from_memory")
@pytest.mark.parametrize("run", some("plain", "failures"), indirect=True)
def test_the_report_shows_the_error_of_the_learner_that_lived(run):
    assert command(report.main, [str(run.path)]) == 0
    assert f">{run.error:.3f}<" in (run.path / "report.html").read_text()


def test_a_change_is_said_recorded_and_reported_once(files, tmp_path, capsys):
    words = f"--environment opened:slipping --evaluate-at [] --repeats 0 --out {tmp_path} --movements".split()
    assert command(main, [*words, "220"]) == 0
    said = "since movement 150 outcomes are not what they were"
    assert said in capsys.readouterr().err
    (change,) = read_run(tmp_path / "practice/seed-000").changes
    assert change.startswith(said)
    assert command(report.main, [str(tmp_path)]) == 0
    assert said in (tmp_path / "report.html").read_text()
    assert command(main, [*words, "230", "--resume"]) == 0
    assert read_run(tmp_path / "practice/seed-000").changes == [change]
    assert said not in capsys.readouterr().err
    assert command(forget.main, [str(tmp_path / "practice/seed-000"), "--movements=20", "--trust"]) == 0
    assert said in capsys.readouterr().err  # it was looked for again
    assert command(main, [*words, "240", "--resume"]) == 0
    assert len(read_run(tmp_path / "practice/seed-000").changes) == 1
    assert said not in capsys.readouterr().err


@pytest.mark.usefixtures("answered_from_memory")
def test_a_benchmark_is_made_of_the_outcomes_of_the_learner_that_lived(run, tmp_path, capsys):
    assert command(benchmark.main, [str(run.path), f"--out={tmp_path}/goals.npz", "--tiles=4"]) == 0
    lived = len(run.parts.learner.memory)
    assert f"reached by {lived} movements of 1 run" in capsys.readouterr().out
