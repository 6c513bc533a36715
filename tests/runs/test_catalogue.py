"""The catalogue: what it says of each thing is true, and a user's own parts work like ours."""

import inspect
import re
import subprocess
import sys
import typing
from dataclasses import fields, replace

import numpy as np
import pytest

from runs import ROOT
from sgimd_torch.catalogue import CATALOGUE, SHARED, Entry, checked, colour, find, label, load
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.runs.build import build, task_of
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.config import Config, dashed, from_settings, words
from sgimd_torch.runs.config import default as default_of
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.tasks import MOST_GOALS, goals_all_over
from sgimd_torch.searches.widening import Widening

ENTRIES = [(kind, word, entry) for kind, entries in CATALOGUE.items() for word, entry in entries.items()]
TOSS = '''
import numpy as np
from sgimd_torch import Box, Demonstration
from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.runs.tasks import Task

class Toss:
    """theta: elevation and charge, both in [0, 1]; outcome: how far the ball flies (m)."""
    contexts, policies, outcomes = Box.cube(0, 1, 0), Box.cube(0, 1, 2), Box.cube(0, 10, 1)
    rest, outcome_noise = np.zeros(1), 0.05
    def observe(self, rng):
        return self.contexts.sample(rng)
    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return np.array([10 * theta[1] * np.sin(np.pi * theta[0]) + rng.normal(0, 0.05)])

def shown():
    times = np.linspace(0, 1, 3)
    return [Demonstration(np.empty(0), times, np.tile([0.5, charge], (3, 1)), np.array([10 * charge]))
            for charge in (0.2, 0.5, 0.9)]

def taught():
    return Task(Toss(), demonstrations=shown, correspondence=lambda times, trajectory: trajectory[-1])

class Half:
    outcomes, policies = Box.cube(0, 1, 1), Box.cube(0, 1, 1)

class Worst:
    def __init__(self, contexts, outcomes, rng, *, window=8):
        self.outcomes, self.rng, self.window = outcomes, rng, window
    def sample(self, context):
        return self.outcomes.sample(self.rng)
    def add(self, context, goal, competence, strategy="autonomous", gain=0.0):
        pass

number = 7
'''
SHORT = ("--movements", "40", "--evaluate-at", "20", "--repeats", "2")


@pytest.fixture
def toss(tmp_path, monkeypatch):
    """A module of the user's, in the working directory."""
    (tmp_path / "toss.py").write_text(TOSS)
    (tmp_path / "broken.py").write_text("import nothing_of_that_name\n")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.path[:] = [place for place in sys.path if place != str(tmp_path)]
    for module in ("toss", "broken"):
        sys.modules.pop(module, None)


@pytest.mark.parametrize(("kind", "word", "entry"), ENTRIES, ids=lambda each: each if isinstance(each, str) else "")
def test_what_an_entry_takes_its_parameters_are(kind, word, entry):
    made = entry.load()
    names = set(inspect.signature(made).parameters)
    for handed_on in typing.get_type_hints(made).values() if inspect.isfunction(made) else ():
        if typing.get_origin(handed_on) is typing.Unpack:  # **parts: Unpack[Parts]
            names |= typing.get_args(handed_on)[0].__annotations__.keys()
    assert {*entry.uses, *entry.fixed} <= names
    known = {each.name for each in fields(Config)} | SHARED.keys() | {"policies", "outcome_noise", "correspondence"}
    assert {*entry.options, *entry.ignores} <= known
    assert entry.learns_with is None or entry.learns_with in CATALOGUE[kind]


def test_defaults_of_options_are_those_of_the_library():
    """So that help need not load what it explains."""
    compared, standards = set(), {each.name: default_of(each, "") for each in fields(Config)}
    for word, entry in [*((word, entry) for _, word, entry in ENTRIES), *SHARED.items()]:
        parameters = dict(inspect.signature(entry.load()).parameters)
        if word in ("sgim-d", "sagg-riac"):  # they hand their parts on
            parameters |= inspect.signature(load("sgimd_torch.algorithms:goal_babbling")).parameters
        for parameter, option in entry.uses.items():
            given, ours = parameters.get(parameter), standards.get(option)
            if given is None or given.default is given.empty or ours is None:
                continue
            default = LocalProcess if option == "inverse" and given.default is None else given.default
            compared.add(option)
            assert default is (find(option, ours).load() if option in CATALOGUE else ours) or default == ours, option
    assert compared >= {"goals", "inverse", "search", "competence", "budget", "social", "window", "progress", "choice"}
    assert compared >= {"imitations", "epsilon", "residual", "members", "noise_heads", "training", "focus", "anchored"}
    evaluate, rod = (load(at) for at in ("sgimd_torch.evaluation:evaluate", "sgimd_torch:FishingRod"))
    assert inspect.signature(evaluate).parameters["repeats"].default == Config.repeats
    assert inspect.signature(rod).parameters["noise"].default == Config.noise


