"""Runs with a forward model: what they record and report, what they refuse, and that a stop leaves no trace."""

import re

import numpy as np
import pytest

from boards import curves_of
from runs import LIVE, RUN, content_of, end, start, stopped_at
from sgimd_torch.board.legend import LEGEND
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.forward_model.shared import ModelListener
from sgimd_torch.memory import Memory
from sgimd_torch.options.build import build
from sgimd_torch.options.command_line import main
from sgimd_torch.options.config import Config
from sgimd_torch.record import Record, layout
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import Seconds
from sgimd_torch.runs.signals import command
from sgimd_torch.spaces import Episode, Move, stream

MOVEMENTS = 170
MODEL = ("--inverse", "model-alone", "--search", "gradient", "--inverse.rate", 2)
TAGS = {tag for tag in LEGEND if tag.startswith("model/")}
NO_CONTEXT = np.empty(0)


@pytest.fixture(scope="module")
def arguments(tmp_path_factory):
    """Those of a short run on an arm, with three goals to evaluate it on; later options win."""
    path = tmp_path_factory.mktemp("benchmark") / "arm.npz"
    save_benchmark(path, Benchmark("PlanarArm", np.array([[0.0, 0.6], [0.3, -0.5], [-0.4, 0.4]]), 0.1))
    short = f"--algorithm sgim-d --environment planar-arm-7 --seed 3 --movements {MOVEMENTS}"
    short = f"{short} --evaluate_at 120 --repeats 0"

    def arguments(out, *options):
        return [str(word) for word in (*short.split(), "--benchmark", path, "--out", out, *options)]

    return arguments


@pytest.fixture(scope="module")
def live(arguments):
    return lambda out, *options: command(main, arguments(out, *options))


@pytest.fixture(scope="module")
def reference(tmp_path_factory, live):
    """Directory of a whole run that searches and answers through the model, and is watched."""
    out = tmp_path_factory.mktemp("model")
    assert live(out, *MODEL, "--board", "true") == 0
    return out / "sgim-d" / "seed-003"


def table(directory, name):
    """The names of the columns of a table, and its rows."""
    with Record(directory / FILE) as record:
        columns = [column.split()[0] for column in layout(record.dims)[name][:-1]]
        return columns, np.array(list(record.rows(name)), dtype=np.float64)


def test_every_movement_after_the_first_refresh_was_predicted_and_is_recorded_with_its_outcome(reference):
    columns, predictions = table(reference, "predictions")
    parts = [[f"{part}_{k}" for k in (0, 1)] for part in ("outcome", "predicted", "epistemic", "aleatoric")]
    assert columns == ["exemplar", *np.ravel(parts)]
    assert predictions[:, 0].tolist() == list(range(50, 150))  # what is newer waits for the next refresh
    outcome, _, epistemic, aleatoric = np.split(predictions[:, 1:], 4, axis=1)
    np.testing.assert_array_equal(outcome, read_run(reference).outcomes[50:150])
    assert (epistemic > 0).all()
    assert (aleatoric > 0).all()


def test_recorded_predictions_are_those_of_a_model_of_all_earlier_movements(reference):
    run, memory, model = read_run(reference), Memory(0, 7, 2), ForwardModel(0, 7, 2, seed=3, rate=2.0)
    _, predictions = table(reference, "predictions")
    for n in (50, 100):
        for k in range(len(memory), n):
            memory.add(NO_CONTEXT, run.thetas[k], run.outcomes[k])
        model.refresh(memory)
        predicted = np.hstack(model.predict(NO_CONTEXT, run.thetas[n : n + 50]))
        np.testing.assert_array_equal(predictions[n - 50 : n, 3:], predicted)


def test_every_refresh_is_recorded(reference):
    columns, refreshes = table(reference, "refreshes")
    assert columns == ["movements", "exemplars", "steps", "held_out", "relative_error", "diverged"]
    assert refreshes[:, 0].tolist() == refreshes[:, 1].tolist() == [50, 100, 150]
    assert refreshes[:, 2].tolist() == [100, 100, 100]  # 2 a movement
    assert refreshes[-1, 4] < 0.17
    assert not refreshes[:, 5].any()
    assert read_run(reference).summary["seconds_model"] > 0


