"""The table of the results of runs."""

import csv
import io
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from pages import rows_of as table_of
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.extras.report import command as report
from sgimd_torch.extras.table import variants
from sgimd_torch.extras.table.command import main
from sgimd_torch.extras.table.results import print_table
from sgimd_torch.runs.command import main as live
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

FEW = "fewer than 5 seeds, too few for an interval: sgim-d (1)\n"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "tiny.npz"
    save_benchmark(path, Benchmark("FishingRod", np.array([[0.0, 0.6], [0.3, 0.5]]), 0.1))
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory, tiny):
    out = tmp_path_factory.mktemp("runs")
    for algorithm, seed in (*(("random", seed) for seed in range(5)), ("sgim-d", 0)):
        options = f"--algorithm {algorithm} --seed {seed} --movements 40 --repeats 2 --evaluate_at 20"
        assert live([*options.split(), "--benchmark", str(tiny), "--out", str(out)]) == 0
    return out


@pytest.fixture
def copied(runs, tmp_path):
    return shutil.copytree(runs, tmp_path / "runs")


def table(*options):
    """The exit code."""
    return command(main, [str(option) for option in options])


def rows_of(said):
    """Cells of a table by head, for each variant."""
    head, *lines = [re.split(r"  +", line) for line in said.splitlines()]
    return {line[0]: dict(zip(head, line, strict=True)) for line in lines}


@pytest.mark.usefixtures("undrawn")
def test_numbers_are_interquartile_means_with_intervals_if_there_are_five_seeds_as_in_a_report(runs, capsys):
    assert table(runs, "--at", 40) == 0
    said = capsys.readouterr()
    rows = rows_of(said.out)
    for head, column in (("error (m)", "mean_error"), ("median (m)", "median_error")):
        errors, few = (
            np.array([read_run(path).evaluations["own"][column][-1] for path in sorted((runs / name).iterdir())])
            for name in ("random", "sgim-d")
        )
        middle = np.sort(errors)[1:-1].mean()  # of five seeds, the best and the worst are left out
        low, high = map(float, re.fullmatch(rf"{middle:.3f} \[(.*), (.*)\]", rows["random"][head]).groups())
        assert errors.min() - 5e-4 <= low <= middle <= high <= errors.max() + 5e-4
        assert rows["sgim-d"][head] == f"{few[0]:.3f}"
    assert [(row["seeds"], row["movements"]) for row in (rows["random"], rows["sgim-d"])] == [("5", "40"), ("1", "40")]
    assert said.err == FEW
    assert report.main([str(runs), "--out", str(runs / "page.html")]) == 0
    head, *shown = table_of((runs / "page.html").read_text(), "Errors")
    errors = [row[head.index("error (m)")] for row in shown[::-1]]
    assert errors == [row["error (m)"] for row in rows.values()]
    assert head[1:] == list(rows["random"])[1:]


def test_csv_has_all_digits_and_columns_of_the_ends_of_intervals(runs, capsys):
    assert table(runs, "--at", 40, "--format", "csv") == 0
    rows = {row["variant"]: row for row in csv.DictReader(io.StringIO(capsys.readouterr().out))}
    found = variants.Variant("random", variants.read_runs(runs)["random"], 40).last_error
    cells = [rows["random"][f"error (m){end}"] for end in ("", " low", " high")]
    assert tuple(map(float, cells)) == found
    assert rows["sgim-d"]["error (m) low"] == ""
    assert rows["sgim-d"]["seeds"] == "1"


def test_runs_without_evaluations_are_judged_by_the_goals_that_the_learner_chose(tmp_path, capsys):
    words = "--environment planar-arm-7 --movements 120 --evaluate-at []"
    for algorithm in ("random", "practice"):
        assert live([*words.split(), "--algorithm", algorithm, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    assert table(tmp_path) == 0
    rows = rows_of(capsys.readouterr().out)
    run = read_run(tmp_path / "practice/seed-000")
    own = run.origin == "local"  # global exploration aims at no goal
    missed = np.linalg.norm(run.goals - run.outcomes, axis=1)[own][-50:]  # each goal has one movement
    found, head = rows["practice"], "miss of the last 50 own goals (m)"
    assert found[head] == f"{np.median(missed):.3f}"
    assert found["met"] == f"{(missed <= run.tolerance).mean():.0%}"
    assert (found["failed"], found["movements"]) == ("0.0%", "120")
    assert (rows["random"][head], rows["random"]["met"]) == ("-", "-")  # it chooses no goals


def test_variants_are_compared_where_all_finished_runs_were_evaluated_the_last_time(copied, tiny, capsys):
    assert table(copied) == 0
    said = capsys.readouterr()
    assert rows_of(said.out)["random"]["movements"] == "40"
    assert said.err == FEW
    options = "--algorithm random --name longer --movements 60 --repeats 0 --evaluate_at 20"
    assert live([*options.split(), "--benchmark", str(tiny), "--out", str(copied)]) == 0
    capsys.readouterr()
    assert table(copied) == 0  # after 20 and 60 the one, after 20 and 40 the others
    said = capsys.readouterr()
    assert rows_of(said.out)["random"]["movements"] == "20"
    assert len(said.out.splitlines()) == 4
    error = read_run(copied / "longer/seed-000").evaluations["own"]["mean_error"][0]
    assert f"{error:.3f}" in next(line for line in said.out.splitlines() if line.startswith("longer"))


def test_an_unfinished_run_counts_where_it_was_evaluated_and_is_named_where_it_was_not(runs, monkeypatch, capsys):
    cut, read_whole = runs / "random/seed-001", variants.read_run

    def read(path):
        run = read_whole(path)
        if path != cut:
            return run
        own = {name: column[:1] for name, column in run.evaluations["own"].items()}
        summary = {**run.summary, "finished": False}
        return replace(run, index=run.index[:30], evaluations={**run.evaluations, "own": own}, summary=summary)

    monkeypatch.setattr(variants, "read_run", read)
    for at, seeds in ((), "4"), (("--at", 20), "5"):
        assert table(runs, *at) == 0
        said = capsys.readouterr()
        assert next(line for line in said.out.splitlines() if line.startswith("random")).split()[1] == seeds
        left_out = f"left out: {cut} was not evaluated after 40 movements, it has 30 of 40"
        assert (left_out in said.err) == (seeds == "4")


def test_a_folder_without_a_run_is_named(copied, capsys):
    shutil.move(copied / "random/seed-001/run.sqlite", copied / "random/seed-001/run.sqlite.bak")
    assert table(copied) == 0
    said = capsys.readouterr()
    assert f"left out: {copied / 'random/seed-001'} has no run.sqlite that can be read" in said.err
    assert next(line for line in said.out.splitlines() if line.startswith("random")).split()[1] == "4"


def test_seeds_of_one_name_with_other_settings_are_named(copied, tiny, capsys):
    assert not table(copied)
    assert "differ" not in capsys.readouterr().err
    options = "--algorithm random --seed 7 --movements 40 --evaluate_at 40 --environment.task_space 3 --repeats 0"
    assert live([*options.split(), "--benchmark", str(tiny), "--out", str(copied)]) == 0
    assert table(copied) == 0
    assert "random: its seeds differ in environment.task_space; were two studies given" in capsys.readouterr().err


def test_columns_are_as_wide_as_their_widest_cell_and_lines_end_with_text(capsys):
    print_table([("task", "error (m)", "seeds"), ("planar-arm-50", "0.1", "3"), ("toss", "0.25", "")])
    assert capsys.readouterr().out.splitlines() == [
        "task           error (m)  seeds",
        "planar-arm-50  0.1        3",
        "toss           0.25",
    ]
