"""Runs with a forward model: what they record and report, what they refuse, and that a stop leaves no trace."""

import importlib
import math
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch

from boards import curves_of
from marks import slow
from models import ARM, problem_of
from runs import ROOT, about_of, content_of, write_about
from sgimd_torch.board.legend import LEGEND
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.forward_model.checkpoints import CHECKPOINT, _crc32, write_checkpoint
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.shared import ModelListener
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.options.config import Config
from sgimd_torch.record import Record, layout
from sgimd_torch.record.replay import load_life
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.load import OpenRun, load_learner
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.runs.run import RunLoop, Seconds
from sgimd_torch.spaces import Episode, Move, stream
from worlds import NO_CONTEXT, executed

MOVEMENTS = 170
MODEL = ("--inverse", "model-alone", "--search", "gradient", "--inverse.rate", 2)
TAGS = {tag for tag in LEGEND if tag.startswith("model/")}


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """Runs ``sgimd run`` with these options on an arm, with three goals of evaluation; returns the run's directory."""
    path = tmp_path_factory.mktemp("benchmark") / "arm.npz"
    save_benchmark(path, Benchmark("PlanarArm", np.array([[0.0, 0.6], [0.3, -0.5], [-0.4, 0.4]]), 0.1))
    short = f"--algorithm sgim-d --environment planar-arm-7 --seed 3 --movements {MOVEMENTS} --evaluate_at 120"

    def live(out, *options):
        words = (*short.split(), "--repeats", 0, "--benchmark", path, "--board", "true", "--out", out, *options)
        assert command(main, [str(word) for word in words]) == 0
        return out / "sgim-d" / "seed-003"

    return live


@pytest.fixture(scope="module")
def reference(tmp_path_factory, live):
    """Directory of a whole run that searches and answers through the model."""
    return live(tmp_path_factory.mktemp("guided"), *MODEL)


ALONE = ("--inverse", "model-alone", "--evaluate-at", "60,120")


@pytest.fixture(scope="module")
def unguided(tmp_path_factory, live):
    """Directory of a whole run that learns without the model and answers evaluations by it."""
    return live(tmp_path_factory.mktemp("unguided"), *ALONE)


def table(directory, name):
    """The names of the columns of a table, and its rows."""
    with Record(directory / RUN_FILE) as record:
        columns = [column.split()[0] for column in layout(record.dims)[name][:-1]]
        return columns, np.array(list(record.rows(name)), dtype=np.float64)


def test_recorded_predictions_are_those_of_a_model_of_all_earlier_movements(reference):
    columns, predictions = table(reference, "predictions")
    kinds = [[f"{kind}_{k}" for k in (0, 1)] for kind in ("outcome", "predicted", "epistemic", "aleatoric")]
    assert columns == ["exemplar", *np.ravel(kinds)]
    assert predictions[:, 0].tolist() == list(range(50, 150))  # newer movements wait for the next refresh
    run, memory, model = read_run(reference), Memory(0, 7, 2), ForwardModel(0, 7, 2, seed=3, rate=2.0)
    np.testing.assert_array_equal(predictions[:, 1:3], run.outcomes[50:150])
    for n in (50, 100):
        memory.extend(run.contexts[n - 50 : n], run.thetas[n - 50 : n], run.outcomes[n - 50 : n])
        model.refresh(memory)
        predicted = np.hstack(model.predict(NO_CONTEXT, run.thetas[n : n + 50]))
        np.testing.assert_array_equal(predictions[n - 50 : n, 3:], predicted)


def test_every_refresh_is_recorded(reference):
    columns, refreshes = table(reference, "refreshes")
    learnt = ["held_out", "relative_error", "diverged", "training_loss", "gradient_norm", "learning_rate"]
    assert columns == ["movements", "exemplars", "steps", *learnt]
    assert refreshes[:, 0].tolist() == refreshes[:, 1].tolist() == [50, 100, 150]
    assert refreshes[:, 2].tolist() == [100, 100, 100]  # 2 a movement
    assert refreshes[-1, 4] < 0.17
    assert not refreshes[:, 5].any()
    assert read_run(reference).summary["seconds_model"] > 0


