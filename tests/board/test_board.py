"""The board: what its curves count, what its file holds, and that a resumed run leaves one continuous board."""

import signal
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from boards import charts_of, curves_of, values_of
from runs import arguments, content_of, end, stopped_at
from sgimd_torch import InterestMap, stream
from sgimd_torch.board import pictures
from sgimd_torch.board.curves import Behaviour, Competent, Grid, branches, cells_of, of_regions
from sgimd_torch.board.events import EventFile
from sgimd_torch.board.legend import LEGEND
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import Evaluation, load_benchmark
from sgimd_torch.figures.sections import sections
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Box, Demonstration, Episode, Move, Request

PLANE = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m")
GOAL, NEAR, FAR = np.array([0.5, 0.5]), np.array([0.5, 0.51]), np.array([0.5, 0.9])  # near: within the tolerance
SHOWN = Demonstration(np.zeros(0), np.arange(2.0), np.zeros((2, 1)), np.array([-0.5, 0.5]))


def movement(index, goal, outcome, origin="local", demonstration=None):
    return Episode(index, np.zeros(0), Move(np.zeros(1), goal, origin), outcome, demonstration)


def evaluation(errors):
    """Of goals that were missed by ``errors``; nothing else is known."""
    errors = np.array(errors)
    nothing = np.full((len(errors), 0), np.nan)
    return Evaluation(errors, nothing, nothing, np.full(len(errors), 0.01), nothing, errors < 0)


def interest_map(n=400):
    goals = InterestMap(Box.cube(0, 1, 0), PLANE, stream(0, "goals"))
    rng = stream(0, "competence")
    for _ in range(n):
        goal = goals.sample([])
        goals.add([], goal, -rng.random() if goal[0] > 0 else -0.1)
    return goals


def test_a_goal_counts_once_and_as_reached_when_one_of_its_movements_came_near():
    behaviour = Behaviour(tolerance=0.02)
    for index, outcome in enumerate([FAR, NEAR, FAR]):
        behaviour.episode(movement(index, GOAL, outcome))
    behaviour.episode(movement(3, -GOAL, FAR))
    values = behaviour.curves()
    assert values["goals/reached_share"] == 0.5
    assert values["goals/missed_by"] == pytest.approx((0.01 + np.hypot(1, 1.4)) / 2)


def test_imitations_count_for_the_teacher_and_not_as_goals_of_the_learners_own():
    behaviour = Behaviour(0.02)
    behaviour.episode(movement(0, GOAL, NEAR))
    behaviour.episode(movement(1, SHOWN.outcome, SHOWN.outcome * 1.2, "imitate", SHOWN))
    behaviour.episode(movement(2, SHOWN.outcome, SHOWN.outcome * 1.4, "imitate"))
    values = behaviour.curves()
    assert values["goals/reached_share"] == 1
    assert values["teacher/demonstrations"] == 1
    assert values["teacher/missed_by"] == pytest.approx(0.3 * np.sqrt(0.5))


def test_shares_of_regimes_sum_to_one_and_a_regime_that_was_seen_keeps_its_curve():
    behaviour = Behaviour(0.02)
    for index, origin in enumerate(["global", "local", "local", "imitate"]):
        behaviour.episode(movement(index, GOAL, FAR, origin))
    assert behaviour.curves().items() >= {"regime/global": 0.25, "regime/local": 0.5, "regime/imitate": 0.25}.items()
    behaviour.episode(Episode(4, np.zeros(0), None, None, None))
    values = {tag: value for tag, value in behaviour.curves().items() if tag.startswith("regime/")}
    assert values == {"regime/global": 0, "regime/local": 0, "regime/imitate": 0, "regime/rest": 1}


def test_requests_are_counted_by_strategy():
    behaviour = Behaviour(0.02)
    for index, (strategy, reply) in enumerate([("imitate ann", "shown"), ("imitate ben", "again"), ("", ""), ("", "")]):
        request = Request(strategy[-3:], GOAL, strategy) if strategy else None
        behaviour.episode(Episode(index, np.zeros(0), Move(np.zeros(1), GOAL, "local"), FAR, None, request, reply))
    values = behaviour.curves()
    assert (values["strategy/imitate ann"], values["strategy/imitate ben"], values["asked/answered"]) == (0.25, 0.25, 1)
    behaviour.episode(movement(8, GOAL, FAR))
    assert behaviour.curves()["strategy/imitate ann"] == 0


def test_a_region_that_was_cut_goes_on_as_the_mean_over_the_goals_of_its_parts():
    regions = interest_map().regions
    values = of_regions(regions)
    for path in ("R", "R0", "R10"):
        below = [region for region in regions if region.path.startswith(path)]
        assert len(below) > 1
        goals = np.concatenate([region.competences for region in below])
        interests = np.concatenate([np.full(len(region.goals), region.interest()) for region in below])
        assert values[f"competence/{path}"] == pytest.approx(goals.mean())
        assert values[f"interest/{path}"] == pytest.approx(interests.mean())
    assert values["regions/count"] == len(regions)


