"""A robot of one's own in every command: its file has changed, or it is in the working directory."""

import os
import re
import subprocess
import sys

import pytest

from runs import ROOT
from sgimd_torch.extras.ask import command as ask
from sgimd_torch.extras.film import command as film
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command

SHORT = (
    "--environment sliders:Slider --algorithm random --movements 40 --evaluate-at 20 --repeats 0 --inverse linear --out"
)
OWN = [*SHORT.split(), "runs"]


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


@pytest.mark.slow
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
