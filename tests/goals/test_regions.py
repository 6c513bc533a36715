"""Interest of a region: eq. (3), the mean gain and the other measures, over the goals that were attempted last."""

import numpy as np
import pytest

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import absolute_progress, gained_progress, interest_of, paired_progress
from sgimd_torch.spaces import Array, Box
from worlds import problem


def interest(
    competences: list[float], strategy: str | None = None, gains: list[float] | None = None, **options
) -> float:
    """Of the only region of a map that saw these competences, oldest first."""
    goals = InterestMap(problem(outcomes=Box.cube(0, 1, 1)), **options)
    for index, competence in enumerate(competences):
        gain = 0.0 if gains is None else gains[index]
        goals.add([], [index / 100], competence, "imitate" if index % 2 else "autonomous", gain)
    (region,) = goals.regions
    return region.interest(strategy)


@pytest.mark.parametrize(
    ("competences", "expected"),
    [
        ([-1, -0.5, 0], 0),  # fewer than 4
        ([-1, -1, 0, 0], 0.5),  # |(0 + 0) - (-1 - 1)| / 4
        ([0, 0, -1, -1], 0.5),  # falling counts like rising
        ([-0.7, -1, -1, 0, 0], 0.5),  # 5 values: the oldest is dropped
        ([-0.9, -0.8, -0.7, -0.3, -0.2, -0.1], 0.3),  # |-.6 + 2.4| / 6
        ([-0.4] * 30, 0),
    ],
)
def test_absolute_progress_is_the_change_between_the_halves_of_the_history(competences, expected):
    assert interest(competences, progress=absolute_progress) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("gains", "expected"),
    [
        ([0.3, 0.4, 0.5], 0),  # fewer than 4
        ([0.1, 0.2, 0.3, 0.4], 0.25),
        ([0.4, 0.3, 0.2, 0.1], 0.25),  # in whatever order
        ([0.1, 0.2, 0.3, 0.4, 0.75], 0.35),  # an odd number loses none
        ([0, 0, 0, 0], 0),
    ],
)
@pytest.mark.parametrize("competence", [-1.0, -0.5, 0.0])
def test_by_default_interest_is_the_mean_gain_whatever_the_competences(gains, expected, competence):
    assert interest([competence] * len(gains), gains=gains) == pytest.approx(expected)
    changing = [competence, -0.25, -1, -0.5, 0][: len(gains)]
    assert interest(changing, gains=gains, progress=gained_progress) == pytest.approx(expected)


def test_a_users_own_measure_is_given_the_window_oldest_first():
    windows: list[tuple[list[float], list[float], list[float]]] = []

    def remember(points: Array, competences: Array, gains: Array) -> float:
        windows.append((points[:, 0].tolist(), competences.tolist(), gains.tolist()))
        return 7.0

    competences, gains = [-0.9, -0.8, -0.7, -0.6, -0.5, -0.4, -0.3], [0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1]
    assert interest(competences, gains=gains, window=6, progress=remember) == 7.0
    assert windows[-1] == ([0.01, 0.02, 0.03, 0.04, 0.05, 0.06], competences[1:], gains[1:])


def test_interest_of_a_strategy_counts_only_its_own_goals():
    competences = [-1, -0.4, -1, -0.4, 0, -0.4, 0, -0.4]  # autonomous rises, imitate stands still
    gains = [0.3, 0, 0.1, 0, 0.1, 0, 0.3, 0]
    for progress, expected in ((absolute_progress, 0.5), (gained_progress, 0.2)):
        assert interest(competences, "autonomous", gains, progress=progress) == pytest.approx(expected)
        assert interest(competences, "imitate", gains, progress=progress) == 0
        assert interest(competences, "nobody's", gains, progress=progress) == 0


@pytest.mark.parametrize(
    ("places", "competences", "expected"),
    [
        ([0.1, 0.9, 0.1, 0.9], [-1, -0.4, -1, -0.4], 0.2),  # places differ, time changes nothing: |.6| + 0 + 0, by 3
        (
            [0.1, 0.9, 0.2, 0.8],
            [-1, -0.4, -0.7, -0.8],
            1.3 / 3,
        ),  # .6 to the only earlier one, .3 and .4 to the near ones
        ([0.5, 0.5, 0.5, 0.5], [-1, -0.5, -0.5, -0.4], 0.2),  # equally near: the latest, .5 + 0 + .1
        ([0.1, 0.2, 0.3, 0.4], [0, -1, 0, -1], 1),  # falling counts like rising
        ([0.1, 0.2, 0.3], [0, -1, 0], 0),  # fewer than 4
        # In all dimensions: second and first, third and second, fourth and third: .8 + .1 + 0.
        ([(0, 0), (0, 1), (0.1, 0.9), (0.9, 0.9)], [0, -0.8, -0.7, -0.7], 0.3),
    ],
)
def test_paired_progress_compares_each_goal_with_the_nearest_earlier_one(places, competences, expected):
    points = np.array(places, dtype=float).reshape(len(places), -1)
    found = interest_of(points, np.array(competences), np.zeros(len(places)), window=24, progress=paired_progress)
    assert found == pytest.approx(expected)
