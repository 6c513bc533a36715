"""Errors in what all modules use: which entry is wrong, in one line, however long the array; and read-only records."""

import numpy as np
import pytest

from sgimd_torch.spaces import (
    Box,
    Demonstration,
    Episode,
    Estimate,
    Move,
    check_count,
    check_vector,
    stream,
)

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


@pytest.mark.parametrize("value", [2, 3, np.int64(2), np.uint8(200)])
def test_a_count_may_be_any_whole_number_that_is_large_enough(value: int):
    assert check_count("n", value, 2) == value
    assert type(check_count("n", value, 2)) is int


@pytest.mark.parametrize("value", [1, -1, 2.0, 2.5, np.float64(3), np.nan, "3", None, np.arange(3)])
def test_anything_but_a_count_is_refused(value: object):
    assert ">= 2, got " in refused(check_count, value, 2)


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (THETA + 0j, "complex128"),
        (["0.5"] * 25, "<U3"),
        (np.full(25, "2014-05-01", dtype="datetime64[D]"), "datetime64"),
        (THETA > 0, "bool"),
        ([True] * 25, "bool"),
        (np.ma.masked_array(THETA, THETA > 0), "masked"),
        ([np.ma.masked_array(THETA, THETA > 0)], "masked"),
        ([np.ma.masked] * 25, "masked"),
    ],
)
def test_a_vector_of_anything_but_real_numbers_is_refused_by_its_type(value: object, found: str):
    assert found in refused(check_vector, value, 25, "a hint")


@pytest.mark.parametrize("value", [[1] * 25, np.ones(25, dtype=np.uint8), np.ones(25, dtype=np.float32), [1.0] * 25])
def test_a_vector_may_hold_any_real_numbers(value: object):
    assert check_vector("theta", value, 25).dtype == np.float64
    assert check_vector("theta", value, 25).tolist() == [1.0] * 25


@pytest.mark.parametrize(("seed", "index"), [(1.5, None), (-1, None), (True, None), ("1", None), (0, 1.5), (0, -1)])
def test_a_stream_needs_whole_numbers(seed: object, index: object):
    with pytest.raises(ValueError, match=rf"must be a whole number >= 0, got {index if index else repr(seed)}"):
        stream(seed, "search", index)


def test_a_record_keeps_what_it_was_made_of_and_is_read_only():
    arrays = [np.full(shape, 0.5) for shape in (1, 1, (1, 2), 2, 2)]
    demonstration = Demonstration(*arrays[:4])
    move = Move(arrays[3], arrays[4], "test")
    records = [demonstration, move, Episode(0, arrays[0], move, arrays[4], demonstration)]
    for array in arrays:
        array[:] = 9.0
    fields = [value for record in records for value in vars(record).values() if isinstance(value, np.ndarray)]
    assert len(fields) == 8
    for field in fields:
        assert (field == 0.5).all()
        with pytest.raises(ValueError, match="read-only"):
            field[0] = 9.0
    assert Move(THETA, None, "babble").goal is None
    assert Episode(0, THETA, None, None, None).outcome is None


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1, 2**32, 2**96 + 3, 2**200])
@pytest.mark.parametrize("index", [None, 0, 7, 2**32 - 1, 2**32, 2**70])
def test_a_stream_is_that_of_the_spawned_seed_sequence(seed: int, index: int | None) -> None:
    for name in ("", "environment", "Käse"):
        key = tuple(name.encode()) + (() if index is None else (256, index))
        expected = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
        found = stream(seed, name, index)
        assert np.array_equal(found.random(3), expected.random(3))
        assert np.array_equal(found.spawn(2)[1].random(3), expected.spawn(2)[1].random(3))


