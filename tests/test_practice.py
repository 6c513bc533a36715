"""Practice: on a robot that it was not made for it learns more from few movements than the standard baseline."""

import numpy as np
import pytest

from sgimd_torch.algorithms import practice, sagg_riac
from sgimd_torch.environments.toys import toss, two_elbows
from sgimd_torch.evaluation import evaluate
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.local import NearestNeighbour
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.runs.tasks import toy_benchmark
from sgimd_torch.searches.perturb import perturb
from sgimd_torch.session import run

SEEDS = (1, 2)


def after(learner: Learner, robot, seed: int, movements: int = 150) -> Learner:
    for _ in run(learner, robot, seed, movements=movements):
        pass
    return learner


@pytest.mark.parametrize(("make", "side"), [(toss, 0.4), (two_elbows, 0.1)])
def test_practice_beats_uniform_goals_with_the_nearest_and_noise(make, side):
    robot, errors = make(), np.empty((2, len(SEEDS)))
    goals = toy_benchmark(robot, side).goals
    for k, seed in enumerate(SEEDS):
        ours = after(practice(robot, seed), robot, seed)
        theirs = sagg_riac(robot, seed, goals=UniformGoals, inverse=NearestNeighbour, search=perturb, budget=1)
        after(theirs, robot, seed)
        for row, inverse in enumerate(
            (LocalProcess(ours.memory, noise=robot.outcome_noise), NearestNeighbour(theirs.memory))
        ):
            errors[row, k] = evaluate(inverse, robot, goals, seed, 150, repeats=0).mean_error
    assert (errors[0] < 0.75 * errors[1]).all()


def test_each_part_of_practice_is_one_changed_word():
    robot = two_elbows()
    learner = practice(robot, 0, budget=3, inverse=NearestNeighbour)
    goals = [episode.move.goal for episode in run(learner, robot, 0, movements=30)]
    lengths = np.diff(np.flatnonzero(np.diff(goals, axis=0, prepend=np.nan).any(axis=1)))
    assert lengths.max() == 3
