"""A user's robot that ends its own process, or another one, in the middle of a run. So tests need no timing."""

import os
import subprocess
import sys

from runs import ROOT, content_of

# Before its 20th movement, the arm does what the environment variable AT_20 names, a key of WAYS.
ROBOT = """
import os, signal, time
import numpy as np
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.tasks import Task

def signal_to(pid, signum):  # and wait until the own signal comes, or the end
    heard, hears = os.pipe()
    os.set_blocking(hears, False)
    signal.set_wakeup_fd(hears)
    os.kill(pid, signum)
    os.read(heard, 1)

def signal_another():  # once, as soon as a file names the process and the signal
    named = os.environ["ANOTHER"]
    while not os.path.exists(named):
        if os.path.exists(named + ".done"):
            return
        time.sleep(0.01)
    try:
        os.rename(named, named + ".done")
    except FileNotFoundError:  # another run was faster
        return
    signal_to(*map(int, open(named + ".done").read().split()))

WAYS = {
    "": lambda: None,
    "dies": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "stops the sweep": lambda: signal_to(os.getppid(), int(os.environ["SIGNAL"])),
    "signals another": signal_another,
}

class Arm(PlanarArm):
    made = 0

    def execute(self, context, theta, rng):
        self.made += 1
        if self.made == 20:
            WAYS[os.environ.get("AT_20", "")]()
        return super().execute(context, theta, rng)

def make():
    return Task(Arm(), lambda: Benchmark("Arm", np.array([[0.5, 0.5], [-0.3, 0.2]]), 0.1))
"""
ODD = ["--environment", "odd:make", "--algorithm", "random", "--movements", "40", "--evaluate-at", "[]"]
SWEEP = "import sys; from sgimd_torch.runs import program; from sgimd_torch.extras.sweep import command"
SWEEP += "; sys.exit(program.command(command.main))"


def odd_place(place, *options):
    """Write the module of the robot to ``place``, and undisturbed runs of seeds 0 and 1 to its folder ``alone``."""
    (place / "odd.py").write_text(ROBOT)
    words = [sys.executable, "-c", SWEEP, *ODD, *options, "--seeds", "0-1", "--out", "alone"]
    subprocess.run(words, cwd=place, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True, capture_output=True)
    return place


def as_alone(place, out):
    """Whether the runs in ``out`` equal the undisturbed runs in ``alone``."""
    places = "random/seed-000", "random/seed-001"
    return all(content_of(out / run) == content_of(place / "alone" / run) for run in places)


def said_by(process, code):
    """The error output of a process, which must end with this exit code and without a traceback."""
    _, said = process.communicate()
    assert process.returncode == code, said
    assert "Traceback" not in said, said
    return said
