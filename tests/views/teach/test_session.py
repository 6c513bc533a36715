"""A session without a page: lessons enter the run, which goes on, back and again without anybody."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from runs import ROOT
from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command_line import main as run
from sgimd_torch.runs.config import Config, words
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.tasks.robots import arm_demonstrations
from sgimd_torch.teachers.by_hand import ByHand, GivenLesson, keep_lesson, read_lessons
from sgimd_torch.views.report.command import main as report
from sgimd_torch.views.report.data import demonstrated, read_life
from sgimd_torch.views.teach import main, options_of
from sgimd_torch.views.teach.hanging import Hanging
from sgimd_torch.views.teach.serving import PATIENCE, Seat
from sgimd_torch.views.teach.session import Session

SHOWN = arm_demonstrations(PlanarArm())
FAST = 0.005  # s, from one movement to the next: time to pause before all movements are made


def taught(out, **options):
    """A run on the small arm."""
    given = {"algorithm": "sgim-d", "teacher": "by-hand", "movements": 300, "evaluate_at": (20,), **options}
    return Config.from_settings({**given, "name": "taught", "out": out, "repeats": 0, "environment": "planar-arm-7"})


def until(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


@pytest.fixture
def going(tmp_path):
    """Sessions that have made some movements and are paused."""
    opened = []

    def go(made=30, **options):
        session = Session(taught(tmp_path, **options))
        session.interval = FAST
        session.__enter__()
        opened.append(session)
        until(lambda: session.state.movements >= made or session.state.problem)
        assert not session.state.problem
        session.pause(True)
        time.sleep(0.1)
        return session

    yield go
    for session in opened:
        session.__exit__()


def again(config, out, movements):
    """The same run made by `sgimd run`, from its configuration and its lessons alone; its log."""
    alone = replace(config, out=out, movements=movements)
    shutil.copytree(config.directory / "lessons", alone.directory / "lessons")
    shutil.copy(config.directory / "config.json", alone.directory)
    assert command(run, [*words(vars(alone)), "--resume"]) == 0
    return (alone.directory / "episodes.csv").read_bytes()


def test_a_lesson_is_answered_at_once_also_while_the_learner_is_paused(going):
    session = going()
    before = session.state.movements
    session.show(SHOWN[7]).result()
    assert session.state.movements == before + session.config.imitations
    assert session.state.lessons == 1
    rows = [episode for episode in session.state.latest if episode.index >= before]
    assert {episode.move.origin for episode in rows} == {"imitate"}
    assert np.array_equal(rows[0].demonstration.trajectory, SHOWN[7].trajectory)
    time.sleep(0.1)
    assert session.state.movements == before + session.config.imitations  # and then it waits again


def test_the_map_after_a_lesson_is_better_where_the_lesson_landed(going):
    session = going(5)
    session.show(SHOWN[120]).result()
    state, box = session.state, session.run.parts.environment.outcomes
    column, row = ((SHOWN[120].outcome - box.low) / box.sides * state.chart.error.shape[0]).astype(int)
    assert state.chart.error[row, column] < 0.05 < state.before.error[row, column]
    assert (state.chart.movements, state.chart.lessons) == (state.movements, 1)


def test_the_run_repeats_byte_for_byte_without_a_page(going, tmp_path):
    session = going()
    for row in (7, 90):
        session.show(SHOWN[row]).result()
    session.pause(False)
    until(lambda: session.state.movements > 100)
    session.__exit__()
    log = (session.run.directory.path / "episodes.csv").read_bytes()
    assert again(session.config, tmp_path / "alone", session.state.movements) == log


def test_the_log_names_lessons_by_rows_after_those_of_the_file(going):
    session = going(40, teacher="periodic")  # the arm has 127 demonstrations of its own, every 30 movements
    session.show(SHOWN[3]).result()
    session.show(SHOWN[4]).result()
    session.__exit__()
    rows = read_run(session.run.directory.path).demonstration
    assert rows[rows >= 127].tolist() == [127, 128]
    assert (rows[rows >= 0] < 127).sum() >= 1
    parts = build(session.config)
    assert np.array_equal(parts.demonstrations[128].trajectory, SHOWN[4].trajectory)


def test_a_teacher_of_the_run_shows_the_same_whether_or_not_a_person_does():
    class Counting:
        def offer(self, index, memory):
            return SHOWN[index]

    hand = ByHand([GivenLesson(2, SHOWN[50])], Counting())
    assert [hand.offer(index, None) for index in range(4)] == [SHOWN[0], SHOWN[1], SHOWN[50], SHOWN[3]]


def test_a_session_goes_on_where_it_was_stopped(going, tmp_path):
    session = going()
    session.show(SHOWN[7]).result()
    session.__exit__()
    log = (session.run.directory.path / "episodes.csv").read_bytes()
    with Session(session.config) as other:
        other.pause(True)
        until(lambda: not other.state.busy)
        assert other.state.lessons == 1
        assert len(other.run.parts.learner.memory) == other.state.movements
    assert (session.run.directory.path / "episodes.csv").read_bytes().startswith(log)


def test_taking_back_a_lesson_leaves_the_run_as_it_was_before_and_keeps_what_is_taken_back(going):
    session = going(25)
    path = session.run.directory.path
    session.show(SHOWN[7]).result()
    names = ("episodes.csv", "evaluation.csv", "regions.csv")
    before = {name: (path / name).read_bytes() for name in names}
    made, error = session.state.movements, session.state.chart.error
    session.show(SHOWN[90]).result()
    taken = {name: (path / name).read_bytes() for name in names}
    session.take_back().result()
    assert {name: (path / name).read_bytes() for name in names} == before
    assert (session.state.movements, session.state.lessons) == (made, 1)
    assert np.array_equal(session.state.chart.error, error)
    assert [lesson.index for lesson in read_lessons(path / "lessons")] == [made - 10]
    copy = path / "taken-back-0"
    assert {name: (copy / name).read_bytes() for name in names} == taken
    assert [lesson.index for lesson in read_lessons(copy / "lessons")] == [made - 10, made]
    session.take_back().result()
    assert not read_lessons(path / "lessons")
    with pytest.raises(ValueError, match="no lesson to take back"):
        session.take_back().result()


def test_the_same_lesson_after_taking_it_back_leads_to_the_same_run(going):
    session = going()
    session.show(SHOWN[7]).result()
    log = (session.run.directory.path / "episodes.csv").read_bytes()
    session.take_back().result()
    session.show(SHOWN[7]).result()
    assert (session.run.directory.path / "episodes.csv").read_bytes() == log


def test_a_trial_changes_nothing_and_lands_where_the_arm_without_noise_does(going):
    session = going()
    memory, log = len(session.run.parts.learner.memory), (session.run.directory.path / "episodes.csv").read_bytes()
    trial = session.try_goal(np.array([0.3, 0.4])).result()
    arm = PlanarArm()
    assert np.allclose(arm.execute(np.empty(0), trial.theta, np.random.default_rng(0)), trial.outcome)
    assert trial.missed == pytest.approx(np.linalg.norm(trial.outcome - [0.3, 0.4]))
    assert len(session.run.parts.learner.memory) == memory
    assert (session.run.directory.path / "episodes.csv").read_bytes() == log
    with pytest.raises(ValueError, match="must lie in its box"):
        session.try_goal(np.array([3.0, 0.4])).result()


def test_what_the_robot_cannot_use_is_refused_and_nothing_happens(going):
    session = going()
    made = session.state.movements
    with pytest.raises(ValueError, match="first joint turns within"):
        session.show(replace(SHOWN[0], trajectory=100 * SHOWN[0].trajectory)).result()
    assert (session.state.movements, session.state.lessons) == (made, 0)
    assert not (session.run.directory.path / "lessons").exists()


def test_a_learner_that_learns_alone_says_so(going):
    session = going(algorithm="sagg-riac", teacher="periodic")
    with pytest.raises(ValueError, match="sagg-riac learns alone"):
        session.show(SHOWN[0]).result()


def test_a_run_that_is_over_takes_no_lesson_but_still_tries(going):
    session = going(30, movements=30)
    assert session.try_goal(np.array([0.3, 0.4])).result().missed < 2
    with pytest.raises(ValueError, match="--movements 60"):
        session.show(SHOWN[0]).result()


def test_a_learner_that_asks_waits_for_the_answer_and_repeats_it_alone(going, tmp_path):
    session = going(1, algorithm="sgim-im", teachers=("by-hand",), teacher="periodic")
    with pytest.raises(ValueError, match="only when it asks"):
        session.show(SHOWN[0]).result()
    session.answered = True
    session.pause(False)
    until(lambda: session.state.waiting)
    declined = session.state.movements
    session.decline().result()
    until(lambda: session.state.waiting and session.state.movements > declined)
    made, goal = session.state.movements, session.state.asked
    time.sleep(0.1)
    assert session.state.movements == made
    nearest = min(SHOWN, key=lambda shown: np.linalg.norm(shown.outcome - goal))
    session.show(nearest).result()
    session.answered = False
    until(lambda: session.state.movements > made + 60)
    session.__exit__()
    (lesson,) = read_lessons(session.run.directory.path / "lessons")
    assert lesson.asked
    assert lesson.index == made
    log = (session.run.directory.path / "episodes.csv").read_bytes()
    assert again(session.config, tmp_path / "alone", session.state.movements) == log


def test_a_report_shows_lessons_that_were_given_by_hand(going, tmp_path):
    session = going(40, teacher="periodic")
    for row in (3, 4):
        session.show(SHOWN[row]).result()
    before = ", ".join(map(str, session.run.hand.lessons))
    session.__exit__()
    (life,) = [read_life(session.run.directory.path)]
    outcomes, missing = demonstrated([life])
    assert missing == ""
    assert {tuple(each) for each in outcomes} >= {tuple(SHOWN[row].outcome) for row in (3, 4)}
    assert len(outcomes) == len(life.shown)  # one of the teacher's own, and two by hand
    assert command(report, [str(session.run.directory.path), "--out", str(tmp_path / "report.html")]) == 0
    told = f"Seed 0 was given 2 lessons by hand, before movements {before}."
    assert told in (tmp_path / "report.html").read_text()


def test_a_killed_session_loses_nothing(tmp_path):
    config = taught(tmp_path, movements=200)
    save_demonstrations(tmp_path / "shown.npz", SHOWN[:9])
    program = f"""
