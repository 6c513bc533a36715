"""The package as users get it: built, installed into an empty environment away from the checkout, and put to work."""

import os
import signal
import subprocess
import sys
import time
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


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder of commands of an environment in which only the wheel is installed, with its extra for reports."""
    place = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", str(place), str(ROOT)], check=True, env=WITHOUT_CHECKOUT)
    (wheel,) = place.glob("sgimd_torch-*.whl")
    venv.create(place / "env", with_pip=True)
    commands = place / "env" / "bin"
    pip = [str(commands / "python"), "-m", "pip", "--disable-pip-version-check", "-q", "install"]
    subprocess.run([*pip, f"{wheel}[report]", "-c", str(ROOT / "constraints.txt")], check=True, env=WITHOUT_CHECKOUT)
    return commands


@pytest.fixture(scope="module")
def sgimd(installed, tmp_path_factory):
    """Runs the installed command in a folder of its own; returns exit code, stdout and stderr."""
    away = tmp_path_factory.mktemp("away")

    def sgimd(*words, stop_after=None):
        process = subprocess.Popen(
            [str(installed / "sgimd"), *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=away,
            env=WITHOUT_CHECKOUT,
        )
        while stop_after is not None and process.poll() is None:
            if stop_after.exists() and stop_after.read_bytes().count(b"\n") > 200:
                process.send_signal(signal.SIGINT)
                break
            time.sleep(0.01)
        said, errors = process.communicate(timeout=300)
        return process.returncode, said, errors

    sgimd.away = away
    return sgimd


def test_it_runs_stops_resumes_and_is_looked_at_without_a_checkout(sgimd):
    log = sgimd.away / "runs/sgim-d/seed-000/episodes.csv"
    code, _, errors = sgimd("run", *SHORT, stop_after=log)
    assert code == 130, errors
    assert "to go on: " in errors
    assert "Traceback" not in errors
    stopped = log.read_bytes()
    code, said, errors = sgimd("run", *SHORT, "--resume")
    assert code == 0, errors
    assert "3000 movements, mean error" in said
    assert log.read_bytes().startswith(stopped)
    code, said, errors = sgimd("table", "runs")
    assert code == 0, errors
    assert "sgim-d" in said
    code, said, errors = sgimd("report", "runs")
    assert code == 0, errors
    assert (sgimd.away / "runs/report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (["run", *SHORT, "--name", "watched", "--board", "true"], "board"),
        (["watch", "runs"], "board"),
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


def test_what_lies_beside_the_code_is_in_the_wheel(installed):
    program = (
        "import sgimd_torch as s; s.load_benchmark(); s.load_demonstrations(); s.FishingRod(); print(s.__version__)"
    )
    done = subprocess.run(
        [str(installed / "python"), "-c", program],
        capture_output=True,
        text=True,
        cwd="/",
        env=WITHOUT_CHECKOUT,
        check=True,
    )
    assert done.stdout.strip() == sgimd_torch.__version__
