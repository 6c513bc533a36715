"""The board: what its curves count, what its file holds, and that a resumed run leaves one continuous board."""

import dataclasses
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.plugins.custom_scalar import layout_pb2
from tensorboard.plugins.hparams import metadata as hparams
from tensorboard.util.tensor_util import make_ndarray

from runs import EAGER, arguments, csv_of, signal_after, start
from sgimd_torch import InterestMap, PeriodicTeacher, PlanarArm, evaluate, run, stream
from sgimd_torch.algorithms import random_exploration, sagg_riac
from sgimd_torch.board import pictures
from sgimd_torch.board.scalars import LEGEND, Curves, Grid, branches
from sgimd_torch.board.writer import Board, read_events
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import Benchmark, load_benchmark
from sgimd_torch.figures.sections import sections
from sgimd_torch.inverses.local import LocalInverse
from sgimd_torch.runs.board import cells_of
from sgimd_torch.runs.build import build
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.process import Stopping
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import live_in
from sgimd_torch.spaces import Box, Demonstration, Episode, Move, Request
from worlds import demonstrations, make

LIFE = 1500  # movements
PLANE = Box.cube(-1, 1, 2)
GOAL, NEAR, FAR = np.array([0.5, 0.5]), np.array([0.5, 0.51]), np.array([0.5, 0.9])  # near: within the tolerance
SHOWN = Demonstration(np.zeros(0), np.zeros(2), np.zeros((2, 1)), np.array([-0.5, 0.5]))


def movement(index, goal, outcome, origin="local", demonstration=None):
    return Episode(index, np.zeros(0), Move(np.zeros(1), goal, origin), outcome, demonstration)


def events_of(directory):
    (path,) = directory.glob("events.out.tfevents.*")
    return list(EventFileLoader(str(path)).Load())


def curves_of(directory):
    """By tag: {step: value}; a step that is there twice fails."""
    found = {}
    for event in events_of(directory):
        for value in event.summary.value:
            tensor = make_ndarray(value.tensor)
            shown = tensor.item() if tensor.dtype == np.float32 and tensor.size else tensor.tolist()
            assert found.setdefault(value.tag, {}).setdefault(event.step, shown) is shown, (value.tag, event.step)
    return found


def interest_map(n=400):
    goals = InterestMap(Box.cube(0, 1, 0), PLANE, stream(0, "goals"))
    rng = stream(0, "competence")
    for _ in range(n):
        goal = goals.sample([])
        goals.add([], goal, -rng.random() if goal[0] > 0 else -0.1)
    return goals


def test_a_goal_counts_once_and_as_reached_when_one_of_its_movements_came_near():
    curves = Curves(PLANE, tolerance=0.02)
    for index, outcome in enumerate([FAR, NEAR, FAR]):
        curves.episode(movement(index, GOAL, outcome))
    curves.episode(movement(3, -GOAL, FAR))
    values = curves.of_behaviour()
    assert (values["goals/attempted"], values["goals/reached"], values["goals/reached_share"]) == (2, 1, 0.5)
    assert values["goals/missed_by"] == pytest.approx((0.01 + np.hypot(1, 1.4)) / 2)


def test_imitations_count_for_the_teacher_and_not_as_goals_of_the_learners_own():
    curves = Curves(PLANE)
    curves.episode(movement(0, GOAL, NEAR))
    curves.episode(movement(1, SHOWN.outcome, SHOWN.outcome * 1.2, "imitate", SHOWN))
    curves.episode(movement(2, SHOWN.outcome, SHOWN.outcome * 1.4, "imitate"))
    values = curves.of_behaviour()
    assert values["goals/attempted"] == 1
    assert values["teacher/demonstrations"] == 1
    assert values["teacher/missed_by"] == pytest.approx(0.3 * np.sqrt(0.5))


