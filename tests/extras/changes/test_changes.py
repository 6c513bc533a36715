"""A robot that changes: it is noticed, told and repeated; earlier exemplars are kept if they help now."""

from functools import cache, partial

import numpy as np
import pytest

from changing import Changing
from marks import slow
from sgimd_torch.algorithms.paper import sagg_riac, sagg_riac_letter, sgim_d
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import evaluate
from sgimd_torch.extras.changes.calibration import Calibration
from sgimd_torch.extras.changes.eras import Era
from sgimd_torch.extras.changes.watcher import changes
from sgimd_torch.forward_model.search import GradientSearch
from sgimd_torch.inverses.local import LocalInverse
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Inverse
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, Failure, stream
from sgimd_torch.teachers import PeriodicTeacher
from worlds import NO_CONTEXT, Boxes, demonstrate, demonstrations, executed, last_posture, problem

ARM = PlanarArm(3)
GOALS = np.array([[0.3, 0.4], [-0.4, 0.5], [0.6, -0.1], [0.1, -0.7]])
WATCHED = partial(sagg_riac, watch=changes)
LIVES = {
    "practice": practice,
    "sagg-riac": WATCHED,
    "sgim-d": partial(sgim_d, correspondence=last_posture, watch=changes),
}


def live(learner, robot, movements, at_once=1, seed=0, teacher=None):
    """Let a learner move; returns the thetas."""
    thetas = []
    for episode in run(learner, robot, seed, movements=movements, at_once=at_once, teacher=teacher):
        robot.made = episode.index + 1
        thetas.append(np.full(robot.policies.dim, np.nan) if episode.move is None else episode.move.theta)
    return np.array(thetas)


def error(learner, robot):
    return evaluate(learner.inverse, robot, GOALS, 1, step=0, repeats=0).mean_error


def blind(learner):
    learner.watcher = None
    return learner


@pytest.fixture(scope="module")
def changed():
    """A life of practice on an arm of seven joints, which shift after 400 movements."""
    robot = Changing(PlanarArm(7), "offset-0.05", 400)
    learner = practice(robot, 3)
    live(learner, robot, 500)
    return learner, robot


@pytest.mark.parametrize("name", LIVES)
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_where_nothing_changes_a_life_is_that_of_a_learner_who_notices_nothing(name, noise):
    arm = PlanarArm(3, noise=noise)
    taught = name == "sgim-d"
    teachers = [PeriodicTeacher(demonstrations(ARM), stream(0, "teacher")) if taught else None for _ in range(2)]
    thetas = [
        live(watches(LIVES[name](arm, 1)), Changing(arm, "none", 0), 160, teacher=teacher)
        for watches, teacher in zip((blind, lambda learner: learner), teachers, strict=True)
    ]
    assert np.array_equal(*thetas, equal_nan=True)


def test_a_change_is_noticed_soon_and_told_since_when(changed):
    learner, _ = changed
    (change,) = learner.changes
    assert 400 <= change.since <= 404
    assert change.since < change.noticed <= 430
    assert change.helpful > 0
    assert str(change).startswith(f"since movement {change.since} outcomes are not what they were: ")
    told = [event.reply for event in learner.events() if event.kind == Kind.CHANGED]
    assert told == [str(change)]


def test_after_a_small_change_a_learner_is_far_better_than_one_that_begins_and_one_that_notices_nothing():
    errors = []
    for seed in (3, 13, 23):
        makes = (practice, lambda *to: blind(practice(*to)), practice)
        errors.append([])
        for make, before in zip(makes, (200, 200, 0), strict=True):
            robot = Changing(PlanarArm(7), "offset-0.05", before)
            learner = make(robot, seed)
            live(learner, robot, before + 60)
            errors[-1].append(error(learner, robot))
    notices, deaf, anew = np.exp(np.log(errors).mean(axis=0))
    assert notices < 0.6 * min(deaf, anew)


def test_if_nothing_holds_any_more_nothing_is_kept():
    robot = Changing(ARM, "reversed", 200)
    learner = practice(robot, 4)
    live(learner, robot, 300)
    (change,) = learner.changes
    assert change.helpful == 0
    assert str(change).endswith("nothing of before helps")
    assert np.array_equal(learner.problem.memory.thetas, learner.memory.thetas[change.since :])


def test_what_was_learnt_first_comes_back_with_the_first_robot():
    robot = Changing(ARM, "undone", 200)
    learner = practice(robot, 5)
    live(learner, robot, 700 + 100)
    _, back = learner.changes
    assert 698 <= back.since <= 704
    assert back.helpful > 100
    assert error(learner, robot) < 0.01


def test_noise_alone_is_no_change():
    robot = Changing(PlanarArm(3, noise=0.05), "noise", 200)
    learner = practice(robot, 3)
    live(learner, robot, 400)
    assert learner.changes == []


