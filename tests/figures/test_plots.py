"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.learning import (
    COLOURS,
    NAMES,
    Curve,
    count_bar,
    error_curves,
    histogram,
    interest_map,
    landing_points,
)
from sgimd_torch.figures.results import Difference, SeedCurves, forest, goal_distances, goal_histogram, seed_curves
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.spaces import Box, stream

T = Box.cube(-1.0, 1.0, 2)


@pytest.fixture
def ax():
    return Figure().add_subplot()


def curve(*errors, movements=(1000, 2000)):
    return Curve(np.array(movements), np.array(errors), np.full(len(errors), 0.04))


def test_every_algorithm_has_a_name_and_a_colour_of_its_own():
    assert set(COLOURS) == set(NAMES) == {"random", "sagg-riac", "imitation", "observation", "sgim-d"}
    assert len(set(COLOURS.values())) == len(COLOURS)


def test_an_error_curve_of_one_seed_shows_its_errors_and_noise_floor(ax):
    drawn = error_curves(ax, {"sgim-d": [curve(0.3, 0.2)]})["sgim-d"]
    np.testing.assert_array_equal(drawn.mean.get_xydata(), [[1000, 0.3], [2000, 0.2]])
    np.testing.assert_array_equal(drawn.noise_floor.get_xydata(), [[1000, 0.04], [2000, 0.04]])
    assert drawn.noise_floor.get_linestyle() == "--"
    assert drawn.band is None
    assert drawn.mean.get_color() == COLOURS["sgim-d"]


def test_several_seeds_are_averaged_with_a_band_of_one_standard_deviation_and_counted(ax):
    drawn = error_curves(ax, {"random": [curve(0.3, 0.1), curve(0.5, 0.3)]})["random"]
    np.testing.assert_allclose(drawn.mean.get_ydata(), [0.4, 0.2])
    heights = drawn.band.get_paths()[0].vertices[:, 1]
    half = 0.1 * np.sqrt(2)  # sd of two values .2 apart, n - 1
    assert heights.max() == pytest.approx(0.4 + half)
    assert heights.min() == pytest.approx(0.2 - half)
    assert drawn.mean.get_label() == "Random (2 seeds)"


def test_seeds_of_different_length_are_compared_where_both_were_evaluated(ax):
    long = curve(0.3, 0.2, 0.1, movements=(1000, 2000, 3000))
    drawn = error_curves(ax, {"random": [long, curve(0.4, 0.2, movements=(500, 2000))]})["random"]
    np.testing.assert_allclose(drawn.mean.get_xydata(), [[2000, 0.2]])
    with pytest.raises(ValueError, match="never evaluated after the same movement"):
        error_curves(ax, {"random": [long, curve(0.4, movements=(500,))]})


def test_an_algorithm_without_a_colour_is_refused(ax):
    with pytest.raises(ValueError, match="got 'sgimd'"):
        error_curves(ax, {"sgimd": [curve(0.3, 0.2)]})


def test_each_landing_point_inside_is_counted_on_its_tile_and_those_outside_are_told(ax):
    outcomes = np.array([[-0.9, 0.9], [-0.8, 0.8], [0.9, -0.9], [3.0, 0.0]])
    counts = landing_points(ax, outcomes, T, side=1.0).get_array()
    np.testing.assert_array_equal(counts.filled(0), [[0, 1], [2, 0]])  # rows are y, from below
    assert [text.get_text() for text in ax.texts] == ["1 of 4 landed outside"]


def test_two_histograms_can_share_their_scale(ax):
    mesh = landing_points(ax, np.zeros((3, 2)), T, most=50)
    assert (mesh.norm.vmin, mesh.norm.vmax) == (1, 50)


def test_no_landing_point_leaves_an_empty_plane(ax):
    assert landing_points(ax, np.empty((0, 2)), T).get_array().mask.all()


def test_demonstrated_outcomes_are_crosses_and_the_base_is_at_the_origin(ax):
    demonstrated = np.array([[0.1, 0.2], [-0.3, 0.4]])
    landing_points(ax, np.zeros((3, 2)), T, demonstrated=demonstrated)
    crosses, base = ax.lines
    np.testing.assert_array_equal(crosses.get_xydata(), demonstrated)
    np.testing.assert_array_equal(base.get_xydata(), [[0, 0]])


def test_landing_points_need_a_plane(ax):
    with pytest.raises(ValueError, match="2 dimensions, got a box of 3"):
        landing_points(ax, np.zeros((3, 3)), Box.cube(-1, 1, 3))