def test_shares_of_regimes_sum_to_one_and_a_regime_that_was_seen_keeps_its_curve():
    curves = Curves(PLANE)
    for index, origin in enumerate(["global", "local", "local", "imitate"]):
        curves.episode(movement(index, GOAL, FAR, origin))
    assert curves.of_behaviour().items() >= {"regime/global": 0.25, "regime/local": 0.5, "regime/imitate": 0.25}.items()
    curves.episode(Episode(4, np.zeros(0), None, None, None))
    values = {tag: value for tag, value in curves.of_behaviour().items() if tag.startswith("regime/")}
    assert values == {"regime/global": 0, "regime/local": 0, "regime/imitate": 0, "regime/rest": 1}


def test_requests_are_counted_by_strategy_and_by_the_place_of_their_goals():
    curves = Curves(PLANE)
    wanted = [("imitate ann", (-0.5, -0.5), "shown"), ("imitate ben", (0.5, 0.5), "again"), None, None]
    for index, each in enumerate(wanted * 2):
        request = each and Request(each[0].partition(" ")[2], np.array(each[1]), each[0])
        move = Move(np.zeros(1), GOAL, "local")
        curves.episode(Episode(index, np.zeros(0), move, FAR, None, request, each[2] if each else ""))
    values = curves.of_behaviour()
    assert (values["strategy/imitate ann"], values["strategy/imitate ben"]) == (0.25, 0.25)
    assert values["asked/answered"] == 2
    places = {tag: value for tag, value in values.items() if tag.startswith("asked/") and tag != "asked/answered"}
    assert sorted(places.values()) == [0, 0, 0.5, 0.5]
    curves.episode(movement(8, GOAL, FAR))
    later = curves.of_behaviour()
    assert later["strategy/imitate ann"] == 0
    assert not any(tag.startswith("asked/") for tag in later)  # no requests, no shares of them


def test_a_region_that_was_cut_goes_on_as_the_mean_over_the_goals_of_its_parts():
    regions = interest_map().regions
    values = Curves(PLANE, depth=3).of_regions(regions)
    for path in ("R", "R0", "R10"):
        below = [region for region in regions if region.path.startswith(path)]
        assert len(below) > 1
        goals = np.concatenate([region.competences for region in below])
        interests = np.concatenate([np.full(len(region.goals), region.interest()) for region in below])
        assert values[f"competence/{path}"] == pytest.approx(goals.mean())
        assert values[f"interest/{path}"] == pytest.approx(interests.mean())
        assert values[f"region_goals/{path}"] == sum(region.attempts for region in below)
    assert values["region_size/R"] == pytest.approx(1)
    assert values["region_size/R0"] + values["region_size/R1"] == pytest.approx(1)
    assert values["regions/count"] == len(regions)


def test_the_names_of_regions_are_bounded_and_none_disappears_while_the_tree_grows():
    goals, curves, names = interest_map(0), Curves(PLANE, depth=2), set()
    rng = stream(1, "goals")
    for _ in range(2000):
        goal = PLANE.sample(rng)
        goals.add([], goal, -rng.random())
        if rng.random() < 0.05:
            now = {tag for tag in curves.of_regions(goals.regions) if tag.startswith("interest/")}
            assert names <= now
            names = now
    assert len(goals.regions) > 20
    assert names == {f"interest/R{bits}" for bits in ("", "0", "1", "00", "01", "10", "11")}


def test_regions_asked_for_again_and_again_give_what_fresh_curves_give():
    goals, curves = interest_map(0), Curves(PLANE)
    rng = stream(2, "goals")
    for _ in range(300):
        goals.add([], PLANE.sample(rng), -rng.random())
        values = curves.of_regions(goals.regions)
    fresh = Curves(PLANE).of_regions(goals.regions)
    assert values == {tag: value for tag, value in fresh.items() if tag in values}
    assert {tag.partition("/")[0] for tag in fresh.keys() - values.keys()} <= {"region_size"}  # which is told once


def test_a_region_knows_which_share_of_its_goals_was_reached():
    goals, curves = interest_map(0), Curves(PLANE, tolerance=0.02)
    for index, outcome in enumerate([NEAR, FAR, FAR, NEAR]):
        goal = GOAL * (1 + 0.001 * index)
        curves.episode(movement(index, goal, outcome))
        goals.add([], goal, -0.5)
    assert curves.of_regions(goals.regions)["region_reached/R"] == 0.5


