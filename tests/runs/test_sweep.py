"""Many runs at once, in real processes: which runs a command line means, what is left to do, how runs can fail."""

import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import termios
import time
from dataclasses import replace
from pathlib import Path

import pytest

from runs import ROOT, csv_of, signal_after, start, sweep_here
from sgimd_torch.files import locked
from sgimd_torch.runs.command_line import main as run
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import finished, movements_on_disk
from sgimd_torch.runs.sweep import main, variants_of

SWEEP = "import sys; from sgimd_torch.runs import process, sweep; sys.exit(process.command(sweep.main))"
# An arm without physics; 40 movements and one evaluation take a moment.
ALONE = ["--environment", "planar-arm-7", "--movements", "40", "--evaluate-at", "20", "--repeats", "0"]
SHORT = [*ALONE, "--algorithm", "random"]
# On the rod these take some seconds.
LONG = ["--algorithm", "random", "--movements", "1000", "--evaluate-at", "[]"]


def short(out, **changes):
    changes = {"environment": "planar-arm-7", "algorithm": "random", "movements": 40, **changes}
    return Config.from_settings({**changes, "repeats": 0, "evaluate_at": (20,), "out": out})


def long(out, **changes):
    return Config.from_settings({**changes, "algorithm": "random", "movements": 1000, "evaluate_at": (), "out": out})


def swept(*options):
    """In this process; the exit code."""
    return command(main, [str(option) for option in options])


def names(varied, *options):
    return [variant.variant for variant in variants_of(varied, options)[0]]


def test_options_are_crossed_and_each_combination_has_its_name():
    assert names(["goals=interest-map,uniform", "budget=5,15"]) == [
        *("budget=5,goals=interest-map", "budget=15,goals=interest-map"),
        *("budget=5,goals=uniform", "budget=15,goals=uniform"),
    ]
    assert names(["algorithm=random,sgim-d"]) == ["random", "sgim-d"]
    assert names([], "--algorithm", "sagg-riac") == ["sagg-riac"]
    assert names(["goals=uniform,uniform"]) == ["goals=uniform"]
    assert names(["environment.line=1,1.5"]) == ["environment.line=1", "environment.line=1.5"]
    assert names(["demonstrations=/far/away/mine.npz"]) == ["demonstrations=mine.npz"]


def test_the_order_of_what_is_varied_does_not_change_where_runs_go():
    one, other = ["goals=uniform", "algorithm=sgim-d"], ["algorithm=sgim-d", "goals=uniform"]
    assert names(one) == names(other) == ["sgim-d,goals=uniform"]


