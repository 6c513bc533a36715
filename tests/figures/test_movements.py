"""The drawn data, read back from the axes. How it looks is for eyes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from sgimd_torch.figures.movements import chosen_goals, competence_map, interest_over_time, noise_ellipses, trajectories
from sgimd_torch.spaces import Box, Demonstration, stream

T = Box.cube(-1.0, 1.0, 2)
LOWS, HIGHS = np.array([[-1.0, -1.0], [0.0, -1.0]]), np.array([[0.0, 1.0], [1.0, 1.0]])


@pytest.fixture
def ax():
    return Figure().add_subplot()


def demonstration(n_times=5):
    times = np.linspace(0.0, 1.0, n_times)
    return Demonstration(np.zeros(0), times, np.stack([times, 2 * times], axis=1), np.zeros(2))


def test_each_joint_shows_what_was_demonstrated_and_what_the_primitive_makes_of_it():
    axes = Figure().subplots(1, 2)
    shown, times = [demonstration(5), demonstration(7)], np.array([0.0, 1.0])
    fitted = [(times, np.array([[0.0, 0.0], [1.0, 3.0]]))] * 2
    drawn = trajectories(axes, shown, fitted, names=("yaw", "elbow"))
    np.testing.assert_array_equal(drawn[1].demonstrated[1].get_xydata()[:, 1], shown[1].trajectory[:, 1])
    np.testing.assert_array_equal(drawn[1].fitted[0].get_xydata(), [[0, 0], [1, 3]])
    assert [len(joint.demonstrated) for joint in drawn] == [len(joint.fitted) for joint in drawn] == [2, 2]
    assert drawn[0].fitted[0].get_linestyle() == "--"
    assert [ax.get_title() for ax in axes] == ["yaw", "elbow"]
    assert (axes[1].get_xlabel(), axes[1].get_ylabel()) == ("time (s)", "angle (rad)")


def test_trajectories_can_be_shown_without_a_fit():
    drawn = trajectories(Figure().subplots(1, 2), [demonstration()])
    assert [joint.fitted for joint in drawn] == [[], []]


@pytest.mark.parametrize(
    ("n_axes", "shown", "fitted", "names"),
    [
        (2, [], None, None),
        (3, [demonstration()], None, None),  # of two joints
        (2, [demonstration()], [], None),
        (2, [demonstration()], None, ("yaw",)),
    ],
)
def test_trajectories_that_do_not_match_are_refused(n_axes, shown, fitted, names):
    with pytest.raises(ValueError, match="needs"):
        trajectories(Figure().subplots(1, n_axes), shown, fitted, names=names)


def test_an_ellipse_has_the_standard_deviations_along_its_axes_as_half_axes(ax):
    cross = np.array([[3.0, 0.0], [-3.0, 0.0], [0.0, 1.0], [0.0, -1.0]])  # sd sqrt(18 / 3) and sqrt(2 / 3)
    turn = np.radians(30)
    turned = cross @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    (ellipse,) = noise_ellipses(ax, [turned + np.array([0.5, -0.2])], deviations=1.0)
    halves = {ellipse.width / 2: ellipse.angle, ellipse.height / 2: ellipse.angle + 90}
    assert sorted(halves) == pytest.approx([np.sqrt(2 / 3), np.sqrt(6)])
    assert halves[max(halves)] % 180 == pytest.approx(30)
    np.testing.assert_allclose(ellipse.center, [0.5, -0.2], atol=1e-12)


def test_about_86_of_100_points_lie_inside_an_ellipse_of_two_deviations(ax):
    landed = stream(0, "test").normal(0, [0.05, 0.01], (4000, 2))
    (ellipse,) = noise_ellipses(ax, [landed])
    inside = ellipse.get_patch_transform().inverted().transform(landed)
    assert np.mean((inside**2).sum(axis=1) < 1) == pytest.approx(1 - np.exp(-2), abs=0.02)  # chi2 of 2; 3 sd are .016


def test_several_movements_are_told_apart_and_the_plane_is_not_distorted(ax):
    ellipses = noise_ellipses(ax, list(stream(0, "test").normal(0, 0.1, (3, 20, 2))))
    assert len({ellipse.get_edgecolor() for ellipse in ellipses}) == 3
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect()) == ("x (m)", "y (m)", 1.0)
    assert ax.get_legend().get_texts()[2].get_text().startswith("movement 3: sd (0.")


@pytest.mark.parametrize("outcomes", [[], [np.zeros((1, 2))], [np.zeros((5, 3))], [np.zeros(2)]])
def test_a_movement_needs_two_landing_points_to_scatter(ax, outcomes):
    with pytest.raises(ValueError, match=r"needs \(n, 2\) landing points"):
        noise_ellipses(ax, outcomes)


def test_competence_is_shown_from_minus_one_to_zero_and_unknown_regions_are_left_white(ax):
    drawn = competence_map(ax, LOWS, HIGHS, np.array([-0.3, np.nan]))
    assert drawn.get_clim() == (-1, 0)
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn.get_array()), [False, True])
    corners = np.stack([path.vertices for path in drawn.get_paths()])
    np.testing.assert_array_equal(corners.min(axis=1), LOWS)
    np.testing.assert_array_equal(corners.max(axis=1), HIGHS)
    assert (ax.get_xlabel(), ax.get_aspect(), ax.get_xlim()) == ("x (m)", 1.0, (-1, 1))


def test_a_competence_map_over_contexts_is_refused(ax):
    with pytest.raises(ValueError, match="regions must be"):
        competence_map(ax, np.zeros((1, 3)), np.ones((1, 3)), np.zeros(1))


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
    assert [regions.get_clim() for regions in drawn] == [(0, 0.3), (0, 0.3)]
    assert [ax.get_title() for ax in axes] == ["after 100 movements: 1 region", "after 300 movements: 3 regions"]


def test_axes_without_a_map_are_hidden_and_a_single_one_shows_the_last():
    axes = Figure().subplots(1, 3)
    assert len(interest_over_time(axes, history(100, 200))) == 2
    assert [ax.get_visible() for ax in axes] == [True, True, False]
    (last,) = interest_over_time([Figure().add_subplot()], history(100, 200))
    assert len(last.get_paths()) == 2


@pytest.mark.parametrize("regions", [{"movements": np.zeros(0)}, {**history(100), "low_2": np.zeros(1)}])
def test_a_run_without_a_map_of_the_plane_is_refused(ax, regions):
    with pytest.raises(ValueError, match="at least one interest map"):
        interest_over_time([ax], regions)


def test_chosen_goals_are_coloured_by_when_and_all_in_sight(ax):
    goals, times = np.array([[0.1, 0.2], [-3.0, 0.4]]), np.array([10, 500])
    points = chosen_goals(ax, goals, times)
    np.testing.assert_array_equal(points.get_offsets(), goals)
    np.testing.assert_array_equal(points.get_array(), times)
    assert ax.get_xlim()[0] < -3
    assert ax.get_aspect() == 1.0
    other = Figure().add_subplot()
    chosen_goals(other, goals, times, T)
    assert other.get_xlim() == (-1, 1)


@pytest.mark.parametrize(("goals", "times"), [((0, 2), 0), ((3, 2), 2), ((3, 3), 3), ((3,), 3)])
def test_goals_and_times_that_do_not_match_are_refused(ax, goals, times):
    with pytest.raises(ValueError, match="goals"):
        chosen_goals(ax, np.zeros(goals), np.zeros(times))
