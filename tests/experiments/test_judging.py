"""How a claim is judged: its bars, its parts, and its company."""

import numpy as np
import pytest

from evidence import Evidence
from judging import Claim, at_least, at_most, holm, judge
from made_up import row, write, write_rows
from sgimd_torch.extras.table.statistics import Interval


def number(value, low, high):
    """A measure whose interval is the same at every confidence."""
    return lambda level=0.95: Interval(value, low, high)


def verdict(*parts):
    (found,) = judge([Claim("it holds", parts)])
    return found.verdict


@pytest.mark.parametrize(
    ("value", "low", "high", "expected"),
    [
        (0.48, 0.46, 0.54, "holds"),
        (0.48, 0.46, 0.56, "open"),
        (0.52, 0.49, 0.54, "open"),
        (0.52, 0.51, 0.54, "fails"),
        (0.48, np.nan, np.nan, "open"),  # too few seeds for an interval
    ],
)
def test_a_bar_with_a_margin_for_its_interval(value, low, high, expected):
    assert verdict(at_most(0.5, number(value, low, high), margin=0.05)) == expected
    assert verdict(at_least(-0.5, number(-value, -high, -low), margin=0.05)) == expected


def test_a_claim_of_several_parts_holds_if_each_does_and_fails_if_one_does():
    good, unsure, bad = (at_most(1, number(*each)) for each in ((0.5, 0.4, 0.6), (0.9, 0.8, 1.1), (2, 1.9, 2.1)))
    assert verdict(good, good) == "holds"
    assert verdict(good, unsure) == "open"
    assert verdict(good, unsure, bad) == "fails"


def test_the_number_of_a_claim_is_that_of_its_worst_part():
    parts = [at_most(1, number(0.5, 0.4, 0.6), name="first"), at_most(1, number(0.9, 0.8, 0.95), name="second")]
    (found,) = judge([Claim("two parts", parts)])
    assert found.number == "0.90 [0.80, 0.95] (second)"


def three_parts(level):
    """Clear of the bar at 95 %, not at the confidence that one of three parts needs to fail alone."""
    return Interval(1.2, 1.1 if level < 0.98 else 0.9, 1.3)


def test_one_of_several_parts_needs_more_certainty_to_fail_a_claim():
    certain = at_most(1, lambda level=0.95: three_parts(level or 0.0))
    assert verdict(certain) == "fails"
    assert verdict(certain, certain, certain) == "open"


def test_a_claim_among_many_needs_more_certainty_than_one_alone(tmp_path):
    """Five seeds decide a claim alone; among all of a page, by Holm's method, they do not."""
    errors = {"ours": [0.1] * 5, "theirs": [0.105, 0.12, 0.0995, 0.11, 0.103]}
    rows = [
        row(name, seed, 5000, "process", value) for name, found in errors.items() for seed, value in enumerate(found)
    ]
    write_rows(tmp_path)
    found = Evidence.of(write(tmp_path, rows))
    claim = Claim("ours err less", [at_most(0, found.difference, "ours", "theirs")])
    others = [Claim(f"unsure {k}", [at_most(1, number(0.9, 0.8, 1.1))]) for k in range(20)]
    assert judge([claim])[0].verdict == "holds"
    among = judge([claim, *others])[0]
    assert among.verdict == "open"
    assert among.number.startswith("−0.0")


def test_claims_that_were_not_run_do_not_count_among_the_others(tmp_path):
    write_rows(tmp_path)
    found = Evidence.of(tmp_path)
    claim = Claim("SGIM-D errs less", [at_most(0, found.difference, "sgim-d", "random")])
    missing = Claim("nobody errs less", [at_most(0, found.difference, "nobody", "random")])
    assert [each.verdict for each in judge([claim, missing])] == ["holds", "not run"]


def test_holm_by_intervals_is_holm_by_p_values():
    """An interval at a level rejects where p is at most 1 - level."""
    for p in np.random.default_rng(0).random((200, 6)) ** 4:
        order = np.argsort(p)
        adjusted = np.maximum.accumulate(p[order] * np.arange(6, 0, -1))
        expected = set(order[adjusted <= 0.05].tolist())
        assert holm(range(6), lambda claim, level, p=p: p[claim] <= 1 - level) == expected