def test_values_and_further_options_become_those_of_the_runs():
    (few, many), flags = variants_of(["floor-at=[],[20,40]"], ["--movements", "60", "--accept_loss"])
    assert (few.floor_at, many.floor_at) == ((), (20, 40))
    assert few.movements == many.movements == 60
    assert flags == ["--accept-loss"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--vary gaols=uniform", "--gaols: .* did you mean goals?"),
        ("--vary goals=unifrom,grid", "unknown goals 'unifrom'; did you mean uniform?"),
        ("--vary budget=5,x", "--budget must be a whole number, got x"),
        ("--vary budget=5,0", "budget must be .*1.*got 0"),
        ("--vary goals", "--vary must be like goals=interest-map,uniform, got 'goals'"),
        ("--vary goals=", "--vary must be like"),
        ("--vary =uniform", "--vary must be like"),
        ("--vary goals=grid,,uniform", "--vary must be like"),
        ("--vary seed=0,1", "--seed cannot be given here: --seeds takes them"),
        ("--vary name=a,b", "--name cannot be given here"),
        ("--vary out=a,b", "--out cannot be given here: all runs of a sweep go to one --out"),
        ("--seed 3", "--seed cannot be given here: --seeds takes them, such as 5, 0-19 or 0,3,7-9"),
        ("--name=mine", "--name cannot be given here"),
        ("--shard 0/4", "--shard: must be like 1/4, the first of four parts, got '0/4'"),
        ("--shard 5/4", "--shard: must be like 1/4, .*, got '5/4'"),
        ("--shard 2", "--shard: must be like 1/4, .*, got '2'"),
        ("--shard 1/x", "--shard: must be like 1/4, .*, got '1/x'"),
        ("--engine slurm", "--engine: invalid choice: 'slurm'"),
        ("--address auto", "--address auto is of a Ray cluster; it needs --engine ray"),
        ("--engine ray --address auto --processes 2", "--processes cannot be given with --address: a cluster runs as"),
        ("--vary goals=grid --vary goals=uniform", "--goals is there twice"),
        ("--vary environment.task_space=1,2 --environment.task_space 3", "--environment.task-space is there twice"),
        ("--gaols uniform", "--gaols: .*did you mean goals"),
        ("--movements many", "--movements must be a whole number, got many"),
        ("stray", "'stray' belongs to no option"),
        ("--seeds 5-3", "--seeds: must be like 5, 0-19 or 0,3,7-9, got '5-3'"),
        ("--seeds=-1", "--seeds: must be like"),
        ("--seeds 1,,2", "--seeds: must be like"),
        ("--seeds five", "--seeds: must be like"),
        ("--processes 0", "--processes: must be a whole number of at least 1, got '0'"),
        ("--processes two", "--processes: must be a whole number of at least 1, got 'two'"),
        ("--demonstrations nowhere.npz", "there is no file nowhere.npz"),
        ("--vary benchmark=file,nowhere.npz", "file is no"),
        ("--out file", "file cannot be made: file is no folder"),
    ],
)
def test_impossible_requests_are_refused_before_anything_starts(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    assert swept(*options.split()) == 2
    said = capsys.readouterr().err
    assert re.search(message.replace("?", r"\?"), said)
    assert "Traceback" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_seeds_are_one_or_a_range_or_a_list(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for seeds, wanted in (("5", [5]), ("0-2", [0, 1, 2]), ("0,3,7-9", [0, 3, 7, 8, 9]), ("1,0-1", [1, 0])):
        assert swept("--seeds", seeds, "--dry-run") == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines == [f"practice-taught seed {seed}: 0 of 5000 movements" for seed in wanted]
    assert not list(tmp_path.iterdir())


def listed(capsys, *options):
    """The titles of the runs that are still to be done."""
    capsys.readouterr()
    assert swept(*options, "--dry-run") == 0
    return [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()]


def test_shards_are_consecutive_parts_of_the_list_and_together_the_whole(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--vary", "goals=interest-map,uniform", "--seeds", "0-4"]
    whole = listed(capsys, *options)
    for n in (1, 3, 4, 10, 12):
        parts = [listed(capsys, *options, "--shard", f"{k}/{n}") for k in range(1, n + 1)]
        assert [run for part in parts for run in part] == whole
        assert {len(part) for part in parts} <= {10 // n, -(-10 // n)}
    assert swept(*options, "--shard", "3/4", "--dry-run") == 0
    assert "2 runs (2 variants, 5 seeds, shard 3/4 of 10 runs), 0 of them finished: runs" in capsys.readouterr().err


def test_a_shard_carries_out_its_runs_alone_and_what_is_finished_does_not_shift_it(tmp_path, capsys):
    options = [*SHORT, "--seeds", "0-3", "--out", tmp_path]
    assert swept(*options, "--shard", "2/2") == 0
    assert [finished(short(tmp_path, seed=seed)) for seed in range(4)] == [False, False, True, True]
    assert listed(capsys, *options, "--shard", "1/2") == ["random seed 0", "random seed 1"]
    assert listed(capsys, *options, "--shard", "2/2") == []
    assert swept(*options, "--shard", "1/9") == 0  # more parts than runs: an empty one
    assert not finished(short(tmp_path, seed=0))


def test_without_ray_the_extra_that_brings_it_is_named(tmp_path):
    program = f"import sys; sys.modules['ray'] = None; {SWEEP}"
    process = start(program, *SHORT, "--engine", "ray", "--out", tmp_path / "study")
    _, said = process.communicate()
    assert process.returncode == 2
    slip = "pip install 'sgimd-torch[ray]' installs it"
    assert said.splitlines()[-1] == f"error: --engine ray needs ray, which is not installed; {slip}"
    assert not (tmp_path / "study").exists()


def test_every_run_is_what_it_would_be_alone_and_a_second_start_does_nothing(tmp_path, capsys):
    options = [*ALONE, "--vary", "algorithm=random,sagg-riac", "--processes", 2, "--out", tmp_path / "study"]
    assert swept(*options, "--seeds", "0-1") == 0
    assert "4 runs (2 variants, 2 seeds), 0 of them finished" in capsys.readouterr().err
    places = {name: tmp_path / "study" / name / "seed-001" for name in ("random", "sagg-riac")}
    for name, place in places.items():
        assert command(run, [*ALONE, "--algorithm", name, "--seed", "1", "--out", str(tmp_path / "alone")]) == 0
        assert csv_of(place) == csv_of(tmp_path / "alone" / name / "seed-001")
        assert place.with_suffix(".log").exists()
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "study").rglob("*")}
    capsys.readouterr()
    assert swept(*options, "--seeds", "0-1") == 0
    assert "4 of them finished" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "study").rglob("*")} == before
    assert swept(*options, "--seeds", "0-2", "--dry-run") == 0
    assert capsys.readouterr().out.splitlines() == [f"{name} seed 2: 0 of 40 movements" for name in places]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished run."""
    config = short(tmp_path_factory.mktemp("whole"))
    assert sweep_here([config]) == []
    return config


@pytest.fixture
def copied(whole, tmp_path):
    shutil.copytree(whole.out, tmp_path, dirs_exist_ok=True)
    return short(tmp_path)


def test_a_run_is_finished_when_it_has_all_movements_and_evaluations_with_these_options(copied):
    assert finished(copied)
    out = copied.out
    for changes in ({"movements": 50}, {"inverse": "nearest"}, {"seed": 1}, {"floor_at": ()}, {"repeats": 2}):
        assert not finished(short(out, **changes)), changes
    assert not finished(replace(copied, evaluate_at=(30,)))


@pytest.mark.parametrize("name", ["episodes.csv", "evaluation.csv", "summary.json", "config.json"])
@pytest.mark.parametrize("damage", ["missing", "junk", "torn", "edited"])
def test_a_damaged_run_is_not_finished(copied, name, damage):
    path = copied.directory / name
    content = path.read_bytes()
    half = len(content) // 2
    changed = {"junk": b"[junk", "torn": content[:-3], "edited": content[:half] + b"\0" + content[half + 1 :]}
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(changed[damage])
        assert path.read_bytes() != content
    assert not finished(copied)


def test_a_file_of_goals_that_has_changed_makes_a_run_unfinished(benchmark, tmp_path, go):
    goals = tmp_path / "goals.npz"
    shutil.copy(benchmark, goals)
    options = ["--movements", 20, "--evaluate_at", "[]", "--algorithm", "random", "--benchmark", goals]
    assert go(tmp_path, *options) == 0
    config = Config("random", seed=3, movements=20, evaluate_at=(), repeats=2, benchmark=goals, out=tmp_path)
    assert finished(config)
    goals.write_bytes(b"others")
    assert not finished(config)


def test_movements_on_disk_are_counted_by_the_last_whole_line(copied, tmp_path):
    log = copied.directory / "episodes.csv"
    assert movements_on_disk(copied.directory) == 40
    log.write_bytes(log.read_bytes()[:-1])
    assert movements_on_disk(copied.directory) == 39
    log.write_bytes(log.read_bytes().splitlines(keepends=True)[0])
    assert movements_on_disk(copied.directory) == 0
    assert movements_on_disk(tmp_path / "nowhere") == 0


def test_a_run_that_fails_is_named_with_its_last_words_and_the_others_go_on(tmp_path, capsys):
    foreign = tmp_path / "random/seed-000/thesis.txt"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("not a run")
    assert swept(*SHORT, "--seeds", "0-1", "--processes", 1, "--out", tmp_path) == 1
    said = capsys.readouterr().err
    assert "1 runs ended well, 1 failed" in said
    assert re.search(r"random seed 0 failed: \S*seed-000 holds thesis.txt", said)
    assert f"Its whole log: {tmp_path / 'random/seed-000.log'}" in said
    assert "Traceback" not in said
    assert finished(short(tmp_path, seed=1))
    assert foreign.read_text() == "not a run"


def test_without_keep_going_a_failure_stops_the_others_and_is_raised(tmp_path):
    (tmp_path / "random").mkdir()
    (tmp_path / "random/seed-000").write_text("a file where its directory should be")
    other = long(tmp_path, seed=1)
    with pytest.raises(ValueError, match="random seed 0 failed: "):
        sweep_here([long(tmp_path), other], 2, keep_going=False)
    assert not locked(other.directory / "lock")
    assert not finished(other)


def test_a_run_that_is_killed_is_named_and_goes_on_next_time(tmp_path):
    config = long(tmp_path)
    process = start(SWEEP, *LONG, "--seeds", "0-1", "--processes", 1, "--out", tmp_path)
    os.kill(child_of(process, config), signal.SIGKILL)
    _, said = process.communicate()
    assert process.returncode == 1
    assert "random seed 0 failed: stopped by SIGKILL; the same command goes on with it" in said
    assert finished(long(tmp_path, seed=1))
    before = (config.directory / "episodes.csv").read_bytes()
    assert 5 < before.count(b"\n") < 1001
    assert sweep_here([config]) == []
    assert (config.directory / "episodes.csv").read_bytes().startswith(before)


def child_of(process, config):
    """The process that carries a run out, once it writes."""
    log = config.directory / "episodes.csv"
    while process.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") > 5):
        time.sleep(0.01)
    children = Path(f"/proc/{process.pid}/task").glob("*/children")
    (pid,) = {int(pid) for path in children for pid in path.read_text().split()}
    return pid


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_it_leaves_no_process_and_goes_on_as_if_nothing_had_happened(tmp_path, signum, code):
    options = [*LONG, "--processes", 2, "--seeds", "0-1", "--out", tmp_path / "study"]
    configs = [long(tmp_path / "study", seed=seed) for seed in (0, 1)]
    log = configs[0].directory / "episodes.csv"
    found, said = signal_after(start(SWEEP, *options), log, 5, signum)
    assert found == code
    assert "stopping all runs; the same command goes on from here" in said
    assert "Traceback" not in said
    assert not any(locked(config.directory / "lock") for config in configs)
    before = log.read_bytes()
    assert 5 <= before.count(b"\n") < 1001
    assert swept(*options) == 0
    assert log.read_bytes().startswith(before)
    assert command(run, [*LONG, "--out", str(tmp_path / "alone")]) == 0
    assert csv_of(configs[0].directory) == csv_of(tmp_path / "alone/random/seed-000")


def test_a_run_that_a_killed_sweep_left_behind_is_waited_for_and_taken_up(tmp_path):
    options, config = [*LONG, "--seeds", "0", "--out", tmp_path], long(tmp_path)
    first = start(SWEEP, *options)
    pid = child_of(first, config)
    first.kill()
    first.communicate()
    os.kill(pid, signal.SIGSTOP)  # it still holds the run, but makes no progress
    assert locked(config.directory / "lock")
    second = start(SWEEP, *options)
    while "random seed 0: waiting for another process, which writes this run" not in second.stderr.readline():
        assert second.poll() is None
    for signum in (signal.SIGINT, signal.SIGCONT):  # it ends in the middle, and the second sweep goes on with it
        os.kill(pid, signum)
    _, said = second.communicate()
    assert second.returncode == 0, said
    assert finished(config)


def test_on_end_is_called_once_for_each_finished_run_and_its_error_is_a_failure(whole, tmp_path):
    configs, ended = [whole, short(tmp_path, seed=1)], []

    def on_end(config):
        ended.append(config)
        if config is whole:
            raise ValueError("its rows are damaged")

    assert sweep_here(configs, 2, on_end=on_end) == ["random seed 0 failed: its rows are damaged"]
    assert sorted(ended, key=lambda config: config.seed) == configs
    with pytest.raises(ValueError, match="its rows are damaged"):
        sweep_here([whole], on_end=on_end, keep_going=False)


def test_two_runs_with_one_directory_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"two runs would be written to .*seed-000"):
        sweep_here([short(tmp_path), short(tmp_path, inverse="nearest")])
    assert not list(tmp_path.iterdir())


def on_a_terminal(*options):
    """The exit code of a sweep on a terminal of 200 columns, and every line that it showed, for however short."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (40, 200))
    process = subprocess.Popen([sys.executable, "-m", "sgimd_torch", "sweep", *options], stderr=theirs, cwd=ROOT)
    os.close(theirs)
    shown = b""
    while select.select([ours], [], [], 60)[0]:
        try:
            shown += os.read(ours, 4096)
        except OSError:  # it has ended
            break
    os.close(ours)
    return process.wait(), re.split("[\r\n]+", shown.decode())


