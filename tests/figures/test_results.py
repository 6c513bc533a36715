"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.learning import COLOURS
from sgimd_torch.figures.results import Difference, SeedCurves, forest, goal_distances, goal_histogram, seed_curves
from sgimd_torch.spaces import Box

PLANE = Box.cube(-1, 1, 2, unit="m")


@pytest.fixture
def ax():
    return Figure().add_subplot()


def curves_of(algorithm, errors, **options):
    errors = np.array(errors)
    return SeedCurves(
        algorithm, "Mine", np.array([1000.0, 2000.0]), errors, errors[0], errors[0] - 0.1, errors[0] + 0.2, **options
    )


def test_seed_curves_show_the_centre_its_interval_and_every_seed(ax):
    (line,) = seed_curves(ax, [curves_of("sgim-d", [[0.4, 0.2], [0.5, 0.3], [0.3, 0.1]])])
    assert line.get_label() == "Mine (3 seeds)"
    np.testing.assert_allclose(line.get_xydata(), [[1000, 0.4], [2000, 0.2]])
    assert line.get_color() == COLOURS["sgim-d"]
    seeds = [other.get_ydata() for other in ax.lines if other is not line]
    np.testing.assert_allclose(seeds, [[0.4, 0.2], [0.5, 0.3], [0.3, 0.1]])
    heights = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert (heights.min(), heights.max()) == pytest.approx((0.1, 0.6))
    assert "(m)" in ax.get_ylabel()
    assert "movements" in ax.get_xlabel()
    assert ax.get_ylim()[0] == 0


def test_curves_of_one_colour_are_told_apart_by_their_dashes(ax):
    lines = seed_curves(ax, [curves_of("random", [[0.4, 0.2]]), curves_of("random", [[0.5, 0.3]], dashed=True)])
    assert [line.get_linestyle() for line in lines] == ["-", "--"]
    assert lines[0].get_label() == "Mine (1 seed)"


def test_a_single_seed_has_no_band(ax):
    (line,) = seed_curves(ax, [curves_of("sgim-d", [[0.3, 0.2]])])
    np.testing.assert_array_equal(line.get_xydata(), [[1000, 0.3], [2000, 0.2]])
    assert not ax.collections


def test_goals_of_a_large_space_keep_its_shape(ax):
    box = Box.cube(-100.0, 100.0, 2)
    mesh = goal_histogram(ax, np.array([[-90.0, 90.0], [3.0, 3.0], [4.0, 4.0]]), box, side=100.0)
    np.testing.assert_array_equal(mesh.get_array().filled(0), [[0, 0], [1, 2]])
    assert (ax.get_aspect(), ax.get_xlabel(), ax.get_xlim()) == (1.0, "outcome 0", (-100, 100))


def test_the_share_of_goals_within_a_distance_counts_all_seeds_alike(ax):
    seeds = [np.array([[3.0, 4.0], [0.0, 1.0]]), np.array([[0.0, 10.0], [0.0, 20.0]])]
    (line,) = goal_distances(ax, {"sgim-d": seeds}, reach=1.5)
    np.testing.assert_allclose(line.get_xydata(), [[1, 25], [5, 50], [10, 75], [20, 100]])
    assert line.get_label() == "SGIM-D (2 seeds)"
    np.testing.assert_allclose(ax.lines[0].get_xydata(), [[1, 50], [5, 100]])
    assert 1.5 in ax.lines[-1].get_xdata()
    assert "(m)" in ax.get_xlabel()
    assert "(%)" in ax.get_ylabel()


def test_a_row_of_a_forest_without_an_interval_shows_its_seeds_alone(ax):
    few = Difference("few", np.array([-0.2, -0.1]), -0.15, np.nan, np.nan)
    (points,) = forest(ax, [few], reference="SGIM-D", space=PLANE)
    np.testing.assert_array_equal(points.get_xdata(), few.seeds)
    assert not [line for line in ax.lines if line.get_color() == "black"]  # neither mark nor interval


def test_a_forest_has_the_best_on_top_and_a_full_mark_where_zero_is_excluded(ax):
    worse = Difference("worse", np.array([0.1, 0.3]), 0.2, 0.1, 0.3)
    unsure = Difference("unsure", np.array([-0.1, 0.2, 0.0]), 0.05, -0.1, 0.2)
    better = Difference("better", np.array([-0.3, -0.1]), -0.2, -0.3, -0.1)
    marks = forest(ax, [worse, unsure, better], reference="SGIM-D", space=PLANE)
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "better (2 seeds)",
        "unsure (3 seeds)",
        "worse (2 seeds)",
    ]
    heights = [mark.get_ydata()[0] for mark in marks]
    assert (np.diff(ax.transData.transform([[0, height] for height in heights])[:, 1]) < 0).all()  # downwards
    assert [mark.get_markerfacecolor() for mark in marks] == ["black", "white", "black"]
    assert [mark.get_xdata()[0] for mark in marks] == [-0.2, 0.05, 0.2]
    spans = [line.get_xdata() for line in ax.lines if line.get_color() == "black" and len(line.get_xdata()) == 2]
    np.testing.assert_allclose(spans, [[-0.3, -0.1], [-0.1, 0.2], [0.1, 0.3]])
    ticks = [line.get_xdata() for line in ax.lines if line.get_marker() == "|"]
    np.testing.assert_allclose(ticks[1], unsure.seeds)
    assert "SGIM-D" in ax.get_xlabel()
    assert "(m)" in ax.get_xlabel()