@pytest.mark.parametrize(
    ("long_run", "options", "begun"),
    [
        ("reference", MODEL, MODEL),
        ("unguided", ALONE, ALONE),
        slow("unguided", ALONE, (*ALONE[:-1], "120")),  # its evaluation at 60 needs the model of that moment
    ],
)
def test_a_run_made_longer_equals_a_long_run_and_so_do_its_board_and_checkpoint(
    tmp_path, live, request, long_run, options, begun
):
    whole = request.getfixturevalue(long_run)
    directory = live(tmp_path, *begun, "--movements", 120)
    assert table(directory, "predictions")[1][:, 0].tolist() == list(range(50, 100))
    live(tmp_path, *options, "--resume")
    assert content_of(directory) == content_of(whole)
    resumed, curves = curves_of(directory), curves_of(whole)
    assert {tag for tag in curves if tag.startswith("model/")} == TAGS
    assert {tag: resumed[tag] for tag in TAGS} == {tag: curves[tag] for tag in TAGS}
    one, other = (torch.load(at / CHECKPOINT) for at in (directory, whole))
    assert str(one) == str(other)


def model_at(directory, movements=math.inf):
    run = OpenRun(directory)
    run.recall(movements)
    (shared,) = run.parts.learner.problem.trained
    return shared.model


def copied(directory, tmp_path):
    return shutil.copytree(directory, tmp_path / directory.parent.name / directory.name)


@pytest.mark.parametrize("made", ["reference", "unguided"])
def test_a_model_comes_from_the_checkpoint_of_its_moment_or_is_trained_to_the_same_state(made, request, tmp_path):
    made = request.getfixturevalue(made)
    trains = copied(made, tmp_path)
    shutil.rmtree(trains / "checkpoints")
    for movements, loads in ((40, False), (60, False), (130, False), (math.inf, True)):
        loaded, trained = model_at(made, movements), model_at(trains, movements)
        assert (loaded._online.moments is not None) == loads  # of an optimiser that nothing has trained since
        assert trained._online.moments is None
        assert all(map(torch.equal, loaded.state_dict().values(), trained.state_dict().values()))
        assert torch.equal(loaded._online.generator.get_state(), trained._online.generator.get_state())


@pytest.mark.parametrize(("made", "trains"), [("reference", True), ("unguided", False)])
def test_a_replay_trains_the_model_again_if_it_has_guided_the_learner(made, trains, request, tmp_path):
    directory = copied(request.getfixturevalue(made), tmp_path)
    assert (directory / CHECKPOINT).exists()
    config = replace(config_of(read_run(directory)), out=tmp_path, name=directory.parent.name, movements=MOVEMENTS + 1)
    parts = build(config)
    with RunLoop(parts, resume=True):
        (shared,) = parts.learner.problem.trained
        assert bool(shared.model.awaited) != trains


def of_another_robot(path):
    model = ForwardModel(0, 8, 2, seed=3)
    model.refresh(executed(PlanarArm(8), stream(0, "thetas").random((60, 8))))
    write_checkpoint(path.parents[1], model, (150, 150))


def changed(**entries):
    def spoil(path):
        checkpoint = {**torch.load(path), **entries}
        del checkpoint["crc32"]
        torch.save({**checkpoint, "crc32": _crc32(checkpoint)}, path)

    return spoil


def weights(change):
    """Other weights, as an editor or a bad disk leaves them: the checksum is that of before."""

    def spoil(path):
        checkpoint = torch.load(path)
        name = next(name for name, values in checkpoint["state_dict"].items() if values.is_floating_point())
        checkpoint["state_dict"][name] = change(checkpoint["state_dict"][name])
        torch.save(checkpoint, path)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:1000]), "cannot be read as a checkpoint: "),
        (of_another_robot, "is of another model: theta_dim 8, here 7"),
        (lambda path: torch.save([print], path), "cannot be read as a checkpoint: it is damaged, or another file"),
        (weights(lambda values: values * 1.01), "is not what was written"),
        (weights(lambda values: values * math.nan), "is not what was written"),
        (changed(made_by="0.1"), "was written by version 0.1, this is "),
        (changed(refresh=[150, 150, 50, 0.1]), "is of another run"),
        (changed(state_dict={}), "has weights of other shapes"),
    ],
)
def test_a_checkpoint_of_another_model_is_told_in_one_line_and_nothing_is_lost(
    unguided, tmp_path, spoil, message, capsys
):
    directory = copied(unguided, tmp_path)
    spoil(directory / CHECKPOINT)
    model = model_at(directory)
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert model.relative_error == model_at(unguided).relative_error


