"""Runs with a forward model: what they record and report, what they refuse, and that a stop leaves no trace."""

import importlib.metadata
import json
import re
import shlex
import signal

import numpy as np
import pytest
from sgimd_torch.runs.model_record import RunModel
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.plugins.custom_scalar import layout_pb2
from tensorboard.util.tensor_util import make_ndarray

from runs import EAGER, LIVE, RUN, signal_after, start
from sgimd_torch.board.legend import LEGEND
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.memory import Memory
from sgimd_torch.runs.build import LEAST_NOISE, build
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Episode, Move, stream

MOVEMENTS = 170
FILES = ("episodes.csv", "evaluation.csv", "regions.csv", "predictions.csv", "refreshes.csv")
MODEL = ("--inverse", "model", "--search", "gradient")
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
        rate = ("--model.rate", "2") if {"model", "gradient", "gauss-newton", "model-proved"} & {*options} else ()
        return [str(word) for word in (*short.split(), *rate, "--benchmark", path, "--out", out, *options)]

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


def files_of(directory):
    return {name: (directory / name).read_bytes() for name in FILES if (directory / name).exists()}


def table(path):
    header, *lines = (line.split(",") for line in path.read_text().splitlines())
    assert header[-1] == "crc32"
    return header[:-1], np.array([line[:-1] for line in lines], dtype=np.float64)


def curves_of(directory):
    """By tag: {step: value}."""
    found = {}
    (path,) = directory.glob("events.out.tfevents.*")
    for event in EventFileLoader(str(path)).Load():
        for value in event.summary.value:
            tensor = make_ndarray(value.tensor)
            found.setdefault(value.tag, {})[event.step] = tensor.item() if tensor.size == 1 else tensor.tolist()
    return found


def test_every_movement_after_the_first_refresh_was_predicted_and_is_recorded_with_its_outcome(reference):
    columns, predictions = table(reference / "predictions.csv")
    parts = [[f"{part}_{k}" for k in (0, 1)] for part in ("outcome", "predicted", "epistemic", "aleatoric")]
    assert columns == ["exemplar", *np.ravel(parts)]
    assert predictions[:, 0].tolist() == list(range(50, 150))  # what is newer waits for the next refresh
    outcome, _, epistemic, aleatoric = np.split(predictions[:, 1:], 4, axis=1)
    np.testing.assert_array_equal(outcome, read_run(reference).outcomes[50:150])
    assert (epistemic > 0).all()
    assert (aleatoric > 0).all()


def test_recorded_predictions_are_those_of_a_model_of_all_earlier_movements(reference):
    run, memory, model = read_run(reference), Memory(0, 7, 2), ForwardModel(0, 7, 2, seed=3, rate=2.0)
    _, predictions = table(reference / "predictions.csv")
    for n in (50, 100):
        for k in range(len(memory), n):
            memory.add(NO_CONTEXT, run.thetas[k], run.outcomes[k])
        model.refresh(memory)
        predicted = np.hstack(model.predict(NO_CONTEXT, run.thetas[n : n + 50]))
        np.testing.assert_array_equal(predictions[n - 50 : n, 3:], predicted)


def test_every_refresh_is_recorded(reference):
    columns, refreshes = table(reference / "refreshes.csv")
    assert columns == ["movements", "exemplars", "steps", "held_out", "relative_error", "diverged"]
    assert refreshes[:, 0].tolist() == refreshes[:, 1].tolist() == [50, 100, 150]
    assert refreshes[:, 2].tolist() == [100, 100, 100]  # 2 a movement
    assert refreshes[-1, 4] < 0.17
    assert not refreshes[:, 5].any()
    assert json.loads((reference / "summary.json").read_text())["seconds_model"] > 0


def test_a_run_made_longer_equals_a_long_run_and_so_does_its_board(tmp_path, live, reference):
    watched = (*MODEL, "--board", "true")
    assert live(tmp_path, *watched, "--movements", 120) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    assert table(directory / "predictions.csv")[1][:, 0].tolist() == list(range(50, 100))
    assert live(tmp_path, *watched, "--resume") == 0
    assert files_of(directory) == files_of(reference)
    resumed, whole = curves_of(directory), curves_of(reference)
    for tag in TAGS:
        assert resumed[tag] == whole[tag], tag


