"""Goals made from runs: near what they reached, from all of them together, for outcomes of any dimension."""

import numpy as np
import pytest

from sgimd_torch.evaluation import SIDES, load_benchmark, tile_side
from sgimd_torch.extras.benchmark.command import main
from sgimd_torch.runs.command import main as live
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Box, stream


def run(*options, movements=300, algorithm="random"):
    words = f"--algorithm {algorithm} --movements {movements} --evaluate-at [] --out runs"
    assert command(live, [*words.split(), *map(str, options)]) == 0


def goals_of(*options):
    assert command(main, [*map(str, options), "--out", "goals.npz"]) == 0
    return load_benchmark("goals.npz")


@pytest.mark.parametrize("dim", [1, 3])
def test_goals_lie_on_tiles_that_were_reached_twice_and_a_run_uses_them(own, capsys, dim):
    robot = ("--environment", f"sliders:Slider{dim if dim > 1 else ''}")
    run(*robot, "--seed", 1)
    run(*robot, "--seed", 2)
    made = goals_of("runs", "--tiles", "20")
    assert "600 movements of 2 runs: goals.npz" in capsys.readouterr().out
    outcomes = np.concatenate([read_run(f"runs/random/seed-00{seed}").outcomes for seed in (1, 2)])
    tiles, goals = (np.floor((points + 1) / made.side) for points in (outcomes, made.goals))
    assert len(np.unique(goals, axis=0)) == len(goals)
    counts = [(tiles == goal).all(axis=1).sum() for goal in goals]
    assert min(counts) >= 2
    _, all_counts = np.unique(tiles, axis=0, return_counts=True)
    assert len(goals) == (all_counts >= 2).sum()  # none is left out
    capsys.readouterr()
    words = "--algorithm random --movements 40 --evaluate-at 20 --out judged --benchmark goals.npz"
    assert command(live, [*robot, *words.split()]) == 0
    assert "has no benchmark goals" not in capsys.readouterr().err
    judged = read_run("judged/random/seed-000")
    assert len(judged.files["benchmark_crc32"]) == 8
    assert judged.evaluations["own"]["movements"].tolist() == [20, 40]


def test_runs_are_named_one_by_one_by_variant_or_all_together_and_the_seed_draws_within_their_tiles(own):
    for seed in (1, 2):
        run("--environment", "sliders:Slider2", "--seed", seed)
    files = []
    for places in (["runs"], ["runs/random"], ["runs/random/seed-002", "runs/random/seed-001", "runs"]):
        goals_of(*places, "--tiles", 20)
        files.append((own / "goals.npz").read_bytes())
    assert files[0] == files[1] == files[2]
    both, one = (goals_of(place, "--tiles", 60) for place in ("runs", "runs/random/seed-001"))
    assert both.side != one.side
    one, other = (goals_of("runs", "--tiles", 20, "--seed", seed) for seed in (3, 4))
    assert (np.floor((one.goals + 1) / one.side) == np.floor((other.goals + 1) / one.side)).all()
    assert not (one.goals == other.goals).any()


def test_the_sides_tried_in_the_plane_of_the_paper_are_five_to_twenty_centimetres():
    """So the command makes the same benchmark of the rod as the script that it replaced."""
    assert (np.linspace(0.05, 0.2, 301) == 2.0 * SIDES).all()
    outcomes = stream(0, "test").uniform(-1, 1, (5000, 2))
    assert tile_side(outcomes, Box.cube(-1, 1, 2), 400) in np.linspace(0.05, 0.2, 301)


@pytest.mark.parametrize(("dim", "most"), [(2, 1.2), (6, 2)])  # 2, 3 or 4 tiles a side of 6
def test_about_as_many_goals_as_wanted_are_made_also_where_little_of_a_large_space_was_reached(dim, most):
    outcomes = stream(0, "test").uniform(-1, 1, (5000, dim))
    for reach in (1.0, 1.5, 100.0):
        box = Box.cube(-reach, reach, dim)
        side = tile_side(outcomes, box, 200)
        _, counts = np.unique(np.floor((outcomes + reach) / side), axis=0, return_counts=True)
        assert 1 / most <= (counts >= 2).sum() / 200 <= most


@pytest.mark.parametrize(
    ("movements", "spread", "tiles", "limit"),
    [
        (1000, 1.0, 20, "no tiles are larger than 0.4"),
        (1000, 0.15, 200, "no tiles are smaller than 0.1"),  # what is reached has room for 49 of them
        (60, 1.0, 358, "tiles smaller than "),  # of 60 movements, hardly two land on one tile
        (1000, 1.0, 200, ""),
    ],
)
def test_what_limits_the_number_of_goals_is_said(own, module, capsys, movements, spread, tiles, limit):
    module("spread", SPREAD.format(spread=spread))
    run("--environment", "spread:Spread", movements=movements)
    capsys.readouterr()
    made = goals_of("runs", "--tiles", tiles)
    said = capsys.readouterr().err
    assert (f"{tiles} goals were requested, and {len(made.goals)} made: {limit}" in said) == bool(limit)
    assert bool(said) == bool(limit)


SPREAD = """
from sliders import *

class Spread(Slider2):
    def execute(self, context, theta, rng):
        return 1 + 2 * {spread} * (2 * theta - 1)  # around the middle of T, whose sides are 4
"""
