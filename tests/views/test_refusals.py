"""What the views refuse, all in one table: the reason is said, the exit code is 2, and nothing is written."""

import shutil
import sys

import pytest

from own import MODULE
from sgimd_torch.options.command_line import main as live
from sgimd_torch.runs.signals import command
from sgimd_torch.views import ask, benchmark, table
from sgimd_torch.views.film import command as film
from sgimd_torch.views.report import command as report

RUN = "runs/random/seed-000"
BY = {
    ask: f"{RUN} --trust",
    benchmark: "",
    film: f"{RUN} --trust",
    report: "runs",
    table: "",
}
REFUSED = [
    (ask, "", "give --goal X,Y or --goals FILE"),
    (ask, "--goal 0.3", "goal must have shape (..., 2)"),
    (ask, "--goal 0.3,40", "goal must lie in its box"),
    (ask, "--goal 0.3,0.4 --context 1", "--context must have shape (..., 0)"),
    (ask, "--goal 0.3,0.4 --trajectory joints.csv", "no motor primitive that gives joints over time"),
    (ask, "--goals bad.csv", "bad.csv: row 2 is no goal of 2 numbers: 1,z"),
    (ask, "--goals first.csv", "first.csv: row 1 is no goal of 2 numbers: 0.3,1_0"),
    (ask, "--goals lost.csv", "lost.csv cannot be read or written"),
    (benchmark, "nowhere --out g.npz", "nowhere does not exist; runs are in OUT/NAME/seed-000"),
    (benchmark, "runs --out g.csv", "--out must be a .npz file in a folder that exists, got g.csv"),
    (benchmark, "runs --out g.npz --tiles 0", "--tiles must be a whole number >= 1, got 0"),
    (benchmark, "runs odd --out g.npz", "all runs must be of one environment with one T: runs/random/seed-000 is of"),
    (film, "--goals 0.3,0.6 1,2,3", "--goals must have shape"),
    (film, "--goals -0.3,far", "--goals: must be numbers with commas, got '-0.3,far'"),
    (film, "--goals 0.3,0.6 -30,60", "outside"),
    (film, "--context 0.5,0.1", "--context must have shape"),
    (film, "--after 20 61", "--after must be from 1 to 60"),
    (film, "--out film.avi", "--out must be a .mp4 or .webp file"),
    (film, "--out nowhere/film.mp4", "--out"),
    (report, "--out empty", "--out must be a file"),
    (report, "--out no/x.html", "folder that exists"),
    (table, "nowhere", "nowhere does not exist; runs are in OUT/NAME/seed-000"),
    (table, "runs --baseline random", "no finished run was evaluated; were they made with --evaluate-at '[]'?"),
    (table, "mixed", "never evaluated after the same number of movements; choose one with --at"),
    (table, "mixed --at 5000", "seed-000 was not evaluated after 5000 movements"),
    (table, "mixed --at 20 --baseline randon", "'randon'; did you mean random? Known are random"),
    (table, "damaged", "damaged/random/seed-000/run.sqlite"),
]
UNPICTURED = {
    "NoPicture": "sliders:NoPicture, which cannot be filmed: it needs a method trace(",
    "WrongPicture": "WrongPicture must give a Sketch with an outcome of 1 dimension, got list",
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with runs of a user's robots."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "sliders.py").write_text(MODULE)
    (folder / "bad.csv").write_text("0,1\n1,z\n")
    (folder / "first.csv").write_text("0.3,1_0\n")
    (folder / "empty").mkdir()
    sys.path.insert(0, str(folder))
    runs = {
        "runs": "Slider2 --movements 60 --evaluate-at []",
        "odd": "Slider3 --movements 20 --evaluate-at []",
        "mixed": "Slider2 --movements 40 --evaluate-at 20",
        "mixed --name other": "Slider2 --movements 50 --evaluate-at 30",
        **{f"pictures --name {robot}": f"{robot} --movements 20 --evaluate-at []" for robot in UNPICTURED},
    }
    for out, words in runs.items():
        words = f"--algorithm random --repeats 0 --environment sliders:{words} --out {folder}/{out}"
        assert command(live, words.split()) == 0
    shutil.copytree(folder / "mixed/random", folder / "damaged/random")
    file = folder / "damaged/random/seed-000/run.sqlite"
    content = bytearray(file.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 4] = b"junk"
    file.write_bytes(content)
    yield folder
    sys.path.remove(str(folder))
    sys.modules.pop("sliders", None)


@pytest.mark.parametrize(
    ("view", "words", "message"),
    [
        *((view, f"{BY[view]} {words}", message) for view, words, message in REFUSED),
        *((film, f"pictures/{robot}/seed-000 --trust", message) for robot, message in UNPICTURED.items()),
    ],
)
def test_what_is_wrong_is_refused_with_its_reason_and_nothing_is_written(
    place, monkeypatch, capsys, view, words, message
):
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    try:
        code = command(view.main, words.split())
    except SystemExit as end:  # of a parser
        code = end.code
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    assert message in said.err
    assert "Traceback" not in said.err
    assert sorted(place.rglob("*")) == before
