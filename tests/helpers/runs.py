"""Helpers for tests of runs: they start runs, stop them at a movement, edit records, and read them."""

import os
import shlex
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import sgimd_torch
from sgimd_torch.record import Record, layout
from sgimd_torch.runs.directory import RUN_FILE

ROOT = Path(sgimd_torch.__file__).parents[1]
MOVEMENTS = 90
RUN = "import sys; from sgimd_torch.runs import command as command_line; from sgimd_torch.runs import program"
LIVE = f"{RUN}; sys.exit(program.command(command_line.main, sys.argv[1:]))"
# A run that stops its own process after {0} movements; every movement is written to the disk at once.
STOPS = f"""
import os, signal
from sgimd_torch.runs import run
run.COMMIT_EVERY, after = 0, run.RunLoop._after
def stop(life, episode):
    after(life, episode)
    if life.movements == {{0}}:
        os.kill(os.getpid(), signal.SIGSTOP)
run.RunLoop._after = stop
{LIVE}"""


def arguments(out, benchmark):
    fixed = f"--algorithm sgim-d --seed 3 --movements {MOVEMENTS} --evaluate_at 30,60 --repeats 2".split()
    return [*fixed, "--benchmark", str(benchmark), "--out", str(out)]


def content_of(directory):
    """The rows of all tables except ``about``, which differs from run to run."""
    with Record(directory / RUN_FILE) as record:
        return {table: list(record.rows(table)) for table in layout(record.dims) if table != "about"}


def about_of(directory):
    """The table ``about`` of a run: its settings, versions and times."""
    with Record(directory / RUN_FILE) as record:
        return record.about


def write_about(directory, **about):
    """Replace entries of the table ``about`` of a run."""
    with Record(directory / RUN_FILE, write=True) as record:
        record.about |= about
        record.commit()


def edit(path, *statements):
    """Change the file of a record by SQL, without new checksums."""
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def files_of(directory):
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def start(program, *options, limit=""):
    """Start a program in another process; ``limit`` are options of ``ulimit``."""
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    command = shlex.join([sys.executable, "-c", program, *map(str, options)])
    return subprocess.Popen(
        ["bash", "-c", f"{f'ulimit {limit}; ' if limit else ''}exec {command}"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def stopped(program, *options):
    """Start a program in another process, and return this process when it has stopped itself."""
    process = start(program, *options)
    _, status = os.waitpid(process.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status), process.communicate()
    return process


def stopped_at(movements, *options):
    """A process of ``sgimd run`` that has stopped itself after ``movements`` movements."""
    return stopped(STOPS.format(movements), *options)


def end(process, signum=signal.SIGKILL):
    """Send a signal to a stopped process and continue the process; returns (exit code, stderr)."""
    process.send_signal(signum)
    process.send_signal(signal.SIGCONT)
    _, errors = process.communicate()
    return process.returncode, errors
