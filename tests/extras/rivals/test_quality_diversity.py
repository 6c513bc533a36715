"""Quality diversity as learners: batches, interruptions, an archive that fills, demonstrations, noise."""

import numpy as np
import pytest

from marks import slow
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.rivals.quality_diversity import (
    cma_mae_alone,
    cma_me_alone,
    isoline_alone,
    map_elites_alone,
)
from sgimd_torch.learner import Learner
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, Box, stream
from sgimd_torch.tasks.robots import arm_demonstrations
from worlds import NO_CONTEXT

ARM = PlanarArm(6)
ELITES, TEAMS = (map_elites_alone, isoline_alone), (cma_me_alone, cma_mae_alone)
BOTH = pytest.mark.parametrize("make", [*ELITES, *TEAMS])


class Elsewhere(PlanarArm):
    """The arm with other spaces, which the learners read; its movements are made up in the tests."""

    def __init__(self, policies: Box, outcomes: Box, contexts: Box) -> None:
        super().__init__(policies.dim)
        self.policies, self.outcomes, self.contexts = policies, outcomes, contexts


def live(learner: Learner, n: int) -> Array:
    for _ in run(learner, ARM, 0, movements=learner.movements + n):
        pass
    return learner.memory.thetas


def cells_reached(learner: Learner) -> int:
    return len(learner.autonomous.archive)


@pytest.mark.parametrize("make", [*ELITES, TEAMS[0], slow(TEAMS[1])])
def test_the_same_seed_makes_the_same_movements_and_another_seed_others(make):
    numpy_state = str(np.random.get_state())  # noqa: NPY002 - nobody may touch it
    first, same, other = (live(make(ARM, seed), 150) for seed in (1, 1, 2))
    assert np.array_equal(first, same)
    assert not np.isclose(first, other).all(axis=1).any()
    assert str(np.random.get_state()) == numpy_state  # noqa: NPY002
    assert ARM.policies.contains(first).all()


@BOTH
def test_an_interruption_at_any_movement_costs_nothing(make):
    undisturbed, interrupted = make(ARM, 3), make(ARM, 3)
    expected = live(undisturbed, 150)
    for index in range(150):
        move = interrupted.ask(NO_CONTEXT)
        if index % 7 == 3:  # before its outcome is told: it comes again
            interrupted.interrupt()
            assert np.array_equal(interrupted.ask(NO_CONTEXT).theta, move.theta)
        interrupted.tell(undisturbed.memory.outcomes[index])
        if index % 5 == 2:
            interrupted.interrupt()
    assert np.array_equal(interrupted.memory.thetas, expected)
    assert cells_reached(interrupted) == cells_reached(undisturbed)


@BOTH
def test_the_archive_is_told_of_a_batch_when_all_its_movements_were_made(make):
    learner = make(ARM, 4, batch=8, **({"first": 8} if make in ELITES else {"emitters": 1}))
    found = []
    for _ in range(24):
        live(learner, 1)
        found.append(cells_reached(learner))
    assert found[6] == 0 < found[7] == found[14]
    assert found[7] <= found[15] <= found[23]


def test_cma_me_moves_on_from_its_first_generation():
    adapting, still = cma_me_alone(ARM, 6), cma_me_alone(ARM, 6, emitters=1, batch=500)
    live(adapting, 500), live(still, 500)
    assert cells_reached(adapting) > 2 * cells_reached(still)


def test_variations_of_elites_spread_by_sd_and_elites_are_of_little_effort():
    learner = map_elites_alone(ARM, 7, first=50, batch=500, sd=0.01)
    thetas = live(learner, 550)
    first, later = thetas[:50], thetas[50:]
    away = np.linalg.norm(later[:, None] - first, axis=2).min(axis=1)
    assert np.sqrt(np.mean(np.square(away)) / 6) == pytest.approx(0.01, rel=0.15)  # those clipped move less
    elites = learner.autonomous.archive.data("solution")
    assert np.square(elites - 0.5).mean() < np.square(thetas - 0.5).mean()


@BOTH
def test_policies_may_be_of_any_box_and_outcomes_outside_of_t(make):
    policies = Box(np.array([-5.0, 0.0, 3.0]), np.array([5.0, 1000.0, 3.001]))
    learner = make(Elsewhere(policies, Box.cube(-1, 1, 2), ARM.contexts), 8)
    for index in range(230):
        theta = learner.ask(NO_CONTEXT).theta
        assert policies.contains(theta)
        learner.tell(np.array([-1e6, 0.5 + index]))
    assert learner.memory.thetas.std(axis=0) == pytest.approx(policies.sides * 0.2, rel=0.7)
    assert cells_reached(learner) in (1, 2)  # the second is of y = .5, all others share the corner


REFUSED = [
    *((make, {"sd": 0.0}, "sd must be positive") for make in (*ELITES, *TEAMS)),
    *((make, {"batch": 0}, "batch must be") for make in (*ELITES, *TEAMS)),
    *((make, {"first": 0}, "first must be a whole number") for make in ELITES),
    *((make, {"emitters": 0}, "emitters must be a whole number") for make in TEAMS),
    *((cma_mae_alone, {"learning_rate": rate}, "learning_rate must") for rate in (0.0, 1.5, np.nan)),
    (map_elites_alone, {"line": -0.1}, "line must be finite and >= 0"),
    (map_elites_alone, {"cells": 0}, "cells must be"),
    (map_elites_alone, {"cells": 2000}, "in all at most, got 2000 in 2 dimensions"),
]


@pytest.mark.parametrize(("make", "options", "message"), REFUSED)
def test_options_that_make_no_sense_are_refused(make, options, message):
    with pytest.raises(ValueError, match=message):
        make(ARM, 0, **options)


@pytest.mark.parametrize(
    ("spaces", "message"),
    [
        ((ARM.policies, ARM.outcomes, Box.cube(0, 1, 1)), "one context only, got contexts of dim 1"),
        ((ARM.policies, Box.cube(2, 3, 2), ARM.contexts), "rest of the environment must lie in"),
    ],
)
def test_a_robot_with_contexts_or_a_wrong_rest_is_refused(spaces, message):
    with pytest.raises(ValueError, match=message):
        cma_me_alone(Elsewhere(*spaces), 0)


def test_movements_of_cma_mae_stay_compact():
    """Its thresholds keep a cell worth improving, so it comes back with less effort; CMA-ME goes on to new cells."""
    effort = {make: np.square(live(make(ARM, 5), 1500)[-500:] - 0.5).mean() for make in TEAMS}
    assert effort[cma_mae_alone] < effort[cma_me_alone]


@BOTH
def test_what_is_demonstrated_is_imitated_and_enters_the_archive(make):
    shown = arm_demonstrations(ARM)[3]
    learner = make(ARM, 2, correspondence=ARM.correspondence, imitations=4, epsilon=0.01)
    learner.watch(shown)
    moves = []
    for _ in range(4):
        moves.append(learner.ask(NO_CONTEXT))
        learner.tell(ARM.execute(NO_CONTEXT, moves[-1].theta, stream(0, "arm")))
    assert [move.origin for move in moves] == ["imitate"] * 4
    assert learner.ask(NO_CONTEXT).origin != "imitate"  # its own batch goes on
    theta_d = ARM.correspondence(shown.times, shown.trajectory)
    assert np.abs(np.array([move.theta for move in moves]) - theta_d).max() <= 0.01
    elites = learner.autonomous.archive.data("solution")
    assert 1 <= len(elites) <= 4
    assert np.abs(elites - theta_d).max() <= 0.01