def test_the_rectangles_of_an_interest_map_are_its_regions_and_tile_the_task_space(ax):
    goals, rng = InterestMap(Box.cube(0, 1, 0), T, stream(0, "goals")), stream(0, "test")
    for _ in range(400):
        goal = T.sample(rng)
        goals.add([], goal, -rng.random() if goal[0] > 0 else -1.0)
    regions = goals.regions
    assert len(regions) > 4
    lows, highs = np.stack([region.low for region in regions]), np.stack([region.high for region in regions])
    interests = np.array([region.interest() for region in regions])
    drawn = interest_map(ax, lows, highs, interests, goals=regions[0].goals)
    corners = np.stack([path.vertices for path in drawn.get_paths()])
    np.testing.assert_allclose(corners.min(axis=1), lows)
    np.testing.assert_allclose(corners.max(axis=1), highs)
    np.testing.assert_array_equal(drawn.get_array(), interests)
    points = T.low + rng.random((500, 2)) * T.sides
    inside = (corners.min(axis=1)[:, None] <= points) & (points < corners.max(axis=1)[:, None])
    assert (inside.all(axis=2).sum(axis=0) == 1).all()
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), regions[0].goals)


def test_a_map_without_any_interest_can_be_drawn(ax):
    drawn = interest_map(ax, T.low[None], T.high[None], np.zeros(1))
    assert drawn.get_clim()[1] > 0


def test_an_interest_map_over_contexts_is_refused(ax):
    with pytest.raises(ValueError, match="cut at one context"):
        interest_map(ax, np.zeros((1, 3)), np.ones((1, 3)), np.zeros(1))


def test_one_colour_bar_serves_histograms_that_share_a_scale():
    axes = list(Figure().subplots(1, 2))
    mesh, _ = (landing_points(ax, np.zeros((3, 2)), T, most=40, colour_bar=False) for ax in axes)
    figure = axes[0].get_figure()
    assert len(figure.axes) == 2
    bar = count_bar(axes, mesh, "movements")
    assert len(figure.axes) == 3
    assert bar.ax.get_ylabel() == "movements"
    assert [tick for tick in bar.get_ticks() if 1 <= tick <= 40] == [1, 2, 5, 10, 20]
    assert (bar.vmin, bar.vmax) == (1, 40)


def test_a_histogram_is_nothing_but_tiles(ax):
    counts = histogram(ax, np.array([[-0.9, 0.9], [0.9, -0.9], [0.8, -0.8]]), T, side=1.0).get_array()
    np.testing.assert_array_equal(counts.filled(0), [[0, 2], [1, 0]])
    assert not ax.lines


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
    with pytest.raises(ValueError, match="got 'grid'"):
        seed_curves(ax, [curves_of("grid", [[0.4, 0.2]])])


def test_goals_of_a_large_space_keep_its_shape(ax):
    box = Box.cube(-100.0, 100.0, 2)
    mesh = goal_histogram(ax, np.array([[-90.0, 90.0], [3.0, 3.0], [4.0, 4.0]]), box, side=100.0)
    np.testing.assert_array_equal(mesh.get_array().filled(0), [[0, 0], [1, 2]])
    assert (ax.get_aspect(), ax.get_xlabel(), ax.get_xlim()) == (1.0, "x (m)", (-100, 100))


def test_the_share_of_goals_within_a_distance_counts_all_seeds_alike(ax):
    seeds = [np.array([[3.0, 4.0], [0.0, 1.0]]), np.array([[0.0, 10.0], [0.0, 20.0]])]
    (line,) = goal_distances(ax, {"sgim-d": seeds}, reach=1.5)
    np.testing.assert_allclose(line.get_xydata(), [[1, 25], [5, 50], [10, 75], [20, 100]])
    assert line.get_label() == "SGIM-D (2 seeds)"
    np.testing.assert_allclose(ax.lines[0].get_xydata(), [[1, 50], [5, 100]])
    assert 1.5 in ax.lines[-1].get_xdata()
    assert "(m)" in ax.get_xlabel()
    assert "(%)" in ax.get_ylabel()


def test_a_forest_has_the_best_on_top_and_a_full_mark_where_zero_is_excluded(ax):
    worse = Difference("worse", np.array([0.1, 0.3]), 0.2, 0.1, 0.3)
    unsure = Difference("unsure", np.array([-0.1, 0.2, 0.0]), 0.05, -0.1, 0.2)
    better = Difference("better", np.array([-0.3, -0.1]), -0.2, -0.3, -0.1)
    marks = forest(ax, [worse, unsure, better], reference="SGIM-D")
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


@pytest.mark.parametrize("draw", ["error_curves", "landing_points", "interest_map"])
def test_axes_carry_names_with_units_and_the_water_plane_is_not_distorted(ax, draw):
    if draw == "error_curves":
        error_curves(ax, {"random": [curve(0.3, 0.2)]})
        assert "(m)" in ax.get_ylabel()
        assert "movements" in ax.get_xlabel()
        return
    if draw == "landing_points":
        landing_points(ax, np.zeros((3, 2)), T)
    else:
        interest_map(ax, T.low[None], T.high[None], np.zeros(1))
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect()) == ("x (m)", "y (m)", 1.0)
    assert ax.get_xlim() == ax.get_ylim() == (-1, 1)
