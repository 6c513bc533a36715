"""Runs that are stopped, killed, damaged or made longer: in the end they are as if nothing had happened."""

import json
import os
import signal
import zlib
from dataclasses import replace

import numpy as np
import pytest
from sgimd_torch.runs.tables import sealed

from runs import EAGER, MOVEMENTS, accept_loss, arguments, csv_of, signal_after, start
from sgimd_torch.evaluation import evaluate
from sgimd_torch.files import lock
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.runs import run as run_script
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.read import finished, read_run
from sgimd_torch.spaces import stream


@pytest.mark.parametrize(
    ("signum", "lines", "code"), [(signal.SIGKILL, 20, -9), (signal.SIGKILL, 64, -9), (signal.SIGINT, 40, 130)]
)
def test_a_run_that_is_stopped_and_resumed_ends_as_if_it_never_was(
    tmp_path, go, benchmark, reference, capsys, signum, lines, code
):
    directory = tmp_path / "sgim-d" / "seed-003"
    process = start(EAGER, *arguments(tmp_path, benchmark))
    found, errors = signal_after(process, directory / "episodes.csv", lines, signum)
    assert found == code
    assert "Traceback" not in errors
    assert ("--resume" in errors) == (signum == signal.SIGINT)
    before = (directory / "episodes.csv").read_bytes()
    assert lines <= before.count(b"\n") < MOVEMENTS
    assert read_run(directory).summary["movements"] < before.count(b"\n")  # the log is the first to know
    assert go(tmp_path) == 2  # without --resume nothing is touched
    assert "--resume" in capsys.readouterr().err
    assert (directory / "episodes.csv").read_bytes() == before
    assert go(tmp_path, "--resume") == 0
    assert csv_of(directory) == reference


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["random", "imitation", "sgim-d"])
def test_a_run_killed_five_times_at_random_ends_as_if_it_never_was(tmp_path, go, benchmark, algorithm):
    options = ("--algorithm", algorithm, "--movements", 900, "--evaluate_at", "200,400,600,800")
    assert go(tmp_path / "whole", *options) == 0
    directory = tmp_path / "killed" / algorithm / "seed-003"
    for lines in sorted(stream(0, "kills").integers(2, 880, size=5)):
        process = start(EAGER, *arguments(tmp_path / "killed", benchmark), *options, "--resume")
        signal_after(process, directory / "episodes.csv", lines, signal.SIGKILL)
    assert go(tmp_path / "killed", *options, "--resume") == 0
    assert csv_of(directory) == csv_of(tmp_path / "whole" / algorithm / "seed-003")


@pytest.mark.parametrize("algorithm", ["sgim-d", "observation"])
def test_a_finished_run_made_longer_equals_a_long_run(tmp_path, go, algorithm):
    options = ("--algorithm", algorithm)
    assert go(tmp_path / "long", *options) == 0
    assert go(tmp_path / "extended", *options, "--movements", 50) == 0  # evaluated after 50, which the long one is not
    assert go(tmp_path / "extended", *options, "--resume") == 0
    extended = tmp_path / "extended" / algorithm / "seed-003"
    assert csv_of(extended) == csv_of(tmp_path / "long" / algorithm / "seed-003")
    assert read_run(extended).config["movements"] == MOVEMENTS


def test_resuming_a_finished_run_changes_nothing_but_what_is_asked_of_its_evaluation(tmp_path, go, reference):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    assert go(tmp_path, "--resume") == 0
    assert csv_of(directory) == reference
    assert go(tmp_path, "--resume", "--evaluate_at", "45", "--repeats", 3) == 0
    assert read_run(directory).evaluation["movements"].tolist() == [45, 90]
    assert go(tmp_path, "--resume") == 0
    assert csv_of(directory) == reference


def test_a_resumed_run_keeps_its_evaluations_until_floor_at_changes(tmp_path, go, reference, monkeypatch):
    evaluated = []

    def evaluate_and_note(inverse, environment, goals, seed, movements, **options):
        if not isinstance(inverse, LocallyLinear):  # the other answer, which never measures the noise
            evaluated.append((movements, options["repeats"]))
        return evaluate(inverse, environment, goals, seed, movements, **options)

    monkeypatch.setattr(run_script, "evaluate", evaluate_and_note)
    assert go(tmp_path, "--movements", 60, "--floor_at", "30,90") == 0
    assert evaluated == [(30, 2), (60, 0)]
    assert go(tmp_path, "--resume", "--floor_at", "30,90") == 0
    assert evaluated == [(30, 2), (60, 0), (90, 2)]
    assert go(tmp_path, "--resume", "--floor_at", "30,90") == 0
    assert len(evaluated) == 3
    assert go(tmp_path, "--resume", "--floor_at", "90") == 0
    assert evaluated[3:] == [(30, 0), (60, 0), (90, 2)]
    assert go(tmp_path, "--resume") == 0  # null: all of them
    assert evaluated[6:] == [(30, 2), (60, 2), (90, 2)]
    assert csv_of(tmp_path / "sgim-d" / "seed-003") == reference


