"""What the views refuse, all in one table: the reason is said, the exit code is 2, and nothing is written."""

import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from own import MODULE
from runs import write_about
from sgimd_torch.__main__ import _call
from sgimd_torch.record import Record
from sgimd_torch.runs.command import main as live
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.program import command

REFUSALS = Path(__file__).parent / "refusals.txt"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with runs of a user's robots."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "sliders.py").write_text(MODULE)
    (folder / "bad.csv").write_text("0,1\n1,z\n")
    (folder / "first.csv").write_text("0.3,1_0\n")
    (folder / "wide.csv").write_text(f"0,{'1' * 200_000}\n")
    for name in ("pipe.csv", "pipe.npz", "pipe.mp4"):
        os.mkfifo(folder / name)
    (folder / "empty").mkdir()
    sys.path.insert(0, str(folder))
    runs = {
        "runs": "Slider2 --movements 60 --evaluate-at []",
        "memory": "Slider2 --movements 20 --evaluate-at [] --context previous",
        "odd": "Slider3 --movements 20 --evaluate-at []",
        "mixed": "Slider2 --movements 40 --evaluate-at 20",
        "mixed --name other": "Slider2 --movements 50 --evaluate-at 30",
        "pictures --name NoPicture": "NoPicture --movements 20 --evaluate-at []",
        "pictures --name OtherMovement": "OtherMovement --movements 20 --evaluate-at []",
        "pictures --name WrongPicture": "WrongPicture --movements 20 --evaluate-at []",
    }
    for out, words in runs.items():
        words = f"--algorithm random --repeats 0 --environment sliders:{words} --out {folder}/{out}"
        assert command(live, words.split()) == 0
    (folder / "unborn/seed-000").mkdir(parents=True)
    with Record(folder / "runs/random/seed-000" / RUN_FILE) as whole:
        Record.make(folder / "unborn/seed-000" / RUN_FILE, whole.dims, whole.about).close()
    shutil.copytree(folder / "mixed/random", folder / "damaged/random")
    shutil.copytree(folder / "odd/random", folder / "escape/random")
    write_about(folder / "escape/random/seed-000", spaces={"outcomes": [[0], [1], ["x"], "\x1b[31m"]})
    file = folder / "damaged/random/seed-000/run.sqlite"
    content = bytearray(file.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 4] = b"junk"
    file.write_bytes(content)
    yield folder
    sys.path.remove(str(folder))
    sys.modules.pop("sliders", None)


@pytest.mark.parametrize(
    ("words", "message"),
    [line.split(" => ") for line in REFUSALS.read_text(encoding="utf-8").splitlines() if not line.startswith("#")],
)
def test_what_is_wrong_is_refused_with_its_reason_and_nothing_is_written(place, monkeypatch, capsys, words, message):
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    try:
        code = command(_call, words.split())
    except SystemExit as end:  # of a parser
        code = end.code
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    assert message in said.err
    assert not re.search("Traceback|\x1b", said.err)
    assert sorted(place.rglob("*")) == before
