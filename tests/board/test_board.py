"""The board: what its curves count, what its file holds, and that a resumed run leaves one continuous board."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_rel
from tensorboardX import summary

from boards import ANY_OUTCOMES, board_of, board_of_any, curves_of, hparams_of
from marks import slow
from runs import content_of
from sgimd_torch.board.curves import Behaviour, Places, evaluation_curves, region_curves, tiles_of
from sgimd_torch.board.legend import LEGEND
from sgimd_torch.board.listener import EventFile
from sgimd_torch.board.listener import hparams_of as columns_of
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, Evaluation, evaluate, grid_over, save_benchmark
from sgimd_torch.options.config import Config
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, Demonstration, Episode, Move, Request
from worlds import interest_map, problem

GOAL, NEAR, FAR = np.array([0.5, 0.5]), np.array([0.5, 0.51]), np.array([0.5, 0.9])  # near: within the tolerance
SHOWN = Demonstration(np.zeros(0), np.arange(2.0), np.zeros((2, 1)), np.array([-0.5, 0.5]))


def movement(index, goal, outcome, origin="local", demonstration=None):
    return Episode(index, np.zeros(0), Move(np.zeros(1), goal, origin), outcome, demonstration)


def evaluation(errors):
    """Of goals that were missed by ``errors``; nothing else is known."""
    errors = np.array(errors)
    nothing = np.full((len(errors), 0), np.nan)
    unknown = np.full(len(errors), np.nan)
    return Evaluation(errors, nothing, nothing, np.full(len(errors), 0.01), nothing, errors < 0, unknown)


PLANE = Box.cube(-2, 2, 2)


def behaviour_of(*movements, at_once=1):
    """The behaviour after these movements, each a tuple (goal, outcome, origin, demonstration); the last may lack."""
    behaviour = Behaviour(PLANE, 0.02, at_once)
    for index, told in enumerate(movements):
        behaviour.episode(movement(index, *told))
    return behaviour


@pytest.mark.parametrize(
    ("at_once", "movements", "reached"),
    [
        (1, [(GOAL, FAR), (GOAL, NEAR), (GOAL, FAR), (-GOAL, FAR)], 1 / 2),  # once, by its nearest outcome
        (1, [(GOAL, FAR), (-GOAL, FAR), (GOAL, NEAR), (-GOAL, FAR)], 1 / 4),
        (2, [(GOAL, FAR), (-GOAL, FAR), (GOAL, NEAR), (-GOAL, FAR)], 1 / 2),  # robots that move at once share no goal
        (1, [(GOAL, NEAR, "global")], None),  # global exploration aims at none
        (1, [(GOAL, NEAR), (SHOWN.outcome, FAR, "imitate")], 1),  # an imitation has no goal of the learner's own
    ],
)
def test_a_goal_counts_once_and_as_reached_when_one_of_its_movements_came_near(at_once, movements, reached):
    values = behaviour_of(*movements, at_once=at_once).curves()
    assert values.get("goals/reached") == reached
    if reached == 1 / 2:
        assert values["goals/missed_by"] == pytest.approx((0.01 + np.hypot(1, 1.4)) / 2)


def test_imitations_count_for_the_teacher():
    imitated = SHOWN.outcome, SHOWN.outcome * 1.2, "imitate", SHOWN
    values = behaviour_of((GOAL, NEAR), imitated, (SHOWN.outcome, SHOWN.outcome * 1.4, "imitate")).curves()
    assert values["teacher/demonstrations"] == 1
    assert values["teacher/missed_by"] == pytest.approx(0.3 * np.sqrt(0.5))


def test_shares_of_kinds_of_movements_sum_to_one_and_a_kind_that_was_seen_keeps_its_curve():
    behaviour = behaviour_of(*((GOAL, FAR, origin) for origin in ("global", "local", "local", "imitate")))
    assert behaviour.curves().items() >= {"kind/global": 0.25, "kind/local": 0.5, "kind/imitate": 0.25}.items()
    behaviour.episode(Episode(4, np.zeros(0), None, None, None))
    values = {tag: value for tag, value in behaviour.curves().items() if tag.startswith("kind/")}
    assert values == {"kind/global": 0, "kind/local": 0, "kind/imitate": 0, "kind/rest": 1}


def test_requests_are_counted_by_strategy():
    behaviour = Behaviour(PLANE, 0.02)
    for index, (strategy, reply) in enumerate([("imitate ann", "shown"), ("imitate ben", "again"), ("", ""), ("", "")]):
        request = Request(strategy[-3:], GOAL, strategy) if strategy else None
        behaviour.episode(Episode(index, np.zeros(0), Move(np.zeros(1), GOAL, "local"), FAR, None, request, reply))
    values = behaviour.curves()
    assert values["strategy/imitate ann"] == values["strategy/imitate ben"] == 0.25
    assert values["teacher/replies"] == 1
    behaviour.episode(movement(8, GOAL, FAR))
    assert behaviour.curves()["strategy/imitate ann"] == 0


def test_regions_count_and_have_the_means_over_the_goals_that_they_remember():
    regions = interest_map().regions
    values = region_curves(regions)
    assert values["regions/count"] == len(regions) > 1
    assert values["regions/competence"] == pytest.approx(np.concatenate([r.competences for r in regions]).mean())
    interests = np.concatenate([np.full(len(region.goals), region.interest()) for region in regions])
    assert values["regions/interest"] == pytest.approx(interests.mean())


def test_a_tile_has_the_mean_competence_of_its_goals_and_the_name_of_its_place():
    goals = np.array([[-0.9, 0.1], [-0.6, 0.4], [1.0, 1.0], [0.0, 0.0]])
    places = Places(Benchmark("Any", goals, 0.1), problem(outcomes=Box.cube(-1, 1, 2, names=("x", "y"))))
    values = places.curves(np.array([0.0, np.hypot(0.6, 0.4) / 2, 9.0, 0.005]))
    assert values == pytest.approx(
        {
            "competence/x -1..-0.5, y 0..0.5": -0.25,
            "competence/x 0..0.5, y 0..0.5": -0.25,  # at rest, where eq. (7) divides by the tolerance
            "competence/x 0.5..1, y 0.5..1": -1,  # no worse, however far
            "competence/mean": -0.4375,
        }
    )
    places.add([np.array([-0.9, 0.14]), np.array([0.0, 0.06])])
    assert places.coverage == 0.25


def test_the_share_of_goals_met_is_counted():
    values = evaluation_curves(evaluation([0.01, 0.2, 0.05, 0.0]), 0.05)
    assert values["goals/met"] == 0.75
    assert values["error/mean"] == pytest.approx(0.065)


def test_earlier_event_files_stay_until_the_replay_is_over(tmp_path):
    def told(*points, begins_after=0):
        file = EventFile(tmp_path)
        for n, (step, value) in enumerate(points):
            if n == begins_after:
                file.begin()
            file.add(step, summary.scalar("error/mean", value))
        return file

    told((50, 1.0)).close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    told((50, 3.0), begins_after=1).close()  # stopped within the replay
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    third = told((50, 3.0), (100, 4.0), begins_after=1)
    third.flush()
    assert curves_of(tmp_path) == {"error/mean": {50: 3.0, 100: 4.0}}
    third.close()
    assert before.keys().isdisjoint(
        path.name for path in tmp_path.iterdir()
    )  # otherwise an open TensorBoard ignores it


SIX = ("random", "sagg-riac", "sgim-d", "practice", "practice-taught", "sagg-riac-letter")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_of_two_learners_the_one_that_errs_less_has_the_higher_curves(seed):
    """At goals that the curves do not know, by tile: where errors differ by a fifth, and by more than chance."""
    errors, curves, movements = {}, {}, 300
    for algorithm in SIX:
        parts = build(Config(algorithm=algorithm, seed=seed, parts={"environment": "planar-arm-7"}))
        learner, arm, benchmark = parts.learner, parts.environment, parts.benchmark
        for _ in run(learner, arm, seed, movements=movements, teacher=parts.teacher):
            pass
        evaluation = evaluate(learner.inverse, arm, benchmark.goals, seed, movements, repeats=0)
        curves[algorithm] = Places(benchmark, learner.problem).curves(evaluation.errors)
        goals = grid_over(arm.outcomes, (24, 24))
        goals = goals[arm.reachable(goals)]
        missed = evaluate(learner.inverse, arm, goals, seed + 1, movements, repeats=0).errors
        tiles = {f"competence/{place}": inside for place, inside in tiles_of(goals, arm.outcomes).items()}
        tiles["competence/mean"] = np.full(len(goals), True)
        errors[algorithm] = {tag: missed[inside] for tag, inside in tiles.items()}
    higher = {
        (less, more, tag): curves[less][tag] > curves[more][tag]
        for less, more in permutations(SIX, 2)
        for tag in curves["random"]
        if errors[less][tag].mean() < 0.8 * errors[more][tag].mean()
        and ttest_rel(errors[less][tag], errors[more][tag]).pvalue < 0.05
    }
    assert all(is_so for (_, _, tag), is_so in higher.items() if tag == "competence/mean")
    assert len(higher) > 200
    assert np.mean([*higher.values()]) > 0.97


OPTIONS = ("--movements", "160", "--evaluate_at", "60,120", "--board", "true")


@pytest.fixture(scope="module")
def watched(tmp_path_factory, go):
    out = tmp_path_factory.mktemp("watched")
    assert go(out, *OPTIONS) == 0
    return out / "sgim-d" / "seed-003"


def test_the_curves_of_a_run_are_those_of_its_record(watched):
    curves, read = curves_of(watched), read_run(watched)
    for tag, column in {"mean": "mean_error", "p90": "p90_error"}.items():
        expected = dict(zip(read.evaluation["movements"], read.evaluation[column], strict=True))
        assert curves[f"error/{tag}"] == pytest.approx(expected, rel=1e-6)
    shares = read.evaluation["goals_met"] / len(read.benchmark)
    assert curves["goals/met"] == pytest.approx(dict(zip(read.evaluation["movements"], shares, strict=True)))
    first = read.origin[:50]
    for origin in np.unique(first):
        assert curves[f"kind/{origin}"][50] == pytest.approx((first == origin).mean())
    shown = {step: (read.demonstration[:step] >= 0).sum() for step in (50, 100, 150)}
    assert curves["teacher/demonstrations"] == shown
    assert curves["regions/interest"].keys() == curves["time/physics"].keys() == {50, 100, 150}
    assert curves["competence/x 0..0.5, y 0.5..1"].keys() == curves["error/mean"].keys()


@pytest.mark.filterwarnings("ignore:The inplace keyword:DeprecationWarning")  # of tbparse 0.0.9, in pandas 3.1
def test_other_readers_find_every_curve(watched):
    found = pytest.importorskip("tbparse").SummaryReader(str(watched)).scalars
    assert set(found.tag) == curves_of(watched).keys()
    assert {"error/mean", "goals/met", "competence/mean"} < set(found.tag)


def test_every_tag_is_explained_in_the_file_with_its_unit_and_in_the_legend(watched):
    board = board_of(watched)
    for tag in board.Tags()["scalars"]:
        assert board.SummaryMetadata(tag).summary_description
    assert "(m)" in board.SummaryMetadata("error/mean").summary_description
    (page,) = board.Tensors("about/legend/text_summary")
    assert all(f"**{tag}" in page.tensor_proto.string_val[0].decode() for tag in LEGEND)


def content(board):
    """The histograms of a board, by tag."""
    return {tag: [(h.step, h.histogram_value) for h in board.Histograms(tag)] for tag in board.Tags()["histograms"]}


def assert_same_board(directory, whole):
    """By tag, step and value; but for seconds, which a replayed movement does not have."""
    found, wanted = (
        {tag: curve for tag, curve in curves_of(each).items() if not tag.startswith("time/")}
        for each in (directory, whole)
    )
    assert found == wanted


def test_runs_whose_parts_or_options_differ_have_different_rows_under_equal_columns():
    changes = {}, {"inverse": "nearest"}, {"search": "perturb"}, {"goals.window": 12}, {"memory": "scan"}
    rows = [columns_of(Config(algorithm="sgim-d", parts=parts)) for parts in changes]
    rows.append(columns_of(Config(algorithm="practice")))
    assert len({tuple(row.values()) for row in rows}) == len(rows)
    assert len({tuple(row) for row in rows}) == 1
    assert rows[3]["changed"] == "goals.window=12"


def test_without_evaluations_there_are_curves_of_the_learners_own_goals_and_of_failures(own):
    directory = Path("runs/practice/seed-000")
    words = "--environment planar-arm-7 --algorithm practice --movements 150 --evaluate-at [] --board true --out runs"
    assert command(main, words.split()) == 0
    curves, goals = curves_of(directory), read_run(directory).own_goals()
    for movements in (50, 100, 150):
        assert curves["goals/missed_by"][movements] == pytest.approx(np.median(goals.recent_misses(movements)))
    assert not any(tag.startswith("error/") for tag in curves)
    read = read_run(directory)
    near = np.linalg.norm(read.outcomes[:100, None] - read.benchmark, axis=2).min(axis=0)
    arm = PlanarArm(7)
    expected = -np.minimum(1, near / np.linalg.norm(read.benchmark - arm.rest, axis=1)).mean()
    assert curves["competence/mean"][100] == pytest.approx(expected, rel=1e-3)
    assert hparams_of(directory)[1] == ["goals/missed_by"]


SOME = ["practice-taught", "sagg-riac", "random"]
MORE = [slow("practice"), slow("sgim-d")]


@pytest.mark.parametrize("algorithm", [*SOME, *MORE])
def test_a_board_changes_no_byte_of_its_run_and_shows_it_from_the_first_movement_also_after_a_resume(own, algorithm):
    """Histograms, too."""
    save_benchmark("few.npz", Benchmark("PlanarArm", np.array([[0.5, 0.5], [-0.3, 0.2]]), 0.1))
    words = f"--environment planar-arm-7 --algorithm {algorithm} --repeats 0 --benchmark few.npz --out".split()
    all_of_it = ["--movements", "150", "--evaluate-at", "60,120"]
    assert command(main, [*words, "plain", *all_of_it]) == 0
    assert command(main, [*words, "runs", *all_of_it, "--board", "true"]) == 0
    assert command(main, [*words, "resumed", "--movements", "80", "--evaluate-at", "60"]) == 0
    assert command(main, [*words, "resumed", *all_of_it, "--board", "true", "--resume"]) == 0
    plain, whole, resumed = (Path(out) / algorithm / "seed-000" for out in ("plain", "runs", "resumed"))
    assert content_of(plain) == content_of(whole)
    assert_same_board(resumed, whole)
    assert curves_of(resumed)["time/physics"].keys() == {100, 150}  # nobody knows those of what was replayed
    made = content(board_of(whole))
    assert made.keys() >= {"outcomes/x", "outcomes/y"} | ({"goals/x"} if algorithm != "random" else set())
    assert made == content(board_of(resumed))


@pytest.mark.parametrize("robot", ANY_OUTCOMES)
def test_outcomes_of_any_dimension_or_named_like_a_formula_have_curves(own, module, robot):
    directory = board_of_any(robot, module)
    assert {"error/mean", "competence/mean", "regions/interest", "goals/missed_by"} < curves_of(directory).keys()
