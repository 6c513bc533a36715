"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
from matplotlib.figure import Figure

from sgimd_torch.figures.movements import trajectories
from sgimd_torch.spaces import Demonstration


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
