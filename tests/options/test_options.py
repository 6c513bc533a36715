"""The table of words: what it says of each thing is true, and a user's own parts work like ours."""

import inspect
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.options.catalogue import WORDS, about, load_word
from sgimd_torch.options.config import RUN, Config, all_options, words
from sgimd_torch.options.help import overview
from sgimd_torch.options.parse import parse
from sgimd_torch.runs import command as run_command
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.session import run
from sgimd_torch.spaces import Box
from sgimd_torch.tasks.goals import MAX_GOALS, goals_all_over

ENTRIES = [(kind, word) for kind, words in WORDS.items() for word in words]
TAUGHT = '''
import numpy as np
from sgimd_torch import Demonstration, UniformGoals
from sgimd_torch.tasks import Task
from sliders import Slider

def taught():
    shown = [Demonstration(np.empty(0), np.arange(3), np.full((3, 1), place), [place]) for place in (0.2, 0.5, 0.9)]
    return Task(Slider(), demonstrations=lambda: shown, correspondence=lambda times, trajectory: trajectory[-1])

class Worst(UniformGoals):
    """Goals anywhere.

    Args:
        window: number of goals that are looked at.
    """
    def __init__(self, problem, *, window=8):
        super().__init__(problem)
        self.window = window
'''
PUCK, THROW = "experiments.toys:puck", "experiments.toys:toss"
SHORT = ("--movements", "40", "--evaluate-at", "20", "--repeats", "2", "--inverse", "linear")


@pytest.mark.parametrize(("kind", "word"), ENTRIES)
def test_a_word_is_described_by_its_docstring_in_a_line(kind, word):
    said = about(kind, word)
    assert 10 < len(said) <= 118
    if kind != "command":
        assert callable(load_word(kind, word))
        own = inspect.getdoc(load_word(kind, word))
        assert said in own or isinstance(load_word(kind, word), partial)


def test_a_users_task_comes_with_its_teacher_and_without_goals(own, module, capsys):
    module("lessons", TAUGHT)
    assert command(main, ["--algorithm", "sgim-d", "--environment", "lessons:taught", "--out", "runs", *SHORT]) == 0
    run = read_run(own / "runs/sgim-d/seed-000")
    assert np.flatnonzero(run.demonstration >= 0).tolist() == [30]
    assert run.evaluation["movements"].tolist() == [20, 40]
    printed = capsys.readouterr().err
    assert "3 demonstrations" in printed
    assert "Slider has no benchmark goals" in printed


def test_an_option_of_a_users_goal_model_is_its_parameter_and_nothing_else(own, module, capsys):
    module("lessons", TAUGHT)
    parts = {"environment": "sliders:Slider", "goals": "lessons:Worst", "goals.window": 4}
    goals = build(Config("sagg-riac", parts=parts)).learner.autonomous.goals
    assert (type(goals).__name__, goals.window) == ("Worst", 4)
    with pytest.raises(SystemExit):
        parse(["--algorithm", "sagg-riac", "--goals", "lessons:Worst", "--help"])
    assert re.search(r"--goals.window .*\n? *number of goals .*default: 8", capsys.readouterr().out)


def test_goals_all_over_a_space_are_at_most_500_and_inside():
    for dim in range(1, 7):
        box = Box(np.full(dim, -2.0), np.arange(1.0, dim + 1))
        goals = goals_all_over(SimpleNamespace(outcomes=box)).goals
        assert 200 < len(goals) <= MAX_GOALS
        assert box.contains(goals).all()
        assert len(np.unique(goals, axis=0)) == len(goals)
        middle, half = (box.low + box.high) / 2, box.sides / 2
        assert (np.abs(goals.mean(axis=0) - middle) < 0.05 * half).all()  # evenly


VALUES = {
    "a number": st.floats(allow_nan=False),
    "a whole number": st.integers(),
    "true or false": st.booleans(),
    "text": st.from_regex(r"[a-z]+:[a-z]{5}", fullmatch=True),
    "a path": st.sampled_from((Path("a"), Path("/b/c.npz"))),
}
SEVERAL = {
    "numbers with commas": st.lists(VALUES["a number"], max_size=3),
    "whole numbers with commas": st.lists(VALUES["a whole number"], max_size=3),
    "names with commas": st.lists(VALUES["text"], max_size=3),
    "two numbers with a comma between": st.lists(VALUES["a number"], min_size=2, max_size=2),
    "three numbers with commas": st.lists(VALUES["a number"], min_size=3, max_size=3),
}