def tear(content):
    return content[:-100]


def zero(content):
    return content[:-1500] + bytes(1500)


def flip(content):
    digit = content.index(b"\n40,") + 60
    return content[:digit] + (b"7" if content[digit : digit + 1] != b"7" else b"8") + content[digit + 1 :]


def lose_newline(content):
    return content[:-1]


def append_garbage(content):
    return content + b"\xff\x00 90,,,"


def repeat_last_line(content):
    return content + content.splitlines(keepends=True)[-1]


def files_of(directory):
    return {path.name: path.read_bytes() for path in directory.iterdir()}


@pytest.mark.parametrize(
    ("damage", "kept"),
    [
        *[(tear, 89), (zero, 87), (flip, 40), (lose_newline, 89)],
        (lambda content: b"", 0),
        (lambda content: None, 0),  # deleted
        (lambda content: content[:100], 0),  # a part of its first line
        (lambda content: b"".join(content.splitlines(keepends=True)[:1]), 0),
        (lambda content: b"".join(content.splitlines(keepends=True)[:31]), 30),  # cut at the end of a line
    ],
)
def test_a_log_that_lacks_movements_is_continued_only_if_the_loss_is_accepted(
    tmp_path, go, benchmark, reference, capsys, damage, kept
):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    log, damaged = directory / "episodes.csv", damage(reference["episodes.csv"])
    log.unlink() if damaged is None else log.write_bytes(damaged)
    run = read_run(directory)
    assert len(run.index) == kept
    assert run.damage == ({"episodes.csv": 42} if damage is flip else {})
    before = files_of(directory)
    assert go(tmp_path, "--resume") == 2
    message = capsys.readouterr().err
    assert f"episodes.csv holds {kept} movements" in message
    assert "summary.json counts 90; was it cut, emptied or deleted?" in message
    assert ("line 42 is damaged" in message) == (damage is flip)
    assert f"the {90 - kept} missing ones again with --accept-loss" in message
    assert files_of(directory) == before
    notes = "\n".join(accept_loss(tmp_path, benchmark))
    whole = sum(map(len, reference["episodes.csv"].splitlines(keepends=True)[: kept + 1])) if kept else 0
    if damaged and len(damaged) not in (whole, reference["episodes.csv"].index(b"\n") + 1):
        assert f"episodes.csv: dropped {len(damaged) - whole} bytes" in notes
        assert f"{kept} movements are kept" in notes
    assert f"episodes.csv lacks {90 - kept} movements: {kept} are kept" in notes
    assert csv_of(directory) == reference
    if damaged is None:
        assert not list(directory.glob("*.lost-*"))
    else:
        assert f"as it was found is kept as {log}.lost-0" in notes
        assert (directory / "episodes.csv.lost-0").read_bytes() == damaged
    assert go(tmp_path, "--resume") == 0  # nothing is missing any more


def test_no_copy_of_a_lost_log_is_overwritten_and_a_loss_is_accepted_once(tmp_path, go, benchmark, reference):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    lines = reference["episodes.csv"].splitlines(keepends=True)
    for k, kept in enumerate((31, 51)):
        (directory / "episodes.csv").write_bytes(b"".join(lines[:kept]))
        accept_loss(tmp_path, benchmark, "--movements", 70)
        (directory / "episodes.csv").write_bytes(b"".join(lines[:71]))
        assert (directory / f"episodes.csv.lost-{k}").read_bytes() == b"".join(lines[:kept])
    assert go(tmp_path, "--resume") == 0
    assert csv_of(directory) == reference
    assert (directory / "episodes.csv.lost-0").read_bytes() == b"".join(lines[:31])


