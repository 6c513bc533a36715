"""The suite: which runs it makes, what it shows of them, and what it refuses."""

import pytest

from sgimd_torch.options.config import Config
from sgimd_torch.runs.plan import task_of
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.tasks.goals import goals_all_over
from suite import RANDOM, TASKS, UNIFORM, main, parsed_options, runs_of

SHORT = ("--movements", "20", "--evaluate-at", "20", "--processes", "1")
LEARNER = ("--goals", "uniform", "--search", "perturb", "--budget", "1")


def suite(*words):
    """The exit code."""
    return command(main, [str(word) for word in words])


def configs_of(*words):
    return runs_of(*parsed_options(words))


def test_the_four_tasks_that_nobody_tuned_on_are_marked():
    assert [name for name, task in TASKS.items() if task.new] == ["swimmer", "crawler", "spatial-arm", "fetch"]


@pytest.mark.parametrize("name", [name for name, task in TASKS.items() if task.quick])
def test_a_task_states_its_noise_and_has_goals_of_its_own(name):
    task = task_of(Config.from_settings({**TASKS[name].options, "algorithm": "random"}))
    assert task.benchmark is not None
    assert len(goals_all_over(task.environment).goals)
    assert task.environment.outcome_noise >= 0


def test_each_task_is_run_with_the_learner_and_with_the_two_that_it_has_to_beat():
    configs = configs_of("--tasks", "toss", "rod-large", "--seeds", "3,4", "--budget", "7", "--out", "here", *SHORT)
    assert len({config.directory for config in configs}) == 2 * 2 * 3
    ours = [config for config in configs if config.variant == "practice"]
    assert {(config["environment"], config.values.get("environment.task_space"), config.seed) for config in ours} == {
        (word, side, seed)
        for word, side in (("experiments.toys:toss", None), ("fishing-rod", 100.0))
        for seed in (3, 4)
    }
    assert {(config.variant, config.values.get("budget")) for config in configs} == {
        (RANDOM, None),
        (UNIFORM, 1),
        ("practice", 7),
    }
    assert {(config.movements, config.evaluate_at) for config in configs} == {(20, (20,))}


def test_what_is_varied_gives_a_learner_for_each_value():
    configs = configs_of("--tasks", "toss", "--vary", "inverse=process,nearest", *LEARNER)
    assert [config["inverse"] for config in configs[2:]] == ["process", "nearest"]
    assert [config.variant for config in configs] == [RANDOM, UNIFORM, "inverse=process", "inverse=nearest"]


@pytest.mark.slow
def test_a_suite_is_run_shown_and_gone_on_with(tmp_path, capsys):
    out = tmp_path / "study"
    words = ("--tasks", "toss", "--out", out, *LEARNER, *SHORT)
    assert suite(*words) == 0
    shown = capsys.readouterr().out
    random, uniform = (read_run(out / "toss" / name / "seed-000").at(20) for name in (RANDOM, UNIFORM))
    line = next(line.split() for line in shown.splitlines() if line.startswith(UNIFORM))
    assert line[3] == f"{uniform:.3f}"
    assert line[-1] == f"{uniform - random:+.4f}"
    assert suite(*words, "--dry-run") == 0
    assert capsys.readouterr().out == ""
    assert suite(*words, "--seeds", "0-1", "--dry-run") == 0
    assert f"{out}/toss/practice/seed-001: 0 of 20 movements" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--environment toss", "--environment cannot be given here: each task has its own"),
        ("--environment.task_space=2", "--environment cannot be given here"),
        ("--vary environment=toss,crawler", "--environment cannot be given here"),
        ("--tasks toss --vary seed=1,2", "--seed cannot be given here: use --seeds"),
        ("--tasks tos", "invalid choice: 'tos'"),
        ("--tasks crawler --algorithm imitation", "has no demonstrations"),
    ],
)
def test_a_wrong_suite_is_refused_and_leaves_nothing(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert suite(*words.split()) == 2
    assert message in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]
