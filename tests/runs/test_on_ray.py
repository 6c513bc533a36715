"""Sweeps on a Ray cluster: what dies on the way changes nothing in what comes home."""

import os
import re
import secrets
import sqlite3
import subprocess
import sys

import pytest

from odd import ODD, SWEEP, as_alone, odd_place, said_by
from runs import start
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines import on_ray
from sgimd_torch.runs.process import Failed

# Like SWEEP, in a working directory, and it leaves its number where MARK says.
FAR = "import os, sys; os.chdir(sys.argv.pop(1)); open(os.environ['MARK'], 'w').write(str(os.getpid()));" + SWEEP
# A process that is killed in the middle of a transaction, with half of it in the file.
TORN = """
import os, signal, sqlite3, sys
file = sqlite3.connect(sys.argv[1], isolation_level=None)
file.execute("PRAGMA cache_size = 1")
file.execute("CREATE TABLE rows (content)")
for committed in (True, False):
    file.execute("BEGIN")
    file.executemany("INSERT INTO rows VALUES (?)", [(str(committed) * 500,)] * 100)
    if committed:
        file.execute("COMMIT")
os.kill(os.getpid(), signal.SIGKILL)
"""
pytestmark = pytest.mark.skipif(" " in sys.executable, reason="Ray cannot start Python from a path with a space")


def test_a_task_begins_with_what_it_is_given_and_returns_the_record_and_what_was_said(monkeypatch):
    program = (
        "import pathlib, sys; record = pathlib.Path('runs/run.sqlite');"
        "record.write_bytes(record.read_bytes() + b' and more'); print(sys.argv[1:]); sys.exit('error: no goals')"
    )
    monkeypatch.setattr(on_ray, "PROGRAM", ("-c", program))
    code, said, record = on_ray.carry_out(["run"], "runs/run.sqlite", {"runs/run.sqlite": b"some", "goals.npz": b"1"})
    assert (code, said, record) == (1, b"['run']\nerror: no goals\n", b"some and more")
    monkeypatch.setattr(on_ray, "PROGRAM", ("-c", "print(open('goals.npz').read())"))
    assert on_ray.carry_out([], "runs/run.sqlite", {"goals.npz": b"1"}) == (0, b"1\n", None)


def test_what_a_task_returns_is_kept_whatever_came_of_it(tmp_path):
    config = Config("random", out=tmp_path)
    on_ray._keep(config, (0, b"well\n", b"record"))
    with pytest.raises(Failed, match="no goals"):
        on_ray._keep(config, (1, b"error: no goals\n", None))
    assert (config.directory / "run.sqlite").read_bytes() == b"record"
    assert config.directory.with_suffix(".log").read_text() == "well\nerror: no goals\n"


def test_of_a_record_whose_process_was_killed_the_last_commit_is_sent(tmp_path):
    path = tmp_path / "run.sqlite"
    subprocess.run([sys.executable, "-c", TORN, path])
    assert path.with_name("run.sqlite-journal").exists()
    with sqlite3.connect(":memory:") as sent:
        sent.deserialize(on_ray._snapshot(path))
        assert sent.execute("SELECT count(*) FROM rows").fetchone() == (100,)
    path.write_bytes(b"no record" * 500)
    with pytest.raises(sqlite3.DatabaseError):
        on_ray._snapshot(path)


def test_a_python_that_ray_cannot_start_is_refused(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/a place/bin/python")
    with pytest.raises(ValueError, match="/a place/bin/python"), on_ray.on_ray(None, ships=True):
        pass


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nonsense", "no Ray cluster answers at nonsense: .*--address is host:port"),
        ("127.0.0.1:99999", "no Ray cluster answers at 127.0.0.1:99999"),
        ("127.0.0.1:1", "no Ray cluster answers at 127.0.0.1:1: .*is the cluster running"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused(address, message):
    with pytest.raises(ValueError, match=re.escape(message).replace(r"\.\*", ".*")), on_ray.on_ray(address):
        pass


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """The working directory of the sweeps, with their robot; Ray gets a token, or it would write one to the home."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("RAY_AUTH_MODE", "token")
        patched.setenv("RAY_AUTH_TOKEN", secrets.token_hex(32))
        yield odd_place(tmp_path_factory.mktemp("odd"))


def far(odd, monkeypatch, out, at_20):
    """A sweep of two runs on a cluster of one core that Ray starts here."""
    monkeypatch.setenv("MARK", str(odd / "mark"))
    monkeypatch.setenv("AT_20", at_20)
    engine = ["--engine", "ray", "--processes", "1", "--seeds", "0-1"]
    return start(FAR, odd, *ODD, *engine, "--out", os.path.relpath(odd / out, odd))


@pytest.mark.slow
def test_when_a_task_dies_it_is_started_again_with_the_same_results(odd, monkeypatch):
    said = said_by(far(odd, monkeypatch, "far", "kills the task once"), 0)
    assert (odd / "mark").read_text() == "killed"
    assert "2 runs ended well, 0 failed" in said
    assert as_alone(odd, odd / "far", (0, 1))


@pytest.mark.slow
def test_stopped_it_goes_on_as_if_nothing_had_happened(odd, monkeypatch):
    said = said_by(far(odd, monkeypatch, "stopped", "stops the sweep far away"), 130)
    assert "stopping all runs; the same command continues them" in said
    assert "2 runs ended well, 0 failed" in said_by(far(odd, monkeypatch, "stopped", ""), 0)
    assert as_alone(odd, odd / "stopped", (0, 1))
