"""Strategic interest: progress by hand, hope for the untried, the draw among the greatest, the cut, costs."""

from collections import Counter

import numpy as np
import pytest

from sgimd_torch.extras.asking.interest import StrategicInterest, between_means, progresses, strategic_progress
from sgimd_torch.spaces import Box, stream
from worlds import NO_CONTEXT, problem


def interest():
    """Over the square of 2 m around 0."""
    return StrategicInterest(problem())


def told(goals, strategy, gain, n=10, goal=(0.5, 0.5)):
    """Attempts that made all of their gain up to, or from, the greatest competence: a progress of ``gain``."""
    for _ in range(n):
        goals.add(NO_CONTEXT, goal, min(0.0, gain), strategy, gain)


def test_progress_by_hand():
    # Competences in [0, 1]: from .3 to .5, from .6 to 1, from .8 down to .5; nothing where all is known.
    competences, gains = np.array([-0.5, 0.0, -0.5, 0.0]), np.array([0.2, 0.4, -0.3, 0.0])
    # .2 * .5^2; .4 * 1; -.3 * .8^2; 0
    assert progresses(competences, gains) == pytest.approx([0.05, 0.4, -0.192, 0.0])
    assert strategic_progress(np.zeros((4, 2)), competences, gains) == pytest.approx(0.025)  # (.05 + 0) / 2


def test_progress_is_of_the_last_ten_of_a_strategy():
    goals = interest()
    for gain in [1.0] * 4 + [0.1] * 8 + [0.0, 0.9]:
        told(goals, "imitate", gain, 1)
    (region,) = goals.regions
    assert goals.progress(region, "imitate") == pytest.approx(0.1)


def test_of_a_strategy_that_was_hardly_tried_the_most_is_hoped_for():
    goals = interest()
    told(goals, "imitate", -0.5, 3)
    assert [goals.progress(goals.regions[0], name) for name in ("imitate", "emulate")] == [1.0, 1.0]
    told(goals, "imitate", -0.5, 1)
    assert goals.progress(goals.regions[0], "imitate") == pytest.approx(-0.5)


def test_above_fifty_points_a_region_is_cut_where_the_means_differ_most_and_a_strategy_counts_as_tried_nearest():
    goals, rng = interest(), stream(1, "points")
    for k in range(51):
        assert len(goals.regions) == 1
        x, y = rng.uniform(0.1, 0.9) * (-1) ** k, rng.uniform(-1, 1)
        goals.add(NO_CONTEXT, [x, y], 0.0, "autonomous", 0.8 if x < 0 else 0.0)
    left, right = goals.regions
    assert left.high[0] == right.low[0] == pytest.approx(0, abs=0.15)
    assert goals.progress(left, "autonomous") == pytest.approx(0.8)
    told(goals, "imitate", 0.3, 10, goal=(-0.5, 0.0))
    left, right = goals.regions
    assert goals.progress(right, "imitate") == pytest.approx(0.3)  # it was never tried there
    told(goals, "imitate", -0.2, 4, goal=(0.5, 0.0))
    left, right = goals.regions
    assert goals.progress(right, "imitate") == pytest.approx(-0.2)
    assert goals.progress(left, "imitate") == pytest.approx(0.3)


def test_the_means_of_a_cut_by_hand():
    goals = interest()
    for gain in (0.1, 0.3, 0.6, 0.8):
        goals.add(NO_CONTEXT, [gain, 0.0], 0.0, "autonomous", gain)
    (region,) = goals.regions
    assert between_means(region, np.array([True, True, False, False])) == pytest.approx((0.7 - 0.2) ** 2)


def choices(goals, costs, n=2000):
    return Counter(goals.choose(NO_CONTEXT, costs)[0] for _ in range(n))


@pytest.mark.parametrize(
    ("alone", "imitate", "cost", "share"),
    [
        (0.09, 0.12, 1.0, 0.731),  # e^4 / (e^3 + e^4)
        (0.09, 0.12, 2.0, 0.452),  # e^(3+1/2) / 2 / (e^3 + e^(3+1/2) / 2)
        (-0.03, -0.06, 4.0, 0.084),  # e^-2 / 4 / (e^-1 + e^-2 / 4); were the loss divided by the cost, .29
    ],
)
def test_strategies_are_drawn_in_proportion_to_their_interest_over_their_cost(alone, imitate, cost, share):
    goals = interest()
    told(goals, "autonomous", alone)
    told(goals, "imitate", imitate)
    found = choices(goals, {"autonomous": 1.0, "imitate": cost})["imitate"] / 2000
    assert found == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 2000))  # four standard errors


def test_only_the_ten_greatest_are_drawn_from():
    assert len(choices(interest(), dict.fromkeys("abcdefghijk", 1.0))) == 10


def test_goals_come_from_the_region_that_was_drawn_and_contains_the_context():
    goals = StrategicInterest(problem(contexts=Box.cube(0, 1, 1)))
    rng = stream(1, "points")
    for _ in range(400):  # progress at low contexts on the left, at high ones on the right
        context, x, y = rng.uniform(0, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)
        goals.add([context], [x, y], 0.0, "autonomous", 0.9 if (x < 0) == (context < 0.5) else 0.0)
    for context, sign in ((0.1, -1), (0.9, 1)):
        drawn = [goals.sample([context])[0] * sign > 0 for _ in range(1000)]
        assert np.mean(drawn) > 0.7  # half of them are drawn from all of T
