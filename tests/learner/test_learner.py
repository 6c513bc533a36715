"""The learner: ask, execute, tell; a demonstration interrupts; what cannot be right is refused and changes nothing."""

import re

import numpy as np
import pytest

from sgimd_torch.algorithms.paper import sagg_riac
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Explore, Search, Strategy
from sgimd_torch.spaces import Array, Attempt, Box, Demonstration, Estimate, Move
from sgimd_torch.strategies import Mimic, Rest
from worlds import NO_CONTEXT, demonstrate, last_posture, problem

ARM = PlanarArm(4)
LESSON, SECOND = demonstrate(ARM, [-0.5, 0.5]), demonstrate(ARM, [0.2, -0.6])


class Pursuit(Strategy):
    """A strategy of ``n`` movements at a time that notes contexts, outcomes and how often its attempts ended."""

    def __init__(self, n: int = 3, *, context_dim: int = 0) -> None:
        contexts = Box.cube(0, 1, context_dim)
        super().__init__(problem(contexts=contexts, policies=ARM.policies, inverse=NearestNeighbour))
        self.n = n
        self.contexts: list[Array] = []
        self.outcomes: list[list[float]] = []
        self.n_ended = 0
        self._held: list[Attempt] = []  # Python would close a generator that is not kept

    def attempt(self, context: Array) -> Attempt:
        self._held.append(self._pursue(context))
        return self._held[-1]

    def _pursue(self, context: Array) -> Attempt:
        self.contexts.append(context)
        try:
            for k in range(self.n):
                outcome = yield Move(np.full(4, k / 10), None, "pursuit")
                self.outcomes.append(outcome.tolist())
        finally:
            self.n_ended += 1


def learner(pursuit: Pursuit, *, repeats: int | None = 2) -> Learner:
    mimic = Mimic(pursuit.problem, repeats=repeats)
    return Learner(pursuit.problem, pursuit, social=mimic, correspondence=last_posture)


def step(robot: Learner, outcome: tuple[float, float] = (0.1, 0.2), context: Array = NO_CONTEXT) -> Move | None:
    move = robot.ask(context)
    if move is not None:
        robot.tell(outcome)
    return move


def test_every_outcome_reaches_memory_and_its_attempt_and_the_next_attempt_begins_when_the_learner_is_idle() -> None:
    pursuit = Pursuit(n=2)
    robot = learner(pursuit)
    idle = [robot.idle]
    for k in range(5):
        step(robot, (k, -k))
        idle.append(robot.idle)
    assert idle == [True, False, True, False, True, False]
    assert robot.memory.outcomes.tolist() == pursuit.outcomes == [[k, -k] for k in range(5)]
    assert robot.memory.thetas[:, 0].tolist() == [0.0, 0.1, 0.0, 0.1, 0.0]
    assert (len(pursuit.contexts), pursuit.n_ended) == (3, 2)


def asked() -> Learner:
    robot = learner(Pursuit())
    robot.ask(NO_CONTEXT)
    return robot


OUT_OF_TURN = {  # message: a learner, and what it refuses
    "ask() has not proposed one": (lambda: learner(Pursuit()), lambda robot: robot.tell([0.0, 0.0])),
    "a context for each robot, got none": (lambda: learner(Pursuit()), lambda robot: robot.ask_many([])),
    "go_on_alone() needs a request": (lambda: learner(Pursuit()), lambda robot: robot.go_on_alone("")),
    "was tell() forgotten? Without one, interrupt()": (asked, lambda robot: robot.ask(NO_CONTEXT)),
    "watch() needs the outcome of the last movement first": (asked, lambda robot: robot.watch(LESSON)),
    "add() needs the outcome of the last movement first": (
        *(asked, lambda robot: robot.add(NO_CONTEXT, [0.5] * 4, [0.9, 0.1])),
    ),
}


@pytest.mark.parametrize("message", OUT_OF_TURN)
def test_what_comes_out_of_turn_is_refused_and_changes_nothing(message: str) -> None:
    begin, act = OUT_OF_TURN[message]
    robot = begin()
    waits = bool(robot._asked)
    with pytest.raises((RuntimeError, ValueError), match=re.escape(message)):
        act(robot)
    assert (len(robot.memory), robot.movements, bool(robot._asked)) == (0, 0, waits)


