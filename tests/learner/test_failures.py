"""A movement may fail: it is counted and recorded, nothing is remembered of it, and the learner goes on."""

from collections.abc import Callable
from itertools import count, pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from experiments.toys import toss
from sgimd_torch.algorithms.paper import sagg_riac, sgim_d
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment, SimulationError
from sgimd_torch.evaluation import contexts_of_goals, evaluate
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.session import NoOutcomeError, live, run
from sgimd_torch.spaces import Array, Episode, Failure, stream
from worlds import ArmThat


def failing(fails: Callable[[int], object]) -> ArmThat:
    """``fails(n)`` is what its n-th call gives in the place of an outcome, or raises; None: it moves."""

    def act(n: int, rng: np.random.Generator) -> object:
        failure = fails(n)
        if isinstance(failure, BaseException):
            raise failure
        return failure

    return ArmThat(act, noise=0.01)


def every_fifth(failure: object):
    return lambda n: failure if n % 5 == 4 else None


FAILURES = {
    "diverged": SimulationError("diverged"),
    "ConnectionError: the robot is away": ConnectionError("the robot is away"),
    "SystemExit: 0": SystemExit(0),
    "outcome must be finite": np.array([0.0, np.nan]),
    "outcome must have shape": np.zeros(3),
    "got <U7": "nothing",
    "got object": [None, None],
}


@pytest.mark.parametrize("reason", FAILURES)
def test_a_movement_that_fails_counts_and_is_forgotten(reason: str) -> None:
    arm, drawn = failing(every_fifth(FAILURES[reason])), list[float]()
    fail = arm.act
    arm.act = lambda n, rng: drawn.append(rng.random()) or fail(n, rng)
    learner = practice(arm, 0)
    episodes = list(run(learner, arm, 0, movements=50))
    failed = [episode for episode in episodes if episode.failed]
    assert [episode.index for episode in failed] == list(range(4, 50, 5))
    assert all(episode.outcome is None and episode.move is not None for episode in failed)
    assert all(reason in episode.failed for episode in failed)
    assert len(learner.memory) == 40
    assert learner.movements == 50
    assert drawn == [stream(0, "environment", k).random() for k in range(50)]  # failed or not, each has its own


def test_the_attempt_of_a_failed_movement_is_over() -> None:
    arm = failing(every_fifth(ConnectionError()))
    learner = sgim_d(arm, 0, correspondence=arm.correspondence, budget=1000, give_up=-1.0, tolerance=0.0)
    episodes = list(run(learner, arm, 0, movements=60))
    for before, after in pairwise(episodes):
        assert before.move is not None
        assert after.move is not None
        goals = before.move.goal, after.move.goal
        assert np.array_equal(*goals) == (not before.failed)


def test_what_cannot_be_observed_fails_before_the_learner_proposes_anything() -> None:
    arm = failing(lambda n: None)
    observe, asked = arm.observe, []

    def sometimes(rng: np.random.Generator) -> Array:
        asked.append(rng)
        if len(asked) == 3:
            raise TimeoutError("no camera")
        return observe(rng)

    arm.observe = sometimes
    learner = practice(arm, 0)
    episodes = list(run(learner, arm, 0, movements=5))
    assert [episode.failed for episode in episodes] == ["", "", "TimeoutError: no camera", "", ""]
    assert episodes[2].move is None
    assert (learner.movements, len(learner.memory)) == (5, 4)


def test_a_robot_without_contexts_observes_with_the_stream_of_its_movement() -> None:
    arm = failing(lambda n: None)

    def sometimes(rng: np.random.Generator) -> Array:
        if rng.random() < 0.3:
            raise TimeoutError("no camera")
        return np.zeros(0)

    arm.observe = sometimes
    first, again = ([each.failed for each in run(practice(arm, 0), arm, 0, movements=20)] for _ in range(2))
    assert first == again
    assert 0 < sum(map(bool, first)) < 20


def test_too_many_failures_in_a_row_end_a_run_which_can_go_on() -> None:
    arm = failing(lambda n: ConnectionError("unplugged") if n in (1, 2) or 5 <= n < 8 else None)
    learner = practice(arm, 0)
    episodes: list[Episode] = []
    with pytest.raises(NoOutcomeError, match="3 movements in a row failed, the last one: ConnectionError: unplugged"):
        episodes.extend(run(learner, arm, 0, movements=20, failures=3))
    assert learner.movements == 8
    again = list(run(learner, arm, 0, movements=20, failures=3))
    assert [episode.index for episode in again] == list(range(8, 20))
    assert len(learner.memory) == 15


def test_a_failure_ends_a_run_though_the_robot_beside_it_has_an_outcome() -> None:
    arm = PlanarArm(5)
    learner, moves = practice(arm, 0), live(arm, 0)

    def execute(indices, contexts, thetas):
        outcomes = moves(indices, contexts, thetas)
        return [Failure("jammed") if index == 60 else outcome for index, outcome in zip(indices, outcomes, strict=True)]

    with pytest.raises(NoOutcomeError, match="1 movements in a row failed, the last one: jammed"):
        list(run(learner, arm, 0, movements=70, execute=execute, failures=1, at_once=2))
    assert learner.movements == 62


