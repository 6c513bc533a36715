"""Diagnostics of the forward model, on Gaussians that are known, and their figures, read back from the axes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.predictions import (
    calibration,
    coverage_over_time,
    error_map,
    error_over_time,
    held_out_over_time,
    predictions,
)
from sgimd_torch.forward_model.diagnostics import LEVELS, coverage, error_by_cell, improvements, running
from sgimd_torch.spaces import Box, stream

T = Box.cube(-1.0, 1.0, 2)
N = 20_000
FOUR_ERRORS = 4 * 0.5 / np.sqrt(N)  # standard errors of a share of N, at most; failure odds 6e-5 each


@pytest.fixture
def ax():
    return Figure().add_subplot()


def drawn_from(mean, spread, name="outcomes"):
    return mean + spread * stream(0, name).normal(size=np.broadcast_shapes(mean.shape, np.shape(spread)))


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_outcomes_drawn_from_the_predicted_gaussian_fill_each_region_to_its_level(dim):
    mean = np.zeros((N, dim))
    spread = np.broadcast_to(np.array([0.02, 0.5, 3.0])[:dim], mean.shape)  # the ellipse is as long as each dimension
    levels = (0.1, *LEVELS, 0.99)
    np.testing.assert_allclose(coverage(drawn_from(mean, spread), mean, spread, levels), levels, atol=FOUR_ERRORS)


def test_coverage_shows_a_model_that_doubts_too_little_or_too_much():
    mean, spread = np.zeros((N, 2)), np.full((N, 2), 0.1)
    outcomes = drawn_from(mean, spread)
    # In the plane the squared distance is exponential: half as much spread leaves 1 - (1 - level)^(1/4) inside.
    half = 1 - (1 - np.array(LEVELS)) ** 0.25
    np.testing.assert_allclose(coverage(outcomes, mean, spread / 2), half, atol=FOUR_ERRORS)
    assert (coverage(outcomes, mean, 2 * spread) > np.array(LEVELS) + 0.04).all()


def test_the_region_is_an_ellipse_along_the_axes_not_a_box_or_circle():
    mean, spread = np.zeros((5, 2)), np.tile([0.1, 1.0], (5, 1))
    edge = np.sqrt(-2 * np.log(1 - 0.8))  # of the 80 % region, in standard deviations
    outcomes = np.array([[0.99 * edge, 0], [1.01 * edge, 0], [0, 9.9 * edge], [0, 10.1 * edge], [0.8 * edge, 8 * edge]])
    for row, inside in zip(outcomes * 0.1, [1, 0, 1, 0, 0], strict=True):
        assert coverage(row[None], mean[:1], spread[:1], [0.8]) == inside
    assert coverage(outcomes * 0.1, mean, spread, [0.8]) == pytest.approx(2 / 5)


@pytest.mark.parametrize(
    ("observed", "mean", "spread", "levels", "says"),
    [
        (np.zeros((3, 2)), np.zeros((2, 2)), np.ones((3, 2)), LEVELS, "mean must have the shape of observed"),
        (np.zeros((3, 2)), np.zeros((3, 2)), np.ones((3, 3)), LEVELS, "spread must have shape"),
        (np.zeros((3, 2)), np.full((3, 2), np.nan), np.ones((3, 2)), LEVELS, "mean must be finite"),
        (np.zeros((1, 2)), np.full((1, 2), 3.0), [[1.0, 0.0]], LEVELS, r"above 0, but entry \[0, 1\] is 0.0"),
        (np.zeros((0, 2)), np.zeros((0, 2)), np.ones((0, 2)), LEVELS, "at least one outcome"),
        (np.zeros(2), np.zeros(2), np.ones(2), LEVELS, r"\(n, outcome_dim\)"),
        (np.zeros((1, 2)), np.zeros((1, 2)), np.ones((1, 2)), [50, 80], "in percent"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(observed, mean, spread, levels, says):
    with pytest.raises(ValueError, match=says):
        coverage(observed, mean, spread, levels)


def test_errors_are_given_for_the_cell_in_which_the_outcome_was():
    observed = np.array([[-0.5, 0.5], [-0.5, 0.5], [1.0, -1.0], [5.0, 0.0]])  # the third in a corner, the last outside
    mean = observed + np.array([[0.3, 0.4], [0.0, 0.1], [-2.0, 0.0], [0.0, 9.0]])
    errors, counts = error_by_cell(observed, mean, T, 2)
    np.testing.assert_array_equal(counts, [[0, 2], [1, 0]])  # x first
    np.testing.assert_allclose(errors, [[np.nan, 0.3], [2.0, np.nan]])


def test_a_grid_has_as_many_dimensions_as_outcomes():
    errors, counts = error_by_cell(np.zeros((4, 3)), np.ones((4, 3)), Box.cube(-1, 3, 3), 4)
    assert errors.shape == counts.shape == (4, 4, 4)
    assert counts[1, 1, 1] == 4
    assert errors[1, 1, 1] == pytest.approx(np.sqrt(3))
    with pytest.raises(ValueError, match="observed has 2 dimensions, the box 3"):
        error_by_cell(np.zeros((4, 2)), np.zeros((4, 2)), Box.cube(-1, 1, 3))


def test_windows_follow_one_another_and_leave_no_prediction_out():
    errors = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    observed = np.stack([errors, np.zeros(5)], axis=1)
    last, means, coverages = running(observed, np.zeros((5, 2)), np.full((5, 2), 3.0), window=2, levels=[0.5, 0.999])
    np.testing.assert_array_equal(last, [2, 4])
    np.testing.assert_allclose(means, [3.0, 8.0])
    # The region of 50 % reaches 1.18 standard deviations, that of 99.9 % 3.7 of them.
    np.testing.assert_allclose(coverages, [[2 / 3, 1.0], [0.0, 1.0]])


# goal, outcome, origin: of outcomes on a line, goals are at 1 and 2.
LIFE = [
    (None, 0.0, "babble"),
    (1.0, 0.5, "local"),  # first
    (1.0, 0.99, "global"),  # no refinement, though it comes nearest
    (1.0, 0.7, "local"),
    (1.0, 0.6, "local"),
    (3.0, 3.0, "imitate"),
    (3.0, 3.1, "imitate"),
    (2.0, 1.9, "local"),  # the second goal: nothing better follows
    (2.0, 1.0, "local"),
    (None, None, ""),
    (2.0, 1.8, "local"),  # the first goal again, with one movement only
    (1.0, 0.0, "global"),  # never more than that
]


def lived(life, dim=1):
    goals, outcomes = (
        np.array([np.full(dim, np.nan if row[k] is None else row[k]) for row in life]).reshape(-1, dim) for k in (0, 1)
    )
    return goals, outcomes, np.array([row[2] for row in life], dtype=np.str_)


@pytest.mark.parametrize("dim", [1, 3])
def test_refinements_are_counted_goal_by_goal_without_imitation_and_chance(dim):
    found = improvements(*lived(LIFE, dim))
    np.testing.assert_allclose(found.first, np.sqrt(dim) * np.array([0.5, 0.1, 0.2]))
    np.testing.assert_allclose(found.nearest, np.sqrt(dim) * np.array([0.3, 0.1, 0.2]))
    assert found.movements.tolist() == [3, 2, 1]
    assert found.share == 0.5  # of the two goals with a second movement


@pytest.mark.parametrize("life", [[], LIFE[:1], LIFE[5:7], LIFE[10:]])
def test_without_refinements_there_is_no_share(life):
    found = improvements(*lived(life))
    assert np.isnan(found.share)
    assert len(found.first) == len(found.nearest) == len(found.movements)  # an entry for each goal, if there is any


def test_goals_without_their_outcomes_are_refused():
    goals, outcomes, origins = lived(LIFE)
    with pytest.raises(ValueError, match=r"\(12, 1\), \(11, 1\) and \(12,\)"):
        improvements(goals, outcomes[:-1], origins)
    outcomes[3] = np.nan
    with pytest.raises(ValueError, match=r"outcomes must be finite.*every movement towards a goal has one"):
        improvements(goals, outcomes, origins)


def test_lines_go_from_prediction_to_outcome_and_tell_their_length(ax):
    observed, mean = np.array([[0.0, 0.5], [0.2, 0.2], [3.0, 0.0]]), np.array([[0.3, 0.1], [0.2, 0.2], [3.0, 0.1]])
    lines = predictions(ax, observed, mean, T)
    np.testing.assert_array_equal(lines.get_segments()[0], [[0.3, 0.1], [0.0, 0.5]])
    np.testing.assert_allclose(lines.get_array(), [0.5, 0.0, 0.1])
    assert [text.get_text() for text in ax.texts] == ["1 of 3 landed outside"]


def test_cells_lie_where_their_outcomes_did_and_show_their_number(ax):
    observed = np.array([[-0.5, 0.5], [-0.5, 0.6], [0.5, -0.5]])
    mesh = error_map(ax, error_by_cell(observed, observed + np.array([0.3, 0.0]), T, 2), T)
    np.testing.assert_array_equal(mesh.get_array().mask, [[True, False], [False, True]])  # rows are y, from below
    assert {(*text.get_position(), text.get_text()) for text in ax.texts} == {(-0.5, 0.5, "2"), (0.5, -0.5, "1")}
    exact = error_map(Figure().add_subplot(), error_by_cell(observed, observed, T, 2), T)
    assert 0 == exact.norm.vmin < exact.norm.vmax < 1e-3  # m
    empty = error_map(Figure().add_subplot(), error_by_cell(observed + 9, observed, T, 2), T)
    assert empty.get_array().mask.all()


def test_calibration_is_drawn_beside_the_ideal_and_told_at_50_80_and_95(ax):
    levels = np.arange(1, 20) / 20
    line = calibration(ax, levels, {"last 7": levels**2})["last 7"]
    np.testing.assert_array_equal(line.get_xydata(), np.stack([levels, levels**2], axis=1))
    assert levels[line.get_markevery()].tolist() == list(LEVELS)
    assert line.get_label() == "last 7: 25 / 64 / 90 %"
    assert {axis.get_major_formatter()(0.25) for axis in (ax.xaxis, ax.yaxis)} == {"25 %"}
    ideal = ax.lines[0]
    assert ideal.get_linestyle() == "--"
    np.testing.assert_array_equal(ideal.get_xdata(), ideal.get_ydata())


def test_curves_over_time_show_what_they_are_given_and_the_band_that_will_do(ax):
    movements, values = np.array([300.0, 600.0]), np.array([0.5, 0.75])
    assert error_over_time(ax, movements, values).get_xydata().tolist() == [[300, 0.5], [600, 0.75]]
    other = Figure().add_subplot()
    assert coverage_over_time(other, movements, values).get_ydata().tolist() == [0.5, 0.75]
    assert other.yaxis.get_major_formatter()(0.25) == "25 %"
    band = other.patches[0].get_extents().transformed(other.transData.inverted())
    assert (band.y0, band.y1) == pytest.approx((0.7, 0.9))


def test_refreshes_that_diverged_are_marked_and_one_far_above_does_not_flatten_the_rest(ax):
    held_out = np.array([3000.0, 1.0, 0.5, 0.25, 0.75, 0.125])
    diverged = np.array([False, False, True, False, False, False])
    held_out_over_time(ax, np.arange(6.0), held_out, diverged)
    assert ax.lines[1].get_xydata().tolist() == [[2, 0.5]]
    assert ax.get_ylim()[1] < 2
    assert [text.get_text() for text in ax.texts] == ["1 of 6 lie above, up to 3000.0"]
