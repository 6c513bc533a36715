"""What figures draw, read back from the axes: points projected, regions cut, each dimension of T somewhere.

How it looks is for eyes.
"""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.extras.pictures.maps import competence_map, misses
from sgimd_torch.extras.pictures.sections import sections
from sgimd_torch.spaces import Box, stream

T = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m")
(PLANE,) = sections(T)
LOWS, HIGHS = np.array([[-1.0, -1.0], [0.0, -1.0]]), np.array([[0.0, 1.0], [1.0, 1.0]])


@pytest.fixture
def ax():
    return Figure().add_subplot()


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
