"""Only the learner makes events; and learning loads no database, and few lines of this library."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch

PACKAGE = Path(sgimd_torch.__path__[0])
WRITERS = {"learner/__init__.py", "learner/slots.py", "record/layout.py"}  # the record reads events from rows
LEARNING = """
from sgimd_torch import PlanarArm, practice, run
arm = PlanarArm(7)
for _ in run(practice(arm, 0), arm, 0, movements=30):
    pass
"""
COMMAND = """
import sys
from sgimd_torch.__main__ import main
sys.argv[1:] = "run --algorithm practice --environment planar-arm-7 --movements 30".split()
assert main() in (0, None)
"""
SAYS = """
import sys
files = {each.__file__ for name, each in sys.modules.items() if name.partition(".")[0] == "sgimd_torch"}
print("sqlite3" in sys.modules, *files, sep="|")
"""


def loaded_by(program, folder):
    """Whether a program loads SQLite, and the number of lines of each file of this library that the program loads."""
    words = [sys.executable, "-c", program + SAYS]
    said = subprocess.run(words, capture_output=True, text=True, check=True, cwd=folder).stdout
    sqlite, *files = said.splitlines()[-1].split("|")
    return sqlite == "True", {
        str(Path(each).relative_to(PACKAGE)): len(Path(each).read_text().splitlines()) for each in files
    }


def test_events_are_made_by_the_learner_alone_and_read_by_the_record():
    found = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        calls = [ast.unparse(node.func) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
        if "sgimd_torch.learner" in text and {"Event", "events.Event"} & {*calls}:
            found.add(path.relative_to(PACKAGE).as_posix())
    assert found == WRITERS


@pytest.mark.parametrize(("program", "database", "most"), [(LEARNING, False, 5040), (COMMAND, True, 8080)])
def test_learning_loads_few_lines_of_ours_and_no_database(tmp_path, monkeypatch, program, database, most):
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE.parent))
    sqlite, lines = loaded_by(program, tmp_path)
    assert sqlite == database
    assert sum(lines.values()) <= most, sorted(lines.items(), key=lambda each: -each[1])