DIVERGED = r"outcome .*did the simulation diverge.*theta was \[0\.1, 0\.1, 0\.1, 0\.1\]"


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        *((outcome, DIVERGED) for outcome in ([np.nan, 0.0], [np.inf, 0.0], [1e300, 0.0], [0.0, -1e101])),
        *((outcome, "outcome") for outcome in ([0.0], [0.0, 0.0, 0.0], "far", None, [[0.0, 0.0]])),
        *((outcome, "outcome") for outcome in ([1j, 0.0], [True, False], ["0", "1"])),
    ],
)
def test_an_impossible_outcome_changes_nothing_and_the_learner_still_waits(outcome: object, said: str) -> None:
    pursuit = Pursuit()
    robot = learner(pursuit)
    step(robot)
    robot.ask(NO_CONTEXT)
    with pytest.raises(ValueError, match=said):
        robot.tell(outcome)
    assert len(robot.memory) == 1
    assert len(pursuit.outcomes) == 1
    robot.tell([0.3, 0.4])  # the same movement, executed again
    assert robot.memory.thetas[:, 0].tolist() == [0.0, 0.1]
    assert pursuit.n_ended == 0


def test_a_demonstration_interrupts_a_search_after_any_movement() -> None:
    for n in range(3):
        pursuit = Pursuit(n=3)
        robot = learner(pursuit)
        for _ in range(n):
            step(robot)
        robot.watch(LESSON)
        assert pursuit.n_ended == (1 if n else 0)
        assert np.array_equal(step(robot).theta, LESSON.trajectory[-1])
        assert len(pursuit.outcomes) == n
        assert len(robot.memory) == n + 1


def test_a_demonstration_interrupts_the_imitation_of_the_one_before() -> None:
    robot = learner(Pursuit(), repeats=None)
    robot.watch(LESSON)
    for _ in range(5):
        step(robot)
    robot.watch(SECOND)
    moves = [step(robot) for _ in range(5)]
    assert all(np.array_equal(move.goal, SECOND.outcome) for move in moves)
    assert np.array_equal(moves[0].theta, SECOND.trajectory[-1])


def test_after_resting_there_is_nothing_to_tell_and_the_next_ask_may_follow() -> None:
    pursuit = Pursuit()
    robot = Learner(pursuit.problem, Rest(pursuit.problem))
    assert robot.ask(NO_CONTEXT) is None
    assert robot.ask(NO_CONTEXT) is None
    with pytest.raises(RuntimeError, match="ask"):
        robot.tell([0.0, 0.0])


def test_an_attempt_keeps_its_context_until_it_ends() -> None:
    pursuit = Pursuit(n=2, context_dim=1)
    robot = learner(pursuit)
    one, other = np.array([0.1]), np.array([0.2])
    step(robot, context=one)
    with pytest.raises(RuntimeError, match="idle"):
        robot.ask(other)
    step(robot, context=one)
    step(robot, context=other)
    assert pursuit.contexts == [one, other]
    assert robot.memory.contexts.ravel().tolist() == [0.1, 0.1, 0.2]


def test_a_demonstration_brings_its_own_context() -> None:
    robot = learner(Pursuit(context_dim=1))
    step(robot, context=np.array([0.1]))
    robot.watch(Demonstration(np.array([0.7]), LESSON.times, LESSON.trajectory, LESSON.outcome))
    with pytest.raises(RuntimeError, match="context"):
        robot.ask(np.array([0.1]))
    step(robot, context=np.array([0.7]))
    assert robot.memory.contexts.ravel().tolist() == [0.1, 0.7]


def test_an_interrupted_learner_forgets_what_it_asked_for_and_begins_again() -> None:
    pursuit = Pursuit(n=3)
    robot = learner(pursuit)
    step(robot)
    robot.ask(NO_CONTEXT)
    robot.interrupt()
    robot.interrupt()
    assert pursuit.n_ended == 1
    with pytest.raises(RuntimeError, match="ask"):
        robot.tell([0.0, 0.0])
    assert step(robot).theta[0] == 0.0
    assert len(robot.memory) == 2


def test_a_movement_made_elsewhere_enters_memory_but_counts_as_none() -> None:
    robot, kinds = learner(Pursuit()), list[str]()
    robot.listeners.append(lambda event: kinds.append(str(event.kind)))
    robot.add(NO_CONTEXT, [0.5] * 4, [0.9, 0.1])
    for theta, outcome, said in (
        ([0.5, 0.5, 0.5, 1.5], [0.9, 0.1], "theta must lie in its box"),
        ([0.5] * 4, [0.9, np.nan], "outcome"),
    ):
        with pytest.raises(ValueError, match=said):
            robot.add(NO_CONTEXT, theta, outcome)
    assert (len(robot.memory), robot.movements, kinds) == (1, 0, ["added"])


