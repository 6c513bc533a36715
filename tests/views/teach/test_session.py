"""A session without a page: lessons enter the run, which goes on, back and again without anybody."""

import json
import shutil
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from runs import ROOT
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.command_line import main as run
from sgimd_torch.runs.config import Config, words
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.tasks.robots import arm_demonstrations
from sgimd_torch.teachers.by_hand import BY_HAND, ByHand
from sgimd_torch.views.teach import main, options_of
from sgimd_torch.views.teach.session import Session
from sgimd_torch.views.teach.taught import Record, lessons_among

SHOWN = arm_demonstrations(PlanarArm())
GOAL = np.array([0.3, 0.4])


def taught(out, **options):
    """A run on the small arm; ``teacher`` is None for a learner to whom nobody comes."""
    given = {"algorithm": "sgim-d", "teacher": "by-hand", "movements": 300, "evaluate_at": (20,), **options}
    settings = {name: value for name, value in given.items() if value is not None}
    return Config.from_settings({**settings, "name": "taught", "out": out, "repeats": 0, "environment": "planar-arm-7"})


@pytest.fixture
def paused(tmp_path):
    """Sessions that have made some movements and are paused."""
    opened = []

    def open_session(made=30, **options):
        session = Session(taught(tmp_path, **options))
        session.pause(True)
        opened.append(session.__enter__())
        session.advance(made).result()
        return session

    yield open_session
    for session in opened:
        session.__exit__()


def lived(path):
    """What was recorded of a run, movement by movement."""
    found = read_run(path.parent)
    return [found.contexts, found.thetas, found.goals, found.outcomes, found.origin, found.demonstration]


def try_goal(session, goal):
    return session.do(lambda: session.run.try_goal(goal))


def assert_same(one, other, n=None):
    for ours, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(ours[:n], theirs[:n])


def lessons(path):
    """Before which movements the record has a lesson by hand."""
    with Record(path) as record:
        return [movements for movements, _ in lessons_among(record.events())]


def test_a_lesson_is_answered_at_once_also_while_the_learner_is_paused(paused):
    session = paused()
    assert session.state.movements == 30
    session.show(SHOWN[7]).result()
    assert session.state.movements == 30 + session.config["social.repeats"]
    assert session.state.lessons == (30,)
    rows = [episode for episode in session.state.latest if episode.index >= 30]
    assert {episode.move.origin for episode in rows} == {"imitate"}
    assert np.array_equal(rows[0].demonstration.trajectory, SHOWN[7].trajectory)
    try_goal(session, GOAL).result()
    assert session.state.movements == 30 + session.config["social.repeats"]  # and then it waits again


def test_a_learner_that_is_not_paused_goes_on_by_itself(paused):
    session = paused(5)
    session.pause(False).result()
    assert session.when(lambda state: state.movements >= 40).movements >= 40
    session.pause(True).result()
    made = session.state.movements
    session.pace(1e6).result()
    session.pause(False).result()
    try_goal(session, GOAL).result()
    assert session.state.movements <= made + 1  # its next movement is not due yet


def test_the_map_after_a_lesson_is_better_where_the_lesson_landed(paused):
    session = paused(5)
    session.show(SHOWN[120]).result()
    state, box = session.state, session.run.parts.environment.outcomes
    column, row = ((SHOWN[120].outcome - box.low) / box.sides * state.chart.error.shape[0]).astype(int)
    assert state.chart.error[row, column] < 0.05 < state.before.error[row, column]
    assert (state.chart.movements, state.chart.lessons) == (state.movements, 1)


def test_a_teacher_of_the_run_shows_the_same_whether_or_not_a_person_does():
    class Counting:
        def offer(self, index, memory):
            return SHOWN[index]

    hand, offered = ByHand(Counting()), []
    for index in range(4):
        if index == 2:
            hand.give(SHOWN[50])
        offered.append((hand.offer(index, None), hand.who))
    assert offered == [
        (SHOWN[0], "teacher"),
        (SHOWN[1], "teacher"),
        (SHOWN[50], BY_HAND),
        (SHOWN[3], "teacher"),
    ]
    assert ByHand().demonstrate(np.zeros(0), GOAL, None) is None


@pytest.mark.parametrize("teacher", ["by-hand", "periodic"])
def test_a_session_goes_on_where_it_was_stopped(paused, teacher):
    session = paused(teacher=teacher)
    session.show(SHOWN[7]).result()
    session.show(SHOWN[90]).result()
    memory, path = session.run.parts.learner.memory, session.run.path
    session.__exit__()
    before = lived(path)
    other = Session(session.config)
    other.pause(True)
    with other:
        other.advance(20).result()
        assert other.state.lessons == (30, 40)
        assert other.state.movements == 70
        np.testing.assert_array_equal(other.run.parts.learner.memory.thetas[: len(memory)], memory.thetas)
    assert_same(before, lived(path), 50)


@pytest.mark.parametrize("teacher", ["by-hand", "periodic"])
def test_a_run_that_was_taught_goes_on_without_a_page(paused, teacher):
    session = paused(teacher=teacher)
    session.show(SHOWN[7]).result()
    session.__exit__()
    before = lived(session.run.path)
    assert command(run, [*words(replace(session.config, movements=60)), "--resume"]) == 0
    assert_same(before, lived(session.run.path), 40)
    found = read_run(session.run.path.parent)
    assert np.array_equal(found.demonstrations[found.demonstration[30]].trajectory, SHOWN[7].trajectory)