def test_algorithms_have_a_name_and_a_colour_and_unknown_ones_their_word():
    assert label("sgim-d") == "SGIM-D"
    assert label("mine:Own") == "mine:Own"
    assert re.fullmatch("#[0-9a-f]{6}", colour("sgim-d"))
    assert len({colour(word) for word in ("random", "sagg-riac", "observation", "imitation", "sgim-d")}) == 5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--environment tos:make", "environment tos:make: the module tos cannot be imported: ModuleNotFoundError: No "),
        (
            "--environment broken:make",
            "ModuleNotFoundError: No module named 'nothing_of_that_name'; is it installed, or",
        ),
        ("--environment toss:Tosss", "environment toss:Tosss: toss has no Tosss; did you mean Toss"),
        ("--environment toss:number", "must be called as .* but it is a int"),
        (
            "--environment toss:Half",
            "gave a Half without contexts, rest, outcome_noise, observe, execute; wanted .* which has contexts",
        ),
        ("--environment toss:Toss", "Toss comes without demonstrations, .* --algorithm practice"),
        (
            "--goals toss:Toss",
            r"goals toss:Toss cannot be called as \(contexts, .* a goal model: too many",
        ),
        ("--goals toss:nothing", "goals toss:nothing: toss has no nothing"),
        ("--algorithm toss:shown", "algorithm toss:shown cannot be called as .*environment, seed"),
        (
            "--search nelder",
            r"unknown search 'nelder'; did you mean nelder-mead\? Known are nelder-mead, .*package",
        ),
    ],
)
def test_what_cannot_be_named_is_refused_with_its_reason(toss, capsys, options, message):
    assert command(main, [*options.split(), "--out", "runs"]) == 2
    said = capsys.readouterr().err
    assert re.search(message, said), said
    assert "Traceback" not in said
    assert not (toss / "runs").exists()


def test_a_users_environment_is_run_evaluated_and_resumed(toss, capsys):
    own = ("--environment", "toss:Toss", "--algorithm", "sagg-riac", "--out", "runs", *SHORT)
    assert command(main, own) == 0
    said = capsys.readouterr().err
    assert "Toss has no benchmark goals" in said
    run = read_run(toss / "runs/sagg-riac/seed-000")
    assert run.outcomes.shape == (40, 1)
    assert run.evaluation["movements"].tolist() == [20, 40]
    whole = (run.path / "episodes.csv").read_bytes()
    assert command(main, [*own, "--name", "two", "--movements", "25"]) == 0
    assert command(main, [*own, "--name", "two", "--resume"]) == 0
    assert (toss / "runs/two/seed-000/episodes.csv").read_bytes() == whole


def test_a_users_task_comes_with_its_teacher(toss, capsys):
    taught = ("--algorithm", "sgim-d", "--environment", "toss:taught", "--out", "runs", *SHORT)
    assert command(main, taught) == 0
    run = read_run(toss / "runs/sgim-d/seed-000")
    assert np.flatnonzero(run.demonstration >= 0).tolist() == [30]
    assert "3 demonstrations" in capsys.readouterr().err


def test_a_users_goal_model_gets_the_options_that_it_names(toss):
    own = Config(environment="toss:Toss", algorithm="sagg-riac", goals="toss:Worst", window=4)
    goals = build(own).learner.autonomous.goals
    assert type(goals).__name__ == "Worst"
    assert goals.window == 4
    assert own.without_effect == []
    assert Config(environment="toss:Toss", algorithm="sagg-riac", goals="toss:Worst", progress="signed").without_effect


def test_the_installed_command_finds_modules_in_the_working_directory(toss):
    words_ = [sys.executable, "-c", "import sys; from sgimd_torch.__main__ import main; sys.exit(main())"]
    sys_path = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "PYTHONSAFEPATH": "1"}
    own = ["run", "--environment", "toss:Toss", "--algorithm", "random", "--out", "runs", *SHORT]
    done = subprocess.run([*words_, *own], capture_output=True, text=True, env=sys_path, cwd=toss)
    assert done.returncode == 0, done.stderr
    assert (toss / "runs/random/seed-000/summary.json").exists()


