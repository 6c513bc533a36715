"""Strategic interest: progress by hand, the draw among the greatest, the cut, costs and the random share."""

from collections import Counter

import numpy as np
import pytest

from sgimd_torch.goals.strategic import StrategicInterest, between_means, exemplar_progress
from sgimd_torch.spaces import Box, stream

NONE = np.zeros(0)
SQUARE = Box.cube(-1, 1, 2)


def interest(seed=0, **options):
    return StrategicInterest(Box.cube(0, 1, 0), SQUARE, stream(seed, "goals"), **options)


def test_progress_by_hand():
    # Competences in [0, 1]: from .3 to .5, from .6 to 1, from 0 to 1, and twice nothing.
    competences, gains = np.array([-0.5, 0.0, 0.0, -1.0, 0.0]), np.array([0.2, 0.4, 1.0, 0.0, 0.0])
    # .2 * .25 = .05; .4 * 1; 1 * 1; 0; 0. Without the least, 0, and the greatest, 1: (.05 + .4 + 0) / 3.
    assert exemplar_progress(np.zeros((5, 2)), competences, gains) == pytest.approx(0.15)


def test_interest_is_of_the_last_ten_of_a_strategy():
    goals = interest()
    for gain in [1.0] * 4 + [0.1] * 8 + [0.0, 0.9]:
        goals.add(NONE, [0.5, 0.5], 0.0, "imitate", gain)
    goals.add(NONE, [0.5, 0.5], 0.0, "autonomous", 1.0)
    (region,) = goals.regions
    assert region.interest("imitate") == pytest.approx(0.1)
    assert region.interest("emulate") == region.interest("autonomous") == 0.0


def test_above_fifty_points_a_region_is_cut_where_the_means_differ_most():
    goals, rng = interest(), stream(1, "points")
    for k in range(51):
        assert len(goals.regions) == 1
        x, y = rng.uniform(0.1, 0.9) * (-1) ** k, rng.uniform(-1, 1)
        goals.add(NONE, [x, y], 0.0, "autonomous", 0.8 if x < 0 else 0.0)
    left, right = goals.regions
    assert left.high[0] == right.low[0]
    assert abs(left.high[0]) < 0.15
    assert left.interest("autonomous") == pytest.approx(0.8)


def test_the_means_of_a_cut_by_hand():
    goals = interest()
    for gain in (0.1, 0.3, 0.6, 0.8):
        goals.add(NONE, [gain, 0.0], 0.0, "autonomous", gain)
    (region,) = goals.regions
    assert between_means(region, np.array([True, True, False, False])) == pytest.approx((0.7 - 0.2) ** 2)


def choices(goals, costs, n=2000):
    return Counter(goals.choose(NONE, costs)[0] for _ in range(n))


def test_strategies_are_drawn_in_proportion_to_interest_over_cost():
    goals = interest(share=0.0)
    for _ in range(10):
        goals.add(NONE, [0.0, 0.0], 0.0, "autonomous", 0.3)
        goals.add(NONE, [0.0, 0.0], 0.0, "imitate", 0.6)
    # Interests .3 and .6 / 2, then .6 / 8: 1/2 and 1/5. Standard errors .011 and .009.
    assert choices(goals, {"autonomous": 1.0, "imitate": 2.0})["imitate"] / 2000 == pytest.approx(1 / 2, abs=0.05)
    assert choices(goals, {"autonomous": 1.0, "imitate": 8.0})["imitate"] / 2000 == pytest.approx(1 / 5, abs=0.045)


def test_only_the_greatest_are_drawn_from_and_a_share_is_random():
    costs = {"autonomous": 1.0, "imitate": 1.0, "emulate": 1.0}
    for share, others in ((0.0, 0.0), (0.3, 0.2)):
        goals = interest(share=share, greatest=1)
        for _ in range(10):
            goals.add(NONE, [0.0, 0.0], 0.0, "imitate", 0.6)
            goals.add(NONE, [0.0, 0.0], 0.0, "emulate", 0.5)
        found = choices(goals, costs)
        assert (found["autonomous"] + found["emulate"]) / 2000 == pytest.approx(others, abs=0.045)  # error .009


def test_without_any_progress_all_strategies_are_equally_likely():
    found = choices(interest(share=0.0), {"autonomous": 1.0, "imitate": 100.0})
    assert found["imitate"] / 2000 == pytest.approx(1 / 2, abs=0.055)


def test_goals_come_from_the_region_that_was_drawn_and_contains_the_context():
    contexts = Box.cube(0, 1, 1)
    goals = StrategicInterest(contexts, SQUARE, stream(0, "goals"), share=0.0)
    rng = stream(1, "points")
    for _ in range(400):  # progress at low contexts on the left, at high ones on the right
        context, x, y = rng.uniform(0, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)
        goals.add([context], [x, y], 0.0, "autonomous", 0.9 if (x < 0) == (context < 0.5) else 0.0)
    for context, sign in ((0.1, -1), (0.9, 1)):
        drawn = [goals.sample([context])[0] * sign > 0 for _ in range(200)]
        assert np.mean(drawn) > 0.8


@pytest.mark.parametrize("options", [{"share": 1.1}, {"share": -0.1}, {"greatest": 0}])
def test_numbers_out_of_range_are_refused(options):
    with pytest.raises(ValueError, match=r"share must lie in \[0, 1\] and greatest be at least 1"):
        interest(**options)
