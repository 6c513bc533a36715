"""A room owns its folder: one is added by its files alone, and taken away by deleting them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WITHOUT = ROOT / "scripts/without_rooms.py"
BLOCK = re.compile(r"^```python (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture
def sgimd(tmp_path):
    """The command, from a copy of the package."""
    shutil.copytree(ROOT / "sgimd_torch", tmp_path / "sgimd_torch", ignore=shutil.ignore_patterns("__pycache__"))
    site = re.search(r'^SITE = "(.*)"$', WITHOUT.read_text(), re.MULTILINE)[1]  # the copy alone counts
    (tmp_path / "sitecustomize.py").write_text(site.replace("\\n", "\n"))
    words = [sys.executable, "-m", "sgimd_torch"]
    kept = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(tmp_path)}, "capture_output": True, "text": True}
    return lambda *more: subprocess.run([*words, *more], **kept)


def test_a_room_is_added_by_its_files_alone(sgimd, tmp_path):
    files = BLOCK.findall((ROOT / "docs/explained/house.md").read_text())
    assert sum(len(text.splitlines()) for _, text in files) <= 40
    for name, text in files:
        assert name.startswith("sgimd_torch/extras/farthest/")
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    short = "run --environment planar-arm-7 --algorithm random --movements 40 --evaluate-at [] --out runs"
    done = sgimd(*short.split(), "--tell-every", "20")
    assert done.stderr.count("farthest so far: ") == 2, done.stderr
    said = re.findall(r"farthest so far: (\S+)", done.stderr)
    assert sgimd("farthest", "runs/random/seed-000").stdout == f"farthest: {said[-1]}\n"
    assert "--tell-every" in sgimd("run", "--help").stdout
    assert "  farthest        Find the farthest outcome of a run\n" in sgimd("--help").stdout


def test_what_lacks_a_room_says_so_in_one_line(sgimd, tmp_path):
    short = (
        "run --environment planar-arm-7 --algorithm sagg-riac --goals alp-gmm --movements 5 --evaluate-at [] --out runs"
    )
    assert sgimd(*short.split()).returncode == 0
    for room in ("rivals", "table", "film"):
        shutil.rmtree(tmp_path / "sgimd_torch/extras" / room)
    for words, said in {
        "ask runs/sagg-riac/seed-000 --goal 0.1,0.2": "seed-000 cannot be opened: the room rivals is missing in ",
        "run --goals alp-gmm": "unknown goals 'alp-gmm'",
        "report runs": "perhaps the room report needs a room that is missing in ",
        "film runs": "perhaps the room film is missing in ",
    }.items():
        done = sgimd(*words.split())
        assert (done.returncode, said in done.stderr) == (2, True), done.stderr
        assert done.stderr.removesuffix("--help explains all options\n").count("\n") == 1


@pytest.mark.slow
def test_the_core_passes_its_tests_without_any_room():
    assert subprocess.run([sys.executable, str(WITHOUT), "all"], cwd=ROOT).returncode == 0