def test_goals_all_over_a_space_are_at_most_500_and_inside():
    class Space:
        def __init__(self, dim):
            from sgimd_torch.spaces import Box

            self.outcomes = Box(np.full(dim, -2.0), np.arange(1.0, dim + 1))

    for dim in range(1, 7):
        space = Space(dim)
        goals = goals_all_over(space).goals
        assert 200 < len(goals) <= MOST_GOALS
        assert space.outcomes.contains(goals).all()
        assert len(np.unique(goals, axis=0)) == len(goals)
        middle, half = (space.outcomes.low + space.outcomes.high) / 2, space.outcomes.sides / 2
        assert (np.abs(goals.mean(axis=0) - middle) < 0.05 * half).all()  # evenly


@pytest.mark.parametrize("word", CATALOGUE["environment"])
def test_what_is_said_to_be_filmed_brings_a_picture(word):
    if word == "swimmer":
        pytest.importorskip("gymnasium")
    task = task_of(Config(environment=word))
    assert CATALOGUE["environment"][word].filmed == (task.picture is not None)


def test_a_part_without_its_members_is_refused_by_name():
    with pytest.raises(ValueError, match=r"gave a int without sample, add; wanted \(contexts, outcomes, rng\)"):
        checked("goals", "mine:Own", lambda: 7)()


def test_the_words_of_a_config_make_it_again():
    config = Config(algorithm="sagg-riac", goals="uniform", evaluate_at=(5, 6), every=7, board=False, task_space=2.5)
    from sgimd_torch.runs.command_line import parse

    assert parse(words(vars(config)))[0] == config
    assert all(word.startswith("--") and "_" not in word.partition("=")[0] for word in words(vars(config)))
    assert words(vars(Config())) == []
    assert words({"algorithm": "practice-taught", "no-such-option": 3}) == []
    assert from_settings({"goals": "grid", "evaluate_at": [5], "out": "x", "commit": "abc"}).goals == "grid"
    assert dashed("task_space") == "task-space"


def test_an_option_that_nobody_set_is_what_the_algorithm_has_for_it():
    plain, own = Config(algorithm="sagg-riac"), Config(algorithm="practice-taught")
    assert (plain.goals, plain.search, plain.budget, plain.teacher) == ("interest-map", "nelder-mead", 15, "periodic")
    assert (own.goals, own.search, own.budget, own.teacher) == ("uniform", "practice", 1, "at-once")
    assert words(vars(own)) == own.without_effect == []
    assert words(vars(plain)) == ["--algorithm=sagg-riac"]
    assert Config(algorithm="practice-taught", goals="uniform", budget=1) == own
    assert words(vars(replace(own, goals="interest-map"))) == ["--goals=interest-map"]
    assert from_settings(vars(own)) == own


def test_practice_is_made_of_options_that_can_be_changed_one_by_one():
    learner = build(Config(algorithm="practice", environment="two-elbows")).learner
    other = build(Config(algorithm="practice", environment="two-elbows", goals="interest-map", budget=3)).learner
    assert isinstance(learner.autonomous.goals, UniformGoals)
    assert isinstance(other.autonomous.goals, InterestMap)
    assert (learner.autonomous.budget, other.autonomous.budget) == (1, 3)
    assert isinstance(other.autonomous.look, Widening)
    assert learner.autonomous.search.__qualname__ == other.autonomous.search.__qualname__


def test_an_entry_that_is_not_installed_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    sys.modules.pop("sgimd_torch.searches.cma_es", None)
    with pytest.raises(ValueError, match=r"pip install 'sgimd-torch\[rivals\]'"):
        find("search", "cma-es").load()


def test_the_environment_of_a_config_is_the_task_it_names():
    assert len(task_of(Config(environment="planar-arm-50")).environment.policies.low) == 50
    assert isinstance(find("environment", "planar-arm-7"), Entry)


@pytest.mark.parametrize("kind", CATALOGUE)
def test_the_order_of_the_catalogue_means_nothing(kind, monkeypatch):
    given = {"algorithm": "sagg-riac", "search": "gradient", "residual": False, "epsilon": 0.2, "every": 7}
    before = Config(**given).without_effect, Config(**{**given, "search": "perturb"}).without_effect
    monkeypatch.setitem(CATALOGUE, kind, dict(reversed(CATALOGUE[kind].items())))
    after = Config(**given).without_effect, Config(**{**given, "search": "perturb"}).without_effect
    assert after == before
    assert not any("residual" in note for note in after[0])
    assert any("--residual has no effect with --search perturb" in note for note in after[1])
