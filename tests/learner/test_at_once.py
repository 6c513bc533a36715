"""Several robots move at once: one learner, an attempt for each robot; what one does, or fails to do, is its own."""

from dataclasses import replace

import numpy as np
import pytest

from sgimd_torch import load_life, save_life, session
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Kind
from sgimd_torch.parts import Strategy
from sgimd_torch.record import Record
from sgimd_torch.session import NoOutcomeError, run
from sgimd_torch.spaces import Failure, Move, stream
from sgimd_torch.teachers import PeriodicTeacher, at_once
from worlds import NO_CONTEXT, demonstrations, last_posture, make, problem

ARM = PlanarArm(5, noise=0.01)
SHOWN = demonstrations(ARM)
LEARNERS = {
    "sgim-d": lambda: make("sgim-d", ARM),
    "practice": lambda: practice(ARM, 0),
    "practice-taught": lambda: practice_taught(ARM, 0, correspondence=last_posture),
}


@pytest.fixture(autouse=True)
def _all_robots_join_soon(monkeypatch):
    monkeypatch.setattr(session, "JOINS_EVERY", 1)


def lived(name, path, movements, at_once, *, events=()):
    """The learner, its episodes and its events, after ``movements`` that go on from these ``events``."""
    learner = LEARNERS[name]()
    teacher = None if name == "practice" else PeriodicTeacher(SHOWN, stream(0, "teacher"), every=11)
    with Record.make(path, (0, 5, 2), {}) as record:
        for event in events:
            record.add(event)
        episodes = list(run(learner, ARM, 0, movements=movements, at_once=at_once, record=record, teacher=teacher))
        return learner, episodes, list(record.events())


def test_no_movement_of_a_group_knows_the_outcome_of_another():
    arm = PlanarArm(5)
    first, other = practice(arm, 0), practice(arm, 0)
    for learner, scale in ((first, 1.0), (other, -1.0)):
        for _ in range(12):
            moves = learner.ask_many([NO_CONTEXT] * 4)
            learner.tell_many([arm.execute(NO_CONTEXT, move.theta, stream(0, "noise")) for move in moves])
        learner.told = [move.theta for move in learner.ask_many([NO_CONTEXT] * 4)]
        learner.tell_many([scale * np.array([0.1, 0.2 * k]) for k in range(4)])
    assert np.array_equal(first.told, other.told)
    later = [[move.theta for move in learner.ask_many([NO_CONTEXT] * 4)] for learner in (first, other)]
    assert not np.array_equal(*later)


def test_a_demonstration_goes_to_the_robot_of_its_movement_and_the_others_go_on():
    learner = LEARNERS["practice-taught"]()
    teacher = PeriodicTeacher(SHOWN, stream(0, "teacher"), every=10)
    episodes = list(run(learner, ARM, 0, movements=40, at_once=4, teacher=teacher))
    shown = [episode for episode in episodes if episode.demonstration is not None]
    assert [episode.index for episode in shown] == [10, 20, 30]
    for episode in episodes:
        imitates = episode.move.origin == "imitate"
        assert imitates == (episode.demonstration is not None)
        assert not imitates or np.array_equal(episode.move.theta, episode.demonstration.trajectory[-1])


def test_all_demonstrations_at_the_start_are_imitated_at_once():
    learner = LEARNERS["practice-taught"]()
    teacher = at_once(SHOWN, stream(0, "teacher"))
    episodes = list(run(learner, ARM, 0, movements=24, at_once=8, teacher=teacher))
    assert [episode.move.origin == "imitate" for episode in episodes] == [True] * 20 + [False] * 4


def test_an_imitation_of_one_robot_goes_on_for_group_after_group():
    learner = make("sgim-d", ARM)
    list(run(learner, ARM, 0, movements=20, at_once=2))
    learner.watch(SHOWN[0], robot=1)
    origins = [[move.origin for move in asked(learner, 2)] for _ in range(12)]
    assert [pair[1] == "imitate" for pair in origins] == [True] * 10 + [False] * 2
    assert "imitate" not in [pair[0] for pair in origins]