def test_a_shift_below_the_noise_is_noticed_as_it_biases_predictions():
    robot = Changing(PlanarArm(3, noise=0.12), "shift", 520)  # by .08
    learner = practice(robot, 4)
    live(learner, robot, 640)
    (change,) = learner.changes
    assert 510 <= change.since <= 530


@pytest.mark.parametrize("name", LIVES)
def test_competence_falls_again_where_nothing_is_reached_any_more(name):
    robot = Changing(ARM, "reversed", 200)
    learner = LIVES[name](robot, 3)
    live(learner, robot, 200)
    reached = learner.memory.outcomes[-1]
    babbling = learner.autonomous
    assert babbling.competence(NO_CONTEXT, reached) == 0
    live(learner, robot, 300)
    assert learner.changes
    assert learner.autonomous is not babbling
    assert len(learner.problem.memory) < len(learner.memory) == 300
    assert learner.autonomous.competence(NO_CONTEXT, reached) < 0


@pytest.mark.parametrize("at_once", [1, 5])
@pytest.mark.parametrize("name", LIVES)
def test_a_life_through_a_change_is_repeated_exactly(name, at_once, tmp_path):
    robot, saved = Changing(ARM, "offset-0.1", 80), tmp_path / "life.sqlite"
    whole = LIVES[name](robot, 2)
    shown = demonstrations(ARM)
    teacher = PeriodicTeacher(shown, stream(0, "teacher")) if name == "sgim-d" else None
    live(whole, robot, 140, at_once, teacher=teacher)
    assert whole.changes
    save_life(whole, saved)
    again = LIVES[name](robot, 2)
    teacher_again = PeriodicTeacher(shown, stream(0, "teacher")) if name == "sgim-d" else None
    load_life(again, saved, teacher=teacher_again)
    assert again.changes == whole.changes
    first = live(whole, robot, 160, at_once, teacher=teacher)
    assert np.array_equal(first, live(again, robot, 160, at_once, teacher=teacher_again), equal_nan=True)


def test_movements_of_another_program_and_failures_count_and_a_change_among_them_is_noticed():
    robot, rng = Changing(ARM, "mirrored", 0), stream(0, "elsewhere")
    learner = practice(ARM, 0)
    live(learner, Changing(ARM, "none", 0), 150)
    for k in range(60):
        learner.ask(NO_CONTEXT)
        learner.tell_many([Failure("it slipped")])
        theta = ARM.policies.sample(rng)
        robot.made = k
        learner.add(NO_CONTEXT, theta, robot.execute(NO_CONTEXT, theta, rng))
    assert learner.changes[0].since in range(150, 156)


def test_a_demonstration_after_a_change_is_imitated(changed):
    robot = Changing(ARM, "offset-0.1", 150)
    learner = LIVES["sgim-d"](robot, 2)
    live(learner, robot, 240)
    assert learner.changes
    lesson = demonstrate(ARM, [0.3, 0.4])
    learner.watch(lesson)
    assert np.array_equal(learner.ask(NO_CONTEXT).theta, lesson.trajectory[-1])


@cache
def error_alone(seed):
    """Error of practice after 60 movements without a simulator."""
    learner = practice(ARM, seed)
    live(learner, Changing(ARM, "none", 0), 60)
    return error(learner, ARM)


@pytest.mark.parametrize("change", ["none", "mirrored", slow("offset-0.05")])
def test_a_simulator_helps_as_far_as_it_is_right(change):
    there, ratios = Changing(ARM, change, 0), []
    for seed in (5, 15, 25, 35, 45, 55):
        simulated = practice(there, seed)
        live(simulated, there, 150)
        helped = practice(ARM, seed + 1, prior=simulated.memory)
        live(helped, Changing(ARM, "none", 0), 60)
        assert helped.begun == 0
        assert len(helped.memory) == 60
        ratios.append(error(helped, ARM) / error_alone(seed + 1))
    # After 60 movements a learner without a simulator errs .5 % of a side, so one that is off can hardly help.
    assert np.exp(np.log(ratios).mean()) < {"none": 0.5, "offset-0.05": 1.0, "mirrored": 1.5}[change]


class Sure(Inverse):
    """Nearest exemplar, which expects its outcome again."""

    def __call__(self, context, goal):
        estimate = NearestNeighbour(self.problem)(context, goal)
        return estimate._replace(expected=estimate.outcomes[0], sd=0.1)


def test_a_change_is_noticed_with_any_inverse_model_that_says_how_sure_it_is():
    robot = Changing(ARM, "reversed", 200)
    learner = WATCHED(robot, 3, inverse=Sure)
    live(learner, robot, 260)
    (change,) = learner.changes
    assert 198 <= change.since <= 204
    assert isinstance(learner.inverse, Sure)


