"""Runs that are stopped, killed, damaged or made longer: in the end they are as if nothing had happened."""

import os
import re
import shutil
import signal
import sqlite3
import sys
from dataclasses import replace

import numpy as np
import pytest

from marks import slow
from runs import (
    MOVEMENTS,
    STOPS,
    arguments,
    content_of,
    edit,
    end,
    files_of,
    start,
    stopped,
    stopped_at,
)
from sgimd_torch.evaluation import evaluate
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.record import Record
from sgimd_torch.runs import evaluations, run_parts
from sgimd_torch.runs import run as run_module
from sgimd_torch.runs.command import main
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import movements_on_disk, read_run
from sgimd_torch.spaces import stream
from sgimd_torch.tasks import benchmark_of

# On the arm: a learner with regions, one with a model; and one in contexts.
ARM = "--environment planar-arm-7 --benchmark null --repeats 0 --evaluate_at 50"
LEARNERS = {
    "rod": "",
    "rod, observing": "--algorithm observation",
    "arm": f"{ARM} --algorithm sagg-riac",
    "model": f"{ARM} --search gradient --inverse model --inverse.rate 0.5 --inverse.members 2 --evaluated-by own",
    "contexts": f"{ARM} --environment experiments.toys:toss --algorithm practice-taught",
}


@pytest.mark.parametrize(
    ("name", "movements", "signum", "code"),
    [("rod", 64, signal.SIGKILL, -9), ("rod", 40, signal.SIGINT, 130), slow("contexts", 33, signal.SIGKILL, -9)],
)
def test_a_run_that_is_stopped_and_resumed_ends_as_if_it_never_was(
    tmp_path, go, benchmark, capsys, name, movements, signum, code
):
    options = [*LEARNERS[name].split(), "--name", "run"]
    directory = tmp_path / "cut" / "run" / "seed-003"
    process = stopped_at(movements, *arguments(tmp_path / "cut", benchmark), *options)
    found, errors = end(process, signum)
    assert found == code
    assert "Traceback" not in errors
    assert ("--resume" in errors) == (signum == signal.SIGINT)
    assert movements_on_disk(directory) == movements
    assert read_run(directory).summary["finished"] is False
    before = files_of(directory)
    assert go(tmp_path / "cut", *options) == 2  # without --resume nothing is touched
    assert "--resume" in capsys.readouterr().err
    assert files_of(directory) == before
    assert go(tmp_path / "cut", *options, "--resume") == 0
    assert go(tmp_path / "whole", *options) == 0
    assert content_of(directory) == content_of(tmp_path / "whole" / "run" / "seed-003")


@pytest.mark.slow
@pytest.mark.parametrize("name", LEARNERS)
def test_a_run_killed_five_times_at_random_ends_as_if_it_never_was(tmp_path, go, benchmark, name):
    options = [*LEARNERS[name].split(), "--name", "run", "--movements", 160]
    assert go(tmp_path / "whole", *options) == 0
    for k in sorted(stream(0, "kills").choice(np.arange(2, 160), size=5, replace=False)):
        end(stopped_at(k, *arguments(tmp_path / "killed", benchmark), *options, "--resume"))
        assert movements_on_disk(tmp_path / "killed" / "run" / "seed-003") == k
    assert go(tmp_path / "killed", *options, "--resume") == 0
    killed, whole = (content_of(tmp_path / place / "run" / "seed-003") for place in ("killed", "whole"))
    assert killed == whole


def test_a_kill_loses_what_came_since_the_last_commit_and_every_evaluation_is_one(tmp_path, go, benchmark, reference):
    never = STOPS.format(45).replace("COMMIT_EVERY, after = 0", "COMMIT_EVERY, after = 1e9")
    end(stopped(never, *arguments(tmp_path, benchmark)))
    directory = tmp_path / "sgim-d" / "seed-003"
    run = read_run(directory)
    assert (len(run.index), run.evaluation["movements"].tolist()) == (30, [30])
    assert go(tmp_path, "--resume") == 0
    assert content_of(directory) == reference


def test_a_run_killed_before_its_record_was_made_starts_afresh(tmp_path, go, reference, capsys):
    directory = tmp_path / "sgim-d" / "seed-003"
    directory.mkdir(parents=True)
    for name in (RUN_FILE, f"{RUN_FILE}.7.part"):
        (directory / name).touch()
    assert go(tmp_path, "--resume") == 0
    assert "no run yet" in capsys.readouterr().err
    assert content_of(directory) == reference


def test_a_run_that_another_process_writes_is_left_alone(tmp_path, go, benchmark, reference, capsys):
    process = stopped_at(20, *arguments(tmp_path, benchmark))
    assert len(read_run(tmp_path / "sgim-d" / "seed-003").index) == 20  # it may be read
    assert go(tmp_path, "--resume") == 2
    assert "in use by another process" in capsys.readouterr().err
    assert end(process, signal.SIGCONT)[0] == 0
    assert content_of(tmp_path / "sgim-d" / "seed-003") == reference


