"""What the tests of whole runs share: how a run is started, also in another process, and what it left."""

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

import sgimd_torch
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.engines.local import local
from sgimd_torch.runs.engines.loop import sweep
from sgimd_torch.runs.process import Stopping
from sgimd_torch.runs.run import live_in

ROOT = Path(sgimd_torch.__file__).parents[1]
MOVEMENTS = 90
CSV = ("episodes.csv", "evaluation.csv", "regions.csv")
RUN = "import sys; from sgimd_torch.runs import command_line, process"
LIVE = f"{RUN}; sys.exit(process.command(command_line.main, sys.argv[1:]))"
# Every movement goes to disk at once, so that a test can wait for the k-th.
EAGER = LIVE.replace("process;", "process, run; run.FLUSH_EVERY = 0;")


def arguments(out, benchmark):
    fixed = f"--algorithm sgim-d --seed 3 --movements {MOVEMENTS} --evaluate_at 30,60 --repeats 2".split()
    return [*fixed, "--benchmark", str(benchmark), "--out", str(out)]


def csv_of(directory):
    return {name: (directory / name).read_bytes() for name in CSV if (directory / name).exists()}


def accept_loss(out, benchmark, *options):
    """Go on with a run whose log lacks movements; returns the notes on it."""
    config, _ = parse([*arguments(out, benchmark), *map(str, options)], "")
    parts = build(config)
    with Stopping() as stopping, RunDirectory(parts, resume=True, accept_loss=True) as directory:
        live_in(directory, parts, stopping)
    return directory.notes


def sweep_here(configs, processes=1, **options):
    """On this machine; the failures."""
    with local(processes) as submit:
        return sweep(configs, submit, **options)


def start(program, *options, limit=""):
    """Another process; ``limit`` is for ``ulimit``."""
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    command = shlex.join([sys.executable, "-c", program, *map(str, options)])
    return subprocess.Popen(
        ["bash", "-c", f"{f'ulimit {limit}; ' if limit else ''}exec {command}"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def signal_after(process, log, lines, signum):
    """Send ``signum`` once the log has so many ``lines``; returns (exit code, stderr)."""
    while process.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") >= lines):
        time.sleep(0.001)
    assert process.poll() is None, process.communicate()
    process.send_signal(signum)
    _, errors = process.communicate()
    return process.returncode, errors
