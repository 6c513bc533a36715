"""Compiled functions: compiled once, with a word about it, wherever the result can be kept."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch

PROGRAM = """
import numpy as np
from sgimd_torch.memory.neighbours import Flat
from sgimd_torch.memory.growing import Growing
side = Flat(Growing(1, np.arange(5.0)[:, None]))
print(*side.nearest(np.array([[3.2]]), 2)[0])
"""
LIFE = """
from sgimd_torch import PlanarArm, practice, run
robot = PlanarArm(10, noise=0.05)
learner = practice(robot, 1001)
for _ in run(learner, robot, 1001, movements=60): pass
print(hash(learner.memory.thetas.tobytes()))
"""
SAID = "compiling once, about 20 s\n"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package without caches, whose folders of compiled functions cannot be written to."""
    place, copied = Path(sgimd_torch.__path__[0]), tmp_path / "library" / "sgimd_torch"
    shutil.copytree(place, copied, ignore=shutil.ignore_patterns("__pycache__"))
    (copied / "memory" / "__pycache__").touch()  # not even root makes a folder of it
    return copied


def started(package: Path, program: str = PROGRAM, **variables: str) -> subprocess.Popen[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "XDG"))}
    return subprocess.Popen(
        [sys.executable, "-B", "-c", program],
        cwd=package.parent,
        env={**kept, "PYTHONPATH": "", **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_two_processes_compile_at_once_for_a_third_though_the_package_cannot_be_written_to(package, tmp_path):
    variables = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "HOME": str(tmp_path / "home")}
    both = [started(package, **variables) for _ in range(2)]
    outputs, said = zip(*(process.communicate() for process in both), strict=True)
    assert outputs == ("3 4\n", "3 4\n")
    assert SAID in said
    assert {*said} <= {SAID, ""}  # on a busy machine one may begin when the other has ended
    assert started(package, **variables).communicate() == ("3 4\n", "")


def test_the_cache_is_where_the_user_says(package, tmp_path):
    for said in (SAID, ""):
        assert started(package, NUMBA_CACHE_DIR=str(tmp_path / "mine")).communicate() == ("3 4\n", said)
    assert list((tmp_path / "mine").rglob("*.nbc"))


@pytest.mark.slow
def test_where_nothing_can_be_written_it_compiles_for_this_process_alone(package, tmp_path):
    (tmp_path / "file").touch()
    nowhere = {"HOME": str(tmp_path / "file"), "XDG_CACHE_HOME": str(tmp_path / "file")}
    assert started(package, **nowhere).communicate() == ("3 4\n", SAID)


CALLING = """
import numpy as np
from sgimd_torch.memory.jit import NUMBERS, compiled_for, squared_distance

@compiled_for(NUMBERS)
def squared_length(point):
    return squared_distance(point, np.zeros(1))
"""
CALL = """
import numpy as np
from sgimd_torch.memory.compiled import compiled
print(compiled("sgimd_torch.memory.ordered").squared_length(np.array([3.0])))
"""


MISSING = """
from sgimd_torch.memory.compiled import compiled
compiled("sgimd_torch.nothing")
"""


@pytest.mark.slow
def test_a_damaged_cache_is_made_again_and_a_change_of_what_compiled_code_calls_takes_effect(package, tmp_path):
    mine = {"NUMBA_CACHE_DIR": str(tmp_path / "mine")}
    (package / "memory" / "ordered.py").write_text(CALLING)  # compiled in a moment
    assert started(package, CALL, **mine).communicate() == ("9.0\n", SAID)
    (path,) = (tmp_path / "mine").rglob("*.nbc")
    path.write_bytes(path.read_bytes()[:100])
    assert started(package, CALL, **mine).communicate() == ("9.0\n", SAID)
    assert "No module named 'sgimd_torch.nothing'" in started(package, MISSING, **mine).communicate()[1]
    assert started(package, CALL, **mine).communicate() == ("9.0\n", "")  # an error of another kind removes nothing
    called = package / "memory" / "jit.py"
    called.write_text(called.read_text().replace("total += (one[k] - other[k]) ** 2", "total -= one[k]"))
    assert started(package, CALL, **mine).communicate() == ("-3.0\n", SAID)


@pytest.mark.slow
def test_a_life_that_begins_with_compiling_is_the_same_to_the_last_bit(package, tmp_path):
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "mine"), "PYTHONHASHSEED": "0"}
    lives = [started(package, LIFE, **variables).communicate() for _ in range(2)]
    assert [said for _, said in lives] == [SAID, ""]
    assert lives[0][0] == lives[1][0]
