"""What figures draw, read back from the axes: points projected, regions cut, each dimension of T somewhere.

How it looks is for eyes.
"""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.extras.pictures.maps import competence_map
from sgimd_torch.extras.pictures.sections import sections
from sgimd_torch.extras.report.figures import sections_of_regions
from sgimd_torch.extras.report.maps import interest_map, landing_points, limits
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.spaces import Box, stream
from worlds import problem

T = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m")
(PLANE,) = sections(T)


@pytest.fixture
def ax():
    return Figure().add_subplot()


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