def asked(learner, robots):
    """The next movements of ``robots``, executed."""
    moves = learner.ask_many([NO_CONTEXT] * robots)
    learner.tell_many([None if move is None else ARM.execute(NO_CONTEXT, move.theta, stream(0, "n")) for move in moves])
    return moves


def test_attempts_that_began_in_another_order_than_the_robots_are_replayed_in_theirs(tmp_path):
    learner, again = LEARNERS["practice"](), LEARNERS["practice"]()
    learner.request(NO_CONTEXT, robot=1)  # the attempt of robot 1 begins first
    asked(learner, 2)
    save_life(learner, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    assert np.array_equal(again.memory.thetas, learner.memory.thetas)


class Dozing(Strategy):
    """Draws a theta, rests, and then makes this movement."""

    def attempt(self, context):
        theta = self.problem.policies.sample(self.problem.stream("dozing"))
        yield None
        yield Move(theta, None, "dozing")


def test_an_attempt_whose_rest_has_failed_is_begun_again_in_a_replay(tmp_path):
    learner, again = (Learner(each, Dozing(each)) for each in (problem(), problem()))
    learner.ask_many([NO_CONTEXT])
    learner.tell_many([Failure("lost")])
    save_life(learner, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    thetas = [[each.ask(NO_CONTEXT), each.ask(NO_CONTEXT).theta.tolist()] for each in (learner, again)]
    assert thetas[0] == thetas[1]


def test_a_robot_that_fails_ends_its_own_attempt_alone():
    learner = make("sgim-d", ARM)
    for robot in range(3):
        learner.watch(SHOWN[robot], robot=robot)
    moves = learner.ask_many([NO_CONTEXT] * 3)
    learner.tell_many([[0.1, 0.1], Failure("lost"), [0.2, 0.2]])
    assert [learner.context_of(robot) is None for robot in range(3)] == [False, True, False]
    assert (len(learner.memory), learner.movements) == (2, 3)
    assert [str(event.kind) for event in learner.events()][-3:] == ["moved", "failed", "moved"]
    assert np.array_equal(list(learner.events())[-2].theta, moves[1].theta)


def test_attempts_of_robots_in_other_contexts_keep_their_contexts():
    arm = PlanarArm(3, context=True)
    learner = practice(arm, 0)
    contexts = np.array([[0.1], [-0.3], [0.7]])
    moves = learner.ask_many(contexts)
    learner.tell_many([arm.execute(c, move.theta, stream(0, "n")) for c, move in zip(contexts, moves, strict=True)])
    assert np.array_equal(learner.memory.contexts, contexts)


RIGHT = [[0.1, 0.2]] * 3


@pytest.mark.parametrize(
    ("outcomes", "error"),
    [
        (RIGHT[:2], "tell_many.. needs 3 outcomes, one for each movement, got 2"),
        ([*RIGHT, [0.1, 0.2]], "needs 3 outcomes, one for each movement, got 4"),
        ([*RIGHT[:2], [np.nan, 0.2]], r"outcome must be finite .*entry \[0\] is nan.*theta was"),
        ([*RIGHT[:2], [0.2]], r"outcome must have shape .*2"),
        ([*RIGHT[:2], None], "a movement has an outcome or a Failure, a rest has None"),
    ],
)
def test_wrong_outcomes_leave_the_learner_waiting(outcomes, error):
    learner = practice(ARM, 0)
    learner.ask_many([NO_CONTEXT] * 3)
    with pytest.raises(ValueError, match=error):
        learner.tell_many(outcomes)
    assert (len(learner.memory), learner.movements, list(learner.events())) == (0, 0, [])
    learner.tell_many(RIGHT)
    assert len(learner.memory) == 3


class Together(PlanarArm):
    """Does to a whole group what a test wants."""

    def __init__(self, outcomes):
        super().__init__(5)
        self.outcomes_of = outcomes

    def execute_many(self, contexts, thetas, rngs):
        return self.outcomes_of(super().execute_many(contexts, thetas, rngs))


def with_a_hole(outcomes):
    outcomes[1] = np.nan
    return outcomes


def lost(outcomes):
    raise ConnectionError("unplugged")


@pytest.mark.parametrize(
    ("outcomes", "failed"),
    [
        (with_a_hole, ["", "outcome must be finite", "", ""]),
        (lost, ["ConnectionError: unplugged"] * 4),
        (lambda outcomes: outcomes[:2], ["ValueError: execute_many() must give 4 outcomes in rows"] * 4),
    ],
)
def test_what_execute_many_does_wrong_fails_the_movements_that_it_concerns(outcomes, failed):
    robot = Together(outcomes)
    learner = practice(robot, 0)
    learner.movements = 4
    episodes = list(run(learner, robot, 0, movements=8, at_once=4))
    for episode, reason in zip(episodes, failed, strict=True):
        assert reason in episode.failed
        assert bool(reason) == bool(episode.failed)


def test_the_failure_of_one_robot_is_not_that_of_all():
    learner = practice(ARM, 0)
    learner.ask_many([np.zeros(0)] * 3)
    with pytest.raises(RuntimeError, match=r"fail\(\) is of one robot, but 3 were asked; write tell_many"):
        learner.fail("lost")
    learner.tell_many([Failure("lost"), np.zeros(2), np.zeros(2)])
    assert (learner.movements, len(learner.memory)) == (3, 2)
    learner.ask(np.zeros(0))
    learner.fail("lost")
    assert (learner.movements, len(learner.memory)) == (4, 2)


def test_too_many_failures_end_the_run_after_the_whole_group():
    robot, episodes = Together(lost), []
    learner = practice(robot, 0)
    learner.movements = 4
    with pytest.raises(NoOutcomeError, match="4 movements in a row failed, the last one: ConnectionError: unplugged"):
        episodes.extend(run(learner, robot, 0, movements=40, at_once=4, failures=3))
    assert learner.movements == 8
    assert len(episodes) == 4


@pytest.mark.parametrize("at_once", [1, 3])
@pytest.mark.parametrize("name", LEARNERS)
def test_a_record_that_differs_by_rounding_goes_on_from_what_was_executed_and_says_so_once(name, at_once, tmp_path):
    _, _, events = lived(name, tmp_path / "whole", 45, at_once)
    rng = stream(0, "rounding")

    def elsewhere(event):
        if (lesson := event.lesson) is not None:
            trajectory = lesson.trajectory + 1e-12 * rng.normal(size=lesson.trajectory.shape)
            event = event._replace(lesson=replace(lesson, trajectory=trajectory, outcome=lesson.outcome + 1e-15))
        if event.theta is not None:
            event = event._replace(theta=ARM.policies.clip(event.theta + 1e-12 * rng.normal(size=5)))
        return event

    other = [elsewhere(event) for event in events]
    with pytest.warns(RuntimeWarning, match="differs by rounding") as said:
        learner, episodes, _ = lived(name, tmp_path / "other", 60, at_once, events=other)
    assert len(said) == 1
    executed = [event.theta for event in other if event.kind == Kind.MOVED]
    assert np.array_equal(learner.memory.thetas[: len(executed)], executed)
    assert len(episodes) == 60


def test_one_more_robot_joins_after_each_30_movements(monkeypatch):
    monkeypatch.undo()
    groups, robot = [], Together(lambda outcomes: groups.append(len(outcomes)) or outcomes)
    list(run(practice(robot, 0), robot, 0, movements=130, at_once=3))
    assert groups == [2] * 15 + [3] * 13
