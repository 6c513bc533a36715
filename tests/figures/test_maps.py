"""What figures draw, read back from the axes: points projected, regions cut, each dimension of T somewhere.

How it looks is for eyes.
"""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import limits
from sgimd_torch.figures.learning import competence_map, interest_map, landing_points, misses
from sgimd_torch.figures.names import COLOURS, NAMES
from sgimd_torch.figures.sections import sections, sections_of_regions
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


def test_landing_points_are_counted_on_tiles_or_told_and_demonstrated_ones_are_drawn_once(ax):
    outcomes = np.array([[-0.9, 0.9], [-0.8, 0.8], [0.9, -0.9], [3.0, 0.0]])
    demonstrated = np.array([[0.1, 0.2], [-0.3, 0.4], [0.1, 0.2]])
    counts = landing_points(ax, outcomes, T, PLANE, demonstrated=demonstrated, side=1.0).get_array()
    np.testing.assert_array_equal(counts.filled(0), [[0, 1], [2, 0]])  # rows are y, from below
    assert [text.get_text() for text in ax.texts] == ["1 of 4 landed outside: squares at the edge"]
    np.testing.assert_array_equal(ax.collections[1].get_offsets(), [[1.0, 0.0]])
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


def test_regions_are_coloured_by_competence_on_one_scale_and_left_white_if_it_is_not_known(ax):
    drawn = competence_map(ax, LOWS, HIGHS, np.array([-0.3, np.nan]), PLANE)
    assert drawn.get_clim() == (-1, 0)
    assert drawn.norm(np.array([-1, -0.25, -0.04, -0.01, 0])).tolist() == pytest.approx([0, 0.5, 0.8, 0.9, 1])
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


@pytest.mark.parametrize(
    ("dim", "pairs"),
    [
        (1, [(0,)]),
        (2, [(0, 1)]),
        (3, [(0, 1), (0, 2)]),
        (4, [(0, 1), (2, 3)]),
        (6, [(0, 1), (2, 3), (4, 5)]),
    ],
)
def test_each_dimension_is_in_a_picture(dim, pairs):
    assert [section.dims for section in sections(Box.cube(0, 1, dim))] == pairs
    with pytest.raises(ValueError, match="nothing to draw"):
        sections(Box.cube(0, 1, 0))


def test_points_are_projected_and_tiles_have_the_proportions_of_their_picture():
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert sections(Box.cube(0, 9, 3))[1].points(points).tolist() == [[1.0, 3.0], [4.0, 6.0]]
    (strip,) = sections(Box.cube(-2, 2, 1))
    assert strip.points(points[:, :1]).tolist() == [[1.0, 0.5], [4.0, 0.5]]
    assert (strip.box.low.tolist(), strip.box.high.tolist()) == ([-2.0, 0.0], [2.0, 1.0])
    assert strip.tile(0.1).tolist() == [0.1, 1.0]
    assert PLANE.tile(0.1).tolist() == [0.1, 0.1]
    assert sections(Box(np.zeros(2), np.array([100.0, 1.0])))[0].tile(10.0).tolist() == [10.0, 0.1]


def test_regions_are_cut_at_the_middle_of_what_is_not_shown():
    """C of 1 dimension, T of 3: four regions, cut in the context at .4 and in outcome 2 at .7."""
    lows = np.array([[0, 0, 0, 0], [0.4, 0, 0, 0], [0, 0, 0, 0.7], [0.4, 0, 0, 0.7]])
    highs = np.array([[0.4, 1, 1, 0.7], [1, 1, 1, 0.7], [0.4, 1, 1, 1], [1, 1, 1, 1]])
    first, second = sections_of_regions(lows, highs, Box.cube(0, 1, 3), Box.cube(0, 1, 1, names=("wind",), unit="m/s"))
    low, high, met = first.cut(lows, highs)
    assert met.tolist() == [False, True, False, False]
    assert (low.tolist(), high.tolist()) == ([[0.0, 0.0]], [[1.0, 1.0]])
    assert first.cut_at(lows, highs) == "wind (m/s) = 0.5, outcome 2 = 0.5"
    low, high, met = second.cut(lows, highs)
    assert met.tolist() == [False, True, False, True]
    assert (low.tolist(), high.tolist()) == ([[0.0, 0.0], [0.0, 0.7]], [[1.0, 0.7], [1.0, 1.0]])
    assert second.cut_at(lows, highs) == "wind (m/s) = 0.5, outcome 1 = 0.5"
    (plane, *_) = sections_of_regions(np.zeros((1, 7)), np.ones((1, 7)), Box.cube(0, 1, 6), Box.cube(0, 1, 1))
    assert plane.cut_at(np.zeros((1, 7)), np.ones((1, 7))) == "the middle of 5 others"


@pytest.mark.parametrize(("context_dim", "dim"), [(0, 1), (0, 2), (1, 2), (2, 3)])
def test_the_regions_of_an_interest_map_tile_each_picture_and_have_their_interests(context_dim, dim):
    contexts, space, rng = Box.cube(0, 1, context_dim), Box.cube(-1, 1, dim), stream(0, "test")
    goals = InterestMap(problem(contexts=contexts, outcomes=space))
    for _ in range(300):
        goal = space.sample(rng)
        goals.add(contexts.sample(rng), goal, -rng.random() if goal[0] > 0 else -1.0)
    lows, highs = (np.stack([getattr(region, end) for region in goals.regions]) for end in ("low", "high"))
    interests = np.array([region.interest() for region in goals.regions])
    assert len(lows) > 4
    for section in sections_of_regions(lows, highs, space, contexts):
        low, high, met = section.cut(lows, highs)
        drawn = interest_map(Figure().subplots(), lows, highs, interests, section, goals=goals.regions[0].goals)
        corners = np.stack([path.vertices for path in drawn.get_paths()])
        np.testing.assert_allclose([corners.min(axis=1), corners.max(axis=1)], [low, high])
        np.testing.assert_array_equal(drawn.get_array(), interests[met])
        points = section.box.low + rng.random((300, 2)) * section.box.sides
        inside = ((low[:, None] <= points) & (points < high[:, None])).all(axis=2)
        assert (inside.sum(axis=0) == 1).all()


@pytest.mark.parametrize("dim", [1, 2, 3, 6])
def test_every_figure_shows_outcomes_of_any_dimension(dim):
    space, rng = Box.cube(-1, 1, dim), stream(0, "test")
    outcomes = space.low + rng.random((50, dim)) * space.sides
    lows, highs = space.low[None], space.high[None]
    for section in sections(space):
        axes = Figure().subplots(3)
        mesh = landing_points(axes[0], outcomes, space, section, demonstrated=outcomes[:3], side=0.1)
        assert mesh.get_array().sum() == 50
        assert sorted(axes[0].lines[0].get_xdata()) == sorted(outcomes[:3, section.dims[0]])
        drawn = interest_map(axes[1], lows, highs, np.ones(1), section, goals=outcomes)
        assert len(drawn.get_paths()) == 1
        competence_map(axes[2], lows, highs, np.full(1, -0.5), section)
        assert [ax.get_xlabel() for ax in axes] == [f"outcome {section.dims[0]}"] * 3