def test_a_run_made_longer_equals_a_long_run_and_so_does_its_board(tmp_path, live, reference):
    watched = (*MODEL, "--board", "true")
    assert live(tmp_path, *watched, "--movements", 120) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    assert table(directory, "predictions")[1][:, 0].tolist() == list(range(50, 100))
    assert live(tmp_path, *watched, "--resume") == 0
    assert content_of(directory) == content_of(reference)
    resumed, whole = curves_of(directory), curves_of(reference)
    for tag in TAGS:
        assert resumed[tag] == whole[tag], tag


def test_a_run_that_is_killed_and_resumed_ends_as_if_it_never_was(tmp_path, arguments, live, reference):
    end(stopped_at(110, *arguments(tmp_path, *MODEL)))  # unwatched, too, which changes nothing
    assert live(tmp_path, *MODEL, "--resume") == 0
    assert content_of(tmp_path / "sgim-d" / "seed-003") == content_of(reference)


def test_a_run_without_a_model_writes_no_record_of_one_and_loads_no_library_for_it(tmp_path, arguments):
    heavy = {"torch", "lightning", "tensorboard", "matplotlib"}
    loaded = f"{heavy} & set(sys.modules)"
    program = f"{RUN}; code = command_line.main(sys.argv[1:]); print({loaded}); sys.exit(code)"
    process = start(program, *arguments(tmp_path, "--movements", 60))
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    assert output.splitlines()[-1] == "set()"
    run = read_run(tmp_path / "sgim-d" / "seed-003")
    assert run.predictions is run.refreshes is None
    assert "seconds_model" not in run.summary


def test_without_its_packages_a_run_with_a_model_is_refused_and_says_what_to_install(tmp_path, arguments):
    program = f"import sys; sys.modules['lightning'] = None; {LIVE}"
    process = start(program, *arguments(tmp_path / "out", *MODEL))
    _, errors = process.communicate()
    assert process.returncode == 2
    assert "error: the forward model needs torch: pip install 'sgimd-torch[forward]'" in errors
    assert "Traceback" not in errors
    assert not (tmp_path / "out").exists()


def test_a_model_that_is_asked_is_announced_once(tmp_path, live, capsys):
    assert live(tmp_path, *MODEL, "--movements", 110) == 0
    said = capsys.readouterr().err
    found = re.findall(r"movement (\d+): the forward model is used from here on: its relative error is (\S+), ", said)
    assert [movements for movements, _ in found] == ["50"]
    refreshes = table(tmp_path / "sgim-d" / "seed-003", "refreshes")[1]
    assert float(found[0][1]) == pytest.approx(refreshes[0, 4], abs=6e-4)
    assert "not asked" not in said


@pytest.mark.parametrize(
    ("options", "why", "rows"),
    [
        (("--movements", 40), "there were too few exemplars to train it", 0),
        (("--movements", 60, "--inverse.rate", 0.02), r"its relative error is \d\.\d+, it is trusted up to 0\.25", 1),
    ],
)
def test_a_model_that_was_never_asked_is_reported(tmp_path, live, capsys, options, why, rows):
    assert live(tmp_path, *MODEL, *options) == 0
    said = capsys.readouterr().err
    assert re.search(f"the forward model is not used, the learner goes on without it: {why}\n", said)
    run = read_run(tmp_path / "sgim-d" / "seed-003")
    assert (0 if run.refreshes is None else len(run.refreshes["movements"])) == rows
    assert run.predictions is None