def test_a_replay_that_fails_leaves_a_lossy_directory_as_it_was(tmp_path, go, benchmark):
    assert go(tmp_path) == go(tmp_path, "--seed", 4) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    other = (tmp_path / "sgim-d" / "seed-004" / "episodes.csv").read_bytes()
    (directory / "episodes.csv").write_bytes(other[: other.index(b"\n40,") + 1])
    before = files_of(directory)
    with pytest.raises(run_script.ReplayError, match="movement 0"):
        accept_loss(tmp_path, benchmark)
    assert files_of(directory) == before


@pytest.mark.parametrize(
    ("damage", "kept", "copied"), [(append_garbage, 90, False), (repeat_last_line, 90, True), (flip, 40, True)]
)
def test_whole_lines_of_a_damaged_log_are_kept_and_the_rest_is_made_again(
    tmp_path, go, reference, capsys, damage, kept, copied
):
    """Without asking if nothing shows that movements are missing; an incomplete last line is no damage."""
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    log = directory / "episodes.csv"
    damaged = damage(log.read_bytes())
    log.write_bytes(damaged)
    if kept < 90:
        (directory / "summary.json").unlink()
    assert len(read_run(directory).index) == kept
    assert read_run(directory).damage == ({"episodes.csv": kept + 2} if copied else {})
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 0
    dropped = len(damaged) - sum(map(len, reference["episodes.csv"].splitlines(keepends=True)[: kept + 1]))
    messages = capsys.readouterr().err
    assert f"episodes.csv: dropped {dropped} bytes" in messages
    assert f"from line {kept + 2} on" in messages
    assert f"{kept} movements are kept" in messages
    assert csv_of(directory) == reference
    copies = list(directory.glob("*.lost-*"))
    assert [copy.read_bytes() for copy in copies] == [damaged] * copied
    assert ("is kept as" in messages) == copied


def test_a_process_killed_between_log_and_summary_loses_nothing_and_asks_nothing(tmp_path, go, benchmark, reference):
    directory, dying = tmp_path / "sgim-d" / "seed-003", "sgimd_torch.runs.directory"
    program = (
        f"import os, signal, {dying} as directory\n"
        "write = directory.write_json\n"
        "def write_or_die(path, content):\n"
        "    if content.get('movements') == 50 and path.name == 'summary.json':\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    write(path, content)\n"
        f"directory.write_json = write_or_die\n{EAGER}"
    )
    process = start(program, *arguments(tmp_path, benchmark))
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    run = read_run(directory)
    assert (len(run.index), run.summary["movements"], run.damage) == (50, 49, {})
    assert go(tmp_path, "--resume") == 0
    assert csv_of(directory) == reference


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize(
    ("name", "column", "line"), [("evaluation.csv", "mean_error_m", 4), ("regions.csv", "competence", 4)]
)
def test_an_edited_row_is_reported_and_made_again(tmp_path, go, reference, capsys, name, column, line, checked):
    """Also in the tables of earlier versions, which had no checksums, if the number is impossible."""
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    lines = [row.split(",") for row in reference[name].decode().splitlines()]
    lines[line - 1][lines[0].index(column)] = "-5"
    text = "".join(",".join(row if checked else row[:-1]) + "\n" for row in lines)
    (directory / name).write_text(text)
    run = read_run(directory)
    first = next(k for k, row in enumerate(lines, 1) if row[0] == lines[line - 1][0])  # of its map
    assert run.damage == {name: first}
    assert run.unchecked == (() if checked else (name,))
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 0
    messages = capsys.readouterr().err
    assert f"{name}: dropped" in messages
    assert f"from line {first} on, torn or damaged; it will be evaluated again" in messages
    assert (f"{name} was made without checksums" in messages) == (not checked)
    assert csv_of(directory) == reference
    assert read_run(directory).damage == {}


def test_a_directory_of_an_earlier_version_is_read_resumed_and_gets_checksums(tmp_path, go, reference, capsys):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path, "--movements", 60) == 0
    for name in ("evaluation.csv", "regions.csv"):
        lines = (directory / name).read_text().splitlines()
        (directory / name).write_text("".join(line.rpartition(",")[0] + "\n" for line in lines))
    old = read_run(directory)
    assert old.unchecked == ("evaluation.csv", "regions.csv")
    assert old.evaluation["movements"].tolist() == [30, 60]
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 0
    messages = capsys.readouterr().err
    assert messages.count("was made without checksums") == 2
    assert "evaluated again" not in messages
    assert csv_of(directory) == reference
    assert read_run(directory).unchecked == ()