def test_cells_of_the_grid_hold_each_point_once_the_border_included():
    grid = Grid(PLANE)
    assert len(grid.names) == len(set(grid.names)) == 16
    counts, sums = grid.sums(np.array([[-1, -1], [1, 1], [0, 0], [0.1, 0.4], [1.1, 0]]), np.array([1.0, 2, 3, 4, 5]))
    means = grid.means(counts, sums)
    assert means == {"x -1..-0.5, y -1..-0.5": 1, "x 0.5..1, y 0.5..1": 2, "x 0..0.5, y 0..0.5": 3.5}


def test_cells_of_a_fixed_grid_lie_below_the_whole_and_have_no_curves_of_their_own():
    (region,) = interest_map(0).regions
    halves = [type(region)(**{**vars(region), "path": path}) for path in ("R.0", "R.1")]
    assert branches(halves, 3) == {"R": halves}


@pytest.mark.parametrize("dim", [1, 3])
def test_points_of_another_dimension_are_refused_rather_than_spread_over_the_diagonal(dim):
    goals = np.full((4, dim), 0.6)
    with pytest.raises(ValueError, match=rf"points must have shape \(..., 2\), got \(4, {dim}\)"):
        Curves(PLANE).of_evaluation(goals, np.ones(4), 0.0)
    (cell,) = (tag for tag in Curves(Box.cube(-1, 1, dim)).of_evaluation(goals, np.ones(4), 0.0) if "grid_error" in tag)
    assert cell.count("outcome_") == dim


def test_cells_lie_where_the_goals_of_the_benchmark_do_so_that_task_spaces_of_any_size_have_the_same():
    goals = load_benchmark().goals
    for half_side in (1.0, 10.0, 100.0):
        cells = cells_of(FishingRod(outcomes=Box.cube(-half_side, half_side, 2)).outcomes, goals)
        assert cells.low.tolist() == [-1, -1]
        assert cells.high.tolist() == [1, 1]
    small = cells_of(Box(np.array([0.0, -3, -1]), np.array([0.8, 3, 1])), np.array([[0.1, 0, 0], [0.79, 2.2, 0]]))
    assert small.low.tolist() == [0.1, 0, -1]  # goals that are all alike in a dimension leave all of it
    assert small.high.tolist() == [0.8, 2.5, 1]


