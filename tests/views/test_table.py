"""The table of the results of runs."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.runs.command_line import main as live
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.views import variants
from sgimd_torch.views.table import main

SEEDS = 5


def damage(path):
    """Change some bytes in the middle of the largest file of a run."""
    file = max(path.iterdir(), key=lambda each: each.stat().st_size)
    content = bytearray(file.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 4] = b"junk"
    file.write_bytes(content)


FEW = "fewer than 5 seeds, too few for an interval or a deviation: sgim-d (1)\n"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "tiny.npz"
    save_benchmark(path, Benchmark("FishingRod", np.array([[0.0, 0.6], [0.3, 0.5]]), 0.1))
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory, tiny):
    out = tmp_path_factory.mktemp("runs")
    for algorithm, seed in (*(("random", seed) for seed in range(SEEDS)), ("sgim-d", 0)):
        options = f"--algorithm {algorithm} --seed {seed} --movements 40 --repeats 2 --evaluate_at 20"
        assert live([*options.split(), "--benchmark", str(tiny), "--out", str(out)]) == 0
    return out


@pytest.fixture
def copied(runs, tmp_path):
    return shutil.copytree(runs, tmp_path / "runs")


def table(*options):
    """The exit code."""
    return command(main, [str(option) for option in options])


def test_the_table_gives_mean_and_deviation_over_five_seeds_or_more_and_a_note_where_there_are_fewer(runs, capsys):
    assert table(runs, "--at", 40) == 0
    said = capsys.readouterr()
    lines = {line.split()[0]: line for line in said.out.splitlines()}
    errors, few = (
        np.array([read_run(path).answers["own"]["mean_error"][-1] for path in sorted((runs / name).iterdir())])
        for name in ("random", "sgim-d")
    )
    deviation = np.sqrt(((errors - errors.mean()) ** 2).sum() / (SEEDS - 1))
    assert f"{errors.mean():.3f} ± {deviation:.3f}" in lines["random"]
    assert lines["random"].split()[1] == "5"
    assert lines["sgim-d"].split()[1] == "1"
    assert f"{few.mean():.3f}" in lines["sgim-d"]
    assert "±" not in lines["sgim-d"]
    assert said.err == FEW


def test_variants_are_compared_where_all_finished_runs_were_evaluated_the_last_time(copied, tiny, capsys):
    assert table(copied) == 0
    said = capsys.readouterr()
    assert "at 40 (m)" in said.out
    assert said.err == FEW
    options = "--algorithm random --name longer --movements 60 --repeats 0 --evaluate_at 20"
    assert live([*options.split(), "--benchmark", str(tiny), "--out", str(copied)]) == 0
    capsys.readouterr()
    assert table(copied) == 0  # after 20 and 60 the one, after 20 and 40 the others
    said = capsys.readouterr()
    assert "at 20 (m)" in said.out
    assert len(said.out.splitlines()) == 4
    error = read_run(copied / "longer/seed-000").answers["own"]["mean_error"][0]
    assert f"{error:.3f}" in next(line for line in said.out.splitlines() if line.startswith("longer"))


def test_an_unfinished_run_counts_where_it_was_evaluated_and_is_named_where_it_was_not(runs, monkeypatch, capsys):
    cut, read_whole = runs / "random/seed-001", variants.read_run

    def read(path):
        run = read_whole(path)
        if path != cut:
            return run
        own = {name: column[:1] for name, column in run.answers["own"].items()}
        summary = {**run.summary, "finished": False}
        return replace(run, index=run.index[:30], answers={**run.answers, "own": own}, summary=summary)

    monkeypatch.setattr(variants, "read_run", read)
    for at, seeds in ((), "4"), (("--at", 20), "5"):
        assert table(runs, *at) == 0
        said = capsys.readouterr()
        assert next(line for line in said.out.splitlines() if line.startswith("random")).split()[1] == seeds
        left_out = f"left out: {cut} was not evaluated after 40 movements, it has 30 of 40"
        assert (left_out in said.err) == (seeds == "4")


def test_runs_without_a_common_evaluation_need_at(copied, tiny, capsys):
    options = "--algorithm random --name other --movements 50 --repeats 0 --evaluate_at 30"
    assert live([*options.split(), "--benchmark", str(tiny), "--out", str(copied)]) == 0
    assert table(copied) == 2
    assert "never evaluated after the same number of movements; choose one with --at" in capsys.readouterr().err


def test_runs_that_were_never_evaluated_are_said_to_be_so(tmp_path, capsys):
    assert live(["--algorithm=random", "--movements=5", "--evaluate-at=[]", f"--out={tmp_path}"]) == 0
    assert table(tmp_path) == 2
    assert "no finished run was evaluated; were they made with --evaluate-at '[]'?" in capsys.readouterr().err


def test_a_run_that_is_too_short_is_named(runs, capsys):
    assert table(runs, "--at", 5000) == 2
    assert "seed-000 was not evaluated after 5000 movements" in capsys.readouterr().err


def test_a_damaged_run_is_named_and_nothing_is_printed(copied, capsys):
    path = copied / "random" / "seed-001"
    damage(path)
    assert table(copied) == 2
    said = capsys.readouterr()
    assert not said.out
    assert str(path) in said.err


def test_a_folder_without_a_run_is_named(copied, capsys):
    shutil.move(copied / "random/seed-001/run.sqlite", copied / "random/seed-001/run.sqlite.bak")
    assert table(copied) == 0
    said = capsys.readouterr()
    assert f"left out: {copied / 'random/seed-001'} has no run.sqlite that can be read" in said.err
    assert next(line for line in said.out.splitlines() if line.startswith("random")).split()[1] == "4"


def last_column(said):
    """Of each variant, and the head of the column."""
    head, *lines = said.splitlines()
    place = head.index("  minus ") + 2
    return head[place:], {line.split()[0]: line[place:] for line in lines}


def test_few_seeds_are_compared_with_the_baseline_by_their_differences_alone(runs, capsys):
    assert table(runs, "--at", 40, "--baseline", "random") == 0
    head, found = last_column(capsys.readouterr().out)
    ours, theirs = (
        read_run(runs / name / "seed-000").answers["own"]["mean_error"][-1] for name in ("sgim-d", "random")
    )
    assert head == "minus random"
    assert found == {"random": "-", "sgim-d": f"{ours - theirs:+.4f}"}  # of the only seed that both have


def test_a_baseline_that_is_no_variant_is_refused_with_the_near_name(runs, capsys):
    assert table(runs, "--at", 40, "--baseline", "randon") == 2
    said = capsys.readouterr()
    assert not said.out
    assert "'randon'; did you mean random? Known are random, sgim-d" in said.err
    assert said.err.count("\n") == 1