def remember(memory, n):
    """What ``episode`` returns for each of ``n`` random movements of an arm, which are remembered."""
    arm, rng = PlanarArm(7), stream(0, "exemplars")
    for index in range(n):
        theta, goal = rng.random(7), np.full(2, index // 2)  # two movements for each goal
        outcome = arm.execute(NO_CONTEXT, theta, rng)
        memory.add(NO_CONTEXT, theta, outcome)
        yield Episode(index, NO_CONTEXT, Move(theta, goal, "local"), outcome, None)


@pytest.fixture
def record(tmp_path):
    with Record.make(tmp_path / FILE, (0, 7, 2), {}) as record:
        yield record


def test_a_divergence_is_told_and_recorded(record, capsys):
    model, memory = ForwardModel(0, 7, 2, rate=1.0), Memory(0, 7, 2)
    listener = ModelListener(record, model, lambda: model.trusted, memory, Seconds({}))
    for episode in remember(memory, 150):
        if episode.index == 99:
            model.lr, model._online.optimizer = 1e30, None
        if episode.index == 149:
            model.lr = 1e-2
        listener.episode(episode, replayed=False)
        assert bool(listener.curves()) == ((episode.index + 1) % 50 == 0)
    said = capsys.readouterr().err
    assert said.count("movement 100: training diverged; the forward model keeps its last good weights") == 1
    assert [row[-1] for row in record.rows("refreshes")] == [0, 1, 0]


def test_the_curves_are_those_of_the_newest_refresh(record):
    model, memory = ForwardModel(0, 7, 2, rate=1.0), Memory(0, 7, 2)
    listener = ModelListener(record, model, lambda: model.trusted, memory, Seconds({}))
    episodes = list(remember(Memory(0, 7, 2), 100))
    for episode in episodes:
        memory.add(NO_CONTEXT, episode.move.theta, episode.outcome)
        listener.episode(episode, replayed=False)
        if episode.index == 49:
            assert listener.curves().keys() == TAGS - {"model/error", "model/coverage"}
    curves = listener.curves()
    assert curves.keys() == TAGS
    assert curves["model/relative_error"] == model.relative_error
    predictions = np.array(list(record.rows("predictions")))
    outcome, predicted, epistemic, aleatoric = np.split(predictions[:, 1:], 4, axis=1)
    assert curves["model/error"] == pytest.approx(np.linalg.norm(outcome - predicted, axis=1).mean())
    squared = ((outcome - predicted) ** 2 / (epistemic**2 + aleatoric**2)).sum(axis=1)
    assert curves["model/coverage"] == (squared < -2 * np.log(0.2)).mean()  # chi-squared, two dimensions


def test_a_run_through_the_model_makes_one_of_the_size_of_its_robot():
    environments = {"planar-arm-50": 50, "fishing-rod": 25}
    networks = {"inverse.members": 2, "inverse.rate": 1.5, "inverse.noise_heads": False, "inverse.trust": 0.2}
    for environment, theta_dim in environments.items():
        parts = {"search": "gradient", "inverse": "model", "environment": environment, **networks}
        learner = build(Config(algorithm="sagg-riac", parts=parts)).learner
        (shared,) = learner.problem.trained
        model = shared.model
        assert model is learner.inverse.model
        assert model.sizes == {"context_dim": 0, "theta_dim": theta_dim, "outcome_dim": 2}
        assert (model.members, model.rate, model.noise_heads, model.trust) == (2, 1.5, False, 0.2)
    assert build(Config(parts={"search": "nelder-mead"})).learner.problem.trained == []


@pytest.mark.parametrize(
    "option",
    [
        *(("--inverse.members", 1), ("--inverse.noise_heads", "false")),
        *(("--inverse.trust", 0.01), ("--search", "nelder-mead")),
    ],
)
def test_an_option_of_the_model_changes_the_run(tmp_path, live, reference, option):
    assert live(tmp_path, *MODEL, *option, "--movements", 100) == 0
    changed, whole = (content_of(place)["events"] for place in (tmp_path / "sgim-d" / "seed-003", reference))
    assert changed != whole[: len(changed)]
    assert changed[:50] == whole[:50]  # until it is asked


def test_the_board_shows_how_the_model_does_and_explains_it(reference):
    curves, (_, refreshes) = curves_of(reference), table(reference, "refreshes")
    assert {tag for tag in curves if tag.startswith("model/")} == TAGS
    assert curves["model/relative_error"] == pytest.approx(dict(zip(refreshes[:, 0], refreshes[:, 4], strict=True)))
    assert curves["model/error"].keys() == curves["model/coverage"].keys() == {100, 150}


def test_a_run_that_learns_a_model_but_answers_without_it_is_evaluated_by_both(tmp_path, live):
    options = ("--search", "gradient", "--inverse", "linear", "--evaluated-by", "own,nearest,linear,model-alone")
    assert live(tmp_path, *options) == 0
    evaluations = read_run(tmp_path / "sgim-d" / "seed-003").evaluations
    assert list(evaluations) == ["own", "nearest", "linear", "model-alone"]
    errors = {inverse: columns["mean_error"].tolist() for inverse, columns in evaluations.items()}
    assert errors["own"] == errors["linear"] != errors["model-alone"]
