"""The search for settings of the rivals: rows that are resumed, on tuning seeds only."""

import numpy as np
import pytest

from made_up import write
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.runs.process import command
from table import read_table
from tune_rivals import NOBODY, RIVALS, baseline, in_words, main


@pytest.fixture
def tune(benchmark, tmp_path):
    def tune(*options):
        fixed = ("--benchmark", benchmark, "--results", tmp_path, "--times", 40, 20, "--processes", 1)
        return command(main, [*map(str, fixed), *map(str, options)])

    return tune


def rows(tmp_path):
    return read_table(tmp_path, "rivals.csv").to_dict("records")


def test_each_setting_gets_a_row_for_each_evaluation_and_none_is_run_twice(tune, tmp_path, monkeypatch):
    few = RIVALS["isoline"]._replace(settings=[{}, {"sd": 0.01}])
    monkeypatch.setitem(RIVALS, "isoline", few)
    assert tune("--only", "isoline", "--seeds", 1000) == 0
    found = rows(tmp_path)
    wanted = {(setting, 1000, when) for setting in ("default", "sd=0.01") for when in (20, 40)}
    assert {(row["setting"], row["seed"], row["movements"]) for row in found} == wanted
    assert all(0 < row[answer] < 2 for row in found for answer in ("linear", "process"))
    assert tune("--only", "isoline", "--seeds", 1000) == 0
    assert rows(tmp_path) == found


def test_the_best_so_far_get_more_seeds_and_so_does_the_default(tune, tmp_path, capsys):
    table = [("isoline", f"sd={sd}", 1000, 40, error, error) for sd, error in ((0.01, 0.3), (0.05, 0.2))]
    write(tmp_path, table, "rivals.csv")
    for _ in range(2):  # the new rows do not change the choice
        assert tune("--only", "isoline", "--seeds", 1001, "--best", 1) == 0
        assert {row["setting"] for row in rows(tmp_path) if row["seed"] == 1001} == {"default", "sd=0.05"}
    assert "sd=0.05" in capsys.readouterr().out


def test_seeds_that_learners_are_judged_by_are_refused(tune, tmp_path, capsys):
    assert tune("--seeds", "0-1") == 2
    assert "seeds must be 1000 or more, got 0" in capsys.readouterr().err
    assert not (tmp_path / "rivals.csv").exists()


@pytest.mark.parametrize("name", RIVALS)
def test_every_setting_makes_a_learner_and_has_a_name_of_its_own(name):
    rod, rival = FishingRod(threads=1), RIVALS[name]
    taught = {} if rival.teacher is NOBODY else {"correspondence": rod.primitive.correspondence}
    for setting in rival.settings:
        learner = rival.make(rod, 1000, **taught, **setting)
        if taught:
            learner.watch(load_demonstrations()[0])
        move = learner.ask(np.zeros(0))
        assert rod.policies.contains(move.theta)
        assert (move.origin == "imitate") == bool(taught)
    names = [in_words(setting) for setting in rival.settings]
    assert len({*names}) == len(names) > 2


def test_the_baseline_is_that_of_the_variants():
    learner = baseline(FishingRod(threads=1), 0, correspondence=FishingRod(threads=1).primitive.correspondence)
    parts = learner.autonomous
    assert [type(part).__name__ for part in (parts.goals, parts.inverse)] == ["UniformGoals", "NearestNeighbour"]
