"""Every goal model keeps the same promises; uniform goals, and the grid of the experiments."""

import numpy as np
import pytest

from experiments.progress_grid import ProgressGrid
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import absolute_progress
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, part, problem, remember

LINE, SQUARE = Box.cube(0, 1, 1), Box.cube(0, 1, 2)


@pytest.fixture(params=[*WORDS["goals"], "experiments.progress_grid:ProgressGrid"])
def make(request):
    """Every goal model."""
    return part("goals", request.param)


def in_a_context(seed):
    """Goals in a square, for each context on a line; one movement was made."""
    memory = remember(np.zeros((1, 1)), np.zeros((1, 2)), np.zeros((1, 1)))
    return problem(outcomes=SQUARE, memory=memory, inverse=NearestNeighbour, seed=seed)


def test_goals_lie_in_the_task_space_and_are_drawn_only_when_one_is_sampled(make):
    goals = make(in_a_context(23))
    rng = goals.problem.stream("goals")
    for _ in range(120):
        state = rng.bit_generator.state
        goal = goals.sample([0.5])
        assert goal.shape == (2,)
        assert SQUARE.contains(goal)
        assert rng.bit_generator.state != state
        state = rng.bit_generator.state
        goals.add([0.5], goal, -goal[0], "imitate", 0.1)
        assert rng.bit_generator.state == state


def test_the_same_stream_gives_the_same_goals(make):
    def lived(seed):
        goals, planted = make(in_a_context(seed)), stream(24, "planted")
        sampled = []
        for _ in range(110):
            context = planted.uniform(size=1)
            sampled.append(goals.sample(context))
            goals.add(context, sampled[-1], -planted.uniform())
        return np.array(sampled)

    numpy_state = str(np.random.get_state())  # noqa: NPY002 - nobody may touch it
    assert np.array_equal(lived(1), lived(1))
    assert not np.array_equal(lived(1), lived(2))
    assert str(np.random.get_state()) == numpy_state  # noqa: NPY002


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("goal", value) for value in ([0.5, np.nan], [0.5], [[0.5, 0.5]], [0.5, 1.01])),
        *(("context", value) for value in ([], [1.5], [[0.5]])),
        *(("competence", value) for value in (np.nan, 0.1, -1.1)),
        *(("gain", value) for value in (np.nan, np.inf, -1.01, 1.01)),
    ],
)
def test_what_is_not_an_attempt_at_a_goal_of_the_map_is_refused(make, name, value):
    goals, attempt = make(in_a_context(21)), {"context": [0.5], "goal": [0.5, 0.5], "competence": -0.5}
    with pytest.raises(ValueError, match=name):
        goals.add(**{**attempt, name: value})
    if name == "context":
        with pytest.raises(ValueError, match=name):
            goals.sample(value)


def test_uniform_goals_are_uniform_whatever_was_learnt():
    goals = UniformGoals(problem(outcomes=LINE))
    for index in range(100):
        goals.add(NO_CONTEXT, [0.1], -1 + index / 100)
    counts = np.histogram([goals.sample(NO_CONTEXT) for _ in range(5000)], 10, (0, 1))[0]
    assert np.abs(counts - 500).max() < 5 * np.sqrt(5000 * 0.1 * 0.9)  # five standard deviations


def test_a_cell_forgets_what_lies_before_its_window_and_counts_it():
    goals = ProgressGrid(problem(outcomes=LINE), cells=2, window=4, progress=absolute_progress)
    for competence in (-1, -0.9, -0.8, -0.7, -0.6, -0.5):
        goals.add(NO_CONTEXT, [0.7], competence, gain=-competence)
    goals.add(NO_CONTEXT, [0.2], 0)
    below, above = goals.regions
    assert above.competences.tolist() == [-0.8, -0.7, -0.6, -0.5]
    assert above.gains.tolist() == [0.8, 0.7, 0.6, 0.5]
    assert above.interest() == pytest.approx(0.1)
    assert (above.attempts, below.attempts) == (6, 1)


@pytest.mark.parametrize(("dim", "cells"), [(1, 100), (2, 10), (3, 5), (8, 2)])
def test_cells_tile_the_space_about_a_hundred_of_them(dim, cells):
    box = Box(np.full(dim, -100.0), np.arange(dim) + 100.3)
    regions = ProgressGrid(problem(outcomes=box)).regions
    assert len(regions) == cells**dim == len({region.path for region in regions})
    lows, highs = (np.array([getattr(region, name) for region in regions]) for name in ("low", "high"))
    assert np.prod((highs - lows) / box.sides, axis=1) == pytest.approx(np.full(len(regions), 1 / len(regions)))
    for k in range(dim):
        assert set(lows[:, k]) - {box.low[k]} == set(highs[:, k]) - {box.high[k]}  # to the last digit
    assert regions[1].path == "R" + ".0" * (dim - 1) + ".1"


@pytest.mark.parametrize(
    ("make", "options"),
    [
        *((InterestMap, {"window": window}) for window in (5, 2, 32)),  # the last is more than g_max
        *((InterestMap, {name: 0.0}) for name in ("cuts", "near")),
        *((InterestMap, {"max_aspect": aspect}) for aspect in (0.5, np.nan)),
        *((ProgressGrid, {"window": window}) for window in (5, 2)),
        (ProgressGrid, {"near": 0.0}),
        *((ProgressGrid, {"cells": cells}) for cells in (0, 1000)),  # a million in all
    ],
)
def test_numbers_out_of_range_are_refused(make, options):
    with pytest.raises(ValueError, match=f"{next(iter(options))}.*got"):
        make(problem(outcomes=SQUARE), **options)