def test_a_demonstration_that_does_not_fit_is_refused_and_interrupts_nothing() -> None:
    pursuit = Pursuit()
    robot = learner(pursuit)
    step(robot)
    times, trajectory, outcome = LESSON.times, LESSON.trajectory, LESSON.outcome
    for bad in (
        Demonstration(np.zeros(1), times, trajectory, outcome),
        Demonstration(NO_CONTEXT, times, trajectory, np.zeros(3)),
        Demonstration(NO_CONTEXT, times, trajectory, outcome[None]),
        Demonstration(np.zeros((2, 0)), times, trajectory, outcome),
    ):
        with pytest.raises(ValueError, match="of the demonstration"):
            robot.watch(bad)
    assert pursuit.n_ended == 0
    assert step(robot).theta[0] == 0.1


def test_a_social_strategy_without_a_correspondence_is_refused() -> None:
    pursuit = Pursuit()
    with pytest.raises(ValueError, match="correspondence"):
        Learner(pursuit.problem, pursuit, social=Mimic(pursuit.problem))


def test_a_strategy_without_any_movement_is_an_error_not_an_endless_loop() -> None:
    with pytest.raises(RuntimeError, match="yield"):
        learner(Pursuit(n=0)).ask(NO_CONTEXT)


def test_what_callers_hand_in_may_change_afterwards() -> None:
    pursuit = Pursuit(n=2, context_dim=1)
    robot = learner(pursuit)
    context, outcome, shown = np.array([0.1]), np.array([0.2, 0.3]), LESSON.outcome.copy()
    lesson = Demonstration(context, LESSON.times, LESSON.trajectory, shown)
    step(robot, outcome, context)
    for array in (context, outcome, shown):
        array[:] = 9.0
    assert pursuit.contexts == [np.array([0.1])]
    assert robot.context_of(0).tolist() == [0.1]
    assert robot.memory.outcomes.tolist() == [[0.2, 0.3]]
    robot.watch(lesson)
    move = robot.ask([0.1])
    assert np.array_equal(move.goal, LESSON.outcome)


def test_what_the_learner_hands_out_is_read_only() -> None:
    robot = learner(Pursuit(context_dim=1))
    move = robot.ask([0.1])
    for array in (move.theta, robot.context_of(0)):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


@pytest.mark.parametrize("context", [[[0.1]], [[0.1], [0.2]], [True], ["0.1"], [0.1j]])
def test_a_context_of_another_shape_or_kind_is_refused(context: object) -> None:
    with pytest.raises(ValueError, match=r"context must .*got"):
        learner(Pursuit(context_dim=1)).ask(context)


class Wild(Explore):
    """An explorer whose third theta is wrong."""

    wrong: object = None
    calls = 0

    def __call__(self, context: Array) -> Array:
        self.calls += 1
        inside = self.problem.policies.sample(self.rng)
        return inside if self.calls < 3 else self.wrong  # type: ignore[return-value]


class Jumpy(Search):
    """A search whose second theta leaves Pi."""

    def __call__(self, start: Estimate, goal: Array) -> Attempt:  # type: ignore[override]
        yield start.theta  # type: ignore[misc]
        yield self.problem.policies.high + 1  # type: ignore[misc]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (ARM.policies.high + 1e-9, "theta of the part Wild must lie in its box"),
        (np.full(4, np.nan), "theta of the part Wild must be finite"),
        (np.zeros(3), r"theta of the part Wild must have shape \(..., 4\), got \(3,\)"),
        (np.zeros((2, 4)), r"theta of the part Wild must have shape \(4,\), got \(2, 4\)"),
        ([None] * 4, "theta of the part Wild must be real numbers"),
    ],
)
def test_a_theta_that_is_no_point_of_pi_never_reaches_a_robot(wrong: object, said: str) -> None:
    explore = type("Wild", (Wild,), {"wrong": wrong, "draws_from": "explore"})
    robot = sagg_riac(ARM, 0, explore=explore, global_range=(1.0, 1.0))
    executed = [step(robot) for _ in range(2)]
    with pytest.raises(ValueError, match=said):
        robot.ask(NO_CONTEXT)
    with pytest.raises(RuntimeError, match="has not proposed one"):
        robot.tell((0.1, 0.2))
    assert len(robot.memory) == len(executed) == 2


def test_a_search_that_leaves_pi_is_named() -> None:
    robot = sagg_riac(ARM, 0, search=Jumpy, global_range=(0.0, 0.0), give_up=-1.0)
    with pytest.raises(ValueError, match="theta of the part Jumpy must lie in its box"):
        list(map(step, [robot] * 9))