def test_an_evaluation_that_lost_an_answer_is_done_again(tmp_path, go, reference):
    path = tmp_path / "sgim-d" / "seed-003" / "evaluation.csv"
    assert go(tmp_path) == 0
    lines = path.read_bytes().splitlines(keepends=True)
    assert lines[4].startswith(b"60,linear")
    path.write_bytes(b"".join(lines[:4]))
    assert read_run(path.parent).evaluation["movements"].tolist() == [30, 60]
    assert go(tmp_path, "--resume") == 0
    assert csv_of(path.parent) == reference


def test_evaluations_from_before_there_were_answers_are_the_runs_own(tmp_path, go, benchmark, reference):
    path = tmp_path / "sgim-d" / "seed-003" / "evaluation.csv"
    assert go(tmp_path, "--movements", 60, "--evaluated-by", "own") == 0
    today = read_run(path.parent).evaluation
    rows = [line.split(",") for line in path.read_text().splitlines()]
    rows = [[row[0], *row[2:-2]] for row in rows]  # as they were, before answers, goals met and checksums
    path.write_bytes(",".join([*rows[0], "crc32\n"]).encode() + b"".join(map(sealed, rows[1:])))
    settings = json.loads((path.parent / "config.json").read_text())
    del settings["answers"]
    (path.parent / "config.json").write_text(json.dumps(settings))
    before = read_run(path.parent)
    assert list(before.answers) == ["own"]
    assert before.damage == {}
    assert before.evaluation["mean_error_m"].tolist() == today["mean_error_m"].tolist()
    assert np.isnan(before.evaluation["goals_met"]).all()
    config = Config("sgim-d", seed=3, movements=60, evaluate_at=(30, 60), repeats=2, benchmark=benchmark, out=tmp_path)
    assert finished(replace(config, answers=("own",)))
    assert not finished(config)  # linear did not answer yet
    assert go(tmp_path, "--resume") == 0
    assert csv_of(path.parent) == reference


@pytest.mark.parametrize("name", ["evaluation.csv", "regions.csv"])
@pytest.mark.parametrize("damage", [tear, lose_newline, append_garbage, lambda content: bytes(len(content))])
def test_damaged_evaluations_are_done_again(tmp_path, go, reference, capsys, name, damage):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    (directory / name).write_bytes(damage((directory / name).read_bytes()))
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 0
    assert f"{name}: dropped" in capsys.readouterr().err
    assert csv_of(directory) == reference


def test_a_run_killed_before_its_config_was_written_starts_afresh(tmp_path, go, reference, capsys):
    directory = tmp_path / "sgim-d" / "seed-003"
    directory.mkdir(parents=True)
    for name in ("lock", "versions.json", "config.json.part"):
        (directory / name).touch()
    assert go(tmp_path, "--resume") == 0
    assert "no run yet" in capsys.readouterr().err
    assert csv_of(directory) == reference
    assert not list(directory.glob("*.part"))


def test_a_log_that_another_learner_wrote_is_not_continued(tmp_path, go, capsys):
    assert go(tmp_path) == go(tmp_path, "--seed", 4) == 0
    directory = tmp_path / "sgim-d" / "seed-003"
    other = (tmp_path / "sgim-d" / "seed-004" / "episodes.csv").read_bytes()
    (directory / "episodes.csv").write_bytes(other + b"torn")
    before = {path.name: path.read_bytes() for path in directory.iterdir()}
    capsys.readouterr()
    assert go(tmp_path, "--resume", "--evaluate_at", "10", "--movements", 95) == 2
    message = capsys.readouterr().err
    assert "movement 0" in message
    assert "Traceback" not in message
    assert {path.name: path.read_bytes() for path in directory.iterdir()} == before


def test_a_replay_that_disagrees_names_the_columns(tmp_path, go, capsys):
    assert go(tmp_path) == 0
    log = tmp_path / "sgim-d" / "seed-003" / "episodes.csv"
    header, *lines = log.read_text().splitlines()
    k = next(k for k, line in enumerate(lines) if line.split(",")[1] == "local")
    fields = lines[k].split(",")[:-1]
    column = header.split(",").index("goal_0")
    goal, fields[column] = fields[column], "0.125"
    fields[1] = "global"
    body = ",".join(fields)
    lines[k] = f"{body},{zlib.crc32(body.encode()):08x}"
    log.write_text("".join(f"{line}\n" for line in (header, *lines)))
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 2
    message = capsys.readouterr().err
    assert f"movement {k} " in message
    assert f"origin was global, now local; goal_0 was 0.125, now {goal}. Was it recorded by another" in message
    assert len(message) < 300