def test_cells_of_the_grid_hold_each_point_once_the_border_included():
    grid = Grid(PLANE)
    assert len(grid.names) == len(set(grid.names)) == 4
    means = grid.means(np.array([[-1, -1], [1, 1], [0, 0], [0.1, 0.4], [1.1, 0]]), np.array([1.0, 2, 3, 4, 5]))
    assert means == {"x -1..0, y -1..0": 1, "x 0..1, y 0..1": 3}


@pytest.mark.parametrize(("dim", "cells"), [(1, 8), (2, 4), (3, 8)])
def test_a_grid_has_at_most_eight_cells_in_any_dimension(dim, cells):
    grid = Grid(Box.cube(0, 1, dim))
    assert len(grid.names) == cells
    assert all(name.count("..") == dim for name in grid.names)
    with pytest.raises(ValueError, match="points"):
        grid.means(np.full((4, dim + 1), 0.6), np.ones(4))


def test_cells_lie_where_the_goals_of_the_benchmark_do_so_that_task_spaces_of_any_size_have_the_same():
    goals = load_benchmark().goals
    for half_side in (1.0, 10.0, 100.0):
        cells = cells_of(FishingRod(outcomes=Box.cube(-half_side, half_side, 2)).outcomes, goals)
        assert cells.low.tolist() == [-1, -1]
        assert cells.high.tolist() == [1, 1]
    small = cells_of(Box(np.array([0.0, -3, -1]), np.array([0.8, 3, 1])), np.array([[0.1, 0, 0], [0.79, 2.2, 0]]))
    assert small.low.tolist() == [0.1, 0, -1]  # goals that are all alike in a dimension leave all of it
    assert small.high.tolist() == [0.8, 2.5, 1]


def test_the_share_of_goals_met_is_counted_by_place_and_everywhere():
    goals = np.array([[-0.9, -0.9], [-0.8, -0.9], [0.5, 0.5], [0.9, 0.9]])
    competent = Competent(goals, 0.05, PLANE)
    values = competent.curves(evaluation([0.01, 0.2, 0.05, 0.0]))
    assert values["met/everywhere"] == 0.75
    assert {tag: share for tag, share in values.items() if "x" in tag} == {
        "met/x -1..0, y -1..0": 0.5,
        "met/x 0..1, y 0..1": 1,
    }  # and of no place without goals
    assert (values["error/mean"], values["error/noise_floor"]) == pytest.approx((0.065, 0.01))


def test_the_names_of_regions_lie_where_they_are_and_are_those_of_the_curves():
    regions = interest_map().regions
    ax = Figure().add_subplot()
    pictures._competence(ax, regions, *sections(PLANE))
    named = branches(regions, 3)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert places.keys() == {path for path in named if not {f"{path}0", f"{path}1"} & named.keys()}
    for path, (x, y) in places.items():
        assert any((r.low <= [x, y]).all() and ([x, y] <= r.high).all() for r in named[path])


def test_earlier_event_files_stay_until_the_replay_is_over(tmp_path):
    first = EventFile(tmp_path)
    first.begin()
    first.scalars(50, {"error/mean": 1.0})
    first.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    second = EventFile(tmp_path)
    second.scalars(50, {"error/mean": 3.0, "error/noise_floor": np.nan})
    second.close()  # stopped within the replay
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    third = EventFile(tmp_path)
    third.scalars(50, {"error/mean": 3.0, "error/noise_floor": np.nan})
    third.begin()
    third.scalars(100, {"error/mean": 4.0})
    third.flush()
    assert curves_of(tmp_path) == {"error/mean": {50: 3.0, 100: 4.0}}
    third.close()
    assert before.keys().isdisjoint(path.name for path in tmp_path.iterdir())  # else an open TensorBoard ignores it


OPTIONS = ("--movements", "160", "--evaluate_at", "60,120", "--board", "true")


