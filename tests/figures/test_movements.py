"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.movements import interest_over_time, trajectories
from sgimd_torch.spaces import Demonstration


@pytest.fixture
def ax():
    return Figure().add_subplot()


def demonstration(n_times=5):
    times = np.linspace(0.0, 1.0, n_times)
    return Demonstration(np.zeros(0), times, np.stack([times, 2 * times], axis=1), np.zeros(2))


def test_each_joint_shows_what_was_demonstrated():
    axes = Figure().subplots(1, 2)
    shown = [demonstration(5), demonstration(7)]
    drawn = trajectories(axes, shown, names=("yaw", "elbow"))
    np.testing.assert_array_equal(drawn[1][1].get_xydata()[:, 1], shown[1].trajectory[:, 1])
    assert [len(joint) for joint in drawn] == [2, 2]
    assert [ax.get_title() for ax in axes] == ["yaw", "elbow"]
    assert (axes[1].get_xlabel(), axes[1].get_ylabel()) == ("time (s)", "angle (rad)")


def test_joints_without_names_are_counted_from_one():
    axes = Figure().subplots(1, 2)
    trajectories(axes, [demonstration()])
    assert [ax.get_title() for ax in axes] == ["joint 1", "joint 2"]


def history(*moments):
    """One region at the first moment, one more at each that follows, of interest moment / 1000."""
    rows = [(moment, k, k + 1.0, moment / 1000) for n, moment in enumerate(moments, 1) for k in range(n)]
    movements, low, high, interest = map(np.array, zip(*rows, strict=True))
    ends = {"low_1": 0.0 * low, "high_1": 1.0 + 0.0 * low}
    return {"movements": movements, "low_0": 1.0 * low, "high_0": high, **ends, "interest": interest}


def test_interest_over_time_shows_first_and_last_map_on_one_scale():
    axes = Figure().subplots(1, 2)
    drawn = interest_over_time(axes, history(100, 200, 300))
    assert [len(regions.get_paths()) for regions in drawn] == [1, 3]
    extents = [path.get_extents().extents.tolist() for path in drawn[1].get_paths()]
    assert extents == [[0, 0, 1, 1], [1, 0, 2, 1], [2, 0, 3, 1]]  # from x and y to x and y (m)
    assert [regions.get_clim() for regions in drawn] == [(0, 0.3), (0, 0.3)]
    assert [ax.get_title() for ax in axes] == ["after 100 movements: 1 region", "after 300 movements: 3 regions"]


def test_axes_without_a_map_are_hidden_and_a_single_one_shows_the_last():
    axes = Figure().subplots(1, 3)
    assert len(interest_over_time(axes, history(100, 200))) == 2
    assert [ax.get_visible() for ax in axes] == [True, True, False]
    (last,) = interest_over_time([Figure().add_subplot()], history(100, 200))
    assert len(last.get_paths()) == 2


def test_a_run_without_a_map_of_the_plane_is_refused(ax):
    with pytest.raises(ValueError, match="at least one interest map"):
        interest_over_time([ax], {"movements": np.zeros(0)})
    with pytest.raises(ValueError, match="2 dimensions, got a box of 3"):
        interest_over_time([ax], {**history(100), "low_2": np.zeros(1), "high_2": np.ones(1)})
