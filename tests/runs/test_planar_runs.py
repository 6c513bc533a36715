"""Whole runs on planar arms: the same files as on the rod, goals and a teacher of their own, and what they refuse."""

import re

import numpy as np
import pytest

from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.runs.command import main
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import stream
from sgimd_torch.tasks.robots import arm_benchmark, arm_demonstrations

NO_CONTEXT = np.empty(0)
ALGORITHMS = WORDS["algorithm"]
ARMS = {"planar-arm-7": 7, "planar-arm-50": 50}


SHORT = "--algorithm sgim-d --environment planar-arm-7 --seed 3 --movements 70 --evaluate_at 20,40 --repeats 2"


def live(out, *options):
    """The exit code of a short run; later options win."""
    return command(main, [*SHORT.split(), *map(str, ("--out", out, *options))])


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """A file of three goals for an arm."""
    path = tmp_path_factory.mktemp("goals") / "few.npz"
    save_benchmark(path, Benchmark("PlanarArm", np.array([[0.1, 0.2], [0.5, -0.5], [-0.4, 0.3]]), 0.1))
    return path


LIVES = [*((algorithm, "planar-arm-7") for algorithm in ALGORITHMS), ("practice-taught", "planar-arm-50")]


@pytest.mark.parametrize(("algorithm", "environment"), LIVES)
def test_every_algorithm_lives_and_writes_a_whole_run_directory(tmp_path, few, capsys, algorithm, environment):
    assert live(tmp_path, "--environment", environment, "--algorithm", algorithm, "--benchmark", few) == 0
    directory = tmp_path / algorithm / "seed-003"
    assert f"{directory}: 70 movements, mean error" in capsys.readouterr().out
    assert [path.name for path in directory.iterdir()] == [RUN_FILE]
    run = read_run(directory)
    assert run.index.tolist() == list(range(70))
    assert run.thetas.shape == (70, ARMS[environment])
    assert run.outcomes.shape == (70, 2)
    mapped = algorithm.startswith(("sagg-riac", "sgim-"))
    assert (run.regions is not None) == mapped
    numbers = ("mean_error", "median_error", "p90_error", "noise_floor", "expected_error", "goals_met")
    assert {*run.evaluation} == {"movements", *numbers}
    # Observation and imitation have seen nothing before movement 30, so they have nothing to be evaluated by after 20.
    wanted = [40, 70] if algorithm in ("observation", "imitation") else [20, 40, 70]
    assert run.evaluation["movements"].tolist() == wanted
    *earlier, floor = run.evaluation["noise_floor"]
    assert np.isnan(earlier).all()
    assert floor < 1e-12  # without noise all repetitions end in one point
    for mean, movements in zip(run.evaluation["mean_error"], wanted, strict=True):  # of the errors of all goals
        errors, _ = run.missed_by(movements)
        assert mean == pytest.approx(errors.mean())
        assert len(errors) == len(run.benchmark) == 3
    assert {"seconds_physics", "seconds_learner", "seconds_evaluation"} < set(run.summary)
    assert (run.summary["movements"], run.summary["finished"]) == (70, True)
    assert (run.config["algorithm"], run.config["environment"]) == (algorithm, environment)
    assert {"python", "numpy", "scipy", "faiss", "mujoco", "sgimd_torch", "platform", "commit"} == set(run.versions)
    assert run.files["demonstrations_crc32"] is None
    moved, arm = np.flatnonzero(run.origin != ""), PlanarArm(ARMS[environment])
    for k in moved[-3:]:
        assert np.array_equal(arm.execute(NO_CONTEXT, run.thetas[k], stream(0, "any")), run.outcomes[k])