@pytest.mark.parametrize("dim", [1, 2, 3, 6])
def test_a_grid_has_at_most_sixteen_cells_in_any_dimension(dim):
    assert 1 <= len(Grid(Box.cube(0, 1, dim)).names) <= 16


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A planar arm is taught, and evaluated twice; returns the directory and the mean errors (m)."""
    directory, arm = tmp_path_factory.mktemp("board"), PlanarArm()
    learner, teacher = make("sgim-d", arm), PeriodicTeacher(demonstrations(arm), stream(0, "teacher"))
    goals = np.array([[0.3, 0.3], [-0.5, 0.2]])
    evaluations = {}
    with Board(directory, arm.outcomes, legend={"mine": "A number of mine."}) as board:
        board.settings({"seed": 0, "goals": "interest-map", "fast": True}, first=["seed"])
        for episode in run(learner, arm, 0, movements=LIFE, teacher=teacher):
            board.episode(episode)
            if board.due:
                board.regions(learner.autonomous.goals.regions)
                board.scalars({"mine/squared": board.movements**2, "mine/missing": np.nan})
            if board.movements in (200, LIFE):
                found = evaluate(learner.autonomous.inverse, arm, goals, 0, board.movements)
                board.evaluation(goals, found.errors, found.noise_floor)
                evaluations[board.movements] = found.mean_error
        board.finish()
    return directory, evaluations


def test_tensorboard_reads_what_was_written(board):
    directory, evaluations = board
    curves, steps = curves_of(directory), range(50, LIFE + 1, 50)
    assert curves["error/mean"] == pytest.approx(evaluations, rel=1e-6)
    assert curves["mine/squared"] == {step: step**2 for step in steps}
    assert "mine/missing" not in curves
    assert curves["competence/R"].keys() == curves["regime/local"].keys() == set(steps)


def test_every_tag_is_explained_once_in_the_file_and_once_in_the_legend(board):
    directory, _ = board
    explained = [
        value.tag
        for event in events_of(directory)
        for value in event.summary.value
        if value.metadata.summary_description and value.metadata.plugin_data.plugin_name in ("scalars", "text")
    ]
    curves = curves_of(directory)
    assert sorted(explained) == sorted(tag for tag in curves if not tag.startswith(("_hparams_", "custom_scalars")))
    (legend,) = curves["about/legend"].values()
    assert all(f"**{tag}" in legend.decode() for tag in LEGEND)


def test_a_tag_without_an_explanation_is_refused(tmp_path):
    with Board(tmp_path, PLANE) as board, pytest.raises(ValueError, match="legend"):
        board.scalars({"mine": 1.0})


def charts_of(directory):
    """Of the page of charts: the patterns of tags by category."""
    layout = layout_pb2.Layout.FromString(curves_of(directory)["custom_scalars__config__"][0])
    return {each.title: [tag for chart in each.chart for tag in chart.multiline.tag] for each in layout.category}


def empty_charts(directory):
    tags = curves_of(directory).keys()
    patterns = [pattern for each in charts_of(directory).values() for pattern in each]
    assert len(patterns) == len(set(patterns))
    return [pattern for pattern in patterns if not any(re.match(pattern, tag) for tag in tags)]


def test_the_page_of_charts_begins_with_where_it_is_competent_by_places_with_goals(watched):
    first, *others = charts_of(watched).items()
    assert first[0] == "Where is it competent (half of the goals met, within 0.05 m), and since when?"
    titles = [pattern.replace("\\", "") for pattern in first[1]]
    assert titles[0] == "^met/everywhere$"
    places = ("x -0.4..-0.05, y 0.4..0.5", "x -0.05..0.3, y 0.4..0.5", "x -0.05..0.3, y 0.5..0.6")
    assert titles[1:] == [f"^met/{place}$" for place in places]  # and not the one that no goal lies in
    assert len(others) == 2


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--algorithm", "random"),
        ("--algorithm", "observation", "--repeats", 0),
        ("--algorithm", "imitation"),
        ("--algorithm", "sagg-riac"),
        ("--algorithm", "sgim-im"),
        ("--social", "emulate", "--goals", "uniform"),
        ("--goals", "grid", "--search", "perturb"),
    ],
)
def test_no_chart_of_the_first_page_is_empty_whatever_the_learner(tmp_path, go, options):
    assert go(tmp_path, "--board", "true", *options) == 0
    ((directory,),) = [list(path.glob("seed-*")) for path in tmp_path.iterdir()]
    assert all(charts_of(directory).values())
    assert empty_charts(directory) == []


def test_a_board_of_your_own_has_all_charts_and_those_of_places_with_goals_have_curves(board):
    directory, _ = board
    charts = [pattern for each in charts_of(directory).values() for pattern in each]
    assert {"^error/mean$", "^interest/R$", "^teacher/missed_by$", "^regime/local$", "^regime/imitate$"} < set(charts)
    assert len(empty_charts(directory)) == 2  # of four places; the two goals lie in the others


def test_the_share_of_goals_met_is_counted_by_place_and_everywhere():
    goals = np.array([[-0.9, -0.9], [-0.8, -0.9], [0.5, 0.5], [0.6, 0.6]])
    values = Curves(PLANE, near=0.05).of_evaluation(goals, np.array([0.01, 0.2, 0.05, 0.0]), 0.0)
    assert values["met/everywhere"] == 0.75
    assert (values["met/x -1..0, y -1..0"], values["met/x 0..1, y 0..1"]) == (0.5, 1)
    assert "met/x -1..0, y 0..1" not in values  # no goals there
    assert values["grid_met/x -1..-0.5, y -1..-0.5"] == 0.5


def test_a_cell_counts_as_competent_since_half_of_its_goals_are_met_without_interruption():
    curves = Curves(PLANE)
    for movements, share in ((250, 0.5), (500, 0.4), (1000, 0.6), (2000, 1.0)):
        curves.evaluated(movements, {"grid_met/here": share, "grid_met/there": 0.1, "error/mean": 0.2})
    assert curves.since == {"here": 1000}
    assert curves.shares == {"here": 1.0, "there": 0.1}


def test_a_recalled_evaluation_tells_since_when_it_is_competent(tmp_path):
    goals, cell = np.array([[0.2, 0.2]]), "x 0..0.5, y 0..0.5"
    with Board(tmp_path, PLANE) as board:
        board.movements = 250
        board.evaluation(goals, np.array([0.01]), 0.0)
    with Board(tmp_path, PLANE, replace=True) as board:
        board.movements = 250
        assert board.recall("error", "grid_met", needs=("error/mean",))
        board.movements = 500
        board.evaluation(goals, np.array([0.02]), 0.0)
        assert board.curves.since == {cell: 250}


def test_the_map_says_where_since_when_and_what_is_missing_elsewhere():
    ax, names = Figure().add_subplot(), Grid(PLANE).names
    pictures._since(ax, Grid(PLANE), {names[0]: 0.75, names[7]: 0.25}, {names[0]: 1000})
    texts = {text.get_text(): text.get_position() for text in ax.texts}
    assert texts == {"since\n1000": (-0.75, -0.75), "25%": (-0.25, 0.75)}  # as the names say
    assert (names[0], names[7]) == ("x -1..-0.5, y -1..-0.5", "x -0.5..0, y 0.5..1")
    assert ax.collections[0].get_array()[3, 1] == 0.25


def test_the_names_of_regions_lie_where_they_are_and_are_those_of_the_curves():
    regions = interest_map().regions
    ax = Figure().add_subplot()
    pictures._competence(ax, regions, *sections(PLANE))
    named = branches(regions, 3)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert places.keys() == {path for path in named if not {f"{path}0", f"{path}1"} & named.keys()}
    for path, (x, y) in places.items():
        assert any((r.low <= [x, y]).all() and ([x, y] <= r.high).all() for r in named[path])


def test_runs_can_be_compared_by_settings_and_results(board):
    directory, _ = board
    contents = {
        value.tag: value.metadata.plugin_data.content for event in events_of(directory) for value in event.summary.value
    }
    begun = hparams.parse_session_start_info_plugin_data(contents[hparams.SESSION_START_INFO_TAG])
    assert begun.hparams["seed"].number_value == 0
    assert begun.hparams["goals"].string_value == "interest-map"
    assert begun.hparams["fast"].bool_value is True
    compared = hparams.parse_experiment_plugin_data(contents[hparams.EXPERIMENT_TAG])
    assert [info.name for info in compared.hparam_infos if info.differs] == ["seed"]
    assert {info.name.tag for info in compared.metric_infos} <= curves_of(directory).keys()


def test_a_second_board_in_one_directory_is_refused(tmp_path):
    Board(tmp_path, PLANE).close()
    with pytest.raises(ValueError, match="another directory"):
        Board(tmp_path, PLANE)


def test_a_board_that_replaces_another_leaves_it_alone_until_published(tmp_path):
    with Board(tmp_path, PLANE) as first:
        first.scalars({"error/mean": 1.0})
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with Board(tmp_path, PLANE, replace=True) as second:
        second.scalars({"error/mean": 2.0})
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    with Board(tmp_path, PLANE, replace=True) as third:
        third.publish()
        third.scalars({"error/mean": 3.0})
    assert curves_of(tmp_path)["error/mean"] == {0: 3.0}
    assert before.keys().isdisjoint(path.name for path in tmp_path.iterdir())


@pytest.mark.parametrize("tail", [b"", b"\x10", bytes(100), b"\xff" * 40], ids=["whole", "torn", "zeros", "ones"])
def test_a_torn_or_damaged_end_of_the_old_file_is_left_out(tmp_path, tail):
    with Board(tmp_path, PLANE) as board:
        board.scalars({"error/mean": 1.0})
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes() + tail)
    with Board(tmp_path, PLANE, replace=True) as board:
        board.publish()
        assert board.recall("error")
        assert not board.recall("map")
    assert curves_of(tmp_path)["error/mean"] == {0: 1.0}


def test_a_run_that_is_not_watched_loads_no_tensorboard_and_nothing_else_that_takes_long_to_import():
    program = "import sys, sgimd_torch.runs.run; assert not {'tensorboard', 'torch', 'scipy.stats'} & set(sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {sys.path!r}; {program}"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_board_loads_neither_torch_nor_matplotlib_nor_tensorflow():
    program = "import sys, sgimd_torch.board.writer; print({'torch', 'matplotlib', 'tensorflow'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {sys.path!r}; {program}"], capture_output=True, text=True
    )
    assert done.stdout == "set()\n", done.stderr


OPTIONS = ("--movements", "160", "--evaluate_at", "60,120", "--board", "true")


@pytest.fixture(scope="module")
def watched(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("watched")
    assert go(out, *OPTIONS) == 0
    return out / "sgim-d" / "seed-003"


def test_watching_a_run_changes_no_byte_of_it(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS, "--board", "false") == 0
    assert csv_of(tmp_path / "sgim-d" / "seed-003") == csv_of(watched)


def test_the_curves_of_a_run_are_those_of_its_files(watched):
    curves, read = curves_of(watched), read_run(watched)
    for tag, column in {"mean": "mean_error_m", "p90": "p90_error_m", "noise_floor": "noise_floor_m"}.items():
        expected = dict(zip(read.evaluation["movements"], read.evaluation[column], strict=True))
        assert curves[f"error/{tag}"] == pytest.approx(expected, rel=1e-6)
    first = read.origin[:50]
    for origin in np.unique(first):
        assert curves[f"regime/{origin}"][50] == pytest.approx((first == origin).mean())
    shown = {step: (read.demonstration[:step] >= 0).sum() for step in (50, 100, 150)}
    assert curves["teacher/demonstrations"] == shown
    assert all(picture[2].startswith(b"\x89PNG") for picture in curves["map/error"].values())
    assert curves["map/error"].keys() == {60, 120, 160}  # when the movements have doubled, and at the end


def assert_same_board(resumed, whole, apart=()):
    """Every point of the one is in the other, with the same value unless it is a time."""
    resumed, whole = curves_of(resumed), curves_of(whole)
    assert resumed.keys() - whole.keys() == set()
    for tag in whole:
        family = tag.partition("/")[0]
        if family in apart:
            continue
        assert resumed[tag].keys() == whole[tag].keys(), tag
        if family not in ("time", "_hparams_") and tag not in ("about/settings", "model/ms"):
            assert resumed[tag] == whole[tag], tag


@pytest.mark.parametrize(("signum", "lines"), [(signal.SIGKILL, 110), (signal.SIGINT, 130)])
def test_a_run_that_was_stopped_and_resumed_leaves_the_board_of_one_that_never_was(
    tmp_path, go, benchmark, watched, signum, lines
):
    directory = tmp_path / "sgim-d" / "seed-003"
    process = start(EAGER, *arguments(tmp_path, benchmark), *OPTIONS)
    signal_after(process, directory / "episodes.csv", lines, signum)
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(directory, watched)


@pytest.mark.parametrize("flush_every", [0, 3600])
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_run_killed_while_it_writes_an_evaluation_loses_no_point_of_the_board(
    tmp_path, go, benchmark, watched, when, flush_every
):
    """The kill comes just before or just after the evaluation of movement 120 enters evaluation.csv."""
    directory = tmp_path / "sgim-d" / "seed-003"
    kill = "os.kill(os.getpid(), signal.SIGKILL)"
    before, after = (kill, "pass") if when == "before" else ("pass", kill)
    program = (
        "import os, signal, sys\nfrom sgimd_torch.runs import command_line, directory, run\n"
        "add = directory.Evaluations.add\n"
        "def add_and_die(self, movements, *found):\n"
        f"    if movements == 120: {before}\n"
        "    add(self, movements, *found)\n"
        f"    if movements == 120: {after}\n"
        f"directory.Evaluations.add = add_and_die\nrun.FLUSH_EVERY = {flush_every}\n"
        "sys.exit(command_line.main(sys.argv[1:]))"
    )
    process = start(program, *arguments(tmp_path, benchmark), *OPTIONS)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert (120 in read_run(directory).evaluation["movements"]) == (when == "after")
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(directory, watched)


def test_points_that_an_event_file_lost_are_made_again(tmp_path, go, watched):
    """From every event of the second evaluation on, and without the file."""
    whole = events_of(watched)
    cuts = [k for k, event in enumerate(whole) if event.step == 120] + [len(whole) - 1]
    assert go(tmp_path, *OPTIONS) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    for kept in cuts:
        (path,) = directory.glob("events.out.tfevents.*")
        path.write_bytes(b"".join(records_of(path.read_bytes())[:kept]) + b"torn")
        assert len(list(read_events(path))) == kept
        assert go(tmp_path, *OPTIONS, "--resume") == 0
        assert_same_board(directory, watched)
    (path,) = directory.glob("events.out.tfevents.*")
    path.unlink()
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(directory, watched, apart=("time",))


def records_of(content):
    """Of an event file: length, checksum, event, checksum."""
    records = []
    while content:
        size = 16 + int.from_bytes(content[:8], "little")
        records.append(content[:size])
        content = content[size:]
    return records


def test_two_event_files_that_a_kill_left_give_each_point_once(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    (path,) = directory.glob("events.out.tfevents.*")
    (directory / "events.out.tfevents.007").write_bytes(path.read_bytes())
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(directory, watched)


def test_a_watched_run_made_longer_leaves_the_board_of_a_long_one(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS, "--movements", 130) == 0
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(tmp_path / "sgim-d" / "seed-003", watched)


def test_a_run_that_was_not_watched_gets_its_board_when_it_is_resumed(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS, "--board", "false") == 0
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(tmp_path / "sgim-d" / "seed-003", watched, apart=("time",))  # nobody knows when it was


def test_an_evaluation_that_is_taken_back_leaves_the_board_too(tmp_path, go):
    assert go(tmp_path, *OPTIONS) == 0
    assert go(tmp_path, *OPTIONS, "--evaluate_at", "120", "--resume") == 0
    assert curves_of(tmp_path / "sgim-d" / "seed-003")["error/mean"].keys() == {120, 160}


class Slider:
    """A robot of ``dim`` sliders, whose outcome is their position; a context, if there is one, shifts them."""

    outcome_noise = 0.0

    def __init__(self, dim, context_dim=0):
        self.contexts, self.policies = Box.cube(-0.1, 0.1, context_dim), Box.cube(0, 1, dim)
        self.outcomes, self.rest = Box.cube(0, 1, dim), np.zeros(dim)

    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        return np.asarray(theta) + np.sum(context)


def live_as(out, robot, make, **options):
    """A watched run of a user's robot and learner; returns its directory."""
    config = Config(
        movements=120, evaluate_at=(60,), repeats=0, board=True, out=out, parts={"environment": "planar-arm-7"}
    )
    goals = np.linspace(0.2, 0.9, 5)[:, None].repeat(robot.outcomes.dim, axis=1)
    learner = make(robot, 0, **options)
    alone = {"teacher": None, "demonstrations": [], "model": None, "trust": None}
    parts = dataclasses.replace(
        build(config),
        **{**alone, "environment": robot, "learner": learner, "answers": {"own": LocalInverse(learner.memory)}},
        benchmark=Benchmark("Slider", goals, 0.1),
    )
    with Stopping() as stopping, RunDirectory(parts, resume=False) as directory:
        live_in(directory, parts, stopping)
    return directory.path


