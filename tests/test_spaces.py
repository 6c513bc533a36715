"""Errors of the words that all modules speak: which entry is wrong, in one line, however long the array."""

import numpy as np
import pytest

from sgimd_torch.spaces import Box, check_count, check_vector

THETA = np.full(25, 0.5)


def refused(check, *values: object) -> str:
    with pytest.raises(ValueError, match="must") as raised:
        check("theta", *values)
    message = str(raised.value)
    assert "\n" not in message
    assert len(message) < 150
    return message


def test_a_vector_that_is_not_finite_is_refused_by_its_first_wrong_entry():
    theta = THETA.copy()
    theta[[3, 7, 9]] = np.nan, np.inf, np.nan
    assert "entry [3] is nan (and 2 more); a hint" in refused(check_vector, theta, 25, "a hint")
    assert "entry [1, 3] is nan (and 2 more)" in refused(check_vector, np.stack([THETA, theta]), 25)


def test_a_point_outside_its_box_is_refused_by_its_first_wrong_entry_and_that_side():
    box, theta = Box(np.arange(25.0) - 25, np.arange(25.0) + 1), THETA.copy()
    theta[2] = 3.5
    assert "entry [2] is 3.5, outside [-23.0, 3.0];" in refused(box.check, theta)


def test_what_is_not_numeric_is_not_printed_in_full():
    for value in ("far" * 1000, np.full((99, 25), None), [[0.0], [0.0, 1.0]] * 99, None):
        refused(check_vector, value, 25)


@pytest.mark.parametrize("value", [2, 3, np.int64(2), np.uint8(200)])
def test_a_count_may_be_any_whole_number_that_is_large_enough(value: int):
    assert check_count("n", value, 2) == value
    assert type(check_count("n", value, 2)) is int


@pytest.mark.parametrize("value", [1, -1, 2.0, 2.5, np.float64(3), np.nan, "3", None, np.arange(3)])
def test_what_is_no_count_is_refused(value: object):
    assert ">= 2, got " in refused(check_count, value, 2)
