"""What is done to a recording before it is a lesson: trim, pace, resample, save."""

import numpy as np
import pytest

from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.demonstrations.lessons import LedMovement


@pytest.fixture
def led():
    """Still for .3 s, then 1 rad in 1 s, then still for .7 s; 100 samples a second."""
    times = np.arange(201) / 100
    first = np.interp(times, [0.3, 1.3], [0.0, 1.0])
    return Recording(times, np.stack([first, -first], axis=1), gaps=times / 10)


def test_trimming_keeps_what_was_between_and_counts_from_0(led):
    part = led.trim(0.5, 1.0)
    assert (len(part.times), part.times[0], part.duration) == (51, 0.0, pytest.approx(0.5))
    np.testing.assert_array_equal(part.joints, led.joints[50:101])
    np.testing.assert_array_equal(part.gaps, led.gaps[50:101])


@pytest.mark.parametrize("ends", [(1.0, 0.5), (3.0, 4.0), (0.501, 0.509)])
def test_trimming_all_away_is_refused(led, ends):
    with pytest.raises(ValueError, match="at least 2 are needed; were the ends swapped"):
        led.trim(*ends)


def test_pauses_at_both_ends_are_cut(led):
    part = led.without_pauses()
    assert part.duration == pytest.approx(1.0)
    np.testing.assert_allclose(part.joints[[0, -1], 0], [0, 1], atol=1e-12)


def test_an_arm_that_never_moved_has_no_pauses_to_cut():
    still = Recording(np.arange(3.0), np.ones((3, 2)))
    assert still.without_pauses() is still


def test_a_pause_in_the_middle_stays(led):
    twice = Recording(np.arange(402) / 100, np.concatenate([led.joints, led.joints[::-1]]))
    assert twice.without_pauses().duration == pytest.approx(3.4, abs=0.02)


def test_a_slow_recording_is_played_faster_and_ends_exactly_when_it_should(led):
    fast = led.within(1.6)
    assert fast.duration == 1.6  # a correspondence refuses anything longer
    np.testing.assert_allclose(fast.speeds, led.speeds * 2 / 1.6)
    np.testing.assert_array_equal(fast.joints, led.joints)
    assert led.within(2.0) is led


def test_resampling_has_equal_steps_and_both_ends(led):
    even = led.trim(0, 1.29).resampled(50)
    assert len(even.times) == 66  # 64.5 steps of 1/50 s are 65
    assert even.duration == pytest.approx(1.29)
    np.testing.assert_allclose(np.diff(even.times), even.times[1], rtol=1e-9)
    np.testing.assert_allclose(even.joints[[0, -1], 0], [0, 0.99], atol=1e-9)
    assert len(led.resampled(50).times) == 101  # exact multiples do not get one more


def test_a_saved_recording_is_a_demonstration_file_without_an_outcome(led, tmp_path):
    led.save(tmp_path / "swing.npz")
    found = Recording.load(tmp_path / "swing.npz")
    np.testing.assert_array_equal(found.times, led.times)
    np.testing.assert_array_equal(found.joints, led.joints)
    (shown,) = load_demonstrations(tmp_path / "swing.npz", n_joints=2)
    assert shown.outcome.shape == (0,)
    with pytest.raises(ValueError, match="has 0 outcome dimensions, the robot has 2"):
        load_demonstrations(tmp_path / "swing.npz", outcome_dim=2)


def test_any_recording_of_a_demonstration_file_can_be_led_on(tmp_path):
    shipped = load_demonstrations()
    np.testing.assert_array_equal(Recording.load(_shipped(), 3).joints, shipped[3].trajectory)
    with pytest.raises(ValueError, match="has 127 recordings, number 127 was wanted"):
        Recording.load(_shipped(), 127)


@pytest.mark.parametrize(
    ("times", "joints", "gaps", "message"),
    [
        ([0.0], [[1.0]], None, "2 samples or more"),
        ([0.0, 1.0], [1.0, 2.0], None, "2 samples or more"),
        ([0.0, 0.0], [[1.0], [2.0]], None, "must increase from 0"),
        ([1.0, 2.0], [[1.0], [2.0]], None, "must increase from 0"),
        ([0.0, 1.0, 2.0], [[1.0], [2.0]], None, "times of a recording must have shape"),
        ([0.0, 1.0], [[1.0], [np.nan]], None, "joints of a recording must be finite"),
        ([0.0, 1.0], [[1.0], [2.0]], [0.0], "gaps of a recording must have shape"),
    ],
)
def test_what_is_no_recording_is_refused(times, joints, gaps, message):
    with pytest.raises(ValueError, match=message):
        Recording(times, joints, gaps)


def test_a_recording_cannot_be_changed_afterwards(led):
    with pytest.raises(ValueError, match="read-only"):
        led.joints[0] = 1.0


def _shipped():
    from sgimd_torch.demonstrations import SHIPPED

    return SHIPPED