def test_a_run_that_is_killed_and_resumed_leaves_the_bytes_of_one_that_never_was(tmp_path, arguments, live, reference):
    directory = tmp_path / "sgim-d" / "seed-003"
    process = start(EAGER, *arguments(tmp_path, *MODEL))  # unwatched, too, which changes nothing
    signal_after(process, directory / "episodes.csv", 110, signal.SIGKILL)
    before = files_of(directory)
    assert before["episodes.csv"].count(b"\n") < MOVEMENTS
    assert live(tmp_path, *MODEL) == 2  # without --resume nothing is touched
    assert files_of(directory) == before
    assert live(tmp_path, *MODEL, "--resume") == 0
    assert files_of(directory) == files_of(reference)


def test_a_replay_that_fails_leaves_the_record_of_the_model_as_it_was(tmp_path, live, capsys):
    assert live(tmp_path, *MODEL, "--movements", 60) == 0
    assert live(tmp_path, *MODEL, "--movements", 60, "--seed", 4) == 0
    directory, other = (tmp_path / "sgim-d" / f"seed-00{seed}" for seed in (3, 4))
    (directory / "episodes.csv").write_bytes((other / "episodes.csv").read_bytes())
    before = files_of(directory)
    assert live(tmp_path, *MODEL, "--resume") == 2
    assert "was it recorded by another version" in capsys.readouterr().err
    assert files_of(directory) == before


def test_a_run_without_a_model_writes_no_record_of_one_and_loads_no_library_for_it(tmp_path, arguments):
    loaded = "{'torch', 'lightning', 'safetensors'} & set(sys.modules)"
    program = f"{RUN}; code = command_line.main(sys.argv[1:]); print({loaded}); sys.exit(code)"
    process = start(program, *arguments(tmp_path, "--movements", 60))
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    assert output.splitlines()[-1] == "set()"
    directory = tmp_path / "sgim-d" / "seed-003"
    assert files_of(directory).keys() == {"episodes.csv", "evaluation.csv", "regions.csv"}
    assert "seconds_model" not in json.loads((directory / "summary.json").read_text())


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
    found = re.findall(r"movement (\d+): the forward model is asked from here on: its relative error is (\S+), ", said)
    assert [movements for movements, _ in found] == ["50"]
    refreshes = table(tmp_path / "sgim-d" / "seed-003" / "refreshes.csv")[1]
    assert float(found[0][1]) == pytest.approx(refreshes[0, 4], abs=6e-4)
    assert "not asked" not in said


@pytest.mark.parametrize(
    ("options", "why", "rows"),
    [
        (("--movements", 40), "there were too few exemplars to train it", 0),
        (("--movements", 60, "--model.rate", 0.02), r"its relative error is \d\.\d+, it is trusted up to 0\.25", 1),
    ],
)
def test_a_model_that_was_never_asked_is_reported(tmp_path, live, capsys, options, why, rows):
    assert live(tmp_path, *MODEL, *options) == 0
    said = capsys.readouterr().err
    instead = "the local inverse model answers and the simplex searches instead"
    assert re.search(f"the forward model is not asked, {instead}: {why}\n", said)
    directory = tmp_path / "sgim-d" / "seed-003"
    assert len((directory / "refreshes.csv").read_text().splitlines()) == 1 + rows
    assert len((directory / "predictions.csv").read_text().splitlines()) == 1


