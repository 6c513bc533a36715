"""Runs that ask: requests, teachers by name, the taught toss; a run that was killed asks nobody again."""

import numpy as np
import pytest

from experiments.toys import toss, toy_demonstrations
from runs import content_of
from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.build import build
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import movements_on_disk, read_run
from sgimd_torch.runs.run import RunLoop
from sgimd_torch.runs.signals import Stopping

WRONG = "experiments.mislabelling:mislabelling"
FOUR = ("demonstrator-1", "demonstrator-2", "demonstrator-3", WRONG)
ACTS = ("--environment=planar-arm-7", "--algorithm=sgim-acts", f"--teachers=low-half,{WRONG}", "--seed=3")
SHORT = ("--movements=60", "--evaluate-at=[]", "--evaluated-by=own", "--repeats=0")


def go(out, *options):
    """The directory of a short run."""
    assert command(main, [*ACTS, *SHORT, f"--out={out}", "--name=run", *options]) == 0
    return out / "run" / "seed-003"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run that nothing has disturbed."""
    return go(tmp_path_factory.mktemp("whole"))


def test_each_request_has_a_row_that_says_what_came_of_it(whole):
    run, asked = read_run(whole), read_run(whole).requests
    first = ("index", "teacher", "strategy", "reply", "shown")
    assert tuple(asked) == (*first, "wanted_0", "wanted_1")
    teachers = build(
        Config("sgim-acts", seed=3, parts={"environment": "planar-arm-7", "teachers": ("low-half", WRONG)})
    ).teachers
    assert {*asked["teacher"]} == {"low-half", WRONG}
    assert {*asked["strategy"]} == {"imitate low-half", f"imitate {WRONG}"}
    answered = asked["reply"] == "shown"
    assert answered.sum() > 5
    assert {*asked["reply"]} <= {"shown", "again"}
    assert (asked["shown"] >= 0).tolist() == answered.tolist()
    assert asked["index"][answered].tolist() == np.flatnonzero(run.demonstration >= 0).tolist()
    assert run.demonstration[asked["index"][answered]].tolist() == asked["shown"][answered].tolist()
    wanted = np.stack([asked[f"wanted_{k}"] for k in range(2)], axis=1)
    for teacher, goal, row in zip(asked["teacher"][answered], wanted[answered], asked["shown"][answered], strict=True):
        answer, shown = teachers[teacher].demonstrate(np.zeros(0), goal, None), run.demonstrations[row]
        assert np.array_equal(shown.outcome, answer.outcome)
        assert np.array_equal(shown.trajectory, answer.trajectory)  # also of who mislabels: what was really made


def test_a_run_that_lost_its_robot_just_after_it_was_shown_something_has_that_answer(whole, tmp_path, monkeypatch):
    """What was shown is recorded before the movement that answers it, and is not asked for again."""
    run = read_run(whole)
    lost = run.requests["index"][np.flatnonzero(run.requests["reply"] == "shown")[3]]
    executed = []

    def execute(self, context, theta, rng, really=PlanarArm.execute):
        executed.append(theta)
        if len(executed) == lost + 1:
            life.commit()
            raise KeyboardInterrupt
        return really(self, context, theta, rng)

    with monkeypatch.context() as patched:
        parts = build(parse([*ACTS, *SHORT, f"--out={tmp_path}", "--name=run"])[0])
        patched.setattr(PlanarArm, "execute", execute)
        with Stopping() as stopping, pytest.raises(KeyboardInterrupt), RunLoop(parts, resume=False) as life:
            life.go_on(stopping)
    cut = content_of(tmp_path / "run" / "seed-003")["events"]
    assert [row[1] for row in cut[-2:]] == ["asked", "shown"]
    assert movements_on_disk(tmp_path / "run" / "seed-003") == lost
    assert content_of(go(tmp_path, "--resume")) == content_of(whole)


@pytest.mark.parametrize("max_wind", [0.0, 0.05])
def test_demonstrators_have_their_own_recordings_whatever_is_there(max_wind):
    parts = build(Config("sgim-acts", parts={"environment.max_wind": max_wind, "teachers": FOUR}))
    context = np.zeros(parts.environment.contexts.dim)
    for number in (1, 2, 3):
        theirs = load_demonstrations(SHIPPED.with_name(f"demonstrator_{number}.npz"))
        shown = parts.teachers[f"demonstrator-{number}"].demonstrations
        assert [each.outcome.tolist() for each in shown] == [each.outcome.tolist() for each in theirs]
        assert all(np.array_equal(each.context, context) for each in shown)
        answer = parts.teachers[f"demonstrator-{number}"].demonstrate(context, theirs[5].outcome, parts.learner.memory)
        assert answer is shown[5]


def test_the_toss_is_demonstrated_in_winds_all_over_c():
    robot = toss().environment
    shown = toy_demonstrations(robot)
    assert len(shown) > 100
    winds = np.array([each.context[0] for each in shown])
    assert np.histogram(winds, 4, (robot.contexts.low[0], robot.contexts.high[0]))[0].min() > 15
    for each in shown:  # what is said of a movement is where it comes without noise, in its own wind
        assert robot.outcomes.contains(each.outcome)
        assert robot.effect(each.context[None], each.trajectory[-1:])[0] == pytest.approx(each.outcome)
    again = toy_demonstrations(robot)
    assert [each.outcome.tolist() for each in again] == [each.outcome.tolist() for each in shown]


def test_a_run_on_the_toss_asks_in_its_own_wind_and_gets_the_nearest_of_goal_and_wind(tmp_path):
    directory = go(tmp_path, "--environment=experiments.toys:toss", "--algorithm=sgim-im", "--teachers=all")
    run = read_run(directory)
    asked, shown = run.requests, toy_demonstrations(toss().environment)
    dim = run.contexts.shape[1] + run.outcomes.shape[1]
    points = np.array([[*each.context, *each.outcome] for each in shown])
    wanted = np.stack([asked[f"wanted_{k}"] for k in range(dim)], axis=1)
    rows = np.array([np.linalg.norm(points - each, axis=1).argmin() for each in wanted])
    answered = asked["reply"] == "shown"
    assert answered.sum() > 5
    recorded = [run.demonstrations[row].trajectory[-1].tolist() for row in asked["shown"][answered]]
    assert recorded == [shown[row].trajectory[-1].tolist() for row in rows[answered]]
    assert wanted[:, :1].tolist() == run.contexts[asked["index"]].tolist()
    imitated = asked["index"][answered]
    assert run.thetas[imitated].tolist() == [shown[row].trajectory[-1].tolist() for row in rows[answered]]
