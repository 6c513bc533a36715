"""Robots that nobody tuned on, and robots that change: how they change, their statistics, their claims."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

import random_robots
import robots
from changing import FIRST_RANDOM, GRADUAL, RANDOM_ROBOTS, UNDONE, Changing, errors, robot_of
from evidence import Evidence, NotRun
from lives import Life, collect
from made_lives import write_lives
from model_files import File
from page_tables import Page
from random_robots import COUNTS, FAMILIES, LEARNERS, RandomRobot, kind
from runs import ROOT
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from table import LEARNING, read_table


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


def test_swapped_parameters_change_places_in_their_ranges_and_shifted_outcomes_are_told_elsewhere():
    box, unit = PlanarArm().policies, np.linspace(0.1, 0.9, PlanarArm().policies.dim)
    theta, outcome = moved("swap", 0, box.low + unit * box.sides)
    np.testing.assert_allclose((theta - box.low) / box.sides, [unit[1], unit[0], *unit[2:]])
    np.testing.assert_array_equal(outcome, [1, 1])
    theta, outcome = moved("shift", 0, box.low + unit * box.sides)
    np.testing.assert_allclose((theta - box.low) / box.sides, unit)
    np.testing.assert_allclose(outcome, 1 + 0.04 * PlanarArm().outcomes.sides)


def test_a_random_robot_that_changes_is_evaluated_at_its_own_goals_without_noise():
    robot, goals = robot_of("random-robots", 3)
    changed = Changing(robot, "shift", at=0)
    assert goals is None
    assert robot.family == kind(FIRST_RANDOM + 3)[0]
    learner = practice(changed, 0)
    ((_, (error, _)),) = errors(learner, changed, 0, goals, 0, (20,)).items()
    assert error == robot.error(learner.inverse, lambda c, theta: robot.effect(c, theta) + 0.04 * robot.outcomes.sides)


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
    ratio = robots.over(found, "sagg-riac", "random", 50).value
    assert ratio == pytest.approx((0.8**4 * 0.25 * 2) ** (1 / 4), rel=0.003)


def test_no_harm_on_sixty_robots_does_not_exclude_harm_on_one_in_twenty(tmp_path):
    """Wilson's bound for 0 of n is z^2 / (n + z^2)."""
    value, low, high = robots.clearly_harmed(found_in(tmp_path), 100)
    assert (value, low, high) == pytest.approx((0, 0, 1.96**2 / (60 + 1.96**2)), abs=1e-5)


def test_only_robots_that_every_learner_has_learnt_count(tmp_path):
    found = found_in(tmp_path, robots=5)
    found = replace(found, robots=found.robots.query("number != 3 or learner != 'random'"))
    assert [*robots.errors(found, 50).index] == [0, 1, 2, 4]
    assert {*robots.errors(found, 50).columns} == {*LEARNERS}


def test_harm_is_judged_over_the_lives_of_a_robot_and_beside_it_two_halves_of_the_random_lives(tmp_path):
    """A robot on which practice errs twice as much in each life is harmed; one with the same errors in another order is
    not, though it errs more in half of its lives. On the latter the later random lives err three times as much."""
    random = {500: [1.0, 1.1, 1.2, 1.3, 1.4] * 2, 501: [1.0, 1.1, 1.2, 1.3, 1.4, 3.0, 3.3, 3.6, 3.9, 4.2]}
    practice = {500: [2 * error for error in random[500][:5]], 501: random[501][4::-1]}
    lives = [(number, name, seed, 50, error) for name, errors in (("practice", practice), ("random", random))
             for number, by_seed in errors.items() for seed, error in enumerate(by_seed)]  # fmt: skip
    found = found_in(tmp_path, robots=2)
    found = replace(found, robots=pd.DataFrame(lives, columns=["number", "learner", "seed", "movements", "error"]))
    table = robots.judged(found, 50)
    assert table.ratio.tolist() == pytest.approx([2, 1])
    assert table.harmed.tolist() == [True, False]
    assert table["equal"].tolist() == [False, True]
    assert robots.clearly_harmed(found, 50, level=None).value == 0.5
    with pytest.raises(NotRun, match="at 100"):
        robots.judged(found, 100)


def test_robots_are_named_by_their_numbers(tmp_path):
    found = found_in(tmp_path, robots=3)
    numbers = found.robots["number"]
    assert robots.lived(found) == "0 to 2"
    assert (
        robots.lived(replace(found, robots=found.robots.assign(number=numbers + 3 * (numbers > 1))))
        == "0 to 1 and 5 to 5"
    )


def test_the_learner_of_before_is_compared_with_the_one_that_starts_anew(tmp_path):
    found = found_in(tmp_path)
    assert robots.over_anew(found, RANDOM_ROBOTS, "gain", 250, level=None).value == pytest.approx(0.4)
    with pytest.raises(NotRun, match="goes-on after gain of fishing-rod at 1000"):
        robots.over_anew(found, "fishing-rod", "gain", 1000)


def test_model_files_are_counted_by_what_is_told_and_errors_on_them_compared(tmp_path, monkeypatch):
    files = [File("dm_control/arm.xml", "site:tip"), File("robosuite/arm.xml", "geom:x", "cannot")]
    monkeypatch.setattr(robots, "FILES", files)
    said = robots.models(Page(found_in(tmp_path), tmp_path))
    assert (
        "2 places in 2 unchanged files of dm_control 1.0, robosuite 1.5: 1 right, 0 warned, 1 refused, of these 1 as"
        in said
    )
    assert "errs 0.80 times as much as random movements in the mean of 1, worse by its interval on 0." in said


@pytest.mark.slow
def test_a_life_is_a_job_that_leaves_the_rows_of_its_table(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    life = Life("robots.csv", (501, "random", 3), COUNTS[-1], tmp_path)
    assert sweep([life], Machine(1), on_end=partial(collect, tmp_path)) == []
    rows = read_table(tmp_path, "robots.csv").set_index(["number", "learner", "seed", "movements"])
    assert [*rows.index] == [(501, "random", 3, at) for at in COUNTS]
    assert rows.error[501, "random", 3, COUNTS[0]] == random_robots.life(501, "random", 3)[COUNTS[0]][0]
    assert {*rows.learning} == {LEARNING}


def test_a_life_that_fails_is_named(tmp_path):
    (said,) = sweep([Life("robots.csv", (501, "nobody", 3), 10, tmp_path)], Machine(1))
    assert said.startswith("501 nobody 3 failed: KeyError: 'nobody'")
