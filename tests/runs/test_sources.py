"""Where a user's own part is written: kept with the run, told when it has changed, found by every process."""

import os
import re
import subprocess
import sys

import pytest

from runs import ROOT, about_of, content_of
from sgimd_torch import PlanarArm
from sgimd_torch.files import checksum
from sgimd_torch.options.command_line import main, parse
from sgimd_torch.options.config import Config
from sgimd_torch.runs.directory import changed_versions, sources
from sgimd_torch.runs.read import finished
from sgimd_torch.runs.signals import command
from sgimd_torch.views import ask
from sgimd_torch.views.film import command as film

SHORT = (
    "--environment sliders:Slider --algorithm random --movements 40 --evaluate-at 20 --repeats 0 --inverse linear --out"
)
OWN = [*SHORT.split(), "runs"]


def test_the_file_of_every_part_of_ones_own_is_kept_and_told_when_it_has_changed(own, capsys):
    (own / "answers.py").write_text(
        "from sgimd_torch import NearestNeighbour\ndef nearest(memory): return NearestNeighbour(memory)\n"
    )
    words = [*OWN, "--evaluated-by", "own,answers:nearest"]
    assert command(main, words) == 0
    before = content_of(own / "runs/random/seed-000")["events"]
    was = {f"{name}.py, crc32 {checksum(own / f'{name}.py')}" for name in ("sliders", "answers")}
    versions = about_of(own / "runs/random/seed-000")["versions"]
    kept = versions["source of sliders:Slider"]
    assert {kept, versions["source of answers:nearest"]} == was
    with (own / "sliders.py").open("a") as file:
        file.write("\n# another remark\n")
    capsys.readouterr()
    assert command(main, [*words, "--movements", "60", "--resume"]) == 0
    said = capsys.readouterr().err
    now = f"sliders.py, crc32 {checksum(own / 'sliders.py')}"
    assert (
        f"resumed with other versions: source of sliders:Slider {versions['source of sliders:Slider']} -> {now};"
        in said
    )
    assert content_of(own / "runs/random/seed-000")["events"][: len(before)] == before
    before = about_of(own / "runs/random/seed-000")["versions"]["before"]
    assert [each["source of sliders:Slider"] for each in before] == [kept]
    sys.modules.pop("answers")
    assert sources(Config(), PlanarArm()) == {}


@pytest.mark.parametrize("is_package", [True, False])
@pytest.mark.parametrize("place", ["thrown:make", "lab.thrown:make"])
def test_modules_that_a_part_imports_from_its_own_folder_belong_to_its_source(tmp_path, monkeypatch, place, is_package):
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("thrown", "lab", "lab.thrown"):
        sys.modules.pop(name, None)
    folder = tmp_path / "lab" if "lab" in place else tmp_path
    folder.mkdir(exist_ok=True)
    package = "lab." * ("lab" in place)
    if is_package:
        (folder / "__init__.py").write_text("")
    imported = "import numpy", "from sgimd_torch import PlanarArm as make", f"from {package}arm import LENGTH"
    (folder / "thrown.py").write_text("\n".join(imported))
    (folder / "arm.py").write_text(f"def late():\n    from {package}deeper import x\nLENGTH = 1\n")
    (folder / "unused.py").write_text("")
    (folder / "deeper.py").write_text("")
    config = Config.from_settings({"environment": place})
    before = sources(config, PlanarArm())
    (folder / "deeper.py").write_text("x = 1\n")
    (folder / "unused.py").write_text("x = 1\n")
    changes = changed_versions(before, sources(config, PlanarArm()))
    assert re.fullmatch(rf"source of {package}deeper deeper.py, crc32 \w+ -> deeper.py, crc32 \w+", changes)


@pytest.mark.parametrize("view", [ask, film])
def test_a_view_that_builds_the_robot_again_says_that_its_file_has_changed(own, capsys, view):
    assert command(main, OWN) == 0
    words = ["runs/random/seed-000", "--trust", f"--goal{'s' * (view is film)}=0.4"]
    assert command(view.main, words) == 0
    assert "is not what it was" not in capsys.readouterr().err
    with (own / "sliders.py").open("a") as file:
        file.write("\n# another remark\n")
    assert command(view.main, words) == 0
    said = r"of runs/random/seed-000 is not what it was, and moves as it is now: source of sliders:Slider .* ->"
    assert re.search(said, capsys.readouterr().err)


def test_a_robot_that_has_become_another_one_is_refused(own, capsys):
    assert command(main, OWN) == 0
    text = (own / "sliders.py").read_text()
    (own / "sliders.py").write_text(text.replace("dim, context_dim = 1, 0", "dim, context_dim = 2, 0"))
    sys.modules.pop("sliders")
    assert command(main, [*OWN, "--movements", "60", "--resume"]) == 2
    assert "is this another robot?" in capsys.readouterr().err


def test_processes_of_many_runs_find_the_working_directory(own):
    """Also where Python does not put it on the path by itself."""
    (own / "learners.py").write_text(
        "from sgimd_torch import random_exploration\n"
        "def mine(environment, seed): return random_exploration(environment, seed)\n"
    )
    program = "import sys; from sgimd_torch.__main__ import main; sys.exit(main())"
    words = "sweep --environment sliders:Slider3 --vary algorithm=learners:mine"
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


def test_an_option_whose_default_is_nan_changes_nothing_and_the_run_can_go_on(module, capsys):
    module(
        "unset",
        "from sgimd_torch.runs.tasks.robots import planar_arm_7\n"
        'def make(*, limit: float = float("nan")):\n    return planar_arm_7()\n',
    )
    short = "--environment unset:make --algorithm random --movements 5 --evaluate-at [] --out runs"
    words = short.split()
    assert command(main, words) == command(main, [*words, "--resume", "--movements", "6"]) == 0
    assert finished(parse([*words, "--movements", "6"])[0])
    assert command(main, [*words, "--movements", "7", "--environment.limit", "1.0", "--resume"]) == 2
    assert "environment.limit was nan, now 1.0" in capsys.readouterr().err


def test_a_path_that_sqlite_cannot_open_is_refused_by_its_length(tmp_path, capsys):
    words = ["--algorithm", "random", "--movements", "3", "--evaluate-at", "[]"]
    assert command(main, [*words, "--out", str(tmp_path / "/".join(["x" * 100] * 6))]) == 2
    assert "has more than 504 bytes; choose a shorter --out" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
