"""Widening: global exploration as wide as its outcomes can be predicted."""

from functools import partial

import numpy as np
import pytest

from experiments.toys import two_elbows
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.searches.explore import Returning, Widening
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, Estimate
from worlds import NO_CONTEXT, problem

POLICIES = Box(np.array([-1.0, 0.0]), np.array([3.0, 10.0]))


class Oracle(NearestNeighbour):
    """Expects theta itself, plus an error."""

    def __init__(self, problem, *, error: float) -> None:
        super().__init__(problem)
        self.error = error

    def predict(self, context, theta):
        return theta + self.error


def live(inverse, movements: int = 60, *, told: bool = True) -> tuple[Widening, np.ndarray]:
    given = problem(policies=POLICIES, inverse=inverse)
    explore, thetas = Widening(given), []
    for _ in range(movements):
        thetas.append(explore(NO_CONTEXT))
        if told:
            given.memory.add(NO_CONTEXT, thetas[-1], thetas[-1])
    return explore, np.array(thetas)


def test_it_begins_around_the_middle():
    _, thetas = live(NearestNeighbour, 4000)
    assert thetas.mean(axis=0) == pytest.approx([1.0, 5.0], abs=0.05)
    assert thetas.std(axis=0) / POLICIES.sides == pytest.approx([0.1, 0.1], rel=0.05)


@pytest.mark.parametrize(("error", "width"), [(0.0, 0.3), (100.0, 0.03)])
def test_good_predictions_widen_it_and_bad_ones_narrow_it(error, width):
    explore, thetas = live(partial(Oracle, error=error))
    assert explore.width.sd == width
    spread = thetas[30:].std(axis=0) / POLICIES.sides
    assert (spread > 0.15).all() if width > 0.1 else (spread < 0.05).all()
    assert POLICIES.contains(thetas).all()


def test_a_movement_that_was_never_made_says_nothing():
    assert live(partial(Oracle, error=0.0), told=False)[0].width.sd == 0.1


@pytest.mark.parametrize(
    ("make", "least", "most"), [(lambda: two_elbows().environment, 0.25, 0.3), (FishingRod, 0.03, 0.25)]
)
def test_it_looks_wide_where_movements_are_alike_and_near_where_they_are_not(make, least, most):
    robot = make()
    learner = practice(robot, 0)
    for _ in run(learner, robot, 0, movements=150):
        pass
    assert least <= learner.autonomous.wide.explore.width.sd <= most


class Ball:
    """It moves if it is hit, as a fifth of all movements do, far from the middle."""

    contexts, policies, outcomes = Box.cube(0, 1, 0), Box.cube(0, 1, 3), Box.cube(-1, 1, 2)
    outcome_noise, rest = 0.0, np.zeros(2)

    def observe(self, rng):
        return NO_CONTEXT

    def execute(self, context, theta, rng):
        return np.sin(3 * (theta[1:] - 0.5)) if theta[0] > 0.8 else np.zeros(2)


def test_where_nothing_happens_practice_looks_wider_until_something_does():
    robot = Ball()
    learner = practice(robot, 0)
    moved = [episode.outcome.any() for episode in run(learner, robot, 0, movements=400)]
    assert np.mean(moved[200:]) > 0.4  # of movements drawn anywhere a fifth


def test_around_a_copied_movement_practice_looks_half_as_wide_as_it_explores():
    babbling, known = practice(two_elbows().environment, 0).autonomous.wide, np.full((1, 3), 0.5)
    babbling.explore.width.sd = 0.06
    search = babbling.search(Estimate(known[0], known, np.zeros((1, 2))), np.zeros(2))
    executed = np.array([next(search), *(search.send(np.zeros(2)) for _ in range(1999))])
    assert executed.std(axis=0) == pytest.approx(np.full(3, 0.03), rel=5 / 63)  # five standard errors


@pytest.mark.parametrize(
    ("inverse", "said"),
    [
        (NearestNeighbour, ["NearestNeighbour predicts nothing", "NearestNeighbour does not report them"]),
        (LocalProcess, ["LocalProcess does not report them"]),
        (AmongEffects, []),
    ],
)
def test_what_an_inverse_model_does_not_tell_exploration_is_remarked(inverse, said):
    given = problem(inverse=inverse)
    Returning(given)
    assert [remark.partition(": ")[2] for remark in given.remarks] == said