def values_of(option):
    """Strategy of the values of an option."""
    if option.part:
        return st.sampled_from(sorted(WORDS[option.part]))
    name = option.values.name.removesuffix(" or null")
    values = VALUES[name] if name in VALUES else SEVERAL[name].map(tuple)
    return st.none() | values if option.values.name.endswith("null") else values


@st.composite
def configs(draw):
    """Any run: an algorithm, another part or none, and some values of options, step by step."""
    own = {
        "seed": st.integers(0),
        "name": values_of(RUN["name"]),
        "out": values_of(RUN["out"]),
        "evaluate_at": st.just((5, 6)),
    }
    config = Config(draw(st.sampled_from(sorted(WORDS["algorithm"]))))
    config = replace(config, **{name: draw(own[name]) for name in draw(st.sets(st.sampled_from(sorted(own))))})
    for _ in range(draw(st.integers(0, 4))):
        options = all_options(config.chosen)
        name = draw(st.sampled_from(sorted(options.keys() - RUN.keys())))
        kept = {each: value for each, value in dict(config.parts).items() if not each.startswith(f"{name}.")}
        config = replace(config, parts=kept | {name: draw(values_of(options[name]))})
    return config


@given(configs())
@settings(derandomize=True)
def test_the_words_and_the_settings_of_a_config_make_it_again(config):
    again, _ = parse(words(config))
    assert again == config
    assert hash(again) == hash(config)
    assert all(word.startswith("--") and "_" not in word.partition("=")[0] for word in words(config))
    stored = json.loads(json.dumps(config.settings))
    assert stored == config.settings
    assert Config.from_settings(stored) == config


def test_what_a_part_is_anyway_is_no_difference():
    own = Config("practice-taught")
    assert (own["goals"], own["search"], own["budget"], own["teacher"]) == ("within-reach", "vary", 1, "at-once")
    assert Config("practice-taught", parts={"goals": "within-reach", "budget": 1}) == own
    assert words(own) == ["--algorithm=practice-taught"]
    assert words(replace(own, parts={"goals": "interest-map"}))[1:] == ["--goals=interest-map"]
    assert "goals.window" not in own.values
    assert own["movements"] == 5000


def test_dashes_and_underscores_mean_the_same():
    assert parse(["--goals", "interest-map", "--goals.window=8", "--give-up", "-1"]) == parse(
        ["--goals=interest-map", "--goals.window", "8", "--give_up=-1"]
    )


def test_help_is_one_screen_and_a_parts_options_are_shown_once_it_is_chosen(capsys):
    for argv in (["--help"], ["--goals", "interest-map", "--help"]):
        with pytest.raises(SystemExit) as stop:
            parse(argv, "What it does.")
        assert stop.value.code == 0
    assert len(overview(run_command.__doc__).splitlines()) <= 60
    said = capsys.readouterr().out
    assert said.count("--goals.window ") == 2  # of which one is an example
    assert "number of recent competences" in " ".join(said.split())


PARTS_OF_PRACTICE = {
    "goals": "within-reach",
    "search": "vary",
    "explore": "returning",
    "inverse": "among-effects",
    "budget": 1,
}


def test_sagg_riac_with_every_part_of_practice_by_name_is_practice():
    def lived(config):
        parts = build(config)
        episodes = run(parts.learner, parts.environment, 7, movements=120)
        return np.concatenate([each.move.theta for each in episodes])

    def with_parts(algorithm, robot, **changed):
        return lived(Config(algorithm, parts={"environment": robot, **changed}))

    practice = {robot: with_parts("practice", robot) for robot in (PUCK, THROW)}
    for robot in practice:
        assert np.array_equal(with_parts("sagg-riac", robot, **PARTS_OF_PRACTICE), practice[robot])
    for name in PARTS_OF_PRACTICE:
        fewer = {each: value for each, value in PARTS_OF_PRACTICE.items() if each != name}
        assert not np.array_equal(with_parts("sagg-riac", PUCK, **fewer), practice[PUCK]), name


def test_a_choice_that_switches_a_part_off_is_told():
    def remarks(**parts):
        return build(Config("practice", parts={"environment": "planar-arm-7", **parts})).learner.problem.remarks

    assert remarks() == []
    assert remarks(inverse="process") == ["exploration does not look for effects: LocalProcess does not report them"]
    assert (
        remarks(inverse="nearest")[1] == "goals are uniform within reach: NearestNeighbour does not say how sure it is"
    )
    assert remarks(inverse="process", explore="anywhere") == []
