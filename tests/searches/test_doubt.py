"""Another hill: movements that nothing explains are repeated, and goals missed again and again get a global one."""

import numpy as np
import pytest

from sgimd_torch.algorithms.practice import practice
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.searches.doubt import Doubt, Stuck
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, Estimate
from worlds import NO_CONTEXT, Boxes, problem

LINE = Box.cube(-3, 3, 1)


def doubting(outcome):
    """A doubt and its memory of 60 movements on a line, then a global movement with this ``outcome``, like 0 .5 .5."""
    thetas = np.random.default_rng(0).random((60, 3))
    memory = Memory(0, 3, 1)
    space = problem(policies=Box.cube(0, 1, 3), outcomes=LINE, noise=0.01, memory=memory, inverse=LocalProcess)
    theta, doubt = np.array([0.0, 0.5, 0.5]), Doubt(space)
    memory.extend(np.zeros((60, 0)), thetas, thetas @ np.ones((3, 1)) / 3)
    memory.add(NO_CONTEXT, theta, [outcome])
    doubt.add(theta)
    return doubt, memory, theta


@pytest.mark.parametrize(("again", "confirmed"), [(2.5, True), (0.33, False)])
def test_an_outcome_that_nothing_explains_is_repeated_once_and_believed_if_it_comes_again(again, confirmed):
    doubt, memory, theta = doubting(2.5)
    assert len(doubt) == 1
    repetition = doubt.next()
    assert repetition == pytest.approx(theta, abs=0.03)
    assert not np.array_equal(repetition, theta)
    memory.add(NO_CONTEXT, repetition, [again])
    doubt.add(repetition)
    assert len(doubt) == 0
    assert [place.tolist() for place in doubt.reached.confirmed] == [[2.5]] * confirmed
    assert doubt.reached.rows == [60]  # a repetition is no global movement


def test_an_outcome_that_similar_movements_explain_is_not_doubted():
    assert len(doubting(1 / 3)[0]) == 0


def known_miss(expected, sd=0.01):
    return Estimate(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), NO_CONTEXT, np.array([expected]), sd)


@pytest.mark.parametrize(
    ("expected", "goals", "is_stuck"),
    [
        (np.zeros(11), np.full(11, 1.0), True),
        (np.zeros(10), np.full(10, 1.0), False),  # ten misses have to come first
        (np.zeros(11), np.linspace(-3, 3, 11), False),  # goals lie far from each other
        (np.linspace(0, 0.5, 11), np.full(11, 1.0), False),  # misses become smaller
        (np.full(11, 0.98), np.full(11, 1.0), False),  # by noise alone
    ],
)
def test_a_learner_is_stuck_after_ten_known_misses_near_a_goal(expected, goals, is_stuck):
    stuck = Stuck(problem(outcomes=LINE))
    answers = [stuck(known_miss(e), np.array([g])) for e, g in zip(expected, goals, strict=True)]
    assert answers[-1] == is_stuck
    assert not any(answers[:-1])


class Hills(Boxes):
    """A broad hill of height 1, and a narrow one of height 3 on which every fortieth movement lands."""

    def __init__(self):
        super().__init__(Box.cube(0, 1, 0), Box.cube(0, 1, 4), Box.cube(0, 3, 1), np.zeros(1), 0.02)

    def execute(self, context, theta, rng):
        broad, narrow = np.sum((theta - 0.3) ** 2), np.sum((theta - [0.2, 0.8, 0.7, 0.6]) ** 2)
        height = np.exp(-broad / 0.8) + 3 / (1 + np.exp(8 * (np.sqrt(narrow) / 0.3 - 0.9)))
        return np.array([height]) + rng.normal(0, self.outcome_noise, 1)


def test_practice_finds_the_other_hill():
    hills = Hills()
    learner = practice(hills, 1)
    for _ in run(learner, hills, 1, movements=400):
        pass
    goals, rng = np.linspace(1.2, 2.6, 15)[:, None], np.random.default_rng(0)
    missed = [hills.execute(NO_CONTEXT, learner.inverse(NO_CONTEXT, goal).theta, rng) - goal for goal in goals]
    assert np.abs(missed).mean() < 0.1
