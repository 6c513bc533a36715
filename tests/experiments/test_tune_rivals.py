"""The search for settings of the rivals: rows that are resumed, on tuning seeds only."""

import csv

import numpy as np
import pytest

from claims import main as claims
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.runs.process import command
from tune_rivals import COLUMNS, NOBODY, RIVALS, baseline, in_words, main


@pytest.fixture
def tune(benchmark, tmp_path):
    def tune(*options):
        fixed = ("--benchmark", benchmark, "--table", tmp_path / "rivals.csv", "--times", 40, 20, "--processes", 1)
        return command(main, [*map(str, fixed), *map(str, options)])

    return tune


def rows(tmp_path):
    with (tmp_path / "rivals.csv").open(newline="") as file:
        header, *found = csv.reader(file)
    assert tuple(header) == COLUMNS
    return found


def test_each_setting_gets_a_row_for_each_evaluation_and_none_is_run_twice(tune, tmp_path, capsys):
    assert tune("--only", "isoline-again", "--seeds", 1000) == 0
    found = rows(tmp_path)
    wanted = {("isoline-again", f"again={share}", "1000", when) for share in (0.1, 0.2, 0.4) for when in ("20", "40")}
    assert {tuple(row[:4]) for row in found} == wanted
    assert all(0 < float(error) < 2 for row in found for error in row[4:])
    assert capsys.readouterr().out.count(" m, 1 seeds") == 3
    assert tune("--only", "isoline-again", "--seeds", 1000) == 0
    assert rows(tmp_path) == found
    assert capsys.readouterr().err == ""


def test_the_best_so_far_get_more_seeds_and_so_does_the_default(tune, tmp_path, capsys):
    table = [("isoline-again", f"again={share}", 1000, 40, error, error) for share, error in ((0.1, 0.3), (0.2, 0.2))]
    lines = [",".join(COLUMNS), *(",".join(map(str, row)) for row in table)]
    (tmp_path / "rivals.csv").write_text("\n".join(lines) + "\n")
    assert tune("--only", "isoline-again", "--seeds", 1001, "--best", 1) == 0
    assert {tuple(row[1:3]) for row in rows(tmp_path)[2:]} == {("again=0.2", "1001")}
    best, second = capsys.readouterr().out.splitlines()
    assert "again=0.2" in best
    assert "2 seeds" in best
    assert tune("--only", "isoline-again", "--seeds", 1001, "--best", 1) == 0  # the new rows do not change the choice
    assert len(rows(tmp_path)) == 4
    assert "again=0.1" in second


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


def test_the_page_lists_settings_the_best_first_and_the_default_in_bold(tmp_path):
    rows = [
        ("isoline", setting, seed, when, error, error + 0.01)
        for setting, error in (("default", 0.06), ("sd=0.01", 0.05), ("sd=0.05", 0.07))
        for seed in (1000, 1001)
        for when in (1000, 5000)
    ]
    rows.append(("isoline", "sd=0.01", 1002, 5000, 0.07, 0.08))
    (tmp_path / "rivals.csv").write_text("\n".join(",".join(map(str, row)) for row in (COLUMNS, *rows)) + "\n")
    assert command(claims, ["--results", str(tmp_path), "--out", str(tmp_path / "pages"), "--only", "RIVALS"]) == 0
    lines = (tmp_path / "pages/RIVALS.md").read_text().splitlines()
    assert [line for line in lines if line.startswith("| `isoline`")] == [
        "| `isoline` | `sd=0.01` | 0.0500 | 0.0600 | 0.0500 | 0.0600 | 0.0700 | 0.0800 |",
        "| `isoline` | **default** | 0.0600 | 0.0700 | 0.0600 | 0.0700 | - | - |",
        "| `isoline` | `sd=0.05` | 0.0700 | 0.0800 | 0.0700 | 0.0800 | - | - |",
    ]
