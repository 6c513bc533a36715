"""``sgimd run --until``: a run ends once the learner expects small errors, and stays ended; the errors are found."""

import re
from shutil import copytree

import numpy as np
import pytest

from runs import about_of, content_of, end, stopped_at
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.until.until import expected_error, goals_reached
from sgimd_torch.options.config import Config
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import finished, read_run
from sgimd_torch.spaces import stream
from worlds import Sure

ARM = "--environment planar-arm-7 --seed 3 --movements 260 --evaluate-at 120"


def go(out, *words):
    return command(main, [*ARM.split(), f"--out={out}", *words])


def path_of(out):
    return out / "practice" / "seed-003"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The content of a run of all movements."""
    out = tmp_path_factory.mktemp("whole")
    assert go(out) == 0
    return content_of(path_of(out))


@pytest.fixture(scope="module")
def early(tmp_path_factory):
    """A run that ended early."""
    out = tmp_path_factory.mktemp("early")
    assert go(out, "--until=0.03") == 0
    return out


def test_a_run_ends_as_soon_as_the_expected_error_is_small_and_is_finished(early, whole):
    run = read_run(path_of(early))
    n = run.summary["movements"]
    assert (n, run.summary["finished"], run.config["movements"]) == (150, True, 260)
    assert run.evaluation["movements"].tolist() == [120, n]  # the last evaluation is that of the end, with its noise
    assert np.isfinite(run.evaluation["noise_floor"]).tolist() == [False, True]
    told = float(re.fullmatch(r"it expected ([0-9.]+) m", run.summary["ended_early"])[1])
    assert run.at(n, "expected_error") - 1e-4 < told <= 0.03  # the larger of what it expects and makes
    assert content_of(path_of(early))["events"] == whole["events"][:n]  # looking changes nothing
    config = Config(
        seed=3, movements=260, evaluate_at=(120,), out=early, parts={"environment": "planar-arm-7", "until": 0.03}
    )
    assert finished(config)


def test_the_expected_error_is_the_one_that_is_found(early):
    run = read_run(path_of(early))
    n = run.summary["movements"]
    assert 0.8 < run.at(n, "expected_error") / run.at(n) < 1.25
    found, expected = run.missed_by(n)
    assert np.corrcoef(found, expected)[0, 1] > 0.5  # goal by goal, too


@pytest.mark.parametrize("words", [[], ["--movements=400"]])
def test_a_run_that_ended_early_stays_ended_when_it_is_resumed(early, words, capsys, tmp_path):
    copytree(early, tmp_path, dirs_exist_ok=True)
    assert go(tmp_path, "--until=0.03", "--resume", *words) == 0
    assert "150 movements, mean error" in capsys.readouterr().out
    assert content_of(path_of(tmp_path)) == content_of(path_of(early))
    assert read_run(path_of(tmp_path)).summary["finished"]


def test_without_its_limit_or_with_a_lower_one_the_run_goes_on_as_if_it_had_never_ended(tmp_path, whole):
    assert go(tmp_path, "--until=0.03") == 0
    assert go(tmp_path, "--until=1e-9", "--resume") == 0
    assert content_of(path_of(tmp_path)) == whole
    assert about_of(path_of(tmp_path))["ended_early"] is None


def test_a_run_killed_at_its_end_ends_there_when_it_is_resumed(early, tmp_path):
    words = [*ARM.split(), f"--out={tmp_path}", "--until=0.03"]
    end(stopped_at(150, *words))
    assert not read_run(path_of(tmp_path)).summary["finished"]
    assert command(main, [*words, "--resume"]) == 0
    assert content_of(path_of(tmp_path)) == content_of(path_of(early))


def test_eight_robots_stop_together_after_the_group_that_passes_the_moment_of_a_look(tmp_path):
    assert go(tmp_path, "--until=0.3", "--at-once=8") == 0
    n = read_run(path_of(tmp_path)).summary["movements"]
    assert 50 <= n < 260
    assert n % 50 < 8


def test_a_robot_without_goals_of_evaluation_is_asked_about_goals_within_reach(tmp_path, own):
    words = ["--environment=sliders:Slider", "--movements=200", "--evaluate-at=[]", f"--out={tmp_path}"]
    assert command(main, [*words, "--until=10"]) == 0
    assert read_run(tmp_path / "practice" / "seed-000").summary["movements"] == 50


SURE = """
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.parts import Inverse

class Sure(Inverse):
    def __call__(self, context, goal):
        estimate = NearestNeighbour(self.problem)(context, goal)
        return estimate._replace(expected=goal, sd=0.01)
"""


def test_an_inverse_model_of_a_users_own_that_says_how_sure_it_is_ends_the_run(tmp_path, module):
    module("confident", SURE)
    assert go(tmp_path, "--until=0.5", "--inverse=confident:Sure") == 0
    assert read_run(path_of(tmp_path)).summary["movements"] == 50


def test_a_run_goes_on_while_answers_miss_by_more_than_its_limit_whatever_is_expected(tmp_path, module, capsys):
    module("confident", SURE)
    assert go(tmp_path, "--until=0.02", "--inverse=confident:Sure") == 0
    assert read_run(path_of(tmp_path)).summary["movements"] == 260
    assert "after 50 movements 0.0125 m was expected, but 20 answers missed by 0." in capsys.readouterr().err


def test_an_error_is_expected_in_remembered_contexts_at_goals_such_as_one_in_each_tile_with_two_outcomes() -> None:
    arm = PlanarArm(5, context=True)
    inverse, rng = Sure(arm), stream(0, "draws")
    memory = inverse.problem.memory
    for context, outcome in ((0.2, 0.5), (0.3, 0.5), (0.4, -0.9)):
        memory.add(np.array([context]), np.full(5, 0.5), np.array([outcome, outcome]))
    assert expected_error(inverse, np.zeros((30, 2)), rng) == pytest.approx(0.5)
    assert {*inverse.asked[0]} | {*inverse.asked[1]} <= {0.2, 0.3, 0.4}
    assert len(goals_reached(inverse, rng)) == 1  # one tile has two outcomes