def remember(memory, n):
    """What ``episode`` returns for each of ``n`` random movements of an arm, which are remembered."""
    arm, rng = PlanarArm(7), stream(0, "exemplars")
    for index in range(n):
        theta, goal = rng.random(7), np.full(2, index // 2)  # two movements for each goal
        outcome = arm.execute(NO_CONTEXT, theta, rng)
        memory.add(NO_CONTEXT, theta, outcome)
        yield Episode(index, NO_CONTEXT, Move(theta, goal, "local"), outcome, None)


def test_a_divergence_is_told_and_recorded(tmp_path):
    model, memory = ForwardModel(0, 7, 2, rate=1.0), Memory(0, 7, 2)
    watched = RunModel(tmp_path, model, 1.0)
    for episode in remember(memory, 150):
        if episode.index == 99:
            model.lr, model._online.optimizer = 1e30, None
        if episode.index == 149:
            model.lr = 1e-2
        learnt = watched.episode(episode, memory)
        assert bool(learnt) == ((episode.index + 1) % 50 == 0)
    watched.begin()
    assert "movement 100: training diverged; the forward model keeps its last good weights" in watched.news()
    assert watched.news() == []
    assert table(tmp_path / "refreshes.csv")[1][:, 5].tolist() == [0, 1, 0]


def test_the_curves_are_those_of_the_newest_refresh(tmp_path):
    model, memory = ForwardModel(0, 7, 2, rate=1.0), Memory(0, 7, 2)
    watched = RunModel(tmp_path, model, 1.0)
    episodes = list(remember(Memory(0, 7, 2), 100))
    nearer = []
    for episode in episodes:
        memory.add(NO_CONTEXT, episode.move.theta, episode.outcome)
        watched.episode(episode, memory)
        if episode.index == 49:
            assert watched.curves.keys() == TAGS - {"model/error", "model/coverage"}
    watched.begin()
    for first, second in zip(episodes[::2], episodes[1::2], strict=True):
        distances = [np.linalg.norm(episode.outcome - episode.move.goal) for episode in (first, second)]
        nearer.append(distances[1] < distances[0])
    assert watched.curves.keys() == TAGS
    assert watched.curves["model/improved"] == pytest.approx(np.mean(nearer))
    assert watched.curves["model/relative_error"] == model.relative_error
    outcome, predicted, epistemic, aleatoric = np.split(table(tmp_path / "predictions.csv")[1][:, 1:], 4, axis=1)
    assert watched.curves["model/error"] == pytest.approx(np.linalg.norm(outcome - predicted, axis=1).mean())
    squared = ((outcome - predicted) ** 2 / (epistemic**2 + aleatoric**2)).sum(axis=1)
    assert watched.curves["model/coverage"] == (squared < -2 * np.log(0.2)).mean()  # chi-squared, two dimensions


def test_options_of_a_model_that_is_not_there_are_named():
    given = {"members": 5, "noise_heads": False, "training": 1.0, "focus": 0.5, "anchored": False, "residual": False}

    def named(**options):
        return {
            note.split()[0].removeprefix("--").replace("-", "_"): note
            for note in Config(**given, **options).without_effect
        }

    assert named().keys() == given.keys()
    assert "without a forward model, see --search and --inverse" in named()["members"]
    assert named(inverse="model").keys() == {"residual"}
    assert named(algorithm="random", inverse="model").keys() == {"residual", "focus"}
    assert named(algorithm="imitation", inverse="model").keys() == {"residual"}
    assert given.keys() <= named(algorithm="random", search="gradient").keys()
    for search in ("gradient", "gauss-newton"):
        assert not named(search=search)
    assert not Config().without_effect


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--model.members 0", "members must be"),
        ("--model.members 1.5", "--model.members must be a whole number, got 1.5"),
        ("--model.rate 0", "rate"),
        ("--model.rate .nan", "rate"),
        ("--model.focus 1.8", "focus"),
        ("--model.noise_heads perhaps", "--model.noise-heads must be true or false, got perhaps"),
        ("--trust.anchors 2", "--trust.anchors must be true or false, got 2"),
        ("--search gradients", "unknown search 'gradients'; did you mean gradient?"),
        ("--inverse models", "unknown inverse 'models'; did you mean model?"),
    ],
)
def test_options_that_make_no_sense_are_refused(tmp_path, live, capsys, options, message):
    assert live(tmp_path / "out", *MODEL, *shlex.split(options)) == 2
    errors = capsys.readouterr().err
    assert re.search(message, errors)
    assert "Traceback" not in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("search", ["gradient", "gauss-newton"])
def test_a_search_through_the_model_makes_one_of_the_size_of_its_robot(search):
    environments = {"planar-arm-50": (50, LEAST_NOISE), "fishing-rod": (25, None)}
    for environment, (theta_dim, noise) in environments.items():
        parts = build(
            Config(
                parts={
                    "search": search,
                    "environment": environment,
                    "model.members": 2,
                    "model.rate": 1.5,
                    "model.noise_heads": False,
                }
            )
        )
        assert parts.model.sizes == {"context_dim": 0, "theta_dim": theta_dim, "outcome_dim": 2}
        assert (parts.model.members, parts.model.rate, parts.model.noise_heads) == (2, 1.5, False)
        assert parts.trust.noise == (parts.environment.outcome_noise if noise is None else noise)
        assert parts.trust.anchors
    assert build(Config(parts={"search": "nelder-mead"})).model is None


