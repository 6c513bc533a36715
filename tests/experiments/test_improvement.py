"""The probability of improvement, by hand, by law, and by the coverage of its interval."""

import numpy as np
import pytest
from scipy import stats

from evidence import improvement, improvement_interval
from sgimd_torch.spaces import stream


@pytest.fixture
def rng():
    return stream(0, "test")


def test_improvement_is_the_mann_whitney_statistic_also_with_ties_and_its_opposite_makes_one(rng):
    ours, theirs = rng.integers(0, 6, 9).astype(float), rng.integers(0, 6, 7).astype(float)
    u = stats.mannwhitneyu(ours, theirs).statistic / 63  # how often ours are larger
    assert improvement(ours, theirs) == pytest.approx(1 - u)
    assert improvement(ours, theirs) + improvement(theirs, ours) == pytest.approx(1)
    found, opposite = improvement_interval(ours, theirs), improvement_interval(theirs, ours)
    assert 0 < found.low < found.value < found.high < 1
    assert opposite == pytest.approx((1 - found.value, 1 - found.high, 1 - found.low))


@pytest.mark.parametrize(("n", "low"), [(5, 0.643), (10, 0.80), (20, 0.90)])
def test_few_seeds_never_make_an_improvement_certain(n, low):
    ours, theirs = np.zeros(n), np.ones(n)
    assert improvement_interval(ours, theirs) == pytest.approx((1, low, 1), abs=0.005)
    assert improvement_interval(theirs, ours) == pytest.approx((0, 0, 1 - low), abs=0.005)
    assert improvement_interval(ours, theirs, level=0.99).low < low


def test_an_improvement_of_fewer_than_five_seeds_has_no_interval():
    found = improvement_interval(np.zeros(4), np.ones(20))
    assert found.value == 1
    assert np.isnan(found.low)
    assert np.isnan(found.high)


@pytest.mark.parametrize(("n", "shift"), [(5, 0.0), (5, 2.0), (10, 1.0), (20, 2.0)])
@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_an_interval_of_an_improvement_holds_the_truth_at_least_about_as_often_as_it_says(rng, n, shift, level):
    truth = stats.norm.cdf(shift / np.sqrt(2))
    pairs = [(rng.normal(size=n), rng.normal(shift, 1, n)) for _ in range(400)]
    found = [improvement_interval(*pair, level=level) for pair in pairs]
    share = np.mean([each.low <= truth <= each.high for each in found])
    assert share > level - 0.1  # four standard errors at .5; five and nine at the others


@pytest.mark.parametrize("theirs", [np.ones(1), np.array([1, np.inf])])
def test_an_improvement_needs_two_seeds_with_finite_errors(theirs):
    with pytest.raises(ValueError, match="2 or more seeds with finite errors"):
        improvement_interval(np.ones(3), theirs)
