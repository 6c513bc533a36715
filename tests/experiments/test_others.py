"""Other people's programs: each answers each goal in Pi, by what it has learnt."""

import numpy as np
import pytest

import other_programs as programs
import others
from marks import slow
from page_tables import Page
from table import TABLES, merge


@pytest.fixture(scope="module")
def arm():
    return programs.robot_of("arm-5")


def live(name, robot, goals, n, contexts=None):
    """A rival after ``n`` movements, and its distances from the goals by its answers, each in its context."""
    contexts = np.zeros((len(goals), 0)) if contexts is None else contexts
    rival = programs.RIVALS[name](robot, contexts, programs._into(robot.outcomes, goals), 1000)
    rng = np.random.default_rng(0)
    for _ in range(n):
        context = rng.random(robot.contexts.dim)
        theta = rival.move(context)
        outcome = robot.execute(programs._out_of(robot.contexts, context), theta, rng)
        rival.tell(context, theta, programs._into(robot.outcomes, outcome))
    answers = rival.answers()
    rival.close()
    assert answers.shape == (len(goals), robot.policies.dim)
    assert ((answers >= 0) & (answers <= 1)).all()
    return rival, missed(robot, contexts, answers, goals, rng)


def missed(robot, contexts, thetas, goals, rng):
    movements = zip(programs._out_of(robot.contexts, contexts), thetas, strict=True)
    return np.linalg.norm([robot.execute(*movement, rng) for movement in movements] - goals, axis=1)


@pytest.mark.parametrize(
    ("name", "better"),
    [("scikit-learn-process", 0.8), slow("torch-network", 0.9), ("practice", 0.6), ("pyribs-cma-me", 9.0)],
)
def test_answers_of_a_program_are_those_of_its_movements_and_models_miss_less_than_the_nearest_one(arm, name, better):
    rival, errors = live(name, *arm, 120)
    nearest = rival.begins(1)[:, 0]
    without = missed(arm[0], np.zeros((len(nearest), 0)), nearest, arm[1], np.random.default_rng(1))
    assert errors.mean() < better * without.mean()


def test_cma_es_has_one_goal_after_another_and_begins_where_it_came_nearest(arm):
    rival, errors = live("cma-es-each-goal", *arm, 200)
    assert errors.mean() < 0.3
    generation = len(rival._asked)
    assert len(rival._searches) == -(-200 // generation)
    first = np.argmin(np.linalg.norm(np.array(rival.outcomes[:generation]) - rival.goals[1], axis=1))
    np.testing.assert_allclose(rival._searches[1].x0, rival.tries[first])


@pytest.mark.skipif(not programs.EXPLAUTO.exists(), reason="scripts/others installs Explauto")
def test_explauto_learns_in_a_process_of_its_own(arm):
    assert live("explauto", *arm, 150)[1].mean() < 0.15


def test_botorch_takes_the_movement_that_it_expects_to_improve_most(arm):
    pytest.importorskip("botorch", reason="scripts/others installs BoTorch")
    rival, errors = live("botorch-each-goal", *arm, 30)
    assert errors.mean() < 0.3
    misses = [np.linalg.norm(rival.outcomes[n] - rival.goals[n % len(rival.goals)]) for n in range(30)]
    assert np.mean(misses[20:]) < 0.8 * np.mean(misses[:20])  # the first twenty are random


def test_mink_knows_the_arm_and_misses_by_its_noise_alone(arm):
    assert live("mink", *arm, 3)[1].mean() < 0.02


@pytest.mark.parametrize("name", ["practice", "scikit-learn-process", slow("torch-network")])
def test_a_program_that_takes_contexts_answers_each_goal_in_its_own(name):
    robot, goals = programs.robot_of("toss")
    winds = np.linspace(0, 1, len(goals))[:, None]
    rival, errors = live(name, robot, goals, 200, winds)
    elsewhere = missed(robot, winds[::-1], rival.answers(), goals, np.random.default_rng(1))
    assert errors.mean() < 0.8 * elsewhere.mean()


def test_the_programs_are_those_that_are_compared_and_each_lives_where_it_can():
    assert (*programs.RIVALS,) == others.PROGRAMS
    keys = {life.key for life in others.lives([1000], others.ROBOTS, "out")}
    assert ("toss", "practice", 1000) in keys
    assert ("toss", "explauto", 1000) not in keys
    assert {robot for robot, name, _ in keys if name == "mink"} == {"arm-5", "arm-7", "arm-50"}


def test_without_explauto_a_line_says_how_to_install_it(arm, monkeypatch, tmp_path):
    monkeypatch.setattr(programs, "EXPLAUTO", tmp_path / "others/bin/python")
    with pytest.raises(FileNotFoundError, match="run scripts/others"):
        programs.Explauto(arm[0], np.zeros((len(arm[1]), 0)), arm[1], 0)


def test_the_table_has_both_answers_of_a_program_and_ours_once(tmp_path, few_draws):
    columns = TABLES[others.TABLE][1]
    rows = [
        (robot, name, seed, at, 0.2, 0.1, 3.0, 4.0)
        for robot in ("arm-5", "rod")
        for name in ("practice", "explauto")
        for seed in (1, 2)
        for at in (50, 100)
    ]
    merge(tmp_path, others.TABLE, [dict(zip(columns, row, strict=False)) for row in rows])
    page = Page(None, tmp_path)
    table = page.others(50)
    assert "| arm-5, 50 | 0.200 | 0.200, 0.100 | – | – | – | – |" in table
    assert "| rod, 50 |" in table
    assert ", 100 |" not in table


def test_a_life_has_an_error_by_both_answers_after_each_number_of_movements():
    found = programs.life("soft-arm", "cma-es-each-goal", 1000, counts=(40, 80))
    assert list(found) == [40, 80]
    assert all(0 < own < 1 and 0 < ours < own for own, ours, *_ in found.values())
