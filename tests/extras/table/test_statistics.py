"""The statistics over seeds, by hand, by law, and by their coverage."""

import itertools

import numpy as np
import pytest

from sgimd_torch.extras.table import statistics
from sgimd_torch.extras.table.statistics import (
    bootstrap_rng,
    common_differences,
    interquartile_mean,
    interval,
    iqm_interval,
)
from sgimd_torch.spaces import stream


@pytest.fixture
def rng():
    return stream(0, "test")


def test_the_interquartile_mean_is_that_of_the_middle_half():
    assert interquartile_mean(np.array([100.0, 1, 2, 3, 4, 5, 6, -50])) == pytest.approx(3.5)  # of 2, 3, 4, 5
    assert interquartile_mean(np.array([3.0, 9.0, 0.0])) == pytest.approx(4)  # nothing to cut


def test_an_interval_is_the_middle_95_percent_of_all_possible_draws(rng):
    values = np.array([1.0, 2, 4, 9, 10, 20])  # so few that all 6^6 draws can be written down
    draws = np.sort(list(itertools.product(values, repeat=6)), axis=1)
    means = draws[:, 1:5].mean(axis=1)
    found = iqm_interval(values, rng=rng)
    assert found.value == pytest.approx(25 / 4)
    # Of 9999 draws the level .025 is met to +- .0016.
    assert np.quantile(means, 0.02) <= found.low <= np.quantile(means, 0.03)
    assert np.quantile(means, 0.97) <= found.high <= np.quantile(means, 0.98)


def test_seeds_are_drawn_within_their_stratum(rng):
    """Two strata without any spread: only mixing them up could make the sum of their means vary."""
    assert interval(lambda x, y: x.mean(-1) + y.mean(-1), np.full(5, 1.0), np.full(5, 3.0), rng=rng) == (4, 4, 4)


def test_each_number_draws_from_a_stream_of_its_own_and_is_told_with_its_interval_unless_seeds_are_few():
    values = np.array([0.3, 0.4, 0.5, 0.6, 0.7])
    found, few = (iqm_interval(some, rng=bootstrap_rng()) for some in (values, values[:4]))
    assert found == iqm_interval(values, rng=bootstrap_rng())  # whatever was computed before
    assert statistics.interval_text(found, ".1f", "m") == f"0.5 [{found.low:.1f}, {found.high:.1f}] m"
    assert (few.value, np.isnan(few.low), np.isnan(few.high)) == (pytest.approx(0.45), True, True)
    assert statistics.interval_text(few) == "0.45"


def test_an_interval_holds_the_truth_about_as_often_as_it_says(rng, monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 499)
    found = [iqm_interval(rng.normal(size=10), rng=rng) for _ in range(400)]
    share = np.mean([each.low <= 0 <= each.high for each in found])
    assert 0.90 < share < 0.98  # .945 measured on 2000; its standard error here is .011


def test_noise_that_both_sides_of_a_pair_share_cancels(rng):
    noise = dict(enumerate(rng.normal(0, 5, 8)))
    np.testing.assert_allclose(common_differences({seed: each - 1 for seed, each in noise.items()}, noise), -1)


def test_pairs_are_matched_by_seed_not_by_place_and_others_are_left_out():
    ours, theirs = {3: 1.0, 1: 5.0, 7: 0.0}, {2: 0.0, 1: 4.0, 3: 3.0}
    np.testing.assert_allclose(common_differences(ours, theirs), [1, -2])


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda rng: iqm_interval(np.array([1.0]), rng=rng), "2 or more seeds, got 1"),
        (lambda rng: iqm_interval(np.array([1.0, np.nan]), rng=rng), "finite, got nan"),
        (
            lambda rng: interval(lambda x, y: x.mean(-1) - y.mean(-1), np.ones(3), np.ones(2), rng=rng, paired=True),
            r"got samples of \[3, 2\]",
        ),
        (lambda rng: interval(interquartile_mean, np.empty(0), rng=rng), "got 0"),
    ],
)
def test_what_cannot_be_computed_is_refused_with_its_reason(rng, refused, message):
    with pytest.raises(ValueError, match=message):
        refused(rng)