@pytest.mark.parametrize(
    "option",
    [("--model.members", 1), ("--model.noise_heads", "false"), ("--model.focus", 0.5), ("--trust.anchors", "false")],
)
def test_an_option_of_the_model_changes_the_run(tmp_path, live, reference, option):
    assert live(tmp_path, *MODEL, *option, "--movements", 100) == 0
    changed = (tmp_path / "sgim-d" / "seed-003" / "episodes.csv").read_bytes()
    whole = (reference / "episodes.csv").read_bytes()
    assert changed != whole[: len(changed)]
    assert changed.splitlines()[:50] == whole.splitlines()[:50]  # until it is asked


def test_the_outcomes_of_a_search_change_its_next_movement_unless_they_are_left_out(tmp_path, live, reference):
    assert live(tmp_path, *MODEL, "--search.residual", "false", "--movements", 100) == 0
    left_out, counted = read_run(tmp_path / "sgim-d" / "seed-003"), read_run(reference)
    first = np.flatnonzero((left_out.thetas != counted.thetas[:100]).any(axis=1))[0]
    assert np.array_equal(left_out.goals[first], left_out.goals[first - 1])  # not the first movement for its goal


def test_the_board_shows_how_the_model_does_and_explains_it(reference):
    curves, (_, refreshes) = curves_of(reference), table(reference / "refreshes.csv")
    assert {tag for tag in curves if tag.startswith("model/")} == TAGS
    assert curves["model/relative_error"] == pytest.approx(dict(zip(refreshes[:, 0], refreshes[:, 4], strict=True)))
    assert curves["model/error"].keys() == curves["model/coverage"].keys() == {100, 150}
    assert "model/error" in charts_of(curves)
    assert "error/mean" in charts_of(curves)


def charts_of(curves):
    """The tags of all charts in the tab Custom Scalars."""
    (*_, last) = curves["custom_scalars__config__"].values()
    layout = layout_pb2.Layout.FromString(last)
    return [tag.strip("^$") for page in layout.category for chart in page.chart for tag in chart.multiline.tag]


def test_the_board_of_a_run_without_a_model_has_nothing_of_it(tmp_path, live):
    assert live(tmp_path, "--board", "true", "--movements", 60) == 0
    curves = curves_of(tmp_path / "sgim-d" / "seed-003")
    assert not [tag for tag in curves if tag.startswith("model/")]
    assert not [tag for tag in charts_of(curves) if tag.startswith("model/")]


def test_its_libraries_are_recorded_and_a_run_of_before_they_were_is_no_run_with_others(tmp_path, live, capsys):
    assert live(tmp_path, *MODEL, "--movements", 10) == 0
    path = tmp_path / "sgim-d" / "seed-003" / "versions.json"
    versions = json.loads(path.read_text())
    forward = ("torch", "lightning", "safetensors")
    assert {name: versions[name] for name in forward} == {name: importlib.metadata.version(name) for name in forward}
    path.write_text(json.dumps({name: value for name, value in versions.items() if name not in forward}))
    assert live(tmp_path, *MODEL, "--movements", 12, "--resume") == 0
    assert json.loads(path.read_text()) == versions
    path.write_text(json.dumps({**versions, "torch": "0.1"}))
    assert live(tmp_path, *MODEL, "--movements", 14, "--resume") == 0
    assert f"torch 0.1 -> {versions['torch']}" in capsys.readouterr().err


def test_a_run_is_not_resumed_with_another_model(tmp_path, live, capsys):
    assert live(tmp_path, *MODEL, "--movements", 10) == 0
    assert live(tmp_path, *MODEL, "--movements", 10, "--resume", "--model.rate", 3, "--trust.anchors", "false") == 2
    message = capsys.readouterr().err
    assert "model.rate was 2.0, now 3.0" in message
    assert "trust.anchors was True, now False" in message


def test_a_run_that_learns_a_model_but_answers_without_it_is_evaluated_by_both(tmp_path, live):
    options = ("--search", "gradient", "--inverse", "linear", "--evaluated-by", "own,nearest,linear,model")
    assert live(tmp_path, *options) == 0
    answers = read_run(tmp_path / "sgim-d" / "seed-003").answers
    assert list(answers) == ["own", "nearest", "linear", "model"]
    errors = {answer: each["mean_error_m"].tolist() for answer, each in answers.items()}
    assert errors["own"] == errors["linear"] != errors["model"]
