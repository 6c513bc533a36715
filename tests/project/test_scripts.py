"""The scripts: when setup installs, and which options are refused."""

import os
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest

import bench
import check_physics
import mutants
from sgimd_torch.spaces import stream


def go(script, options):
    """Run a script with these options."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["script", *shlex.split(options)])
        return script.main()


@pytest.mark.parametrize(
    ("script", "options"),
    [
        (mutants, "nowhere"),
        (mutants, "--commit nowhere"),
        (check_physics, "--movements 0"),
        (bench, "--rounds 0"),
        (bench, "--movements 0"),
        (bench, "--only nothing"),
        (bench, "--against nowhere"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_written(tmp_path, monkeypatch, capsys, script, options):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        go(script, options)
    assert end.value.code == 2
    assert "error: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_each_mutant_has_one_place_in_the_library_and_tests_that_exist():
    library, tests = bench.HERE / "sgimd_torch", bench.HERE / "tests"
    for name, file, paths, right, wrong in mutants.mutants().values():
        assert right != wrong
        assert (library / file).read_text(encoding="utf-8").count(right) == 1, name
        assert all((tests / path).exists() for path in paths.split()), name


INTERPRETER = """#!/usr/bin/env bash
# A fake Python: its venv is one file, and its pip takes 0.3 s and notes its arguments.
case "$1 $2" in
"-m venv") rm -rf "$4" && mkdir -p "$4/bin" && cp "$0" "$4/bin/python" && echo "venv" >>"$NOTES" ;;
"-m pip") sleep 0.3 && echo "${@: -3:1}" >>"$NOTES" && exit "${PIP_FAILS:-0}" ;;
*) exec "PYTHON" "$@" ;;
esac
"""


@pytest.fixture
def setup(tmp_path):
    """A function that starts scripts/setup in a new checkout, and returns what has been installed there so far."""
    root, notes, python = tmp_path / "a checkout", tmp_path / "notes", tmp_path / "python"
    (root / "scripts").mkdir(parents=True)
    for name in ("scripts/setup", "pyproject.toml", "constraints.txt"):
        shutil.copy(bench.HERE / name, root / name)
    python.write_text(INTERPRETER.replace("PYTHON", sys.executable))
    python.chmod(0o755)
    notes.touch()

    def start(*wishes, wanted=0, **environment):
        environment = {**os.environ, "PYTHON": str(python), "NOTES": str(notes), **environment}
        command = [str(root / "scripts/setup")]
        processes = [subprocess.Popen([*command, *wish.split()], env=environment) for wish in wishes]
        assert [process.wait() for process in processes] == [wanted] * len(wishes)
        return notes.read_text().split()

    start.stamp = root / ".venv/setup-stamp"
    return start


DEMO, ALL = ".[plot,report]", ".[all,dev]"  # what setup gives to pip


@pytest.mark.slow
def test_setup_installs_what_is_missing_and_everything_serves_the_demo(setup):
    assert setup("demo") == setup("demo") == ["venv", DEMO]
    assert setup("") == setup("demo") == setup("") == ["venv", DEMO, ALL]
    (setup.stamp.parents[1] / "constraints.txt").write_text("numpy==2.0\n")  # another list of requirements
    assert setup("") == ["venv", DEMO, ALL, ALL]


@pytest.mark.slow
def test_of_several_setups_at_once_one_installs_and_another_word_is_refused(setup):
    assert setup("demo", "demo", "demo") == ["venv", DEMO]
    assert setup("demos", wanted=2) == ["venv", DEMO]


@pytest.mark.slow
def test_an_installation_cut_short_starts_afresh_and_one_that_failed_goes_on(setup):
    assert setup("demo", wanted=3, PIP_FAILS="3") == ["venv", DEMO]
    assert setup("demo") == ["venv", DEMO, DEMO]
    setup.stamp.write_text(setup.stamp.read_text().splitlines()[0] + "\ninstalling\n")
    assert setup("demo")[3:] == ["venv", DEMO]


@pytest.mark.slow
def test_the_bench_compares_two_commits_side_by_side(capsys, monkeypatch):
    measurements, movements = bench.PARTS["learning"]
    monkeypatch.setitem(bench.PARTS, "learning", (measurements[1:2], movements))  # one learner is enough
    assert go(bench, "--only learning run --rounds 1 --movements 20 --against HEAD") == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["here", "there", "here/there"]
    assert len(lines) == 4 * 3 + 1 + 3
    for line in lines:
        ours, theirs, ratio = map(float, line.split()[-3:])
        assert ours > 0
        assert ratio == pytest.approx(ours / theirs, rel=0.01)


def test_smaller_time_steps_of_the_rod_land_nearer_to_the_smallest():
    thetas = stream(0, "thetas").random((10, 25))
    rods = map(check_physics.at_time_step, (0.01, 0.005, 0.002, 0.001, check_physics.FINEST))
    *landed, exact = (check_physics.execute(rod, thetas, "none") for rod in rods)
    apart = np.array([np.median(np.linalg.norm(there - exact, axis=1)) for there in landed])
    assert (apart[:-1] > 1.5 * apart[1:]).all()
    assert apart[0] < 0.037  # the noise