@pytest.mark.parametrize(("dim", "context_dim", "cells"), [(1, 0, 16), (3, 0, 8), (2, 0, 16), (2, 1, 16), (6, 0, 1)])
def test_outcomes_of_any_dimension_have_curves_cells_and_pictures(tmp_path, dim, context_dim, cells):
    directory = live_as(tmp_path, Slider(dim, context_dim), sagg_riac)
    curves, read = curves_of(directory), read_run(directory)
    expected = dict(zip(read.evaluation["movements"], read.evaluation["mean_error_m"], strict=True))
    assert curves["error/mean"] == pytest.approx(expected, rel=1e-6)
    assert {"competence/R", "interest/R", "goals/missed_by", "regions/count", "about/regions"} < curves.keys()
    names = [tag.partition("/")[2] for tag in curves if tag.startswith("grid_error/")]
    assert 1 <= len(names) <= cells
    assert all(name.count("..") == dim for name in names)
    assert sum(curves[f"grid_error/{name}"][120] > 0 for name in names) == len(names)
    pictures = {tag for tag in curves if tag.startswith(("map/", "competent/"))}
    wanted = {"map/landed", "map/error", "map/interest", "map/competence"}
    assert pictures == wanted | ({"competent/since"} if dim == 2 else set())
    assert len(read.regions["low_0"])
    assert f"high_{dim + context_dim - 1}" in read.regions