def test_a_terminal_shows_one_live_line_which_begins_with_what_is_on_disk(copied, tmp_path):
    longer = [*SHORT, "--movements", "80"]  # of 40 that are there already
    code, lines = on_a_terminal(*longer, "--seeds", "0-1", "--out", str(tmp_path))
    assert code == 0
    assert any(re.search(r"sweep:  25%.* 40/160 \[00:00<\?, \? movements/s, 0 of 2 runs", line) for line in lines)
    assert any(re.search(r"sweep: 100%.* 160/160 \[.* movements/s, 2 of 2 runs", line) for line in lines)


def test_the_live_line_does_not_wait_for_what_a_failed_run_will_never_make(tmp_path):
    (tmp_path / "random").mkdir()
    (tmp_path / "random/seed-000").write_text("a file where its directory should be")
    code, lines = on_a_terminal(*SHORT, "--seeds", "0-1", "--out", str(tmp_path))
    assert code == 1
    assert any(re.search(r"sweep: 100%.* 40/40 \[.*, 1 of 2 runs, 1 failed", line) for line in lines)


def test_no_library_for_figures_or_learning_is_loaded_to_watch_processes(tmp_path):
    program = (
        "import sys, sgimd_torch.runs.sweep as sweep; sweep.main(sys.argv[1:]);"
        "print(sorted({'matplotlib', 'torch', 'tensorboard'} & {*sys.modules}))"
    )
    code = start(program, "--dry-run", "--out", tmp_path)
    assert code.communicate()[0].splitlines()[-1] == "[]"


def test_the_help_teaches():
    words = [sys.executable, "-m", "sgimd_torch", "sweep", "--help"]
    said = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert "sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --out study" in said
    assert "--dry-run" in said
