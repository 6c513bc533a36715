"""Interest of a region: eq. (3), the mean gain and the other measures, over the goals that were attempted last."""

import pytest

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import Region, absolute_progress, gained_progress
from sgimd_torch.spaces import Array, Box
from worlds import problem


def region_of(competences: list[float], gains: list[float] | None = None, **options) -> Region:
    """The only region of a map that was told these competences, oldest first."""
    goals = InterestMap(problem(outcomes=Box.cube(0, 1, 1)), **options)
    for index, (competence, gain) in enumerate(zip(competences, gains or [0.0] * len(competences), strict=True)):
        goals.add([], [index / 100], competence, "imitate" if index % 2 else "autonomous", gain)
    (region,) = goals.regions
    return region


def interest(competences: list[float], gains: list[float] | None = None, **options) -> float:
    return region_of(competences, gains, **options).interest()


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
    assert interest([competence] * len(gains), gains) == pytest.approx(expected)
    changing = [competence, -0.25, -1, -0.5, 0][: len(gains)]
    assert interest(changing, gains, progress=gained_progress) == pytest.approx(expected)


def test_a_users_own_measure_is_given_the_window_oldest_first():
    windows: list[tuple[list[float], list[float], list[float]]] = []

    def remember(points: Array, competences: Array, gains: Array) -> float:
        windows.append((points[:, 0].tolist(), competences.tolist(), gains.tolist()))
        return 7.0

    competences, gains = [-0.9, -0.8, -0.7, -0.6, -0.5, -0.4, -0.3], [0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1]
    assert interest(competences, gains, window=6, progress=remember) == 7.0
    assert windows[-1] == ([0.01, 0.02, 0.03, 0.04, 0.05, 0.06], competences[1:], gains[1:])


def test_interest_among_some_goals_is_that_of_these_goals_alone():
    region = region_of([-1, -0.4, -1, -0.4, 0, -0.4, 0, -0.4], [0.3, 0, 0.1, 0, 0.1, 0, 0.3, 0])
    assert region.interest_among(region.strategies == "autonomous") == pytest.approx(0.2)
    assert region.interest_among(region.strategies == "imitate") == 0
    assert region.interest_among(region.strategies == "nobody's") == 0
