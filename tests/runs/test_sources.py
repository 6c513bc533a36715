"""Where a user's own part is written: kept with the run, told when it has changed, found by every process."""

import sys

from runs import about_of, content_of
from sgimd_torch import PlanarArm
from sgimd_torch.files import checksum
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.command import main
from sgimd_torch.runs.directory import sources
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import finished

SHORT = (
    "--environment sliders:Slider --algorithm random --movements 40 --evaluate-at 20 --repeats 0 --inverse linear --out"
)
OWN = [*SHORT.split(), "runs"]


def test_the_file_of_every_part_of_ones_own_is_kept_and_told_when_it_has_changed(own, capsys):
    (own / "answers.py").write_text(
        "from sgimd_torch import NearestNeighbour\ndef nearest(memory): return NearestNeighbour(memory)\n"
    )
    words = [*OWN, "--evaluated-by", "own,answers:nearest"]
    assert command(main, words) == 0
    before = content_of(own / "runs/random/seed-000")["events"]
    was = {f"{name}.py, crc32 {checksum(own / f'{name}.py')}" for name in ("sliders", "answers")}
    versions = about_of(own / "runs/random/seed-000")["versions"]
    kept = versions["source of sliders:Slider"]
    assert {kept, versions["source of answers:nearest"]} == was
    with (own / "sliders.py").open("a") as file:
        file.write("\n# another remark\n")
    capsys.readouterr()
    assert command(main, [*words, "--movements", "60", "--resume"]) == 0
    said = capsys.readouterr().err
    now = f"sliders.py, crc32 {checksum(own / 'sliders.py')}"
    assert (
        f"resumed with other versions: source of sliders:Slider {versions['source of sliders:Slider']} -> {now};"
        in said
    )
    assert content_of(own / "runs/random/seed-000")["events"][: len(before)] == before
    before = about_of(own / "runs/random/seed-000")["versions"]["before"]
    assert [each["source of sliders:Slider"] for each in before] == [kept]
    sys.modules.pop("answers")
    assert sources(Config(), PlanarArm()) == {}


def test_a_robot_that_has_become_another_one_is_refused(own, capsys):
    assert command(main, OWN) == 0
    text = (own / "sliders.py").read_text()
    (own / "sliders.py").write_text(text.replace("dim, context_dim = 1, 0", "dim, context_dim = 2, 0"))
    sys.modules.pop("sliders")
    assert command(main, [*OWN, "--movements", "60", "--resume"]) == 2
    assert "is this another robot?" in capsys.readouterr().err


def test_an_option_whose_default_is_nan_changes_nothing_and_the_run_can_go_on(module, capsys):
    module(
        "unset",
        "from sgimd_torch.tasks.robots import planar_arm_7\n"
        'def make(*, limit: float = float("nan")):\n    return planar_arm_7()\n',
    )
    short = "--environment unset:make --algorithm random --movements 5 --evaluate-at [] --out runs"
    words = short.split()
    assert command(main, words) == command(main, [*words, "--resume", "--movements", "6"]) == 0
    assert finished(parse([*words, "--movements", "6"])[0])
    assert command(main, [*words, "--movements", "7", "--environment.limit", "1.0", "--resume"]) == 2
    assert "environment.limit was nan, now 1.0" in capsys.readouterr().err


def test_a_path_that_sqlite_cannot_open_is_refused_by_its_length(tmp_path, capsys):
    words = ["--algorithm", "random", "--movements", "3", "--evaluate-at", "[]"]
    assert command(main, [*words, "--out", str(tmp_path / "/".join(["x" * 100] * 6))]) == 2
    assert "has more than 504 bytes; choose a shorter --out" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
