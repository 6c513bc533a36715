"""Slow teachers: waited for with a message, given up in the end; a replay agrees with what was and waits for nobody."""

import re
import signal
from threading import Event

import pytest

import sgimd_torch.teachers.awaited
from runs import LIVE, end, stopped
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import stream
from sgimd_torch.teachers.answering import AnsweringTeacher
from sgimd_torch.teachers.awaited import Awaited
from worlds import NO_CONTEXT, demonstrations

ARM = PlanarArm(4, noise=0.02)
SHOWN = demonstrations(PlanarArm(4))
GOAL = SHOWN[3].outcome
STUCK = '''
import os, signal, threading
from sgimd_torch import AnsweringTeacher

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


class Slow:
    """Answers when it is let, and counts the requests that it has begun."""

    def __init__(self):
        self.let, self.begun = Event(), 0

    def demonstrate(self, context, goal, memory):
        self.begun += 1
        self.let.wait()
        return SHOWN[3]


def awaited(teacher, said=None, **options):
    return Awaited("ann", teacher, say=[].append if said is None else said.append, **options)


def ask(teacher):
    return teacher.demonstrate(NO_CONTEXT, GOAL, None)


def test_who_answers_at_once_is_not_waited_for_and_answers_the_same():
    said, teacher = [], AnsweringTeacher(SHOWN, stream(0, "t"), takes=7)
    assert ask(awaited(teacher, said)) is ask(teacher) is SHOWN[3]
    assert awaited(teacher).takes == 7
    assert said == []


def test_while_it_waits_it_says_for_whom(monkeypatch):
    said, slow = [], Slow()

    def say(message):
        said.append(message)
        slow.let.set()

    monkeypatch.setattr(sgimd_torch.teachers.awaited, "SILENT_FOR", 0.0)
    assert ask(Awaited("ann", slow, say=say)) is SHOWN[3]
    assert said == ["waiting for teacher ann, for as long as it takes"]


def test_it_gives_up_when_its_patience_ends():
    slow = Slow()
    with pytest.raises(TimeoutError, match=r"it took longer than 0\.01 s"):
        ask(awaited(slow, patience=0.01))
    slow.let.set()


def test_a_teacher_has_one_request_at_a_time_and_never_sees_one_that_was_given_up_before():
    slow = Slow()
    impatient = awaited(slow, patience=0.01)
    for _ in range(3):
        with pytest.raises(TimeoutError):
            ask(impatient)
    assert slow.begun <= 1  # 0 if its thread did not even come to it
    slow.let.set()
    begun, impatient.patience = slow.begun, None
    assert ask(impatient) is SHOWN[3]
    assert slow.begun == begun + 1


@pytest.mark.parametrize("patience", [0, -1.0, float("nan")])
def test_no_patience_at_all_is_refused(patience):
    with pytest.raises(ValueError, match="patience must be above 0 s, got"):
        awaited(Slow(), patience=patience)


@pytest.fixture
def mine(module):
    """The options of a run with a teacher who gives three answers at first; its directory."""
    place = module("mine", STUCK)
    options = "--environment planar-arm-7 --algorithm sgim-im --evaluate-at [] --evaluated-by own"
    return [*options.split(), "--repeats", "0", "--out", str(place)], place / "sgim-im" / "seed-000"


def test_a_resumed_run_agrees_on_who_was_given_up_and_asks_only_what_is_new(mine, tmp_path):
    options, directory = mine
    options = [*options, "--teachers", "mine:Busy"]
    with pytest.warns(RuntimeWarning, match="teacher mine:Busy did not answer in time"):
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
