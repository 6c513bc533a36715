"""A run that begins with the movements of another robot."""

import csv
import os

import pytest

from runs import content_of, edit, write_about
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.options.parse import parse
from sgimd_torch.record import RunError
from sgimd_torch.record.replay import save_life
from sgimd_torch.runs.command import main
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import finished, read_run

SHORT = ["--environment", "planar-arm-7", "--repeats", "0", "--evaluate-at", "[]"]


def go(out, *options):
    return command(main, [*SHORT, "--out", str(out), *map(str, options)])


@pytest.fixture(scope="module")
def past(tmp_path_factory):
    """The record of a run on the arm of seven joints."""
    out = tmp_path_factory.mktemp("past")
    assert go(out, "--movements", 120) == 0
    return out / "practice/seed-000" / RUN_FILE


def table(path, past, names=("context", "theta", "outcome")):
    """The movements of a run as a csv file."""
    found = read_run(past.parent)
    columns = {"theta": found.thetas, "outcome": found.outcomes}
    heads = [f"{name}_{k}" for name, rows in columns.items() for k in range(rows.shape[1])]
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([heads, *([*t, *o] for t, o in zip(*columns.values(), strict=True))])
    return path


def test_a_run_begins_with_a_run_or_an_equal_table_and_is_resumed_with_it(past, tmp_path, capsys):
    assert go(tmp_path / "a", "--movements", 40, "--begin-with", past) == 0
    assert f"begins with 120 movements of {past}, as far as they help" in capsys.readouterr().err
    listed = table(tmp_path / "past.csv", past)
    assert go(tmp_path / "b", "--movements", 20, "--begin-with", listed) == 0
    assert go(tmp_path / "b", "--movements", 40, "--begin-with", listed, "--resume") == 0
    whole, resumed = (content_of(tmp_path / name / "practice/seed-000")["events"] for name in "ab")
    assert whole == resumed
    assert go(tmp_path / "alone", "--movements", 40) == 0
    assert content_of(tmp_path / "alone/practice/seed-000")["events"] != whole
    assert load_learner(tmp_path / "a/practice/seed-000").movements == 40
    listed.write_text(listed.read_text().replace("theta_0,theta_1", "theta_1,theta_0"))
    assert go(tmp_path / "b", "--movements", 50, "--begin-with", listed, "--resume") == 2
    assert "begin_with_crc32 was" in capsys.readouterr().err


def test_a_run_is_asked_and_resumed_when_the_file_it_began_with_is_gone(past, tmp_path, monkeypatch):
    listed = table(tmp_path / "past.csv", past)
    for name in ("whole", "cut"):
        assert go(tmp_path / name, "--movements", 40 if name == "whole" else 20, "--begin-with", listed) == 0
    listed.unlink()
    monkeypatch.chdir(tmp_path / "cut")
    assert load_learner("practice/seed-000").movements == 20
    assert go(".", "--movements", 40, "--begin-with", "../past.csv", "--resume") == 0
    assert content_of(tmp_path / "cut/practice/seed-000") == content_of(tmp_path / "whole/practice/seed-000")
    assert len(content_of(tmp_path / "cut/practice/seed-000")["prior"]) == 120
    config, _ = parse([*SHORT, "--out", ".", "--movements", "40", "--begin-with", "../past.csv"])
    assert finished(config)


def refused(path, said, out, capsys):
    """It is refused as a past in one line, and nothing is left."""
    capsys.readouterr()
    assert go(out, "--movements", 20, "--begin-with", path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert not out.exists()


EIGHT_JOINTS = ",".join([*(f"theta_{k}" for k in range(8)), "outcome_0", "outcome_1"])
TABLES = [  # what is done to the lines of a right table, and what is said about it
    (lambda lines: [lines[0].replace("theta_6", "theta_x"), *lines[1:]], "lacks the column theta_6"),
    (lambda lines: [f"theta_0,{lines[0]}", *(f"0.5,{line}" for line in lines[1:])], "has two columns theta_0"),
    (lambda lines: [*lines[:3], lines[3].replace("0.", "\u0660.", 1)], "line 4 is no movement of 9 numbers"),
    (lambda lines: [*lines[:3], "1" * 200_000], "is no csv file: field larger than field limit"),
    (lambda lines: [EIGHT_JOINTS], "has a column theta_7, so it is of another robot"),
    (lambda lines: [*lines[:3], lines[3].replace("0.", "x.", 1)], "line 4 is no movement of 9 numbers"),
    (lambda lines: [*lines[:3], lines[3].replace("0.", "0_0.", 1)], "line 4 is no movement of 9 numbers"),
    (lambda lines: [*lines, ",".join(["5"] * 9)], "must lie in its box"),
    (lambda lines: ["\udcff\udcfe\0\1"], "is no csv file: 'utf-8' codec"),
]


@pytest.mark.parametrize(("change", "said"), TABLES)
def test_a_table_that_does_not_fit_is_refused(change, said, past, tmp_path, capsys):
    path = table(tmp_path / "other.csv", past)
    path.write_bytes("\n".join(change(path.read_text().splitlines())).encode("utf-8", "surrogateescape"))
    refused(path, said, tmp_path / "out", capsys)


@pytest.mark.parametrize("spaces", ["far", {"contexts": "far"}, {"contexts": [0]}, [], None])
def test_a_record_whose_spaces_say_nothing_is_refused(spaces, past, tmp_path, capsys):
    (tmp_path / RUN_FILE).write_bytes(past.read_bytes())
    write_about(tmp_path, spaces=spaces)
    refused(tmp_path / RUN_FILE, "cannot be read as a record", tmp_path / "out", capsys)
    with pytest.raises(RunError, match="cannot be read as a record"):
        read_run(tmp_path)


@pytest.mark.parametrize(("unit", "farther", "said"), [("mm", 0, "are in mm, here in m"), ("m", 1, "policies of")])
def test_a_record_of_other_spaces_is_refused(unit, farther, said, past, tmp_path, capsys):
    (tmp_path / RUN_FILE).write_bytes(past.read_bytes())
    spaces = read_run(past.parent).spaces
    told = {name: [box.low.tolist(), box.high.tolist(), box.names, box.unit] for name, box in spaces.items()}
    told["outcomes"][3] = unit
    told["policies"][1][2] += farther
    write_about(tmp_path, spaces=told)
    refused(tmp_path / RUN_FILE, said, tmp_path / "out", capsys)


def test_a_file_that_is_no_past_of_this_robot_is_refused(past, tmp_path, capsys):
    assert go(tmp_path / "toss", "--environment", "experiments.toys:toss", "--movements", 20) == 0
    save_life(practice(PlanarArm(7), 0), tmp_path / "life.sqlite")
    (tmp_path / "damaged").write_bytes(past.read_bytes())
    edit(tmp_path / "damaged", "UPDATE events SET outcome_0 = 0.5 WHERE rowid = 9")
    os.mkfifo(tmp_path / "pipe")
    for name, said in (
        (f"toss/practice/seed-000/{RUN_FILE}", "of context, theta, outcome, this robot has"),
        ("life.sqlite", "holds no movements to begin with"),
        ("damaged", "row 9 of events is not what was written"),
        ("pipe", "is a pipe or a device, not a file"),
        ("missing.csv", "cannot be read"),
    ):
        refused(tmp_path / name, said, tmp_path / "out", capsys)
