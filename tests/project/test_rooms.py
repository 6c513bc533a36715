"""A feature owns its room: to leave a feature out, delete its folder and its lines of the catalogue."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sgimd_torch.options.catalogue import WORDS

ROOT = Path(__file__).parents[2]
ROOMS = ("forward_model", "asking", "teach", "rivals")
KEPT = ("goals", "inverses", "searches", "learner", "memory", "record", "runs", "teachers", "demonstrations")


def words_of(room):
    return [word for words in WORDS.values() for word, place in words.items() if place.startswith(f"{room}.")]


def without(room, folder):
    """Copy package and tests to ``folder`` without a room; returns the number of lines deleted from the table."""
    for name in ("sgimd_torch", "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    for name in ("scripts/documentation", "experiments"):
        (folder / name).mkdir(parents=True)
    shutil.copy(ROOT / "experiments/toys.py", folder / "experiments")  # robots of tests
    shutil.rmtree(folder / "sgimd_torch" / room)
    table = folder / "sgimd_torch/options/catalogue.py"
    lines = table.read_text().splitlines(keepends=True)
    kept = [line for line in lines if not re.match(rf"\w+ +{room}\.", line)]
    table.write_text("".join(kept))
    return len(lines) - len(kept)


@pytest.mark.parametrize("room", ROOMS)
def test_nothing_outside_a_room_imports_it(room):
    for path in (ROOT / "sgimd_torch").rglob("*.py"):
        if room in path.relative_to(ROOT / "sgimd_torch").parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not any(f"{name}.".startswith(f"sgimd_torch.{room}.") for name in names), path


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_without_a_room_the_rest_imports_runs_and_passes_its_own_tests(room, tmp_path):
    words = words_of(room)
    assert words
    assert without(room, tmp_path) > 0

    def go(*arguments):
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout

    walk = "import importlib, pkgutil, sgimd_torch as s; print(s.__path__[0])\n"
    walk += "for module in pkgutil.walk_packages(s.__path__, 'sgimd_torch.'):\n"
    walk += "    module.name.endswith('__main__') or importlib.import_module(module.name)"
    assert go("-c", walk).strip() == str(tmp_path / "sgimd_torch")
    short = ["--environment", "planar-arm-7", "--movements", "30", "--repeats", "0"]
    assert "30 movements, mean error" in go("-m", "sgimd_torch", "run", "--algorithm", "sgim-d", *short)
    go("-m", "sgimd_torch", "run", "--help")

    telling = [word for word in words if len(word) > 4]  # short names such as "all" are in many files

    def concerns(path):
        text = path.read_text(encoding="utf-8")
        return any(
            name in text
            for name in (f"sgimd_torch.{room}", "experiments/", "experiments.mis", "experiments.progress", *telling)
        )

    tests = [
        str(path) for name in KEPT for path in (tmp_path / "tests" / name).rglob("test_*.py") if not concerns(path)
    ]
    assert len(tests) > 15
    assert "passed" in go("-m", "pytest", "-p", "no:cacheprovider", "-m", "not slow", *tests)
