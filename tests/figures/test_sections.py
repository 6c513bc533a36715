"""What a picture shows of a task space of any dimension: each dimension somewhere, points projected, regions cut."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.learning import competence_map, interest_map, landing_points
from sgimd_torch.figures.sections import of_regions, sections
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.spaces import Box, stream
from worlds import problem


@pytest.fixture
def ax():
    return Figure().subplots()


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


def test_without_dimensions_there_is_nothing_to_draw():
    with pytest.raises(ValueError, match="nothing to draw"):
        sections(Box.cube(0, 1, 0))


def test_points_are_projected_and_those_of_one_dimension_lie_in_the_middle_of_a_strip():
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert sections(Box.cube(0, 9, 3))[1].points(points).tolist() == [[1.0, 3.0], [4.0, 6.0]]
    (strip,) = sections(Box.cube(-2, 2, 1))
    assert strip.points(points[:, :1]).tolist() == [[1.0, 0.5], [4.0, 0.5]]
    assert (strip.box.low.tolist(), strip.box.high.tolist()) == ([-2.0, 0.0], [2.0, 1.0])


def test_a_tile_of_a_strip_has_its_height_and_one_of_sides_of_another_scale_their_proportions():
    assert sections(Box.cube(-2, 2, 1))[0].tile(0.1).tolist() == [0.1, 1.0]
    assert sections(Box.cube(-2, 2, 2))[0].tile(0.1).tolist() == [0.1, 0.1]
    assert sections(Box(np.zeros(2), np.array([100.0, 1.0])))[0].tile(10.0).tolist() == [10.0, 0.1]


def test_regions_are_cut_at_the_middle_of_what_is_not_shown():
    """C of 1 dimension, T of 3: four regions, cut in the context at .4 and in outcome 2 at .7."""
    lows = np.array([[0, 0, 0, 0], [0.4, 0, 0, 0], [0, 0, 0, 0.7], [0.4, 0, 0, 0.7]])
    highs = np.array([[0.4, 1, 1, 0.7], [1, 1, 1, 0.7], [0.4, 1, 1, 1], [1, 1, 1, 1]])
    first, second = of_regions(lows, highs, Box.cube(0, 1, 3))
    low, high, met = first.cut(lows, highs)
    assert met.tolist() == [False, True, False, False]
    assert (low.tolist(), high.tolist()) == ([[0.0, 0.0]], [[1.0, 1.0]])
    assert first.cut_at(lows, highs) == "context 0 = 0.5, outcome 2 = 0.5"
    low, high, met = second.cut(lows, highs)
    assert met.tolist() == [False, True, False, True]
    assert (low.tolist(), high.tolist()) == ([[0.0, 0.0], [0.0, 0.7]], [[1.0, 0.7], [1.0, 1.0]])
    assert second.cut_at(lows, highs) == "context 0 = 0.5, outcome 1 = 0.5"
    (plane, *_) = of_regions(np.zeros((1, 7)), np.ones((1, 7)), Box.cube(0, 1, 6))
    assert plane.cut_at(np.zeros((1, 7)), np.ones((1, 7))) == "the middle of 5 others"


@pytest.mark.parametrize(("context_dim", "dim"), [(0, 1), (1, 2), (2, 3)])
def test_a_cut_tiles_each_picture_of_a_map_that_has_split(context_dim, dim):
    contexts, space, rng = Box.cube(0, 1, context_dim), Box.cube(-1, 1, dim), stream(0, "test")
    goals = InterestMap(problem(contexts=contexts, outcomes=space))
    for _ in range(300):
        goal = space.sample(rng)
        goals.add(contexts.sample(rng), goal, -rng.random() if goal[0] > 0 else -1.0)
    lows, highs = (np.stack([getattr(region, end) for region in goals.regions]) for end in ("low", "high"))
    assert len(lows) > 4
    for section in of_regions(lows, highs, space):
        low, high, met = section.cut(lows, highs)
        assert len(low) == met.sum()
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
