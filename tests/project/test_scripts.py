"""The scripts: when setup installs, what demonstrators 1 and 2 show, and which options are refused."""

import os
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest

import bench
import check_physics
import make_benchmark
import make_demonstrations
import make_teachers
import mutants
from sgimd_torch.algorithms.paper import random_exploration, sagg_riac, sgim_d
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import load_benchmark, tile_goals
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, stream
from sgimd_torch.teachers import PeriodicTeacher


def go(script, options):
    """Run a script with these options."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["script", *shlex.split(options)])
        return script.main()


@pytest.mark.parametrize(
    ("script", "options"),
    [
        *((make_benchmark, f"--{name} 0") for name in ("movements", "runs", "tiles", "processes")),
        (make_benchmark, "--seed -1"),
        (make_benchmark, "--runs 1.5"),
        (make_benchmark, "--out nowhere/benchmark.npz"),
        (make_demonstrations, "--n -3"),
        (make_demonstrations, "--n 11 --candidates 10"),
        (make_demonstrations, "--n 10 --candidates 10"),  # some recordings land outside T
        (make_demonstrations, "--candidates 0"),
        (make_demonstrations, "--seed -1"),
        (make_demonstrations, "--out nowhere/demonstrations.npz"),
        *((make_teachers, f"--{name} 0") for name in ("n", "runs", "movements", "processes")),
        (make_teachers, "--seed -1"),
        (make_teachers, "--out nowhere"),
        (make_teachers, "--runs 1 --processes 1 --movements 5 --n 6"),  # too few movements
        (mutants, "nowhere"),
        (mutants, "--commit nowhere"),
        (check_physics, "--movements 0"),
        (bench, "--rounds 0"),
        (bench, "--movements 0"),
        (bench, "--only nothing"),
        (bench, "--against nowhere"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_written(tmp_path, monkeypatch, capsys, script, options):
    monkeypatch.chdir(tmp_path)
    out = {bench: "", check_physics: "", mutants: "", make_teachers: "--out . "}.get(script, "--out out.npz ")
    with pytest.raises(SystemExit) as end:
        go(script, out + options)
    assert end.value.code == 2
    assert "error: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def lived(algorithm, seed, movements):
    """The memory of a learner after its movements, without a run on disk."""
    rod, teacher = FishingRod(threads=1), PeriodicTeacher(load_demonstrations(), stream(seed, "teacher"))
    taught = {"correspondence": rod.primitive.correspondence} if algorithm is sgim_d else {}
    learner = algorithm(rod, seed, **taught)
    for _ in run(learner, rod, seed, movements=movements, teacher=teacher if taught else None):
        pass
    return learner.memory


def test_the_benchmark_is_a_goal_in_each_tile_that_the_three_learners_reached(tmp_path):
    go(make_benchmark, f"--out {tmp_path}/b.npz --runs 1 --movements 40 --seed 2007 --tiles 20")
    outcomes = np.concatenate(
        [lived(algorithm, 2007, 40).outcomes for algorithm in (random_exploration, sagg_riac, sgim_d)]
    )
    box = Box.cube(-1, 1, 2)

    def goals(side):
        return tile_goals(outcomes, box, side, stream(2007, "benchmark"))

    side = min(np.linspace(0.05, 0.2, 301), key=lambda side: abs(len(goals(side)) - 20))
    made = load_benchmark(tmp_path / "b.npz")
    assert (made.environment, made.side) == ("FishingRod", side)
    np.testing.assert_array_equal(made.goals, goals(side))
    assert [path.name for path in tmp_path.iterdir()] == ["b.npz"]


@pytest.fixture(scope="module")
def pool():
    """The exemplars with outcomes in T of two SAGG-RIAC learners after 30 movements each."""
    memories = [lived(sagg_riac, seed, 30) for seed in (4000, 4001)]
    thetas = np.concatenate([memory.thetas for memory in memories])
    outcomes = np.concatenate([memory.outcomes for memory in memories])
    inside = FishingRod().outcomes.contains(outcomes)
    return thetas[inside], outcomes[inside]


@pytest.fixture(scope="module")
def teachers(tmp_path_factory):
    """Demonstrations of demonstrators 1 and 2, made from the learners of ``pool``."""
    out = tmp_path_factory.mktemp("teachers")
    go(make_teachers, f"--out {out} --n 5 --runs 2 --movements 30 --processes 1")
    assert sorted(path.name for path in out.iterdir()) == ["demonstrator_1.npz", "demonstrator_2.npz"]
    return {number: load_demonstrations(out / f"demonstrator_{number}.npz", n_joints=6) for number in (1, 2)}


def rows_of(demonstrations, thetas):
    """Rows of ``thetas`` that the recordings show, by the correspondence of the learner."""
    primitive = FishingRod().primitive
    translated = np.stack([primitive.correspondence(lesson.times, lesson.trajectory) for lesson in demonstrations])
    distances = np.abs(translated[:, None] - thetas).max(axis=2)
    assert (distances.min(axis=1) < 1e-6).all()
    return distances.argmin(axis=1)


def test_the_naive_demonstrator_shows_what_it_remembers(pool, teachers):
    thetas, outcomes = pool
    rows = rows_of(teachers[1], thetas)
    assert len(set(rows)) == 5
    np.testing.assert_array_equal([lesson.outcome for lesson in teachers[1]], outcomes[rows])


def test_the_careful_demonstrator_shows_one_movement_of_a_tile(pool, teachers):
    thetas, outcomes = pool
    rows = rows_of(teachers[2], thetas)
    tiles = make_teachers.on_tiles(outcomes, 5)
    assert sorted(np.concatenate(tiles)) == list(range(len(outcomes)))
    chosen = [next(k for k, tile in enumerate(tiles) if row in tile) for row in rows]
    assert len(set(chosen)) == 5
    assert np.ptp(outcomes[rows], axis=0).min() > 0.5 * np.ptp(outcomes, axis=0).min()  # spread over the reached places


def test_of_several_movements_the_one_that_lands_most_alike_is_the_most_reliable():
    scattered, steady = [[0.0, 0.0], [1.0, 0.0], [0.2, 0.0]], [[0.0, 0.1], [0.0, 0.3], [0.0, 0.4]]
    best, outcome = make_teachers.most_reliable(np.stack([scattered, steady], axis=1))
    assert best == 1
    np.testing.assert_array_equal(outcome, [0.0, 0.3])  # nearest the mean, 0.267


def test_executed_again_without_noise_movements_land_where_they_did(pool):
    rod = FishingRod(noise=0.0)
    landed = make_teachers.execute_again(rod, pool[0][:2], stream(0, "test"))
    assert landed.shape == (make_teachers.EXECUTIONS, 2, 2)
    assert np.ptp(landed, axis=0).max() == 0
    assert np.ptp(make_teachers.execute_again(FishingRod(), pool[0][:2], stream(0, "test")), axis=0).min() > 0


INTERPRETER = """#!/usr/bin/env bash
# A fake Python: its venv is one file, and its pip takes 0.3 s and notes its arguments.
case "$1 $2" in
"-m venv") rm -rf "$4" && mkdir -p "$4/bin" && cp "$0" "$4/bin/python" && echo "venv" >>"$NOTES" ;;
"-m pip") sleep 0.3 && echo "${@: -3:1}" >>"$NOTES" && exit "${PIP_FAILS:-0}" ;;
*) exec "PYTHON" "$@" ;;
esac
"""


@pytest.fixture
def setup(tmp_path):
    """A function that starts scripts/setup in a new checkout, and returns what has been installed there so far."""
    root, notes, python = tmp_path / "a checkout", tmp_path / "notes", tmp_path / "python"
    (root / "scripts").mkdir(parents=True)
    for name in ("scripts/setup", "pyproject.toml", "constraints.txt"):
        shutil.copy(bench.HERE / name, root / name)
    python.write_text(INTERPRETER.replace("PYTHON", sys.executable))
    python.chmod(0o755)
    notes.touch()

    def start(*wishes, wanted=0, **environment):
        environment = {**os.environ, "PYTHON": str(python), "NOTES": str(notes), **environment}
        command = [str(root / "scripts/setup")]
        processes = [subprocess.Popen([*command, *wish.split()], env=environment) for wish in wishes]
        assert [process.wait() for process in processes] == [wanted] * len(wishes)
        return notes.read_text().split()

    start.stamp = root / ".venv/setup-stamp"
    return start


DEMO, ALL = ".[plot,report]", ".[all,dev]"  # what setup gives to pip


def test_setup_installs_what_is_missing_and_everything_serves_the_demo(setup):
    assert setup("demo") == setup("demo") == ["venv", DEMO]
    assert setup("") == setup("demo") == setup("") == ["venv", DEMO, ALL]
    (setup.stamp.parents[1] / "constraints.txt").write_text("numpy==2.0\n")  # another list of requirements
    assert setup("") == ["venv", DEMO, ALL, ALL]


def test_of_several_setups_at_once_one_installs_and_another_word_is_refused(setup):
    assert setup("demo", "demo", "demo") == ["venv", DEMO]
    assert setup("demos", wanted=2) == ["venv", DEMO]


def test_an_installation_cut_short_starts_afresh_and_one_that_failed_goes_on(setup):
    assert setup("demo", wanted=3, PIP_FAILS="3") == ["venv", DEMO]
    assert setup("demo") == ["venv", DEMO, DEMO]
    setup.stamp.write_text(setup.stamp.read_text().splitlines()[0] + "\ninstalling\n")
    assert setup("demo")[3:] == ["venv", DEMO]


@pytest.mark.slow
def test_the_bench_compares_two_commits_side_by_side(capsys, monkeypatch):
    measurements, movements = bench.PARTS["learning"]
    monkeypatch.setitem(bench.PARTS, "learning", (measurements[1:2], movements))  # one learner is enough
    assert go(bench, "--only learning run --rounds 1 --movements 20 --against HEAD") == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["here", "there", "here/there"]
    assert len(lines) == 4 * 3 + 1 + 3
    for line in lines:
        ours, theirs, ratio = map(float, line.split()[-3:])
        assert ours > 0
        assert ratio == pytest.approx(ours / theirs, rel=0.01)


def test_smaller_time_steps_of_the_rod_land_nearer_to_the_smallest(capsys):
    assert go(check_physics, "--time-steps --movements 10") == 0
    table = np.array([[float(cell) for cell in line.split()] for line in capsys.readouterr().out.splitlines()[1:]])
    assert table[:, 0].tolist() == [10, 5, 2, 1]
    assert (table[:-1, [1, 4]] > 1.5 * table[1:, [1, 4]]).all()  # the medians
    assert table[0, 1] < 0.037  # the noise