MISSING = ("--inverse.accelerator", "tpu")


def test_a_missing_device_is_refused_before_the_first_movement(tmp_path, capsys):
    words = ["--environment", "planar-arm-7", "--inverse", "model", *MISSING, "--out", str(tmp_path / "runs")]
    assert command(main, words) == 2
    assert "error: accelerator must be auto or cpu" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.fixture
def elsewhere(tmp_path, reference):
    """Folder of the reference, as another machine would have made it: a function of its device and other settings."""

    def elsewhere(device, **settings):
        directory = copied(reference, tmp_path)
        about = about_of(directory)
        settings = {**about["settings"], "inverse.accelerator": "tpu", **settings}
        write_about(directory, settings=settings, versions={**about["versions"], "device": device})
        return directory

    return elsewhere


def test_a_record_of_a_missing_device_is_loaded_and_resumed_here_and_says_so(tmp_path, live, elsewhere, capsys):
    directory = elsewhere("tpu")
    assert load_learner(directory).movements == MOVEMENTS
    assert "the CPU trains the forward model of this record: accelerator must be" in capsys.readouterr().err
    live(tmp_path, *MODEL, *MISSING, "--movements", MOVEMENTS + 1, "--resume")
    said = capsys.readouterr().err
    assert "the CPU trains the forward model of this record" in said
    assert f"device tpu -> {about_of(directory)['versions']['device']}" in said
    assert len(read_run(directory).index) == MOVEMENTS + 1


def test_a_model_that_was_trained_elsewhere_may_differ_and_the_recorded_movements_count(elsewhere, reference):
    directory = elsewhere(
        "tpu", **{"inverse.accelerator": "auto", "inverse.rate": 1.9}
    )  # another rounding, exaggerated
    learner = build(config_of(read_run(directory))).learner
    (shared,) = learner.problem.trained
    with pytest.warns(RuntimeWarning, match="another device or processor trained the forward model"):
        load_life(learner, directory / RUN_FILE, after=lambda move: shared.refresh(learner.memory))
    np.testing.assert_array_equal(learner.memory.thetas, read_run(reference).thetas)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", WORDS["algorithm"])
def test_the_number_of_threads_does_not_change_a_life(tmp_path, algorithm):
    known = Config(algorithm=algorithm).defaults
    parts = {"inverse": "model-alone", "search": "gradient"}
    words = [f"--{name}={word}" for name, word in parts.items() if name in known]
    short = f"run --algorithm {algorithm} --movements 600 --evaluate-at []"
    for threads in "12":
        chosen = {f"{library}_NUM_THREADS": threads for library in ("OMP", "OPENBLAS", "MKL")}
        line = [sys.executable, "-m", "sgimd_torch", *short.split(), *words, "--out", tmp_path / threads]
        subprocess.run(line, check=True, env={**os.environ, "PYTHONPATH": str(ROOT), **chosen})
    one, two = (content_of(tmp_path / threads / algorithm / "seed-000") for threads in "12")
    assert one == two


def test_without_its_packages_the_model_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "lightning", None)
    monkeypatch.delitem(sys.modules, "sgimd_torch.forward_model")
    with pytest.raises(ImportError, match=r"the forward model needs torch: pip install 'sgimd-torch\[forward\]'"):
        importlib.import_module("sgimd_torch.forward_model")


def test_a_model_that_is_used_is_announced_once(tmp_path, live, capsys):
    directory = live(tmp_path, *MODEL, "--movements", 110)
    text = capsys.readouterr().err
    used = re.findall(r"movement (\d+): the forward model is used from here on: its relative error is (\S+), ", text)
    assert [movements for movements, _ in used] == ["50"]
    assert float(used[0][1]) == pytest.approx(table(directory, "refreshes")[1][0, 4], abs=6e-4)
    assert "is not used" not in text


@pytest.mark.parametrize(
    ("options", "why", "rows"),
    [
        (("--movements", 40), "there were too few exemplars to train it", 0),
        (("--movements", 60, "--inverse.rate", 0.02), r"its relative error is \d\.\d+, it is trusted up to 0\.25", 1),
    ],
)
def test_a_model_that_was_never_used_is_reported(tmp_path, live, capsys, options, why, rows):
    run = read_run(live(tmp_path, *MODEL, *options))
    message = f"the forward model is not used, the learner goes on without it: {why}\n"
    assert re.search(message, capsys.readouterr().err)
    assert (0 if run.refreshes is None else len(run.refreshes["movements"])) == rows
    assert run.predictions is None