@pytest.mark.parametrize("shape", [(5,), (3, 5)])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e300, -1e300, np.nextafter(1e100, np.inf)])
def test_one_number_too_large_or_none_at_all_is_found_wherever_it_stands(shape: tuple[int, ...], wrong: float) -> None:
    right = np.full(shape, 1e100)
    assert np.array_equal(check_vector("point", right, 5), right)
    for entry in np.ndindex(shape):
        array = np.zeros(shape)
        array[entry] = wrong
        with pytest.raises(ValueError, match="finite"):
            check_vector("point", array, 5)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("times", np.arange(2.0), r"shapes \(2,\) and \(3, 2\)"),
        ("times", np.arange(3.0)[None], "shapes"),
        ("times", np.array([0.0, 0.2, 0.1]), "times of a demonstration must increase"),
        ("times", np.array([0.0, np.nan, 1.0]), "times of a demonstration must be finite"),
        ("trajectory", np.zeros(3), "shapes"),
        ("trajectory", np.full((3, 2), np.inf), "trajectory of a demonstration must be finite"),
        ("outcome", np.array([np.nan, 0.0]), "outcome of a demonstration must be finite"),
        ("context", np.array(["north"]), "context of a demonstration must be real numbers"),
    ],
)
def test_a_demonstration_that_cannot_be_right_is_refused_by_the_name_of_its_part(part, value, message):
    right = {"context": np.zeros(0), "times": np.arange(3.0), "trajectory": np.zeros((3, 2)), "outcome": np.zeros(2)}
    Demonstration(**right)
    with pytest.raises(ValueError, match=message):
        Demonstration(**right | {part: value})


@pytest.mark.parametrize("dim", [1, 2, 6])
def test_an_estimate_says_how_far_its_outcome_may_be_off_and_from_the_goal(dim):
    rng, sd = np.random.default_rng(0), 0.3
    estimate = Estimate(THETA, THETA[None], np.zeros((1, dim)), expected=np.ones(dim), sd=sd)
    outcomes = rng.normal(estimate.expected, sd, (40_000, dim))
    assert estimate.expected_deviation == pytest.approx(np.linalg.norm(outcomes - 1, axis=1).mean(), rel=0.02)
    assert estimate.expected_error(np.ones(dim)) == estimate.expected_deviation
    for away in (0.1, 0.3, 1.0, 10.0):
        goal = np.eye(dim)[0] * away + 1
        found = np.linalg.norm(outcomes - goal, axis=1).mean()
        assert 0.98 < estimate.expected_error(goal) / found < 1.11
    unknown = estimate._replace(expected=None, sd=None)
    assert np.isnan([unknown.expected_deviation, unknown.expected_error(np.ones(dim))]).all()


HEADING = Box([-1, 0], [1, 360], ("x", "heading"), periodic=(False, True))


def test_periodic_outcomes_are_as_far_apart_as_the_shorter_way_round():
    a, b = np.array([0.0, 359.0]), np.array([0.0, 2.0])
    assert HEADING.distance(a, b) == pytest.approx(3)
    assert HEADING.unwrapped(a, b).tolist() == [0.0, -1.0]
    assert HEADING.wrapped(np.array([5.0, -1.0])).tolist() == [5.0, 359.0]
    assert HEADING.check("goal", [0, 361]).tolist() == [0.0, 1.0]
    on_circles = HEADING.on_circles(np.stack([a, b]))
    assert np.linalg.norm(on_circles[0] - on_circles[1]) == pytest.approx(3, rel=1e-3)


def test_without_periodic_dimensions_points_stay_the_same_objects():
    plane, points = Box.cube(-1, 1, 2), np.ones((3, 2))
    assert plane.wrapped(points) is plane.unwrapped(points, points) is plane.on_circles(points) is points


@pytest.mark.parametrize(
    ("side", "unit", "periodic", "told"),
    [
        (360, "rad", (True,), "a whole turn, 6.28318531 rad, got [0.0, 360.0]; is it in another unit"),
        (6.28, "deg", (True,), "a whole turn, 360 deg, got [0.0, 6.28]"),
        (360, "deg", (True, False), "Box needs 1 values of periodic, got (True, False)"),
    ],
)
def test_a_periodic_side_is_a_whole_turn_in_its_unit(side, unit, periodic, told):
    with pytest.raises(ValueError, match="periodic") as raised:
        Box([0], [side], unit=unit, periodic=periodic)
    assert told in str(raised.value)