import sys; sys.path.insert(0, {str(ROOT / "tests")!r})
import os, time
from pathlib import Path
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.runs.config import Config
from sgimd_torch.views.teach.hanging import Hanging
from sgimd_torch.views.teach.serving import PATIENCE, Seat
from sgimd_torch.views.teach.session import Session
import json
session = Session(Config.from_settings(json.loads(sys.argv[1])))
session.interval = 0.02
session.__enter__()
for shown in load_demonstrations(sys.argv[2])[5:7]:
    time.sleep(0.3)
    session.show(shown).result()
print("shown", session.state.movements, flush=True)
time.sleep(60)
"""
    settings = json.dumps(config.settings)
    arguments = [sys.executable, "-c", program, settings, str(tmp_path / "shown.npz")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=environment)
    made = int(process.stdout.readline().split()[1])
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert len(read_lessons(config.directory / "lessons")) == 2
    with Session(config) as session:
        session.interval = FAST
        until(lambda: session.state.movements > max(made, 60))
        assert session.state.lessons == 2
    log = (config.directory / "episodes.csv").read_bytes()
    assert again(config, tmp_path / "alone", session.state.movements) == log


def test_a_file_of_lessons_that_was_tampered_with_is_refused(tmp_path):
    folder = tmp_path / "lessons"
    path = keep_lesson(folder, GivenLesson(12, SHOWN[0]))
    assert path.name == "before-000012.npz"
    save_demonstrations(path, SHOWN[:2])
    with pytest.raises(ValueError, match="one lesson, got 2"):
        read_lessons(folder)


def test_the_seat_is_free_after_a_while_or_when_its_holder_leaves():
    seat = Seat()
    assert seat.take(1, now=0.0)
    assert not seat.take(2, now=PATIENCE - 1)
    assert seat.take(2, now=PATIENCE + 1)
    assert not seat.take(1, now=PATIENCE + 2)
    seat.leave(1)  # does not hold it
    assert seat.is_held_by(2)
    seat.leave(2)
    assert seat.take(1, now=PATIENCE + 3)


def test_a_line_that_hangs_on_the_arm_comes_to_rest_plumb_and_lags_behind_when_the_arm_turns():
    led = FishingRod().hand_led
    hanging = Hanging(led.model, led.joints, led.hand, led.start)
    end = led.model.body("float").id
    for _ in range(60):
        hanging.follow(led.start, 0.1)
    assert np.allclose(hanging.data.xpos[end][:2], hanging.hand[:2], atol=0.005)
    behind = []
    for turn in np.linspace(0, 0.6, 20):
        hanging.follow(led.start + np.array([turn, 0, 0, 0, 0, 0]), 0.03)
        behind.append(hanging.data.xpos[end][0] - hanging.hand[0])
    assert max(behind) > 0.02  # it turns to the left, where x falls; the float comes later
    assert np.isfinite(hanging.data.qpos).all()


def test_a_task_without_anything_to_lead_says_why(capsys):
    assert command(main, ["--environment", "toss"]) == 2
    assert "Toy cannot be led by the hand" in capsys.readouterr().err


def test_a_run_that_is_taught_has_a_person_as_its_teacher(tmp_path, going):
    config, port = options_of(["--seed", "4", "--port", "9000", "--out", str(tmp_path)])
    assert (config.directory, config["teacher"], port) == (tmp_path / "taught" / "seed-004", "by-hand", 9000)
    config, _ = options_of(["--algorithm", "sgim-im"])
    assert config["teachers"] == ("by-hand",)
    session = going()
    session.__exit__()
    config, _ = options_of([str(session.run.directory.path)])
    assert config == session.config
    with pytest.raises(RunError, match="no run directory"):
        options_of([str(tmp_path)])
