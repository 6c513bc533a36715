"""CMA-ES as a search: generations around theta of the estimate, and a package that keeps to itself."""

import sys

import numpy as np
import pytest

from sgimd_torch.extras.rivals.cma_es import CmaEs
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.spaces import Box, Estimate, stream
from worlds import World, drive, problem


def test_cma_es_executes_theta_of_the_estimate_first_and_ends_where_all_movements_have_the_same_outcome() -> None:
    world = World(dim=25, k=1)
    world.jacobian = np.zeros((25, 2))
    executed = world.run(CmaEs(world.problem()), 500)
    assert np.array_equal(executed[0], world.theta)
    assert len(executed) < 20


def test_within_the_budget_of_a_goal_small_generations_of_cma_es_come_nearer_than_those_of_the_package() -> None:
    def left(population: int | None) -> float:
        found = []
        for seed in range(30):
            world = World(dim=25, k=1, seed=seed)
            world.goal = world.execute(world.theta) + stream(seed, "goal").normal(0, 0.5, 2)
            executed = world.run(CmaEs(world.problem(seed), population=population), 15)
            found.append(min(map(world.distance, executed)) / world.distance(world.theta))
        return float(np.mean(found))

    # 150 worlds gave .32 of the first distance, and .48 with the package's 13 movements.
    assert left(4) < min(0.4, left(None) - 0.1)


def test_cma_es_writes_nothing_and_takes_no_orders(tmp_path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    world = World(dim=25, k=1)
    first = world.run(CmaEs(world.problem()), 40)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "cma_signals.in").write_text("{'maxfevals': 1}")  # by which the package would take orders
    assert np.array_equal(world.run(CmaEs(world.problem()), 40), first)
    assert capfd.readouterr() == ("", "")


def test_the_first_generation_spreads_by_sd_of_each_side_around_theta_of_the_estimate() -> None:
    policies, theta, n = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0])), np.array([0.4, 6.0]), 200
    start = Estimate(theta, theta[None], np.zeros((1, 1)))
    search = CmaEs(problem(policies=policies), sd=0.02)
    varied = np.array([drive(search(start, np.zeros(1)), lambda x: x[:1], 2)[1] for _ in range(n)])
    # Five standard errors: of the mean sd / sqrt(n), of the standard deviation sd / sqrt(2 n).
    assert (varied.mean(axis=0) - theta) / (0.02 * policies.sides) == pytest.approx([0, 0], abs=5 / np.sqrt(n))
    assert varied.std(axis=0) / policies.sides == pytest.approx([0.02, 0.02], rel=5 / np.sqrt(2 * n))


@pytest.mark.parametrize(
    ("dim", "options", "message"),
    [
        (1, {}, "2 dimensions or more"),
        *((2, {"sd": sd}, "sd") for sd in (0.0, np.nan, np.inf)),
        (2, {"population": 2}, "population"),
    ],
)
def test_a_pi_or_numbers_out_of_range_are_refused(dim, options, message) -> None:
    with pytest.raises(ValueError, match=message):
        CmaEs(problem(policies=Box.cube(0, 1, dim)), **options)


def test_an_entry_that_is_not_installed_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    sys.modules.pop("sgimd_torch.extras.rivals.cma_es", None)
    with pytest.raises(ValueError, match=r"pip install 'sgimd-torch\[rivals\]'"):
        load_word("search", "cma-es")
