"""Sweeps on a Ray cluster: what dies on the way, a node or the sweep itself, changes no byte of what comes out."""

import re
import secrets
import signal
import socket
import subprocess
import sys
import time

import pytest

from runs import csv_of, signal_after, start
from sgimd_torch.files import locked
from sgimd_torch.runs.process import command
from sgimd_torch.runs.sweep import main

# An arm that takes its time, so that there is something to interrupt, but only on the nodes of the cluster.
SLOW = """
import os, time
import numpy as np
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.runs.tasks import Task

class Slow(PlanarArm):
    def execute(self, context, theta, rng):
        time.sleep(float(os.environ.get("NAP", "0")))
        return super().execute(context, theta, rng)

def make():
    return Task(Slow(), lambda: Benchmark("Slow", np.array([[0.5, 0.5], [-0.3, 0.2]]), 0.1))
"""
# Ray's own cluster for tests: a head without cores for runs, and two nodes with one each, all on this machine.
CLUSTER = """
import sys
from ray.cluster_utils import Cluster
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
nodes = [cluster.add_node(num_cpus=1), cluster.add_node(num_cpus=1)]
print("address", cluster.address, flush=True)
for line in sys.stdin:
    cluster.remove_node(nodes.pop(0), allow_graceful=False)
    nodes.append(cluster.add_node(num_cpus=1))
cluster.shutdown()
"""
SWEEP = """
import os, sys
os.chdir(sys.argv.pop(1))
from sgimd_torch.runs import process, sweep
from sgimd_torch.runs.engines import on_ray
on_ray.SEND_EVERY, on_ray.ANSWER_WITHIN = 0.3, float(os.environ.get("ANSWER_WITHIN", "60"))
sys.exit(process.command(sweep.main))
"""
LIVES = ["--environment", "slow:make", "--algorithm", "sagg-riac", "--movements", "250", "--evaluate-at", "100"]
LIVES += ["--repeats", "0", "--seeds", "0-1"]
pytestmark = pytest.mark.skipif(" " in sys.executable, reason="Ray cannot start Python from a path with a space")
FRESH = "holds no run yet"  # what a run says that does not go on from somewhere


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The working directory of the sweeps, with their robot."""
    place = tmp_path_factory.mktemp("place")
    (place / "slow.py").write_text(SLOW)
    return place


@pytest.fixture(scope="module")
def slowly():
    """What is started from now on takes its time; and has a token of its own, or Ray would write one to the home."""
    with pytest.MonkeyPatch.context() as patched:
        for name, value in {"NAP": "0.02", "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}.items():
            patched.setenv(name, value)
        yield


@pytest.fixture(scope="module")
def cluster(slowly):
    """The process of a cluster; each line that it reads kills a node, and later adds another."""
    words, pipe = [sys.executable, "-c", CLUSTER], subprocess.PIPE
    process = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)
    process.address = next(line.split()[1] for line in process.stdout if line.startswith("address"))
    yield process
    process.communicate()


def directories_in(out):
    return [out / "sagg-riac" / f"seed-00{seed}" for seed in (0, 1)]


def on_ray(out, *options):
    """Start the sweep; ``out`` is in its working directory."""
    return start(SWEEP, out.parent, *LIVES, "--out", out.name, "--engine", "ray", *options)


@pytest.fixture(scope="module")
def alone(place, tmp_path_factory):
    """What the same runs write on one machine."""
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(place)
        patched.delenv("NAP", raising=False)
        assert command(main, [*LIVES, "--out", "alone", "--processes", "1"]) == 0
    return [csv_of(directory) for directory in directories_in(place / "alone")]


def under_way(process, directories):
    """Wait until all runs have movements at home."""
    logs = [directory / "episodes.csv" for directory in directories]
    while not all(log.exists() and log.read_bytes().count(b"\n") > 20 for log in logs):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)


def ended(process):
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    return errors


@pytest.mark.slow
def test_when_a_node_dies_its_run_goes_on_elsewhere_with_the_same_results(cluster, place, alone):
    directories, process = directories_in(place / "node"), on_ray(place / "node", "--address", cluster.address)
    under_way(process, directories)
    print(file=cluster.stdin, flush=True)
    assert "2 runs ended well, 0 failed" in ended(process)
    assert [csv_of(directory) for directory in directories] == alone
    resumed = [FRESH not in directory.with_suffix(".log").read_text() for directory in directories]
    assert sorted(resumed) == [False, True]


@pytest.mark.slow
def test_when_the_sweep_is_killed_the_same_command_goes_on_with_the_same_results(cluster, place, alone):
    out = place / "driver"
    directories, process = directories_in(out), on_ray(out, "--address", cluster.address)
    under_way(process, directories)
    process.kill()
    process.communicate()
    before = [(directory / "episodes.csv").read_bytes() for directory in directories]
    ended(on_ray(out, "--address", cluster.address))
    for directory, start_of_it, wanted in zip(directories, before, alone, strict=True):
        assert csv_of(directory) == wanted
        assert wanted["episodes.csv"].startswith(start_of_it[: start_of_it.rindex(b"\n")])
        assert FRESH not in directory.with_suffix(".log").read_text()


@pytest.mark.slow
def test_stopped_it_leaves_no_run_behind_and_goes_on_as_if_nothing_had_happened(slowly, place, alone, monkeypatch):
    directories = directories_in(place / "stopped")
    log = directories[0] / "episodes.csv"
    code, said = signal_after(on_ray(place / "stopped", "--processes", 1), log, 20, signal.SIGINT)
    assert code == 130
    assert "stopping all runs; the same command goes on from here" in said
    assert "Traceback" not in said
    assert not any(locked(directory / "lock") for directory in directories)
    before = log.read_bytes()
    assert 20 <= before.count(b"\n") < 251
    assert not directories[1].exists()  # there is one core, and the other run waits for it
    monkeypatch.chdir(place)
    monkeypatch.delenv("NAP")
    assert command(main, [*LIVES, "--out", "stopped"]) == 0  # now without Ray
    assert [csv_of(directory) for directory in directories] == alone
    assert FRESH not in directories[0].with_suffix(".log").read_text()


def test_a_python_that_ray_cannot_start_is_refused(monkeypatch):
    from sgimd_torch.runs.engines.on_ray import OnRay

    monkeypatch.setattr(sys, "executable", "/a place/bin/python")
    with pytest.raises(
        ValueError, match="from a path with a space, /a place/bin/python, for runs with parts of your own"
    ):
        OnRay(None, ships=True)
    OnRay(None)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nonsense", "no Ray cluster can be used at nonsense: .*nonsense"),
        ("ray://head:10001", "--address must be host:port, or auto, got ray://head:10001; start the sweep on a node"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_in_one_line(place, address, message):
    assert re.search(message, refused(place, "--address", address))


def test_where_nothing_answers_it_ends_in_time(place, monkeypatch):
    monkeypatch.setenv("ANSWER_WITHIN", "4")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        said = refused(place, "--address", address)
    assert f"no Ray cluster answers at {address} within 4 s; is its head running" in said
    assert time.monotonic() - began < 30


def refused(place, *options):
    """What it says; nothing is left behind."""
    process = on_ray(place / "refused", *options)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2, errors
    said = [line for line in errors.splitlines() if "of them finished" not in line]
    assert len(said) == 1
    assert not (place / "refused").exists()
    return said[0]
