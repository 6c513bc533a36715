"""Slow teachers: one who gives up is done without; a replay agrees with what was and waits for nobody."""

import re
import signal

import pytest

from runs import LIVE, end, stopped
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run

STUCK = '''
import os, signal, threading
from sgimd_torch.extras.asking.teachers import AnsweringTeacher

class Busy(AnsweringTeacher):
    """Notes every request; from the fourth one on it is too busy, unless there is a file "awake"."""
    asked = 0

    def demonstrate(self, context, goal, memory):
        self.asked += 1
        with open("asked.txt", "a") as file:
            print(*goal, file=file)
        if self.asked > 3 and not os.path.exists("awake"):
            self.give_up()
        return super().demonstrate(context, goal, memory)

    def give_up(self):
        raise TimeoutError("too busy")

class Stuck(Busy):
    def give_up(self):
        os.kill(os.getpid(), signal.SIGSTOP)
        threading.Event().wait()
'''


@pytest.fixture
def mine(module):
    """The options of a run with a teacher who gives three answers at first; its directory."""
    place = module("mine", STUCK)
    options = "--environment planar-arm-7 --algorithm sgim-im --evaluate-at [] --evaluated-by own"
    return [*options.split(), "--repeats", "0", "--out", str(place)], place / "sgim-im" / "seed-000"


def test_a_resumed_run_agrees_on_who_was_given_up_and_asks_only_what_is_new(mine, tmp_path):
    options, directory = mine
    options = [*options, "--teachers", "mine:Busy"]
    with pytest.warns(RuntimeWarning, match="teacher mine:Busy did not reply in time"):
        assert command(main, [*options, "--movements", "15"]) == 0
    before = read_run(directory)
    replies = before.requests["reply"].tolist()
    assert replies[:3] == ["shown"] * 3
    assert {*replies[3:]} == {"timed out"}
    (tmp_path / "awake").touch()
    (tmp_path / "asked.txt").unlink()
    assert command(main, [*options, "--movements", "20", "--resume"]) == 0
    after = read_run(directory)
    assert after.thetas[:15].tolist() == before.thetas.tolist()
    n = len(replies)
    for name, column in before.requests.items():
        assert column[: n - 1].tolist() == pytest.approx(after.requests[name][: n - 1].tolist(), nan_ok=True)
    asked = (tmp_path / "asked.txt").read_text().splitlines()
    assert len(asked) == len(after.requests["index"]) - n > 0
    assert after.requests["index"][n] >= 15


def test_a_second_ctrl_c_ends_the_wait_for_a_teacher(mine):
    options, _ = mine
    process = stopped(LIVE, *options, "--teachers", "mine:Stuck", "--movements", "15")
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGCONT)
    while "once more stops at once" not in process.stderr.readline():
        assert process.poll() is None
    code, errors = end(process, signal.SIGINT)
    assert code == 130
    assert "Traceback" not in errors
    assert re.search(r"stopped after \d+ movements; to go on", errors)
