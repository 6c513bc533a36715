"""The script that leads the rod as a person would."""

import numpy as np
import pytest

from sgimd_torch.environments.fishing_rod import JOINT_RANGES
from sgimd_torch.spaces import stream

pytest.importorskip("sgimd_torch.teach", reason="needs the room teach, which was left out")

import hand


@pytest.fixture(scope="module")
def lessons():
    return hand.lessons_of_a_script()


def test_a_sweep_goes_around_the_base_and_ends_near_the_place_that_was_meant():
    tip, end = np.array([0.0, 0.43, 0.85]), np.array([-0.5, -0.3, 0.5])
    places = hand.sweep(tip, end, stream(0, "hand"))
    np.testing.assert_array_equal(places[0], tip)
    assert np.linalg.norm(places[-1] - end) < 4 * hand.BESIDE * np.sqrt(3)
    away = np.linalg.norm(places[:, :2], axis=1)
    assert away.min() > 0.2  # the straight way would pass the base at .14 m
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert speed.argmax() == pytest.approx(len(speed) / 2, abs=3)  # a bell


def test_lessons_last_as_long_as_movements_do_and_stay_within_ranges(lessons):
    for lesson in lessons:
        assert 0.8 < lesson.demonstration.times[-1] <= 1.6
        assert JOINT_RANGES.contains(lesson.demonstration.trajectory).all()
        assert lesson.misfit < 0.2


def test_lessons_land_on_all_sides_and_none_twice_in_one_place(lessons):
    landed = np.stack([lesson.demonstration.outcome for lesson in lessons])
    apart = np.linalg.norm(landed[:, None] - landed, axis=2) + np.eye(len(landed))
    assert len(landed) == 10
    assert apart.min() > 0.05
    assert (landed.max(axis=0) > 0.3).all()
    assert (landed.min(axis=0) < -0.3).all()


def test_the_same_lessons_are_made_again(lessons):
    for lesson, again in zip(lessons, hand.lessons_of_a_script(), strict=True):
        np.testing.assert_array_equal(again.demonstration.trajectory, lesson.demonstration.trajectory)
        np.testing.assert_array_equal(again.demonstration.outcome, lesson.demonstration.outcome)