@pytest.fixture
def listen(tmp_path):
    """Function that gives a listener ``n`` movements of an arm; ``before(index, model)`` comes before each of them."""
    with Record.make(tmp_path / RUN_FILE, (0, 7, 2), {}) as record:

        def listen(n, before=lambda index, model: None):
            model, memory = ForwardModel(0, 7, 2, rate=1.0), Memory(0, 7, 2)
            inverse = NearestNeighbour(problem_of(memory))
            trains = ModelListener(record, model, inverse, memory, Seconds({}), tmp_path)
            rng, curves = stream(0, "exemplars"), []
            for index in range(n):
                theta = rng.random(7)
                memory.add(NO_CONTEXT, theta, ARM.execute(NO_CONTEXT, theta, rng))
                before(index, model)
                move = Move(theta, np.full(2, index // 2), "local")
                trains.episode(Episode(index, NO_CONTEXT, move, memory.outcomes[-1], None), replayed=False)
                curves.append(trains.curves())
            return record, model, curves

        yield listen


def test_a_divergence_is_told_and_recorded(listen, capsys):
    def spoil(index, model):
        if index == 99:
            model.lr, model._online.optimizer = 1e30, None
        if index == 149:
            model.lr, model._online.optimizer = 1e-2, None

    record, _, curves = listen(150, spoil)
    assert [index for index, numbers in enumerate(curves) if numbers] == [49, 99, 149]
    text = "movement 100: training diverged; the forward model keeps its last good weights"
    assert capsys.readouterr().err.count(text) == 1
    assert [row[5] for row in record.rows("refreshes")] == [0, 1, 0]


def test_the_curves_are_those_of_the_newest_refresh(listen):
    record, model, curves = listen(100)
    assert curves[49].keys() == TAGS - {"model/error", "model/coverage"} | {"time/training_step"}
    assert curves[99].keys() == TAGS | {"time/training_step"}
    assert curves[99]["model/learning_rate"] == 0.01
    assert curves[99]["model/training_loss"] < curves[99]["model/held_out"]
    assert curves[99]["model/relative_error"] == model.relative_error
    predictions = np.array(list(record.rows("predictions")))
    outcome, predicted, epistemic, aleatoric = np.split(predictions[:, 1:], 4, axis=1)
    assert curves[99]["model/error"] == pytest.approx(np.linalg.norm(outcome - predicted, axis=1).mean())
    squared = ((outcome - predicted) ** 2 / (epistemic**2 + aleatoric**2)).sum(axis=1)
    assert curves[99]["model/coverage"] == (squared < -2 * np.log(0.2)).mean()  # chi-squared, two dimensions


def test_a_run_through_the_model_makes_one_of_the_size_of_its_robot_with_its_options():
    options = {"members": 2, "rate": 1.5, "noise_heads": False, "trust": 0.2, "widths": (8,), "lr": 0.1, "batch": 5}
    options |= {"activation": "tanh"}
    parts = {"search": "gradient", "inverse": "model", "environment": "fishing-rod"}
    parts |= {f"inverse.{name}": value for name, value in options.items()}
    learner = build(Config(algorithm="sagg-riac", parts=parts)).learner
    (shared,) = learner.problem.trained
    assert shared.model is learner.inverse.model
    assert shared.model.hparams.items() >= {**options, "context_dim": 0, "theta_dim": 25, "outcome_dim": 2}.items()
    assert [tuple(weight.shape) for weight in shared.model.networks.weights] == [(2, 25, 8), (2, 8, 4)]
    assert build(Config(parts={"search": "nelder-mead"})).learner.problem.trained == []


def test_a_run_that_learns_a_model_but_answers_without_it_is_evaluated_by_both(tmp_path, live):
    evaluated = ("--evaluated-by", "own,nearest,linear,model-alone")
    run = read_run(live(tmp_path, "--search", "gradient", "--inverse", "linear", *evaluated))
    errors = {inverse: numbers["mean_error"].tolist() for inverse, numbers in run.evaluations.items()}
    assert list(errors) == ["own", "nearest", "linear", "model-alone"]
    assert errors["own"] == errors["linear"] != errors["model-alone"]
