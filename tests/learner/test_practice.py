"""Practice: on a robot that it was not made for it learns more from few movements than the standard baseline."""

import numpy as np
import pytest

from experiments.toys import toss, toy_benchmark, two_elbows
from sgimd_torch.algorithms.paper import sagg_riac
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.evaluation import evaluate
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.searches.perturb import Perturb
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration
from sgimd_torch.teachers import InitialTeacher


def after(learner: Learner, robot, seed: int, movements: int = 200) -> Learner:
    for _ in run(learner, robot, seed, movements=movements):
        pass
    return learner


@pytest.mark.parametrize(("make", "side"), [(toss, 0.4), (two_elbows, 0.1)])
def test_practice_beats_uniform_goals_with_the_nearest_and_noise(make, side):
    robot = make().environment
    goals = toy_benchmark(robot, side).goals
    for seed in (1, 2):
        ours = practice(robot, seed)
        theirs = sagg_riac(robot, seed, goals=UniformGoals, inverse=NearestNeighbour, search=Perturb, budget=1)
        errors = [
            evaluate(after(learner, robot, seed).inverse, robot, goals, seed, 200, repeats=0).mean_error
            for learner in (ours, theirs)
        ]
        assert errors[0] < 0.75 * errors[1]


def test_taught_practice_does_once_what_it_is_shown_and_then_pursues_goals_of_its_own():
    robot = two_elbows().environment
    shown = [Demonstration(np.zeros(0), np.arange(2.0), np.stack((t, t)), np.zeros(2)) for t in np.eye(3)]
    teacher = InitialTeacher(shown, np.random.default_rng(0), every=1)
    learner = practice_taught(robot, 0, correspondence=lambda times, trajectory: trajectory[-1])
    moves = [episode.move for episode in run(learner, robot, 0, movements=9, teacher=teacher)]
    assert {tuple(move.theta) for move in moves[:3]} == {tuple(t) for t in np.eye(3)}
    assert {move.origin for move in moves[:3]} == {"imitate"}
    assert {move.origin for move in moves[3:]} <= {"global", "local"}
