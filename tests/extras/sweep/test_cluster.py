"""A sweep on a Dask cluster: runs move to other workers without a change, and what is missing is told in one line.

The slow tests start schedulers and workers on this machine. They need the extra ``cluster``.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time

import pytest

from odd import ODD, SWEEP, as_alone, odd_place, said_by
from runs import ROOT, start
from sgimd_torch.extras.sweep import cluster
from sgimd_torch.extras.sweep.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import movements_on_disk

EVALUATED = ["--evaluate-at", "10"]  # which also commits the movements before


def swept(*options):
    return command(main, ["--environment", "planar-arm-7", "--movements", "20", *map(str, options)])


def test_a_cluster_that_cannot_be_used_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "CONNECT", "0.2s")
    for place, said in (
        ("tcp://127.0.0.1:9", "no Dask scheduler answers at tcp://127.0.0.1:9; `dask scheduler` starts one"),
        ("head", "no Dask scheduler answers at head; .*missing port number"),
    ):
        assert swept("--out", tmp_path / "study", "--on", place) == 2
        assert_last(capsys, said)
    assert swept("--out", tmp_path / "study", "--on", "head:8786", "--processes", 2) == 2
    assert_last(capsys, "--processes cannot be given with --on: each worker")
    monkeypatch.delitem(sys.modules, cluster.__name__)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert swept("--out", tmp_path / "study", "--on", "head:8786") == 2
    assert_last(capsys, r"--on needs distributed: pip install 'sgimd-torch\[cluster\]'")
    assert not (tmp_path / "study").exists()


def assert_last(capsys, said):
    _, last = capsys.readouterr().err.splitlines()  # the first line counts the runs
    assert re.match(f"error: {said}", last)


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    return odd_place(tmp_path_factory.mktemp("odd"), *EVALUATED)


@pytest.fixture
def dask(odd, tmp_path, monkeypatch):
    """Functions that start a scheduler, a worker and a sweep; at the end they are killed."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(odd), str(ROOT)]))
    monkeypatch.setenv("ANOTHER", str(tmp_path / "another"))
    started = []

    class Dask:
        file = tmp_path / "scheduler.json"

        def program(self, name, *options, at_20=""):
            words = [sys.executable, "-m", "dask", name, "--scheduler-file", str(self.file), *options]
            environment = {**os.environ, "AT_20": at_20}
            with (tmp_path / "dask.txt").open("ab") as log:
                started.append(subprocess.Popen(words, stdout=log, stderr=log, env=environment, cwd=odd))
            return started[-1]

        def scheduler(self):
            process = self.program("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
            while not self.file.exists():
                assert process.poll() is None, (tmp_path / "dask.txt").read_text()
                time.sleep(0.01)
            return process

        def worker(self, at_20=""):
            return self.program("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", at_20=at_20)

        def sweep(self):
            options = [*ODD, *EVALUATED, "--seeds", "0-1", "--out", tmp_path, "--on", self.file]
            return start(SWEEP, *options)

        def at_20_signal(self, process, signum):
            """What the robot of a worker started with "signals another" does at its 20th movement."""
            (tmp_path / "new").write_text(f"{process.pid} {int(signum)}")
            (tmp_path / "new").rename(tmp_path / "another")

    yield Dask()
    for process in started:
        process.kill()
        process.wait()


def log_of_the_one_begun(out):
    """Dask does not promise which of two runs begins first."""
    (log,) = out.glob("random/*.log")
    return log


@pytest.mark.slow
def test_what_a_killed_worker_has_begun_is_resumed_by_workers_that_join_later(dask, odd, tmp_path):
    dask.scheduler()
    sweep, doomed = dask.sweep(), dask.worker("signals another")
    dask.at_20_signal(doomed, signal.SIGKILL)
    assert doomed.wait() == -signal.SIGKILL
    log = log_of_the_one_begun(tmp_path)
    assert 10 <= movements_on_disk(log.with_suffix("")) < 40
    dask.worker(), dask.worker()
    said = said_by(sweep, 0)
    assert "2 runs ended well, 0 failed" in said
    assert log.read_text().count("starts from the beginning") == 1
    assert as_alone(odd, tmp_path)


@pytest.mark.slow
def test_a_scheduler_that_ends_is_told_in_one_line_and_the_sweep_goes_on_with_another(dask, odd, tmp_path):
    scheduler = dask.scheduler()
    worker, sweep = dask.worker("signals another"), dask.sweep()
    dask.at_20_signal(scheduler, signal.SIGKILL)
    *_, last = said_by(sweep, 1).splitlines()
    assert last == "error: the scheduler is gone; all runs are kept, and the same command continues them"
    worker.wait()  # it cannot go on without its scheduler
    dask.file.unlink()
    dask.scheduler(), dask.worker()
    assert "2 runs ended well, 0 failed" in said_by(dask.sweep(), 0)
    assert as_alone(odd, tmp_path)


@pytest.mark.slow
def test_ctrl_c_stops_the_runs_on_the_workers_and_the_same_cluster_continues_them(dask, odd, tmp_path):
    dask.scheduler()
    sweep, _ = dask.sweep(), dask.worker("signals another")
    dask.at_20_signal(sweep, signal.SIGINT)
    assert "stopping all runs; the same command continues them" in said_by(sweep, 130)
    assert re.search(r"stopped after 1\d movements", log_of_the_one_begun(tmp_path).read_text())
    assert "2 runs ended well, 0 failed" in said_by(dask.sweep(), 0)
    assert as_alone(odd, tmp_path)


SLURM = [name for name in ("slurmctld", "slurmd", "munged", "sbatch") if shutil.which(name) is None]


@pytest.fixture
def slurm(tmp_path, monkeypatch):
    """A Slurm of this machine; the result is a function that submits a job, and waits for its end."""
    if SLURM or os.geteuid() != 0:
        pytest.skip(
            f"scripts/slurm needs root and Debian's slurmctld, slurmd, slurm-client and munge; missing: {SLURM}"
        )
    subprocess.run([ROOT / "scripts/slurm", "start"], check=True)
    monkeypatch.setenv("SLURM_CONF", "/tmp/slurm-of-one/slurm.conf")

    def submit(job, during, *options):
        with subprocess.Popen(["sbatch", "--wait", *options, job], cwd=tmp_path) as submitted:
            during(submitted)
        return submitted.returncode

    yield submit
    subprocess.run([ROOT / "scripts/slurm", "stop"], check=True)


@pytest.mark.slow
def test_the_job_of_the_page_goes_on_after_scancel_and_after_its_time_limit(slurm, odd, tmp_path, monkeypatch):
    page = (ROOT / "docs/clusters.md").read_text(encoding="utf-8")
    (job,) = re.findall(r"```\n(#!/bin/bash\n.*?)```", page, re.DOTALL)
    sweep = shlex.join([*ODD, *EVALUATED, "--seeds", "0-1"])
    for ours, wanted in (
        ("--ntasks=20", "--ntasks=2"),
        ("--vary goals=interest-map,uniform --seeds 0-499 --out study", f"{sweep} --out ."),
    ):
        assert ours in job
        job = job.replace(ours, wanted)
    (tmp_path / "study.sh").write_text(job)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(odd), str(ROOT)]))
    monkeypatch.setenv("AT_20", "signals another")
    monkeypatch.setenv("ANOTHER", str(tmp_path / "another"))

    def waiting(submitted):  # a run waits at its 20th movement
        (tmp_path / "another.done").unlink(missing_ok=True)
        (tmp_path / "another").write_text("0 0")  # no signal to another
        while not (tmp_path / "another.done").exists():
            assert submitted.poll() is None
            time.sleep(0.1)

    def cancelled(submitted):
        waiting(submitted)
        subprocess.run(["scancel", "--name", "study"], check=True)

    early = ["--time=2", "--signal=B:TERM@10"]  # Slurm sends a signal up to a minute too early
    for during, limits in ((cancelled, []), (waiting, early)):
        assert slurm("study.sh", during, *limits) != 0
        said = (tmp_path / "study.txt").read_text()
        assert "stopping all runs; the same command continues them" in said
        assert any(movements_on_disk(tmp_path / f"random/seed-00{seed}") in range(10, 40) for seed in (0, 1)), said
    assert slurm("study.sh", lambda submitted: None) == 0, (tmp_path / "study.txt").read_text()
    assert as_alone(odd, tmp_path)
