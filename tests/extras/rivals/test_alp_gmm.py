"""ALP-GMM: goals follow absolute learning progress, also in a context, and nothing of the fit leaks out."""

import numpy as np
import pytest

from sgimd_torch.extras.rivals.alp_gmm import AlpGmm
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, problem

LINE = Box.cube(0, 1, 1)


def on_a_line(seed: int, **options) -> AlpGmm:
    return AlpGmm(problem(outcomes=LINE, seed=seed), **options)


def practise(goals: AlpGmm, n: int, low: float, high: float, seed: int = 0) -> None:
    """Goals on a line, of which only those between ``low`` and ``high`` go up and down."""
    rng = stream(seed, "planted")
    for goal in rng.uniform(size=n):
        goals.add(NO_CONTEXT, [goal], -rng.uniform() if low < goal < high else -1)


def test_goals_follow_progress_and_the_uniform_ones_reach_the_rest():
    goals = on_a_line(1)
    practise(goals, 250, 0.6, 0.8)
    samples = np.array([goals.sample(NO_CONTEXT)[0] for _ in range(2000)])
    inside = np.mean((samples > 0.55) & (samples < 0.85))  # Gaussians have no edges
    assert inside > 0.65  # at most .8 + .2 * .3, where uniform goals would give .3
    assert 0.05 < np.mean(samples < 0.4) < 0.2  # a fifth of .4 = .08 by the uniform ones, where all would give .4


def test_goals_are_uniform_before_the_first_fit_and_where_nothing_progresses():
    for n in (49, 250):
        goals = on_a_line(2)
        practise(goals, n, 2, 3) if n == 250 else practise(goals, n, 0.6, 0.8)
        counts = np.histogram([goals.sample(NO_CONTEXT) for _ in range(2000)], 10, (0, 1))[0]
        assert np.abs(counts - 200).max() < 5 * np.sqrt(2000 * 0.1 * 0.9)  # five standard deviations


def test_goals_before_the_last_memory_ones_are_forgotten():
    goals = on_a_line(3, memory=60, uniform=0.0)
    practise(goals, 60, 0.0, 0.3)
    practise(goals, 400, 0.7, 1.0, seed=1)  # long enough that few goals are nearest to one of the first 60
    samples = np.array([goals.sample(NO_CONTEXT)[0] for _ in range(300)])
    assert np.mean(samples > 0.6) > 0.85


def test_a_new_fit_comes_after_fifty_goals_and_no_sooner():
    one, other = (on_a_line(4, uniform=0.0) for _ in range(2))
    for goals in (one, other):
        practise(goals, 50, 0.0, 0.3)
        assert goals.sample(NO_CONTEXT)[0] < 0.6
    practise(one, 49, 0.7, 1.0, seed=1)
    assert [one.sample(NO_CONTEXT) for _ in range(20)] == [other.sample(NO_CONTEXT) for _ in range(20)]
    one.add(NO_CONTEXT, [0.5], -1)
    assert one.sample(NO_CONTEXT) != other.sample(NO_CONTEXT)


def test_progress_is_measured_against_the_nearest_earlier_goal():
    # Competence differs from place to place in both; only in the second does it change with time, and in one place.
    still, moving = (on_a_line(5, memory=50, uniform=0.0) for _ in range(2))
    for index in range(100):
        place = (index % 10) / 10
        still.add(NO_CONTEXT, [place], -place)
        moving.add(NO_CONTEXT, [place], -1 + index / 100 if place == 0.7 else -place)
    near = [np.mean([abs(goals.sample(NO_CONTEXT)[0] - 0.7) < 0.15 for _ in range(300)]) for goals in (still, moving)]
    assert near[0] == pytest.approx(0.3, abs=0.14)  # uniform, five standard errors
    assert near[1] > 0.9


def test_in_a_context_goals_come_from_where_that_context_progresses():
    goals = AlpGmm(problem(contexts=LINE, outcomes=LINE, seed=6), uniform=0.0)
    rng = stream(6, "planted")
    for context, goal in rng.uniform(size=(250, 2)):
        goals.add([context], [goal], -rng.uniform() if abs(context - goal) < 0.15 else -1)
    for context in (0.2, 0.5, 0.8):
        samples = np.array([goals.sample([context])[0] for _ in range(300)])
        assert np.median(samples) == pytest.approx(context, abs=0.15)


@pytest.mark.parametrize("options", [{"memory": 9}, *({"uniform": uniform} for uniform in (1.1, np.nan))])
def test_numbers_out_of_range_are_refused(options):
    with pytest.raises(ValueError, match=f"{next(iter(options))}.*got"):
        on_a_line(0, **options)


def test_goals_stay_in_a_task_space_of_any_size_even_when_progress_is_in_its_corner():
    box = Box(np.array([-100.0, -1e-3]), np.array([100.0, 0.0]))
    goals, rng = AlpGmm(problem(outcomes=box, seed=7)), stream(7, "planted")
    for goal in rng.uniform(box.low, box.high, (150, 2)):
        goals.add(NO_CONTEXT, goal, -rng.uniform() if goal[0] > 90 else -1)
    samples = np.array([goals.sample(NO_CONTEXT) for _ in range(500)])
    assert box.contains(samples).all()
    assert np.mean(samples[:, 0] > 80) > 0.5
    assert np.mean((samples == box.high).any(axis=1)) < 0.02  # drawn again, hardly ever clipped
