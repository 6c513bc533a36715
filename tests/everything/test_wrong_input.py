"""Wrong commands and wrong calls: each is refused in one line that says what came, what was wanted, the likely slip."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import sgimd_torch as s
from sgimd_torch.__main__ import _call
from sgimd_torch.algorithms.paper import sgim_d
from sgimd_torch.runs.program import command
from sgimd_torch.spaces import Box, Demonstration, stream
from sgimd_torch.tasks import Task
from sgimd_torch.teachers import PeriodicTeacher

ROBOT = """
import numpy as np
from sgimd_torch import Box
from sgimd_torch.environments.protocol import check_movement

class Toss:
    contexts, policies = Box.cube(0, 1, 0), Box.cube(-1, 1, 3)
    outcomes = Box.cube(-2, 2, 2, names=("x", "apex"), unit="m")
    rest, outcome_noise = np.zeros(2), 0.0

    def observe(self, rng):
        return np.zeros(0)

    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return theta[:2] + theta[2]

class Half:
    outcomes, policies = Box.cube(0, 1, 1), Box.cube(0, 1, 1)

def shown():
    return []

def ends():
    raise SystemExit(0)

number = 7
"""
CSV = "time,q0,q1,x,y\n0,0,0,1,0\n0.1,0.1,0.1,0.9,0.1\n"
REFUSALS = [
    line.partition(" => ")[::2]
    for line in (Path(__file__).parent / "wrong_input.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
]


@pytest.mark.parametrize(("words", "message"), REFUSALS)
def test_a_wrong_command_is_refused_in_a_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("toss", None)
    files = {"toss.py": ROBOT, "shown.csv": CSV, "nul.csv": CSV.replace("0.9", "0.9\0")}
    files["broken.py"] = "import nothing_of_that_name\n"
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    assert command(_call, words.removeprefix("+ ").split()) == 2
    printed = capsys.readouterr().err.removesuffix("--help explains all options\n")
    assert re.search(f"error: .*{message}", printed), printed
    assert "Traceback" not in printed
    if not words.startswith("+ "):
        assert printed.startswith("error: ")
        assert printed.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {*files}


ARM = s.PlanarArm(5)
SHOWN = Demonstration(np.zeros(0), np.arange(2.0), np.zeros((2, 5)), np.zeros(2))


def learner(**parts):
    return s.sagg_riac(ARM, 0, **parts)


CALLS = {
    "no inverse": (lambda: learner(inverse=None), "Inverse must be a class or a function, got a NoneType"),
    "a generator for a seed": (lambda: s.sagg_riac(ARM, stream(0, "a")), "seed must be a whole number >= 0"),
    "a class for an environment": (lambda: s.sagg_riac(s.PlanarArm, 0), r"got the class PlanarArm .* PlanarArm\(\)"),
    "a class in a task": (lambda: Task(s.PlanarArm), "got the class PlanarArm itself"),
    "swapped": (lambda: s.sagg_riac(0, ARM), "an environment is wanted, got a int; is the order of arguments right?"),
    "swapped in a run": (
        lambda: next(s.run(ARM, learner(), 0, movements=3)),
        "learner must be a Learner, got a PlanarArm",
    ),
    "a builder": (lambda: next(s.run(s.sagg_riac, ARM, 0, movements=3)), "learner must be a Learner, got a function"),
    "a list for a teacher": (
        lambda: next(s.run(learner(), ARM, 0, movements=3, teacher=[SHOWN])),
        "teacher must be a Teacher, got a list; try PeriodicTeacher",
    ),
    "failures that are none": (
        lambda: next(s.run(learner(), ARM, 0, movements=3, failures=1.5)),
        "failures must be a whole number >= 1, got 1.5",
    ),
    "a pupil that cannot learn": (lambda: learner().watch(SHOWN), "has no social strategy"),
    "no correspondence": (lambda: sgim_d(ARM, 0), "missing 1 required keyword-only argument: 'correspondence'"),
    "corners swapped": (lambda: Box(np.ones(2), np.zeros(2)), "corners with low < high, .* were they swapped?"),
    "a parameter that cannot vary": (
        lambda: Box(np.zeros(3), np.array([1.0, 0.0, 1.0])),
        "corners with low < high, .* dimension 1 cannot vary, so leave it out",
    ),
    "a text for names": (lambda: Box(np.zeros(2), np.ones(2), names="xy"), "Box needs 2 names"),
    "an escape code in a name": (lambda: Box.cube(0, 1, 1, names=("x\x1b[31m",)), "without control characters"),
    "a seed for a teacher": (lambda: PeriodicTeacher([SHOWN], 0), "rng must be a numpy.random.Generator, got int"),
}


@pytest.mark.parametrize("what", CALLS)
def test_a_wrong_call_is_refused_with_the_likely_slip(what):
    call, message = CALLS[what]
    with pytest.raises((ValueError, TypeError, RuntimeError), match=message) as raised:
        call()
    assert "\n" not in str(raised.value)
