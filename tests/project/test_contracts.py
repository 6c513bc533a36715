"""Contracts alone decide: no file asks for a concrete part of another room by its type, only the learner makes events,
and learning loads no database and few lines of this library."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch

PACKAGE = Path(sgimd_torch.__path__[0])
BASES = {"Part", "Built", "Trained"}
CONTRACTS = {"parts", "catalogue"}  # rooms whose classes say what a kind of part must offer


def name_of(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def types_asked_for(package: Path) -> set[tuple[str, str]]:
    """Pairs (file, class) for each question for the type of a concrete part that another room defines."""
    trees = {
        path.relative_to(package).with_suffix("").as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(package.rglob("*.py"))
    }
    classes = {
        node.name: (place.partition("/")[0], {name_of(base) for base in node.bases})
        for place, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }

    def is_part(name: str) -> bool:
        return name in BASES or any(is_part(base) for base in classes.get(name, ("", set()))[1])

    rooms = {name: room for name, (room, _) in classes.items() if is_part(name) and room not in CONTRACTS}
    return {
        (place, name_of(kind))
        for place, tree in trees.items()
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and name_of(call.func) in {"isinstance", "issubclass"}
        for kind in ast.walk(call.args[1])
        if isinstance(kind, ast.Name | ast.Attribute) and rooms.get(name_of(kind), place) != place.partition("/")[0]
        if name_of(kind) in rooms
    }


def test_no_file_asks_for_the_type_of_a_part_of_another_room():
    assert types_asked_for(PACKAGE) == set()


@pytest.mark.parametrize(
    "question", ["isinstance(part, Slow)", "isinstance(part, Fast | Slow)", "issubclass(part, (int, moving.Slow))"]
)
def test_a_question_for_a_type_is_found_outside_the_room_alone(tmp_path, question):
    moving = "class Search(Part): ...\nclass Quick(Search): ...\nclass Slow(Quick): ...\nasked = isinstance(part, Slow)"
    for place, text in {"parts": "class Search(Part): ...", "moving": moving, "runs": question}.items():
        (tmp_path / f"{place}.py").write_text(text)
    assert types_asked_for(tmp_path) == {("runs", "Slow")}


def test_events_are_made_by_the_learner_alone_and_read_by_the_record():
    makers = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        calls = {ast.unparse(node.func) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)}
        if "sgimd_torch.learner" in text and {"Event", "events.Event"} & calls:
            makers.add(path.relative_to(PACKAGE).as_posix())
    assert makers == {"learner/__init__.py", "learner/slots.py", "record/layout.py"}  # the last reads events from rows


def test_every_output_is_written_by_the_functions_of_one_file():
    writers = {
        (path.relative_to(PACKAGE).as_posix(), name_of(call.func))
        for path in PACKAGE.rglob("*.py")
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute | ast.Name)
        if (isinstance(call.func, ast.Attribute) and call.func.attr in {"write_text", "write_bytes"})
        or (name_of(call.func) == "open" and {*"wax"} & {*"".join(a.value for a in call.args if is_mode(a))})
    }
    writers -= {("extras/sweep/parallel.py", "open")}  # a log that grows
    assert writers == {("files.py", "write_bytes")}


def is_mode(argument: ast.expr) -> bool:
    return isinstance(argument, ast.Constant) and isinstance(argument.value, str) and len(argument.value) < 4


LEARN = """
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
LOADED = """
import json, sys
print(json.dumps({name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}))
"""


@pytest.mark.parametrize(("program", "database", "most"), [(LEARN, False, 5500), (COMMAND, True, 8830)])
def test_learning_loads_few_lines_of_the_core_and_no_database(tmp_path, monkeypatch, program, database, most):
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE.parent))
    words = [sys.executable, "-c", program + LOADED]
    done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = json.loads(done.stdout.splitlines()[-1])
    assert ("sqlite3" in loaded) == database
    files = {path for name, path in loaded.items() if f"{name}.".startswith("sgimd_torch.") and "extras" not in name}
    lines = {path: len(Path(path).read_text(encoding="utf-8").splitlines()) for path in files}
    assert sum(lines.values()) <= most, sorted(lines.items(), key=lambda entry: -entry[1])