def test_a_run_is_resumed_with_its_own_configuration_only(tmp_path, go, capsys):
    assert go(tmp_path, "--movements", 10) == 0
    before = (tmp_path / "sgim-d" / "seed-003" / "config.json").read_bytes()
    assert go(tmp_path, "--resume", "--budget", 7, "--goals", "uniform") == 2
    message = capsys.readouterr().err
    assert "goals was interest-map, now uniform" in message
    assert f"budget was {Config('sgim-d').budget}, now 7" in message
    assert "epsilon" not in message
    assert (tmp_path / "sgim-d" / "seed-003" / "config.json").read_bytes() == before


def test_a_run_is_not_made_shorter(tmp_path, go, capsys):
    assert go(tmp_path, "--movements", 10) == 0
    assert go(tmp_path, "--movements", 9, "--resume") == 2
    assert "10 movements already" in capsys.readouterr().err
    assert go(tmp_path, "--movements", 10, "--resume") == 0


def test_a_run_that_another_process_writes_is_left_alone(tmp_path, go, capsys):
    assert go(tmp_path, "--movements", 10) == 0
    held = lock(tmp_path / "sgim-d" / "seed-003" / "lock")
    assert go(tmp_path, "--resume") == 2
    os.close(held)
    assert "in use by another process" in capsys.readouterr().err
    assert go(tmp_path, "--resume") == 0


@pytest.mark.parametrize("watched", ["false", "true"])
def test_a_full_disk_is_reported_and_the_run_can_go_on(tmp_path, go, benchmark, reference, watched):
    directory = tmp_path / "sgim-d" / "seed-003"
    process = start(EAGER, *arguments(tmp_path, benchmark), "--board", watched, limit="-f 24")  # KiB a file may have
    _, errors = process.communicate()
    assert process.returncode == 1
    assert "cannot be written" in errors
    assert "Traceback" not in errors
    sizes = {path.name.partition(".")[0]: path.stat().st_size for path in directory.iterdir()}
    assert sizes["events" if watched == "true" else "episodes"] == 24 * 1024
    assert go(tmp_path, "--board", watched, "--resume") == 0
    assert csv_of(directory) == reference


@pytest.mark.parametrize(
    "damage", ['{"seconds_physics": "x"}', "null", "", '{"seconds_physics": null}', '{"movements": "many"}']
)
@pytest.mark.parametrize("name", ["summary.json", "versions.json"])
def test_a_damaged_note_on_the_run_counts_as_missing(tmp_path, go, reference, capsys, name, damage):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path, "--movements", 50) == 0
    (directory / name).write_text(damage)
    capsys.readouterr()
    assert go(tmp_path, "--resume") == 0
    assert ("it counts as missing" in capsys.readouterr().err) == (name == "summary.json" or damage in ("null", ""))
    assert csv_of(directory) == reference


@pytest.mark.parametrize("line", ["nan,nan,nan,nan,nan", "60.5,1,1,1,1", "4e1,1,1,1,1", "R,1,2,3,4", "60,R,1,1,1"])
def test_a_line_of_evaluations_that_means_nothing_is_dropped(tmp_path, go, reference, capsys, line):
    directory = tmp_path / "sgim-d" / "seed-003"
    assert go(tmp_path) == 0
    lines = (directory / "evaluation.csv").read_text().splitlines()
    (directory / "evaluation.csv").write_text("\n".join([*lines[:2], line, ""]))
    capsys.readouterr()
    assert read_run(directory).evaluation["movements"].tolist() == [30]
    assert go(tmp_path, "--resume") == 0
    assert "evaluation.csv: dropped" in capsys.readouterr().err
    assert csv_of(directory) == reference


def test_the_versions_of_each_part_of_a_run_are_kept(tmp_path, go):
    path = tmp_path / "sgim-d" / "seed-003" / "versions.json"
    short = ("--movements", 3, "--evaluate_at", "[]")
    assert go(tmp_path, *short) == 0
    for other in ("1.0", "2.0"):
        path.write_text(json.dumps({**json.loads(path.read_text()), "numpy": other}))
        assert go(tmp_path, *short, "--resume") == 0
    now = json.loads(path.read_text())
    assert now["numpy"] == np.__version__
    assert [part["numpy"] for part in now["before"]] == ["1.0", "2.0"]
