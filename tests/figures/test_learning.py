"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import limits
from sgimd_torch.figures.learning import (
    COLOURS,
    NAMES,
    competence_map,
    interest_map,
    landing_points,
    misses,
)
from sgimd_torch.figures.sections import sections
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.spaces import Box, stream
from worlds import problem

T = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m")
(PLANE,) = sections(T)
LOWS, HIGHS = np.array([[-1.0, -1.0], [0.0, -1.0]]), np.array([[0.0, 1.0], [1.0, 1.0]])


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_every_algorithm_has_a_name_and_a_colour_of_its_own():
    assert set(COLOURS) == set(NAMES) >= {"random", "sagg-riac", "imitation", "observation", "sgim-d"}
    assert len(set(COLOURS.values())) == len(COLOURS)


def test_each_landing_point_inside_is_counted_on_its_tile_and_those_outside_are_told(ax):
    outcomes = np.array([[-0.9, 0.9], [-0.8, 0.8], [0.9, -0.9], [3.0, 0.0]])
    counts = landing_points(ax, outcomes, T, PLANE, side=1.0).get_array()
    np.testing.assert_array_equal(counts.filled(0), [[0, 1], [2, 0]])  # rows are y, from below
    assert [text.get_text() for text in ax.texts] == ["1 of 4 landed outside: squares at the edge"]
    np.testing.assert_array_equal(ax.collections[1].get_offsets(), [[1.0, 0.0]])


def test_what_was_demonstrated_several_times_is_one_demonstrated_outcome(ax):
    demonstrated = np.array([[0.1, 0.2], [-0.3, 0.4], [0.1, 0.2]])
    landing_points(ax, np.zeros((3, 2)), T, PLANE, demonstrated=demonstrated)
    assert ax.lines[0].get_label() == "2 demonstrated outcomes"
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), demonstrated[[1, 0]])


@pytest.mark.parametrize("n", [20, 400])
def test_limits_hold_every_point_but_one_that_is_far_away(n):
    points = stream(0, "test").uniform([-0.4, 0.1], [0.3, 0.9], (n, 2))
    near = limits(points, T)
    assert near.contains(points).all()
    assert (near.sides < 1).all()
    points[n // 2] = [500.0, -3.0]
    assert (np.abs(limits(points, T).low - near.low) < 0.1).all()
    assert (np.abs(limits(points, T).high - near.high) < 0.1).all()


@pytest.mark.parametrize(
    "points", [[[0.2, 0.3]], [[0.0, 0.0]], [[0.2, 0.3], [0.2, 0.7]], [[-7e-5, 3e-5], [2e-5, 9e-5]]]
)
def test_limits_of_few_points_hold_all_of_them(points):
    box = limits(np.array(points), T)
    assert (box.sides > 0).all()
    assert box.contains(points).all()


def test_the_rectangles_of_an_interest_map_are_its_regions_and_tile_the_task_space(ax):
    goals, rng = InterestMap(problem(outcomes=T)), stream(0, "test")
    for _ in range(400):
        goal = T.sample(rng)
        goals.add([], goal, -rng.random() if goal[0] > 0 else -1.0)
    regions = goals.regions
    assert len(regions) > 4
    lows, highs = np.stack([region.low for region in regions]), np.stack([region.high for region in regions])
    interests = np.array([region.interest() for region in regions])
    drawn = interest_map(ax, lows, highs, interests, PLANE, goals=regions[0].goals)
    corners = np.stack([path.vertices for path in drawn.get_paths()])
    np.testing.assert_allclose(corners.min(axis=1), lows)
    np.testing.assert_allclose(corners.max(axis=1), highs)
    np.testing.assert_array_equal(drawn.get_array(), interests)
    points = T.low + rng.random((500, 2)) * T.sides
    inside = (corners.min(axis=1)[:, None] <= points) & (points < corners.max(axis=1)[:, None])
    assert (inside.all(axis=2).sum(axis=0) == 1).all()
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), regions[0].goals)


@pytest.mark.parametrize(
    ("competences", "span"),
    [
        ((-0.7, -0.35), (-0.7, -0.3)),
        ((-0.62, -0.38), (-0.65, -0.35)),
        ((-0.049, -0.011), (-0.05, -0.01)),
        ((-0.43, -0.43), (-0.43, -0.42)),
        ((0.0, 0.0), (-0.01, 0.0)),
        ((np.nan, np.nan), (-1.0, 0.0)),
    ],
)
def test_the_colours_of_competence_span_the_competences_in_round_numbers(ax, competences, span):
    assert competence_map(ax, LOWS, HIGHS, np.array(competences), PLANE).get_clim() == pytest.approx(span)


def test_regions_of_unknown_competence_are_left_white(ax):
    drawn = competence_map(ax, LOWS, HIGHS, np.array([-0.3, np.nan]), PLANE)
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn.get_array()), [False, True])
    corners = np.stack([path.vertices for path in drawn.get_paths()])
    np.testing.assert_array_equal(corners.min(axis=1), LOWS)
    np.testing.assert_array_equal(corners.max(axis=1), HIGHS)
    assert (ax.get_xlabel(), ax.get_aspect(), ax.get_xlim()) == ("x (m)", 1.0, (-1, 1))


@pytest.mark.parametrize(
    ("dim", "labels"), [(1, ("height", "distance from goal to outcome")), (2, ("height", "reach"))]
)
def test_misses_are_at_their_goals(ax, dim, labels):
    space = Box.cube(0, 1, dim, names=("height", "reach")[:dim])
    goals = stream(0, "test").random((5, dim))
    misses(ax, goals, np.arange(5.0), space, sections(space)[0], 2.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == labels
    drawn = ax.lines[0].get_xydata() if dim == 1 else ax.collections[0].get_offsets()
    np.testing.assert_array_equal(drawn[:, :dim], goals)
    if dim == 2:
        assert ax.collections[0].get_array().tolist() == [0, 1, 2, 3, 4]
