"""Every goal model keeps the same promises; and uniform goals."""

import numpy as np
import pytest

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, part, problem, remember

LINE, SQUARE = Box.cube(0, 1, 1), Box.cube(0, 1, 2)


@pytest.fixture(params=WORDS["goals"])
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


@pytest.mark.parametrize(
    ("make", "options"),
    [
        *((InterestMap, {"window": window}) for window in (5, 2, 32)),  # the last is more than g_max
        *((InterestMap, {name: 0.0}) for name in ("cuts", "near")),
        *((InterestMap, {"max_aspect": aspect}) for aspect in (0.5, np.nan)),
    ],
)
def test_numbers_out_of_range_are_refused(make, options):
    with pytest.raises(ValueError, match=f"{next(iter(options))}.*got"):
        make(problem(outcomes=SQUARE), **options)
