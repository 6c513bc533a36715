"""The package as users get it: built, installed into an empty environment outside the checkout, and used."""

import os
import subprocess
import sys
import tarfile
import venv

import pytest

import sgimd_torch
from runs import ROOT

pytestmark = pytest.mark.slow
WITHOUT_CHECKOUT = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
SHORT = [
    *("--environment", "planar-arm-7", "--algorithm", "sgim-d", "--movements", "3000"),
    *("--evaluate-at", "1000", "--repeats", "2", "--out", "runs"),
]


USER = """
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
    place = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--outdir", str(place), str(ROOT)]
    subprocess.run(words, check=True, capture_output=True, env=WITHOUT_CHECKOUT)
    return place


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """The folder of commands of an environment with the wheel, the extra ``report``, and mypy."""
    place = tmp_path_factory.mktemp("wheel")
    (wheel,) = built.glob("sgimd_torch-*.whl")
    venv.create(place / "env", with_pip=True)
    commands = place / "env" / "bin"
    pip = [str(commands / "python"), "-m", "pip", "--disable-pip-version-check", "-q", "install"]
    wanted = [f"{wheel}[report]", "mypy", "-c", str(ROOT / "constraints.txt")]
    subprocess.run([*pip, *wanted], check=True, env=WITHOUT_CHECKOUT)
    return commands


@pytest.fixture(scope="module")
def sgimd(installed, tmp_path_factory):
    """A function that runs the installed command in a new folder, and returns exit code, stdout and stderr."""
    away = tmp_path_factory.mktemp("away")

    def sgimd(*words):
        command = [str(installed / "sgimd"), *map(str, words)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=away, env=WITHOUT_CHECKOUT)
        return done.returncode, done.stdout, done.stderr

    sgimd.away = away
    return sgimd


def test_it_runs_resumes_and_is_looked_at_without_a_checkout(sgimd):
    for words, printed in (
        (["run", *SHORT, "--movements", "300"], "300 movements, mean error"),
        (["run", *SHORT, "--resume"], "3000 movements, mean error"),
        (["table", "runs"], "sgim-d"),
        (["report", "runs"], ""),
    ):
        code, output, errors = sgimd(*words)
        assert code == 0, errors
        assert printed in output
    assert (sgimd.away / "runs/report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (["run", *SHORT, "--name", "watched", "--board", "true"], "board"),
        (["film", "runs/sgim-d/seed-000"], "film"),
        (["run", *SHORT, "--name", "modelled", "--inverse", "model"], "forward"),
        (["run", *SHORT, "--name", "rival", "--goals", "alp-gmm"], "rivals"),
    ],
)
def test_what_is_not_installed_is_named_with_the_pip_command_that_brings_it(sgimd, words, extra):
    code, _, errors = sgimd(*words)
    assert code == 2
    assert f"pip install 'sgimd-torch[{extra}]'" in errors
    assert "Traceback" not in errors


def test_a_strict_program_of_a_user_runs_and_its_types_are_checked_against_ours(installed, tmp_path):
    (tmp_path / "user.py").write_text(USER)
    (tmp_path / "wrong.py").write_text(USER.replace("arm, 0, movements=200))", "arm, 0, movements='many'))"))

    def checked(*words):
        words = [str(installed / "python"), *words]
        return subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=WITHOUT_CHECKOUT)

    assert checked("user.py").stdout == f"{sgimd_torch.__version__} 127\n200 True (7,)\n"
    done = checked("-m", "mypy", "--strict", "user.py")
    assert done.returncode == 0, done.stdout
    done = checked("-m", "mypy", "--strict", "wrong.py")
    assert 'incompatible type "str"; expected "int"' in done.stdout  # mypy has read our types


def test_the_source_distribution_has_what_builds_tests_and_explains_and_no_more(built):
    (path,) = built.glob("sgimd_torch-*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    top = ["LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "constraints.txt"]
    tests = [path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("*.py")]
    assert {*top, *tests, "sgimd_torch/py.typed", "scripts/test", "results/results.csv", "docs/runs.md"} <= names
    assert not [name for name in names if "__pycache__" in name]
    assert not [name for name in names if name.startswith(("runs", ".venv", "results/model/g"))]
    assert path.stat().st_size < 8e6
