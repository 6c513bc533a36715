"""The package as users get it: built, installed into empty environments outside of the checkout, and used.

``scripts/release`` gives its files by DIST, and has them tried on all supported Pythons that are on PATH.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import sgimd_torch
from runs import ROOT

pytestmark = pytest.mark.slow
DIST = os.environ.get("DIST")
PYTHONS = ["3.11", "3.12", "3.13"] if DIST else [".".join(map(str, sys.version_info[:2]))]
WITHOUT_CHECKOUT = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
README = (ROOT / "README.md").read_text(encoding="utf-8")
SHORT = ["--movements", "200", "--evaluate-at", "100", "--repeats", "0"]

USER = """# pyright: strict
import numpy as np
from numpy.typing import NDArray

import sgimd_torch as s
from sgimd_torch import Episode, PlanarArm, evaluate, practice, run

s.load_benchmark().check(s.FishingRod())  # the wheel contains the data
print(s.__version__, len(s.load_demonstrations()))
arm = PlanarArm()
learner = practice(arm, 0)
episodes: list[Episode] = list(run(learner, arm, 0, movements=200))
goals: NDArray[np.float64] = np.array([[0.0, 0.5], [0.5, 0.5]])
error: float = evaluate(learner.inverse, arm, goals, 0, step=200).mean_error
theta: NDArray[np.float64] = learner.inverse(np.empty(0), goals[0]).theta
print(len(episodes), error < 0.1, theta.shape)
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder with the source distribution, and with the wheel built from the source distribution."""
    if DIST:
        return Path(DIST)
    place = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--outdir", str(place), str(ROOT)]
    subprocess.run(words, check=True, capture_output=True, env=WITHOUT_CHECKOUT)
    return place


class Installed:
    """An environment with the wheel in a folder of its own; ``go`` runs a program of it there."""

    def __init__(self, built, version, folder, extras, *more):
        program = shutil.which(f"python{version}")
        if program is None or subprocess.run([program, "--version"], capture_output=True).returncode:
            pytest.skip(f"python{version} is not on PATH")
        self.folder = folder
        subprocess.run([program, "-m", "venv", folder / "env"], check=True, env=WITHOUT_CHECKOUT)
        (wheel,) = built.glob("*.whl")
        self.ok("pip", "install", "-q", f"{wheel}{extras}", *more)
        self.ok("pip", "check")

    def go(self, program, *words):
        command = [self.folder / "env/bin" / program, *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, cwd=self.folder, env=WITHOUT_CHECKOUT)

    def ok(self, program, *words):
        done = self.go(program, *words)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


@pytest.fixture(scope="module", params=PYTHONS)
def smallest(request, built, tmp_path_factory):
    return Installed(built, request.param, tmp_path_factory.mktemp("smallest"), "")


@pytest.fixture(scope="module", params=PYTHONS)
def complete(request, built, tmp_path_factory):
    checkers = ("mypy", "pyright[nodejs]", "-c", ROOT / "constraints.txt")
    return Installed(built, request.param, tmp_path_factory.mktemp("complete"), "[all]", *checkers)


def test_the_programs_of_the_readme_need_the_smallest_installation(smallest):
    first, *others = re.findall(r"^```python\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    assert re.fullmatch(r"error 0\.1\d m\n", smallest.ok("python", "-c", first))
    for program in others:
        smallest.ok("python", "-c", program)
    assert smallest.ok("sgimd", "--version") == f"sgimd_torch {sgimd_torch.__version__}\n"


def test_what_is_not_installed_is_named_with_the_pip_command_that_brings_it(smallest):
    arm = ["--environment", "planar-arm-7", "--algorithm", "sgim-d", *SHORT]
    smallest.ok("sgimd", "run", *arm)
    for words, extra in (
        (["run", *arm, "--name", "watched", "--board", "true"], "board"),
        (["run", *arm, "--name", "modelled", "--inverse", "model"], "forward"),
        (["run", *arm, "--name", "rival", "--goals", "alp-gmm"], "rivals"),
        (["film", "runs/sgim-d/seed-000"], "film"),
        (["report", "runs"], "report"),
        (["sweep", *arm, "--out", "swept", "--on", "head:8786"], "cluster"),
    ):
        done = smallest.go("sgimd", *words)
        assert done.returncode == 2
        assert f"pip install 'sgimd-torch[{extra}]'" in done.stderr
        assert "Traceback" not in done.stderr


def test_the_commands_of_the_readme_run_and_resume_with_all_extras(complete):
    runs = [line.partition("#")[0].split() for line in re.findall(r"^sgimd (run .*--board.*)$", README, re.MULTILINE)]
    assert len(runs) == 2
    for run in runs:
        complete.ok("sgimd", *run, *SHORT)
    complete.ok("sgimd", *runs[0], *SHORT, "--movements", 300, "--resume")
    assert "300" in complete.ok("sgimd", "table", "runs/sgim-d")
    complete.ok("sgimd", "report", "runs/sgim-d")
    assert (complete.folder / "runs/sgim-d/report.html").read_text().startswith("<!DOCTYPE html>")


def test_a_strict_program_of_a_user_runs_and_its_types_are_checked_against_ours(complete):
    (complete.folder / "user.py").write_text(USER)
    (complete.folder / "wrong.py").write_text(USER.replace("arm, 0, movements=200))", "arm, 0, movements='many'))"))
    assert complete.ok("python", "user.py") == f"{sgimd_torch.__version__} 127\n200 True (7,)\n"
    complete.ok("mypy", "--strict", "user.py")
    complete.ok("pyright", "--pythonpath", complete.folder / "env/bin/python", "user.py")
    assert 'incompatible type "str"; expected "int"' in complete.go("mypy", "--strict", "wrong.py").stdout
    assert '"int"' in complete.go("pyright", "--pythonpath", complete.folder / "env/bin/python", "wrong.py").stdout


def test_the_wheel_has_the_package_and_nothing_else(built):
    (path,) = built.glob("*.whl")
    names = {name for name in zipfile.ZipFile(path).namelist() if ".dist-info/" not in name}
    ours = {path.relative_to(ROOT).as_posix() for path in (ROOT / "sgimd_torch").rglob("*") if path.is_file()}
    assert names == {name for name in ours if "__pycache__" not in name}
    assert path.stat().st_size < 3e6


def test_the_source_distribution_has_what_builds_tests_and_explains_and_no_more(built):
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    top = ["LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "constraints.txt"]
    tests = [path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("*.py")]
    assert {*top, *tests, "sgimd_torch/py.typed", "scripts/test", "results/results.csv", "docs/runs.md"} <= names
    assert not [name for name in names if "__pycache__" in name]
    assert not [name for name in names if name.startswith(("runs", ".venv", "results/model/g"))]
    assert path.stat().st_size < 8e6