@pytest.mark.parametrize("together", [False, True])
def test_a_failed_answer_misses_its_goal_as_if_the_robot_had_not_moved(together: bool) -> None:
    arm = PlanarArm(5)
    learner = practice(arm, 0)
    list(run(learner, arm, 0, movements=30))
    goals = np.array([[0.1, 0.2], [0.3, 0.1], [-0.2, 0.4]])
    right = evaluate(learner.inverse, arm, goals, 0, 30)
    thetas = [theta.tobytes() for theta in right.thetas]

    class Sometimes(PlanarArm):
        def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
            if np.asarray(theta).tobytes() == thetas[1]:
                raise RuntimeError("stuck")
            return super().execute(context, theta, rng)

        def execute_many(self, contexts, thetas, rngs):
            return np.stack([self.execute(*each) for each in zip(contexts, thetas, rngs, strict=True)])

    robot = Sometimes(5)
    if not together:
        robot.execute_many = None
    found = evaluate(learner.inverse, robot, goals, 0, 30)
    assert found.failed.tolist() == [False, True, False]
    assert found.errors[[0, 2]].tolist() == right.errors[[0, 2]].tolist()
    assert found.errors[1] == np.linalg.norm(arm.rest - goals[1])
    assert found.noise_floor == pytest.approx(0, abs=1e-12)


MODULE = """
from pathlib import Path
import numpy as np
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.tasks import Task
class Broken(PlanarArm):
    execute_many = None
    def execute(self, context, theta, rng):
        if Path("repaired").exists():
            return super().execute(context, theta, rng)
        raise SystemExit(0)
class Worse(PlanarArm):
    n, execute_many = 0, None
    def execute(self, context, theta, rng):
        self.n += 1
        if self.n == 11:
            raise TimeoutError("slow")
        if self.n % 2 == 0:
            raise ConnectionError(f"lost packet {self.n}")
        return super().execute(context, theta, rng)
def task(kind):
    goals = np.random.default_rng(0).uniform(-.5, .5, (20, 2))
    return Task(kind(5, noise=.01), lambda: Benchmark(kind.__name__, goals, .1))
def broken(): return task(Broken)
def worse(): return task(Worse)
"""


@pytest.fixture
def robots(module) -> Path:
    return module("lossy_robots", MODULE)


def words(name: str, *more: str) -> list[str]:
    fixed = ["--algorithm", "practice", "--movements", "90", "--evaluate-at", "40", "--repeats", "2", "--seed", "3"]
    return ["--environment", f"lossy_robots:{name}", *fixed, "--out", name, *more]


def test_a_run_whose_robot_is_broken_says_how_to_go_on_and_does(robots: Path, capsys) -> None:
    assert command(main, words("broken")) == 1
    errors = capsys.readouterr().err
    assert "SystemExit" in errors
    assert "10 movements in a row failed, the last one: SystemExit: 0 (--failures says how many in a row" in errors
    assert errors.rstrip().endswith("--resume")
    (robots / "repaired").touch()
    assert command(main, words("broken", "--resume")) == 0
    assert read_run(robots / "broken" / "practice" / "seed-003").summary["failed"] == 10


def test_each_process_tells_three_failures_and_only_counts_later_ones_also_in_evaluations(robots: Path, capsys) -> None:
    assert command(main, words("worse", "--evaluate-at", "20", "--movements", "20")) == 1
    printed = capsys.readouterr()
    assert "movements of the evaluation failed" in printed.err
    assert read_run(robots / "worse" / "practice" / "seed-003").summary["failed"] == 11
    told = [line for line in printed.err.splitlines() if "movement " in line]
    numbers = ("1 failed: ConnectionError: lost packet 2", "3", "5")
    assert len(told) == 3
    assert all(f"movement {each}" in line for line, each in zip(told, numbers, strict=True))
    assert "further failures are only counted" in told[2]
    assert command(main, words("worse", "--evaluate-at", "20", "--movements", "24", "--resume")) == 1
    assert "movement 21 failed: ConnectionError: lost packet 2" in capsys.readouterr().err


def measured(over: float) -> Environment:
    """A toss whose every third measured wind is above C by this part of its side."""
    robot, calls = toss().environment, count(1)

    def observe(rng: np.random.Generator) -> Array:
        box = robot.contexts
        return box.high + over * box.sides if next(calls) % 3 == 0 else box.sample(rng)

    vars(robot)["observe"] = observe
    return robot


def test_a_measured_context_outside_c_by_rounding_is_clipped_and_told() -> None:
    robot = measured(1e-9)
    with pytest.warns(RuntimeWarning, match="a context outside C by rounding was clipped"):
        episodes = list(run(sagg_riac(robot, 0, budget=1), robot, 0, movements=6))
    assert not any(episode.failed for episode in episodes)
    assert [robot.contexts.contains(episode.context) for episode in episodes] == [True] * 6
    assert episodes[2].context.tolist() == robot.contexts.high.tolist()
    with pytest.warns(RuntimeWarning, match="was clipped"):
        assert robot.contexts.contains(contexts_of_goals(robot, 6)).all()


def test_a_context_far_outside_c_is_a_failed_movement_not_the_end_of_the_run() -> None:
    robot = measured(0.1)
    episodes = list(run(sagg_riac(robot, 0, budget=1), robot, 0, movements=6))
    assert [bool(episode.failed) for episode in episodes] == [False, False, True] * 2
    assert "context must lie in its box" in episodes[2].failed