WHOLE = [(30, 0), (60, 0), (90, 2)]  # numbers of movements before each evaluation, and of its repeats
WALKS = {  # options of each start of a run, and the evaluations for which it executes movements
    "longer": [("--movements 50", [(30, 0), (50, 2)]), ("", [(60, 0), (90, 2)])],
    "other moments": [
        ("", WHOLE),
        ("", []),
        ("--evaluate_at 45 --repeats 3", [(45, 0), (90, 3)]),
        ("--evaluate_at 45,60 --repeats 3", [(60, 0), (90, 3)]),
        ("", WHOLE),
    ],
    "other floors": [
        ("--movements 60 --floor_at 30,90", [(30, 2), (60, 0)]),
        ("--floor_at 30,90", [(90, 2)]),
        ("--floor_at 30,90", []),
        ("--floor_at 90", WHOLE),
        ("", WHOLE),  # null: only the end
    ],
}


@pytest.mark.parametrize("walk", WALKS)
def test_a_resumed_run_makes_only_the_evaluations_that_are_missing_or_asked_for(
    tmp_path, go, reference, monkeypatch, walk
):
    evaluated = []

    def evaluate_and_note(inverse, environment, goals, seed, movements, **options):
        if not isinstance(inverse, LocallyLinear):  # the other inverse model, which never measures the noise
            evaluated.append((movements, options["repeats"]))
        return evaluate(inverse, environment, goals, seed, movements, **options)

    monkeypatch.setattr(evaluations, "evaluate", evaluate_and_note)
    for k, (options, executed) in enumerate(WALKS[walk]):
        assert go(tmp_path, *options.split(), *["--resume"] * (k > 0)) == 0
        assert evaluated == executed
        evaluated.clear()
    assert content_of(tmp_path / "sgim-d" / "seed-003") == reference
    assert read_run(tmp_path / "sgim-d" / "seed-003").config["movements"] == MOVEMENTS


@pytest.fixture
def copy(tmp_path, undisturbed):
    """A copy of the uninterrupted run."""
    return shutil.copytree(undisturbed, tmp_path / "sgim-d" / "seed-003")


@pytest.mark.parametrize("others", [lambda goals: goals[1:], lambda goals: 0.9 * goals])
def test_if_the_robot_now_has_other_goals_all_evaluations_are_repeated(tmp_path, copy, go, monkeypatch, capsys, others):
    def changed(*arguments):
        benchmark, *rest = benchmark_of(*arguments)
        return replace(benchmark, goals=others(benchmark.goals)), *rest

    before = read_run(copy)
    monkeypatch.setattr(run_parts, "benchmark_of", changed)
    assert go(tmp_path, "--resume") == 0
    assert "evaluations after 30, 60, 90 movements are dropped, or repeated" in capsys.readouterr().err
    now = read_run(copy)
    assert np.array_equal(now.benchmark, others(before.benchmark))
    assert {len(now.missed_by(movements)[0]) for movements in (30, 60, 90)} == {len(now.benchmark)}


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("UPDATE events SET outcome_0 = 0.5 WHERE movement = 40 AND kind = 'moved'", "of events is not what was"),
        ("DELETE FROM regions WHERE rowid > 1", "regions has 1 rows, .* were written"),
        ("UPDATE about SET value = '[1]' WHERE name = 'settings'", "row 1 of about"),
        (bytes(8192), "cannot be read as a record"),
    ],
)
def test_a_damaged_run_is_refused_and_left_as_it_is(tmp_path, copy, go, capsys, damage, message):
    (copy / RUN_FILE).write_bytes(damage) if isinstance(damage, bytes) else edit(copy / RUN_FILE, damage)
    before = files_of(copy)
    assert go(tmp_path, "--resume") == 2
    said = capsys.readouterr().err
    assert re.search(rf"{message}.*sqlite3 run.sqlite .recover prints what can be read", said)
    assert "Traceback" not in said
    assert files_of(copy) == before


def rewritten(path, change):
    """Write a record anew, whole, with ``change(k, event)`` in the place of the k-th event."""
    with Record(path) as old:
        about, events, dims = old.about, list(old.events()), old.dims
    path.unlink()
    with Record.make(path, dims, about) as new:
        for k, event in enumerate(events):
            new.add(change(k, event))
        new.commit()


@pytest.mark.parametrize(("name", "value"), [("theta", 0.1), ("goal", 0.125)])
def test_a_replay_that_fails_says_where_and_leaves_the_file_as_it_was(
    tmp_path, copy, go, reference, capsys, name, value
):
    row = [origin for _, _, origin, *_ in reference["events"]].index("local")
    movement = reference["events"][row][0]

    def change(k, event):
        if k != row:
            return event
        vector = getattr(event, name).copy()
        vector[0] = value
        return event._replace(**{name: vector})

    rewritten(copy / RUN_FILE, change)
    before = files_of(copy)
    assert go(tmp_path, "--resume", "--evaluate_at", "10", "--movements", 95) == 2
    message = capsys.readouterr().err
    assert f"movement {movement} was recorded with another {name}: {name}_0 was {value}, now" in message
    assert "Traceback" not in message
    assert files_of(copy) == before