@pytest.fixture(scope="module")
def watched(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("watched")
    assert go(out, *OPTIONS) == 0
    return out / "sgim-d" / "seed-003"


def test_watching_a_run_changes_no_byte_of_it(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS, "--board", "false") == 0
    assert content_of(tmp_path / "sgim-d" / "seed-003") == content_of(watched)


def test_the_curves_of_a_run_are_those_of_its_record(watched):
    curves, read = curves_of(watched), read_run(watched)
    for tag, column in {"mean": "mean_error", "p90": "p90_error", "noise_floor": "noise_floor"}.items():
        expected = dict(zip(read.evaluation["movements"], read.evaluation[column], strict=True))
        assert curves[f"error/{tag}"] == pytest.approx(expected, rel=1e-6)
    first = read.origin[:50]
    for origin in np.unique(first):
        assert curves[f"regime/{origin}"][50] == pytest.approx((first == origin).mean())
    shown = {step: (read.demonstration[:step] >= 0).sum() for step in (50, 100, 150)}
    assert curves["teacher/demonstrations"] == shown
    assert curves["competence/R"].keys() == curves["time/physics"].keys() == {50, 100, 150}
    assert all(picture[2].startswith(b"\x89PNG") for picture in curves["map/error"].values())
    assert curves["map/error"].keys() == {60, 120, 160}  # when the movements have doubled, and at the end


def test_every_tag_is_explained_once_in_the_file_and_in_the_legend(watched):
    explained = [value.tag for _, value in values_of(watched) if value.metadata.summary_description]
    curves = curves_of(watched)
    assert sorted(explained) == sorted(tag for tag in curves if not tag.startswith("custom_scalars"))
    (legend,) = curves["about/legend"].values()
    assert all(f"**{tag}" in legend.decode() for tag in LEGEND)


def test_the_page_of_charts_begins_with_where_it_is_competent_by_places_with_goals(watched):
    first, *others = charts_of(watched).items()
    assert first[0] == "Where is it competent (half of the goals met, within 0.05 m), and since when?"
    places = ("x -0.4..-0.05, y 0.4..0.5", "x -0.05..0.3, y 0.4..0.5", "x -0.05..0.3, y 0.5..0.6")
    assert first[1] == ["met/everywhere", *(f"met/{place}" for place in places)]  # not the one that no goal lies in
    assert [len(tags) for _, tags in others] == [3, 5]


@pytest.mark.parametrize("options", [("--goals", "grid", "--search", "perturb")])
def test_no_chart_is_empty_whatever_the_learner(tmp_path, go, options):
    assert go(tmp_path, "--board", "true", *options) == 0
    ((directory,),) = [list(path.glob("seed-*")) for path in tmp_path.iterdir()]
    tags = [tag for each in charts_of(directory).values() for tag in each]
    assert len(tags) == len(set(tags)) > 5
    assert set(tags) < curves_of(directory).keys()


def assert_same_board(directory, whole):
    """By tag, step and value; but for seconds, which a replayed movement does not have."""
    found, wanted = (
        {tag: curve for tag, curve in curves_of(each).items() if not tag.startswith("time/")}
        for each in (directory, whole)
    )
    for found_settings in (found, wanted):
        found_settings.pop("about/settings")  # which say where the run is
    assert found == wanted


def test_a_run_that_was_killed_and_resumed_has_the_board_of_one_that_never_was(tmp_path, go, benchmark, watched):
    directory = tmp_path / "sgim-d" / "seed-003"
    end(stopped_at(130, *arguments(tmp_path, benchmark), *OPTIONS), signal.SIGKILL)
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    assert_same_board(directory, watched)


def test_a_board_depends_only_on_the_last_request(tmp_path, go, watched):
    assert go(tmp_path, *OPTIONS, "--movements", 130, "--board", "false", "--evaluate_at", "60") == 0
    assert go(tmp_path, *OPTIONS, "--resume") == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    assert_same_board(directory, watched)
    assert curves_of(directory)["time/physics"].keys() == {150}  # nobody knows those of what was replayed


def live_as(robot, *options):
    """A watched run of a user's robot; returns its directory."""
    words = f"--environment sliders:{robot} --algorithm sagg-riac --movements 120 --evaluate-at 60 --repeats 0"
    assert command(main, [*words.split(), "--board", "true", "--out", "runs", *options]) == 0
    return Path("runs/sagg-riac/seed-000")


@pytest.mark.parametrize("robot", ["Slider", "Slider3", "Shifted"])
def test_outcomes_of_any_dimension_have_curves_and_pictures(own, robot):
    curves = curves_of(live_as(robot))
    assert {"error/mean", "competence/R", "interest/R", "goals/missed_by"} < curves.keys()
    assert {tag for tag in curves if tag.startswith("map/")} == {"map/error", "map/competence"}


HALVES = '''
import numpy as np
from sgimd_torch import InterestMap

class Halves:
    """A user's goal model; a run knows only its two regions."""

    def __init__(self, contexts, outcomes, rng):
        whole = InterestMap(contexts, outcomes, rng)
        self.sample, self._add = whole.sample, whole.add
        (region,) = whole.regions
        self.regions = region.split(0, 0.5)

    def add(self, context, goal, competence, strategy="autonomous", gain=0.0):
        self.regions = [self.regions[0].extend(np.array(goal), competence, gain, strategy), self.regions[1]]
'''


def test_the_regions_of_any_goal_model_are_shown(own, module):
    module("halves", HALVES)
    curves = curves_of(live_as("Slider2", "--goals", "halves:Halves"))
    assert curves["regions/count"] == {50: 2, 100: 2}
    assert {"competence/R0", "interest/R", "map/competence"} < curves.keys()