class Halves:
    """A user's goal model; a run knows only its two regions."""

    def __init__(self, contexts, outcomes, rng):
        whole = InterestMap(contexts, outcomes, rng)
        self.sample, self._add = whole.sample, whole.add
        (region,) = whole.regions
        self.regions = region.split(0, 0.5)

    def add(self, context, goal, competence, strategy="autonomous", gain=0.0):
        self.regions = [self.regions[0].extend(np.array(goal), competence, gain, strategy), self.regions[1]]


def test_the_regions_of_any_goal_model_are_shown(tmp_path):
    directory = live_as(tmp_path, Slider(2), sagg_riac, goals=Halves)
    read, curves = read_run(directory), curves_of(directory)
    assert read.regions["path"].tolist() == ["R0", "R1"] * 2
    assert read.regions["goals"][-2] > 0
    assert curves["regions/count"] == {50: 2, 100: 2}
    assert {"competence/R0", "region_size/R1", "map/interest"} < curves.keys()


def test_the_map_of_interest_shows_the_last_hundred_goals(tmp_path):
    robot, made = Slider(2), []

    def make(environment, seed):
        made.append(sagg_riac(environment, seed, budget=1))
        return made[0]

    directory = live_as(tmp_path, robot, make)
    goals = read_run(directory).goals
    goals = goals[np.isfinite(goals).all(axis=1)]
    assert len(np.unique(goals, axis=0)) == len(goals) > 100
    drawn = pictures.draw(
        made[0].autonomous.goals.regions,
        robot.outcomes,
        outcomes=goals,
        goals=goals[-100:],
        demonstrated=np.empty((0, 2)),
        benchmark=goals,
        errors=goals[:, 0],
        cells=Grid(robot.outcomes),
        shares={},
        since={},
    )
    assert curves_of(directory)["map/interest"][120][2] == drawn["map/interest"]


def test_the_cells_of_a_grid_are_shown_and_kept_by_a_resumed_run(tmp_path, go):
    options = (*OPTIONS, "--goals", "grid")
    assert go(tmp_path / "whole", *options) == go(tmp_path / "made_longer", *options, "--movements", 130) == 0
    whole, made_longer = (tmp_path / out / "sgim-d" / "seed-003" for out in ("whole", "made_longer"))
    read, curves = read_run(whole), curves_of(whole)
    assert read.damage == {}
    assert read.regions["path"][:3].tolist() == ["R.0.0", "R.0.1", "R.0.2"]
    assert len(read.regions["path"]) == 300
    assert set(curves["regions/count"].values()) == {100}
    assert {"competence/R", "map/interest", "map/competence", "about/regions"} < curves.keys()
    assert go(tmp_path / "made_longer", *options, "--resume") == 0
    assert csv_of(made_longer) == csv_of(whole)
    assert_same_board(made_longer, whole)


def test_a_learner_without_goals_has_a_board_without_regions(tmp_path):
    directory = live_as(tmp_path, Slider(1), random_exploration)
    assert read_run(directory).regions is None
    assert not [tag for tag in curves_of(directory) if tag.startswith(("regions", "competence", "about/regions"))]
