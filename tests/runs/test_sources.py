"""Where a user's own part is written: kept with the run, told when it has changed, found by every process."""

import os
import subprocess
import sys
from functools import partial

import pytest

from runs import ROOT, about_of, content_of
from sgimd_torch.catalogue import source
from sgimd_torch.files import checksum
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import sources
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.sweep import main as sweep

SHORT = "--environment sliders:Slider --algorithm random --movements 40 --evaluate-at 20 --repeats 0 --out"
OWN = [*SHORT.split(), "runs"]


def test_the_file_of_ones_own_and_its_checksum_are_kept_with_the_run(own):
    assert command(main, OWN) == 0
    versions = about_of(own / "runs/random/seed-000")["versions"]
    crc32 = checksum(own / "sliders.py")
    assert versions["source of sliders:Slider"] == f"sliders.py, crc32 {crc32}"
    assert str(own) not in str(versions)


def test_a_changed_file_is_told_on_resume_by_its_name_and_the_replay_decides(own, capsys):
    assert command(main, OWN) == 0
    before = content_of(own / "runs/random/seed-000")["events"]
    was = checksum(own / "sliders.py")
    with (own / "sliders.py").open("a") as file:
        file.write("\n# another remark\n")
    capsys.readouterr()
    assert command(main, [*OWN, "--movements", "60", "--resume"]) == 0
    said = capsys.readouterr().err
    now = checksum(own / "sliders.py")
    assert (
        f"sliders.py has changed since this run was made (sliders.py, crc32 {was} -> sliders.py, crc32 {now})" in said
    )
    assert content_of(own / "runs/random/seed-000")["events"][: len(before)] == before
    versions = about_of(own / "runs/random/seed-000")["versions"]
    assert [each["source of sliders:Slider"] for each in versions["before"]] == [f"sliders.py, crc32 {was}"]
    assert command(main, [*OWN, "--movements", "60", "--resume"]) == 0
    assert "has changed" not in capsys.readouterr().err


def test_a_robot_that_has_become_another_one_is_refused(own, capsys):
    assert command(main, OWN) == 0
    text = (own / "sliders.py").read_text()
    (own / "sliders.py").write_text(text.replace("dim, context_dim = 1, 0", "dim, context_dim = 2, 0"))
    sys.modules.pop("sliders")
    assert command(main, [*OWN, "--movements", "60", "--resume"]) == 2
    assert "has the robot become another one?" in capsys.readouterr().err


def test_every_part_of_ones_own_counts_and_none_of_ours(own):
    (own / "kit").mkdir()
    (own / "kit/__init__.py").write_text("from kit.answers import nearest\n")
    (own / "kit/answers.py").write_text(
        "from functools import partial\nfrom sgimd_torch import NearestNeighbour\n"
        "def make(memory, k): return NearestNeighbour(memory)\nnearest = partial(make, k=1)\n"
    )
    try:
        config = Config(
            algorithm="random", evaluated_by=("own", "kit.answers:nearest"), parts={"environment": "sliders:Slider"}
        )
        assert sorted(sources(config)) == ["source of kit.answers:nearest", "source of sliders:Slider"]
        assert sources(config)["source of kit.answers:nearest"].startswith("kit/answers.py, crc32 ")
        assert source("kit:nearest") == own / "kit/answers.py"
    finally:
        for name in ("kit", "kit.answers"):
            sys.modules.pop(name, None)
    assert sources(Config()) == {}
    assert source("builtins:print") is None
    assert isinstance(partial(print), partial)


@pytest.mark.parametrize("module", ["sweep", "views.suite"])
def test_processes_of_many_runs_find_the_working_directory(own, module):
    """Also where Python does not put it on the path by itself."""
    (own / "learners.py").write_text(
        "from sgimd_torch import random_exploration\n"
        "def mine(environment, seed): return random_exploration(environment, seed)\n"
    )
    program = "import sys; from sgimd_torch.__main__ import main; sys.exit(main())"
    words = {
        "sweep": "sweep --environment sliders:Slider3 --vary algorithm=learners:mine",
        "views.suite": "suite --tasks crawler --algorithm learners:mine",
    }[module]
    done = subprocess.run(
        [sys.executable, "-c", program, *words.split(), *["--movements", "30", "--evaluate-at", "20", "--out", "runs"]],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"},
        cwd=own,
    )
    assert done.returncode == 0, done.stderr
    names = {path.parent.parent.name for path in own.rglob("run.sqlite")}
    assert {"learners:mine", "algorithm=learners:mine"} & names


def test_a_sweep_says_that_finished_runs_were_made_by_another_file(own, capsys):
    words = [*SHORT.split(), "study", "--seeds", "0-1", "--processes", "1"]
    assert command(sweep, words) == 0
    assert "has changed" not in capsys.readouterr().err
    with (own / "sliders.py").open("a") as file:
        file.write("\n# another remark\n")
    assert command(sweep, [*words, "--dry-run"]) == 0
    said = capsys.readouterr().err
    assert "2 of them finished" in said
    assert "random seed 0: sliders.py has changed since this run was made" in said


def test_a_robot_that_loses_its_connection_is_told_and_the_run_goes_on(own, capsys):
    lost = [each.replace("Slider", "LostConnection") for each in OWN]
    assert command(main, lost) == 0
    assert "movement 9 failed: ConnectionResetError: the robot closed the connection" in capsys.readouterr().err
    assert read_run(own / "runs/random/seed-000").summary["failed"] == 1


def test_a_run_with_outcomes_of_integers_goes_on_bit_for_bit(own):
    steps = [each.replace("Slider", "Steps") for each in OWN]
    assert command(main, steps) == 0
    assert command(main, [*steps, "--movements", "60", "--resume"]) == 0
    assert command(main, [*steps, "--movements", "60", "--name", "whole"]) == 0
    assert content_of(own / "runs/random/seed-000") == content_of(own / "runs/whole/seed-000")