def test_taking_back_a_lesson_leaves_the_run_as_it_was_before_and_keeps_a_copy(paused):
    session = paused(25)
    path = session.run.path
    session.show(SHOWN[7]).result()
    before, error = lived(path), session.state.chart.error
    session.show(SHOWN[90]).result()
    session.take_back().result()
    assert_same(lived(path), before)
    assert (session.state.movements, session.state.lessons) == (35, (25,))
    assert np.array_equal(session.state.chart.error, error)
    assert lessons(path) == [25]
    assert lessons(path.with_name("run.taken-back-0.sqlite")) == [25, 35]
    session.take_back().result()
    assert lessons(path) == []
    assert path.with_name("run.taken-back-1.sqlite").exists()
    with pytest.raises(ValueError, match="no lesson to take back"):
        session.take_back().result()


def test_the_same_lesson_after_taking_it_back_leads_to_the_same_run(paused):
    session = paused()
    session.show(SHOWN[7]).result()
    before = lived(session.run.path)
    session.take_back().result()
    session.show(SHOWN[7]).result()
    assert_same(lived(session.run.path), before)


def test_a_trial_changes_nothing_and_lands_where_the_arm_without_noise_does(paused):
    session = paused()
    trial = try_goal(session, GOAL).result()
    landed = PlanarArm().execute(np.empty(0), trial.theta, np.random.default_rng(0))
    assert np.allclose(landed, trial.outcome)
    assert trial.missed == pytest.approx(np.linalg.norm(landed - GOAL))
    assert len(session.run.parts.learner.memory) == session.state.movements == 30


@pytest.mark.parametrize(
    ("options", "ask", "message"),
    [
        ({}, lambda session: try_goal(session, np.array([3.0, 0.4])), "goal"),
        ({}, lambda session: session.show(replace(SHOWN[0], trajectory=100 * SHOWN[0].trajectory)), "first joint"),
        ({"algorithm": "sagg-riac", "teacher": None}, lambda session: session.show(SHOWN[0]), "sagg-riac learns alone"),
        ({"movements": 30}, lambda session: session.show(SHOWN[0]), "--movements 60"),
        (
            {"algorithm": "sgim-im", "teacher": None, "teachers": ("by-hand",)},
            lambda session: session.show(SHOWN[0]),
            "only when it asks",
        ),
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_happens(paused, options, ask, message):
    session = paused(**{"teacher": "periodic", **options})
    with pytest.raises(ValueError, match=message):
        ask(session).result()
    assert (session.state.movements, session.state.lessons) == (30, ())


def test_a_session_that_has_ended_says_so_to_whoever_asks(paused):
    session = paused(1)
    session.__exit__()
    with pytest.raises(ValueError, match="has ended"):
        try_goal(session, GOAL).result()
    with pytest.raises(ValueError, match="has ended"):
        session.when(lambda state: state.movements > 1)


def test_a_learner_that_asks_waits_for_the_answer(paused):
    session = paused(1, algorithm="sgim-im", teachers=("by-hand",), teacher=None)
    session.answered = True
    session.pause(False)
    asked = session.when(lambda state: state.waiting)
    session.decline().result()
    asked = session.when(lambda state: state.waiting and state.movements > asked.movements)
    assert lessons(session.run.path) == []
    nearest = min(SHOWN, key=lambda shown: np.linalg.norm(shown.outcome - asked.asked))
    session.answered = False
    session.show(nearest).result()
    session.when(lambda state: state.movements > asked.movements + 20)
    session.__exit__()
    assert lessons(session.run.path) == [asked.movements]
    before = lived(session.run.path)
    other = Session(session.config)
    other.pause(True)
    with other:
        other.advance(5).result()
    assert_same(before, lived(session.run.path), len(before[0]))


KILLED = f"""
import json, sys; sys.path.insert(0, {str(ROOT / "tests")!r})
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.tasks.robots import arm_demonstrations
from sgimd_torch.views.teach.session import Session
session = Session(Config.from_settings(json.loads(sys.argv[1])))
session.pause(True)
session.__enter__()
for shown in arm_demonstrations(PlanarArm())[5:7]:
    session.advance(10).result()
    session.show(shown).result()
print("shown", flush=True)
sys.stdin.read()
"""


def test_a_killed_session_loses_nothing_that_was_shown(tmp_path):
    config = taught(tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, json.dumps(config.settings)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    assert process.stdout.readline() == "shown\n"
    process.send_signal(signal.SIGKILL)
    process.communicate()
    session = Session(config)
    session.pause(True)
    with session:
        assert session.when(lambda state: not state.busy).lessons == (10, 30)
        assert session.state.movements == 40


def test_a_task_without_anything_to_lead_says_why(capsys):
    assert command(main, ["--environment", "toss"]) == 2
    assert "Toy cannot be led by the hand" in capsys.readouterr().err


def test_a_run_that_is_taught_has_a_person_as_its_teacher(tmp_path, paused):
    config, port = options_of(["--seed", "4", "--port", "9000", "--out", str(tmp_path)])
    assert (config.directory, config["teacher"], port) == (tmp_path / "taught" / "seed-004", "by-hand", 9000)
    config, _ = options_of(["--algorithm", "sgim-im"])
    assert config["teachers"] == ("by-hand",)
    session = paused()
    session.__exit__()
    config, _ = options_of([str(session.run.path.parent)])
    assert config == session.config
    moved = tmp_path / "elsewhere"
    shutil.copytree(session.run.path.parent, moved)
    with pytest.raises(ValueError, match="must be called"):
        options_of([str(moved)])
    with pytest.raises(ValueError, match="holds no run"):
        options_of([str(tmp_path)])