def test_a_change_that_only_wrong_outcomes_had_shown_is_taken_back_with_them():
    robot = Changing(ARM, "reversed", 150)
    learner = practice(robot, 4)
    live(learner, robot, 200)
    (change,) = learner.changes
    learner.forget(range(150, 200))
    assert learner.changes == []
    assert len(learner.problem.memory) == len(learner.memory) == 150 > change.helpful
    robot.at = 1000
    live(learner, robot, 260)
    assert learner.changes == []
    assert error(learner, robot) < 0.05


def test_a_change_stays_when_others_are_forgotten_and_a_life_that_repeats_it_is_equal(tmp_path):
    robot = Changing(ARM, "reversed", 150)
    learner, again = practice(robot, 4), practice(robot, 4)
    live(learner, robot, 220)
    learner.forget([20, 160])
    (change,) = learner.changes
    assert 148 <= change.since <= 155
    assert change.noticed <= 190
    since = learner.memory.thetas[learner.rows[change.since] :]
    assert np.array_equal(learner.problem.memory.thetas[-len(since) :], since)
    save_life(learner, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    assert (again.changes, repr(again.inverse(NO_CONTEXT, GOALS[0]))) == (
        learner.changes,
        repr(learner.inverse(NO_CONTEXT, GOALS[0])),
    )
    assert np.array_equal(*(live(each, robot, 240) for each in (learner, again)))


def test_memory_and_prior_together_are_refused():
    memory = practice(ARM, 0).memory
    with pytest.raises(ValueError, match="give memory, exemplars of this robot, or prior"):
        practice(ARM, 0, memory=memory, prior=memory)


UNWATCHED = {
    "LocalInverse does not say how sure it is": {"inverse": LocalInverse},
    "a forward model cannot begin again": {"search": GradientSearch},
}


@pytest.mark.parametrize("why", UNWATCHED)
def test_who_cannot_begin_again_notices_nothing_and_refuses_a_prior_that_would_count_for_good(why):
    learner = WATCHED(ARM, 0, **UNWATCHED[why])
    assert learner.watcher is None
    assert learner.problem.remarks == [f"changes of the robot are not noticed: {why}"]
    with pytest.raises(ValueError, match=rf"prior \(--begin-with\) needs .*{why}.*; was another --inverse meant"):
        WATCHED(ARM, 0, prior=executed(ARM, [[0.5, 0.5, 0.5]]), **UNWATCHED[why])


@pytest.mark.parametrize("make", [sagg_riac, sagg_riac_letter, partial(sgim_d, correspondence=last_posture)])
def test_algorithms_of_the_paper_notice_nothing_unless_told_to_watch(make):
    learner = make(ARM, 0)
    assert (learner.watcher, learner.problem.remarks) == (None, [])
    with pytest.raises(ValueError, match=r"prior \(--begin-with\) needs a watcher, .*; got --watch none"):
        make(ARM, 0, prior=executed(ARM, [[0.5, 0.5, 0.5]]))


def test_a_calibration_finds_offset_and_gain():
    rng = stream(0, "calibration")
    memory = executed(ARM, rng.uniform(0.2, 0.8, (300, 3)))
    given = problem(ARM, memory=memory)
    era = Era(LocalProcess(given).fitted(), Exemplars.of(memory))
    now = Exemplars.of(memory, slice(100, 140))
    now = now._replace(thetas=0.5 + (now.thetas - 0.5 - 0.04) / 0.9)  # movements of now that do what those did before
    found = Calibration(era, ARM.policies).fit(now)
    assert np.abs(found.predict(now) - now.outcomes).max() < 0.02
    assert found.p[:6] == pytest.approx([-0.1] * 3 + [0.04] * 3, abs=0.02)


class Own(Memory):
    """A memory of a user's."""


def test_a_users_memory_stays_what_it_is_when_the_learner_begins_again():
    learner = practice(ARM, 0, memory=Own)
    live(learner, Changing(ARM, "none", 0), 40)
    again = learner.watcher.begin_again(Exemplars.of(learner.memory, slice(10)), 40)
    assert type(again.memory) is type(again.problem.memory) is Own
    assert type(practice(ARM, 0, memory=Own, prior=learner.memory).problem.memory) is Own


def test_a_robot_whose_outcomes_wrap_is_not_watched_and_that_is_said():
    heading = Boxes(Box.cube(0, 1, 0), Box.cube(0, 1, 2), Box([0], [360], periodic=(True,)), np.zeros(1))
    assert "changes of the robot are not noticed: a calibration does not know outcomes that wrap" in (
        practice(heading, 0, watch=changes).problem.remarks
    )