def test_another_configuration_a_shorter_one_and_what_is_no_run_are_refused(tmp_path, copy, go, capsys):
    before = files_of(copy)
    for options, messages in (
        (("--budget", 7, "--goals", "uniform"), ("goals was interest-map, now uniform", "budget was", "now 7")),
        (("--movements", 89), ("90 movements already, 89 were requested",)),
    ):
        assert go(tmp_path, "--resume", *options) == 2
        said = capsys.readouterr().err
        assert all(message in said for message in messages)
        assert "epsilon" not in said
    assert files_of(copy) == before


@pytest.mark.parametrize("watched", ["false", slow("true")])
def test_a_full_disk_is_reported_and_the_run_can_go_on(tmp_path, go, benchmark, reference, watched):
    words = (*arguments(tmp_path, benchmark), "--board", watched)
    process = start(STOPS.format(-1), *words, limit="-f 64")  # KiB a file may have
    _, errors = process.communicate()
    assert process.returncode == 1
    assert errors.count("\nerror: ") == 1
    assert "cannot be written" in errors
    assert "Traceback" not in errors
    directory = tmp_path / "sgim-d" / "seed-003"
    assert movements_on_disk(directory) < MOVEMENTS
    assert go(tmp_path, "--board", watched, "--resume") == 0
    assert content_of(directory) == reference


def viewed(path):
    """A connection of another program that has begun to read a record and does not end."""
    viewer = sqlite3.connect(path, isolation_level=None)
    viewer.execute("BEGIN")
    assert viewer.execute("SELECT * FROM events").fetchone()
    return viewer


@pytest.mark.slow
def test_beside_an_open_cursor_of_another_program_a_killed_run_keeps_every_commit(tmp_path, go, benchmark, reference):
    directory = tmp_path / "sgim-d" / "seed-003"
    process = stopped_at("20 or life.movements == 60", *arguments(tmp_path, benchmark))
    viewer = viewed(directory / RUN_FILE)
    process.send_signal(signal.SIGCONT)
    assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
    assert end(process)[0] == -signal.SIGKILL
    shutil.copytree(directory, tmp_path / "copied" / "seed-003")
    assert movements_on_disk(tmp_path / "copied" / "seed-003") == 60
    viewer.close()
    assert movements_on_disk(directory) == 60
    assert go(tmp_path, "--resume") == 0
    assert content_of(directory) == reference
    before = files_of(directory)
    assert [*before] == [RUN_FILE]  # a finished run is one file, which no reader changes
    assert movements_on_disk(directory) == 90
    assert files_of(directory) == before


@pytest.mark.parametrize("local", [False, slow(True)])
def test_where_a_reader_stops_commits_a_line_says_since_when(tmp_path, copy, monkeypatch, local, go, capsys):
    """A reader that came before the log, or a file system of several machines."""
    monkeypatch.setattr(run_module, "COMMIT_EVERY", 0.0)
    monkeypatch.setattr("sgimd_torch.record._shares_memory", lambda path: local)
    viewer, commit, kept = viewed(copy / RUN_FILE), Record.commit, []

    def commit_and_note(record):
        kept.append(commit(record))
        if len(kept) == 3:
            viewer.close()
        return kept[-1]

    monkeypatch.setattr(Record, "commit", commit_and_note)
    assert go(tmp_path, "--resume", "--movements", "100") == 0
    said = f"another program reads {copy / RUN_FILE}: until it ends, nothing after movement 90 is kept"
    assert capsys.readouterr().err.count(said) == 1
    assert kept[:3] == [False] * 3
    assert movements_on_disk(copy) == 100


def test_ctrl_c_during_an_evaluation_stops_after_its_movement_and_the_run_ends_as_if_it_never_was(
    tmp_path, module, capsys
):
    module("plugged", PLUGGED)
    short = "--environment plugged:Arm --algorithm random --movements 20 --evaluate-at 10 --repeats 2"
    words = short.split()
    plugged = [*words, "--benchmark", "null", "--out"]
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("CTRL_C_AT", "15")
        assert command(main, [*plugged, "stopped"]) == 130
    assert "stopped after 10 movements; to go on: " in capsys.readouterr().err
    assert sys.modules["plugged"].Arm.made == 15
    assert movements_on_disk(tmp_path / "stopped/random/seed-000") == 10
    assert command(main, [*plugged, "stopped", "--resume"]) == command(main, [*plugged, "whole"]) == 0
    assert content_of(tmp_path / "stopped/random/seed-000") == content_of(tmp_path / "whole/random/seed-000")


PLUGGED = """
import os, signal
from sgimd_torch.environments.planar_arm import PlanarArm

class Arm(PlanarArm):
    made, execute_many = 0, None

    def __init__(self):
        super().__init__(5)

    def execute(self, context, theta, rng):
        Arm.made += 1
        if str(Arm.made) == os.environ.get("CTRL_C_AT"):
            signal.raise_signal(signal.SIGINT)
        return super().execute(context, theta, rng)
"""
