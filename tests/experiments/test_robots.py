"""Robots that nobody tuned on, and robots that change: how they change, their statistics, their claims."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import robots
from changing import GRADUAL, UNDONE, Changing, errors
from evidence import Evidence, NotRun
from lives import make_lives
from made_lives import ALIVE, life, write_lives
from model_files import File
from page_tables import Page
from random_robots import FAMILIES, LEARNERS, RandomRobot, kind
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from table import merge, read_table


def moved(change, since, theta):
    """Movement that an arm executes where it is told ``theta``, some movements after the change."""
    world, seen = Changing(PlanarArm(), change, at=10), []
    world.robot.execute = lambda context, theta, rng: seen.append(theta) or np.ones(2)
    world.made = 10 + since
    outcome = world.execute(np.empty(0), theta, np.random.default_rng(0))
    return seen[0], outcome


@pytest.mark.parametrize(
    ("change", "since", "shift"),
    [
        ("offset-0.02", -1, 0),
        ("offset-0.02", 0, 0.02),
        ("gradual", GRADUAL // 2, 0.05),
        ("undone", UNDONE - 1, 0.1),
        ("undone", UNDONE, 0),
    ],
)
def test_an_offset_shifts_every_parameter_from_its_movement_on(change, since, shift):
    box = PlanarArm().policies
    theta = box.low + 0.4 * box.sides
    np.testing.assert_allclose((moved(change, since, theta)[0] - theta) / box.sides, shift, atol=1e-12)


def test_a_mirrored_robot_turns_movements_and_the_first_outcome_around():
    box = PlanarArm().policies
    theta, outcome = moved("mirrored", 0, box.low + 0.4 * box.sides)
    np.testing.assert_allclose(theta, box.low + 0.6 * box.sides)
    np.testing.assert_array_equal(outcome, [-1, 1])


def test_a_life_is_evaluated_after_the_change_and_counts_movements_from_it():
    arm, executed = Changing(PlanarArm(), "offset-0.1", at=3), []
    arm.execute = lambda context, theta, rng: executed.append(arm.made) or np.zeros(2)
    found = errors(practice(arm, 0), arm, 0, np.array([[0.5, 0.0]]), 3, (1, 4))
    assert {at: error for at, (error, _) in found.items()} == {1: 0.5, 4: 0.5}
    assert executed == [0, 1, 2, 3, 4, 4, 5, 6, 7]  # the fifth and the last belong to evaluations


@pytest.mark.parametrize("number", [0, 7])
def test_the_kind_of_a_random_robot_is_known_without_making_it(number):
    robot = RandomRobot(number)
    assert (robot.family, robot.noise) == kind(number)[:2]
    assert robot.family == FAMILIES[number]


def found_in(folder, spoilt=lambda *key: 1.0, **how):
    return Evidence.of(write_lives(folder, spoilt, **how))


def test_shares_and_means_over_robots(tmp_path):
    """SAGG-RIAC errs .8, on one robot of four .2 and on another one 1.6; random movements 1, `practice` .3."""
    found = found_in(tmp_path, lambda *key: {(0, "sagg-riac"): 0.25, (1, "sagg-riac"): 2.0}.get(key[:2], 1.0), robots=4)
    assert robots.best(found, "sagg-riac", 50).value == 0.25
    assert robots.best(found, "practice", 50).value == 0.75
    assert robots.harmful(found, "sagg-riac", 50).value == 0.25
    assert robots.over(found, "sagg-riac", "random", 50).value == pytest.approx((0.8**4 * 0.25 * 2) ** (1 / 4))


def test_no_harm_on_sixty_robots_does_not_exclude_harm_on_one_in_twenty(tmp_path):
    """Wilson's bound for 0 of n is z^2 / (n + z^2)."""
    value, low, high = robots.harmful(found_in(tmp_path), "practice", 100)
    assert (value, low, high) == pytest.approx((0, 0, 1.96**2 / (60 + 1.96**2)), abs=1e-5)


def test_only_robots_that_every_learner_has_learnt_count(tmp_path):
    found = found_in(tmp_path, robots=5)
    found = replace(found, random=found.random.query("number != 3 or learner != 'random'"))
    assert [*robots.errors(found, 50).index] == [0, 1, 2, 4]
    assert {*robots.errors(found, 50).columns} == {*LEARNERS}


def test_harm_is_judged_over_the_lives_of_a_robot(tmp_path):
    """A robot on which practice errs twice as much in each life is harmed; one with the same errors in another order is
    not, though it errs more in half of its lives."""
    random = [1.0, 1.1, 1.2, 1.3, 1.4]
    practice = {460: [2 * error for error in random], 461: random[::-1]}
    lives = [(n, name, seed, errors[seed]) for n, ours in practice.items() for seed in range(5)
             for name, errors in (("practice", ours), ("random", random))]  # fmt: skip
    rows = [(n, name, seed, 50, error) for n, name, seed, error in lives]
    columns = ["number", "learner", "seed", "movements", "error"]
    found = replace(found_in(tmp_path), repeated=pd.DataFrame(rows, columns=columns))
    table = robots.repeated(found, 50)
    assert table.ratio.tolist() == pytest.approx([2, 1])
    assert table.harmed.tolist() == [True, False]
    assert table.lives.tolist() == [1, 0.4]
    assert table["equal"].tolist() == [0.5, 0.5]
    assert robots.clearly_harmed(found, 50, level=None).value == 0.5
    with pytest.raises(NotRun, match="at 100"):
        robots.repeated(found, 100)


def test_the_learner_of_before_is_compared_with_the_one_that_starts_anew(tmp_path):
    found = found_in(tmp_path)
    assert robots.over_anew(found, "toss", "gain", 250, level=None).value == pytest.approx(0.4)
    with pytest.raises(NotRun, match="goes-on after gain of fishing-rod at 1000"):
        robots.over_anew(found, "fishing-rod", "gain", 1000)


def test_model_files_are_counted_by_what_is_told_and_errors_on_them_compared(tmp_path, monkeypatch):
    files = [File("dm_control/arm.xml", "site:tip"), File("robosuite/arm.xml", "geom:x", "cannot")]
    monkeypatch.setattr(robots, "FILES", files)
    said = robots.models(Page(found_in(tmp_path), tmp_path))
    assert "2 places in 2 unchanged files of dm_control 1.0, robosuite 1.5: 1 right, 0 warned, 1 refused; 1 as" in said
    assert "errs 0.80 times as much as random movements in the mean of 1, worse by its interval on 0." in said


def test_lives_that_the_table_has_are_not_made_again_and_the_others_get_their_rows(tmp_path):
    kept = {"number": 1, "learner": "practice", "movements": 2, "error": 9.0, "noticed": 5}
    merge(tmp_path, "random.csv", [kept])
    make_lives(tmp_path, "random.csv", life, ALIVE, processes=1)
    rows = read_table(tmp_path, "random.csv").set_index(["number", "learner", "movements"])
    assert rows.error.to_dict() == {
        (0, "practice", 1): 0.5,
        (0, "practice", 2): 0.25,
        (0, "random", 1): 0.5,
        (0, "random", 2): 0.25,
        (1, "practice", 2): 9.0,
        (1, "random", 1): 0.5,
        (1, "random", 2): 1.25,
    }
    assert rows.noticed[1, "random", 2] == 1
