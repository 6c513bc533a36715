"""A run that begins with the movements of another robot, and a run whose robot changes, on disk."""

import csv
import os

import pytest

from runs import content_of, edit, write_about
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.options.command_line import main
from sgimd_torch.record.saving import save_life
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.signals import command
from sgimd_torch.views.report.command import main as report

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


def other(tmp_path, past, how):
    """A past that does not fit, and what is said about it."""
    path = tmp_path / "other.csv"
    match how:
        case "joints":
            assert (
                command(
                    main,
                    ["--environment", "experiments.toys:toss", "--movements", "20", "--out", str(tmp_path / "toss")],
                )
                == 0
            )
            return tmp_path / "toss/practice/seed-000" / RUN_FILE, "of context, theta, outcome, this robot has"
        case "unit" | "bounds":
            path = tmp_path / RUN_FILE
            path.write_bytes(past.read_bytes())
            spaces = read_run(past.parent).spaces
            told = {name: [box.low.tolist(), box.high.tolist(), box.names, box.unit] for name, box in spaces.items()}
            told["outcomes"][3] = "mm" if how == "unit" else "m"
            told["policies"][1][2] += how == "bounds"
            write_about(tmp_path, spaces=told)
            return path, "are in mm, here in m" if how == "unit" else "policies of"
        case "damaged":
            path = tmp_path / RUN_FILE
            path.write_bytes(past.read_bytes())
            edit(path, "UPDATE events SET outcome_0 = 0.5 WHERE rowid = 9")
            return path, "row 9 of events is not what was written"
        case "no movements":
            save_life(practice(PlanarArm(7), 0), tmp_path / "life.sqlite")
            return tmp_path / "life.sqlite", "holds no movements to begin with"
        case "columns":
            table(path, past)
            path.write_text(path.read_text().replace("theta_6", "theta_x"))
            return path, "lacks the column theta_6"
        case "more columns":
            path.write_text(",".join([*(f"theta_{k}" for k in range(8)), "outcome_0", "outcome_1"]))
            return path, "has a column theta_7, so it is of another robot"
        case "text":
            lines = table(path, past).read_text().splitlines()
            path.write_text("\n".join([*lines[:3], lines[3].replace("0.", "x.", 1), *lines[4:]]))
            return path, "line 4 is no movement of 9 numbers"
        case "underscore":
            lines = table(path, past).read_text().splitlines()
            path.write_text("\n".join([*lines[:3], lines[3].replace("0.", "0_0.", 1), *lines[4:]]))
            return path, "line 4 is no movement of 9 numbers"
        case "pipe":
            os.mkfifo(path)
            return path, "is a pipe or a device, not a file"
        case "outside":
            lines = table(path, past).read_text().splitlines()
            path.write_text("\n".join([*lines, ",".join(["5"] * 9)]))
            return path, "must lie in its box"
        case "bytes":
            path.write_bytes(b"\xff\xfe\x00\x01")
            return path, "is neither a record nor a csv file"
        case "missing":
            return path, "cannot be read"


HOW = (
    "joints",
    "unit",
    "bounds",
    "damaged",
    "no movements",
    "columns",
    "more columns",
    "text",
    "underscore",
    "pipe",
    "outside",
    "bytes",
    "missing",
)


@pytest.mark.parametrize("how", HOW)
def test_a_past_that_does_not_fit_is_refused_in_one_line_and_nothing_is_left(how, past, tmp_path, capsys):
    path, said = other(tmp_path, past, how)
    capsys.readouterr()
    assert go(tmp_path / "out", "--movements", 20, "--begin-with", path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert not (tmp_path / "out").exists()


def test_an_algorithm_that_does_not_notice_changes_begins_with_nothing(past, tmp_path, capsys):
    assert go(tmp_path, "--algorithm", "random", "--begin-with", past) == 2
    assert "--begin-with: algorithm random does not learn from another robot" in capsys.readouterr().err


@pytest.mark.parametrize("options", [("--inverse", "nearest"), ("--evaluated-by", "own,model")])
def test_a_learner_that_cannot_begin_again_begins_with_nothing(options, past, tmp_path, capsys):
    assert go(tmp_path / "out", *options, "--begin-with", past) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "prior (--begin-with) needs an inverse model that says how sure it is" in line
    assert not (tmp_path / "out").exists()


def test_a_change_is_said_recorded_and_reported(module, capsys):
    where = module(
        "slipping",
        """
import numpy as np
from sgimd_torch import PlanarArm
class Slipping(PlanarArm):
    made = 0
    def execute(self, context, theta, rng):
        self.made += 1
        return super().execute(context, theta if self.made <= 150 else 1 - theta[::-1] ** 2, rng)
def make():
    return Slipping(3)
""",
    )
    options = ["--environment", "slipping:make", "--evaluate-at", "[]", "--repeats", "0", "--out", str(where / "runs")]
    assert command(main, [*options, "--movements", "220"]) == 0
    said = "since movement 150 outcomes are not what they were"
    assert said in capsys.readouterr().err
    found = read_run(where / "runs/practice/seed-000")
    (change,) = found.changes
    assert change.startswith(said)
    assert command(report, [str(where / "runs")]) == 0
    assert said in (where / "runs/report.html").read_text()
    assert command(main, [*options, "--movements", "230", "--resume"]) == 0
    assert read_run(where / "runs/practice/seed-000").changes == [change]
    assert said not in capsys.readouterr().err