@pytest.mark.parametrize("n_joints", ARMS.values())
def test_goals_for_an_arm_lie_within_reach_one_a_tile_and_evenly(n_joints):
    arm = PlanarArm(n_joints)
    benchmark = arm_benchmark(arm)
    benchmark.check(arm)
    goals = benchmark.goals
    assert 200 <= len(goals) <= 360
    assert arm.reachable(goals).all()
    tiles = np.floor((goals - arm.outcomes.low) / benchmark.side)
    assert len(np.unique(tiles, axis=0)) == len(goals)
    quadrants = [((goals * signs) > 0).all(axis=1).sum() for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    assert min(quadrants) > 0.9 * len(goals) / 4
    # A quarter of a disc's area lies within half its radius. Of its tiles, only those on the border are left to chance.
    assert abs((np.linalg.norm(goals, axis=1) < 0.5).sum() - len(goals) / 4) < 10
    assert np.array_equal(goals, arm_benchmark(PlanarArm(n_joints)).goals)


def test_rod_and_arm_have_one_task_space_so_that_their_tiles_begin_at_one_corner():
    assert FishingRod().outcomes.low.tolist() == PlanarArm().outcomes.low.tolist() == [-1, -1]
    assert FishingRod().outcomes.high.tolist() == PlanarArm().outcomes.high.tolist() == [1, 1]


@pytest.mark.parametrize("arm", list(map(PlanarArm, ARMS.values())))
def test_demonstrations_for_an_arm_lead_from_rest_to_equal_bends_all_over_its_reach(arm):
    shown = arm_demonstrations(arm)
    assert len(shown) == 127
    for demonstration in shown:
        trajectory = demonstration.trajectory
        assert not trajectory[0].any()
        np.testing.assert_allclose(trajectory[-1, 1:], trajectory[-1, 1], atol=1e-12)
        theta = arm.correspondence(demonstration.times, trajectory)
        np.testing.assert_array_equal(arm.angles(theta), trajectory[-1])
        end = arm.execute(NO_CONTEXT, theta, stream(0, "any"))
        np.testing.assert_allclose(end, demonstration.outcome, atol=1e-14)
    # A 127th of the area is a disc of this radius: neighbours are between one and two such radii apart.
    radius = np.sqrt(1 / 127)
    ends = np.array([demonstration.outcome for demonstration in shown])
    gaps = np.linalg.norm(ends[:, None] - ends, axis=2)[~np.eye(127, dtype=bool)].reshape(127, 126).min(axis=1)
    assert radius < gaps.min() <= gaps.max() < 2 * radius
    far = np.linalg.norm(ends, axis=1)
    assert far.min() < radius
    assert 1 - radius / 4 < far.max() <= 1


def test_own_demonstrations_and_goals_replace_those_of_the_arm(tmp_path, capsys):
    arm = PlanarArm()
    save_demonstrations(tmp_path / "own.npz", arm_demonstrations(arm)[:2])
    own = [each.trajectory.tolist() for each in arm_demonstrations(arm)[:2]]
    save_benchmark(tmp_path / "goals.npz", Benchmark("PlanarArm", np.array([[0.1, 0.2]]), 0.1))
    files = ("--demonstrations", tmp_path / "own.npz", "--benchmark", tmp_path / "goals.npz")
    assert live(tmp_path, *files) == 0
    run = read_run(tmp_path / "sgim-d" / "seed-003")
    assert {*run.demonstration[run.demonstration >= 0].tolist()} == {0, 1}
    assert [each.trajectory.tolist() for each in run.demonstrations] in (own, own[::-1])
    assert run.evaluation["mean_error"].tolist() == run.evaluation["median_error"].tolist()  # of one goal
    assert None not in (run.files["benchmark_crc32"], run.files["demonstrations_crc32"])
    assert "2 demonstrations" in capsys.readouterr().err
    assert live(tmp_path, "--algorithm", "random", "--movements", 5, "--evaluated-by", "own") == 0
    run = read_run(tmp_path / "random" / "seed-003")
    assert run.benchmark.tolist() == arm_benchmark(arm).goals.tolist()
    assert run.files["benchmark_crc32"] is run.files["demonstrations_crc32"] is None


def test_goals_of_another_robot_are_refused(tmp_path, benchmark, capsys):
    assert live(tmp_path / "out", "--benchmark", benchmark) == 2
    errors = capsys.readouterr().err
    assert re.search("the benchmark was made for the class FishingRod .* got PlanarArm", errors)
    assert "Traceback" not in errors
    assert not (tmp_path / "out").exists()
