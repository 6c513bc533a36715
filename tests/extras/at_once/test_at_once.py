"""Runs of robots that move at once: ``sgimd run --at-once 8``, processes for robots that move one by one, resuming."""

import os
import signal
import time
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from marks import slow
from runs import LIVE, content_of, start
from sgimd_torch import session
from sgimd_torch.extras.at_once.processes import in_processes
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.record import Record
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.read import read_run
from sgimd_torch.session import live
from sgimd_torch.spaces import Failure, stream
from worlds import NO_CONTEXT

MODULE = """
import os, threading, time
import numpy as np
from sgimd_torch.environments.planar_arm import PlanarArm
class Slow(PlanarArm):
    execute_many = None
    def execute(self, context, theta, rng):
        time.sleep(0.02)
        return super().execute(context, theta, rng)
class Odd(PlanarArm):
    execute_many = None
    def execute(self, context, theta, rng):
        if theta[0] > 0.95:
            raise ConnectionError("stuck")
        return super().execute(context, theta, rng)
class Mortal(PlanarArm):
    execute_many = None
    def execute(self, context, theta, rng):
        os._exit(3)
class Single(PlanarArm):
    at_once = 1
class Exclusive(PlanarArm):
    execute_many = None
    def __init__(self):
        super().__init__(3)
        import multiprocessing
        if multiprocessing.parent_process() is not None:
            raise ConnectionError("its port is taken")
class Hanging(PlanarArm):
    execute_many = None
    def execute(self, context, theta, rng):
        if rng.random() < 0.2:
            open("hangs", "w").close()
            threading.Event().wait()
        return super().execute(context, theta, rng)
"""


@pytest.fixture
def own(module):
    """The module of this page's robots, in the working directory."""
    return module("robots_at_once", MODULE)


def test_processes_give_the_outcomes_and_the_failures_of_one_process(own):
    make = partial(load_word("environment", "robots_at_once:Odd"), 3, noise=0.1)
    thetas = stream(0, "thetas").random((12, 3))
    thetas[5, 0] = 1.0
    batch = range(12), [NO_CONTEXT] * 12, list(thetas)
    alone = live(make(), 7)(*batch)
    with in_processes(make, 7, 2) as execute:
        together = execute(*batch)
    assert [isinstance(each, Failure) for each in together] == [k == 5 for k in range(12)]
    for mine, theirs in zip(alone, together, strict=True):
        if isinstance(mine, Failure):
            assert theirs.reason == mine.reason == "ConnectionError: stuck"
        else:
            assert np.array_equal(mine, theirs)


UNJUDGED = ["--evaluate-at", "[]", "--benchmark", "null"]
RUN = ["--algorithm", "practice", "--at-once", "4", "--environment"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "at_once"),
    [("planar-arm-7", 4), ("robots_at_once:Odd", 2), slow("experiments.toys:toss", 2)],
)
def test_a_run_that_was_stopped_goes_on_to_the_rows_of_a_whole_one(
    go, own, tmp_path, robot, at_once, capfd, monkeypatch
):
    monkeypatch.setattr(session, "JOINS_EVERY", 10)
    place = "practice/seed-003"
    common = [*RUN, robot, *UNJUDGED, "--at-once", at_once]
    if robot == "planar-arm-7":
        common += ["--evaluate-at", "50", "--repeats", "0"]
    assert go(tmp_path / "whole", *common, "--movements", "98") == 0
    assert go(tmp_path / "parts", *common, "--movements", "58") == 0
    assert go(tmp_path / "parts", *common, "--movements", "98", "--resume") == 0
    assert content_of(tmp_path / "whole" / place) == content_of(tmp_path / "parts" / place)
    assert "after 50" not in capfd.readouterr().err  # the evaluation after 50 movements is kept
    found = read_run(tmp_path / "whole" / place)
    assert found.summary["movements"] == 98
    with Record(tmp_path / "whole" / place / RUN_FILE) as record:
        robots = [event.robot for event in record.events()]
    sizes = [here + 1 for here, after in pairwise([*robots, 0]) if after == 0]
    assert sizes[:20] == [1] * 20
    assert set(sizes[20:]) == {*range(2, at_once + 1)}


def test_an_evaluation_comes_after_the_group_in_which_it_falls(go, tmp_path):
    options = [*RUN, "planar-arm-7", "--evaluate-at", "121,150", "--repeats", "0", "--benchmark", "null"]
    assert go(tmp_path, *options, "--movements", "160") == 0
    assert read_run(tmp_path / "practice" / "seed-003").evaluation["movements"].tolist() == [124, 152, 160]


@pytest.mark.parametrize(
    ("robot", "code", "said"),
    [
        ("Single", 2, "at_once must be at most 1, the at_once of Single, got 4"),
        ("Mortal", 1, "a process that executes movements ended with exit code 3; is one robot all there is?"),
        ("Exclusive", 1, "cannot make its robot: ConnectionError: its port is taken; is one robot all there is?"),
    ],
)
def test_robots_that_cannot_move_at_once_are_told(go, own, tmp_path, capfd, robot, code, said):
    assert go(tmp_path, *RUN, f"robots_at_once:{robot}", *UNJUDGED, "--movements", "200") == code
    printed = capfd.readouterr().err
    assert said in printed
    assert "Traceback" not in printed


def test_the_second_ctrl_c_ends_a_run_of_processes_that_hang(own, tmp_path):
    """Whoever waits for them waits for ever."""
    with start(LIVE, *RUN, "robots_at_once:Hanging", *UNJUDGED, "--out", tmp_path) as run:
        until(lambda: children_of(run) and (tmp_path / "hangs").exists())
        children = children_of(run)
        run.send_signal(signal.SIGINT)
        assert any("Ctrl-C once more" in line for line in run.stderr)
        run.send_signal(signal.SIGINT)
        assert run.wait() == 130
    until(lambda: not any(map(os.path.exists, children)))


def test_the_processes_end_with_a_run_that_is_killed(own, tmp_path):
    with start(LIVE, *RUN, "robots_at_once:Slow", *UNJUDGED, "--at-once", 2, "--out", tmp_path) as run:
        until(lambda: len(children_of(run)) >= 2)
        children = children_of(run)
        run.kill()
    until(lambda: not any(map(os.path.exists, children)))


def until(true):
    while not true():
        time.sleep(0.05)


def children_of(process):
    """Places of the processes that a process has begun, which must not have ended."""
    assert process.poll() is None
    return [f"/proc/{pid}" for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
