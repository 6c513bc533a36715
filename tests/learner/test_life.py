"""A saved life is lived through again: every learner goes on as if it had never stopped; another one is refused."""

from functools import partial

import numpy as np
import pytest

from runs import edit
from sgimd_torch.algorithms.paper import observation, random_exploration, sagg_riac, sgim_d
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import evaluate
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import Memory
from sgimd_torch.options.build import build
from sgimd_torch.options.command_line import main
from sgimd_torch.record import Record, ReplayError, RunError
from sgimd_torch.record.saving import load_life, save_life
from sgimd_torch.rivals.alp_gmm import AlpGmm
from sgimd_torch.rivals.cma_es import CmaEs
from sgimd_torch.rivals.quality_diversity import cma_mae, cma_me, isoline, map_elites
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.runs.signals import command
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.teachers import PeriodicTeacher
from worlds import ALGORITHMS, NO_CONTEXT, TAUGHT, demonstrate, demonstrations, last_posture

ARM = PlanarArm(4, noise=0.02)
TURNED = PlanarArm(4, noise=0.02, context=True)
LEARNERS = {
    **{name: (partial(build, ARM), name in TAUGHT, ARM) for name, build in ALGORITHMS.items()},
    "map-elites": (partial(map_elites, ARM, first=20), False, ARM),
    "cma-me": (partial(cma_me, ARM), False, ARM),
    "isoline": (partial(isoline, ARM, first=20, correspondence=last_posture), True, ARM),
    "alp-gmm and cma-es": (partial(sagg_riac, ARM, goals=AlpGmm, search=CmaEs), False, ARM),
    "contexts": (partial(sgim_d, TURNED, correspondence=last_posture), True, TURNED),
}
every_learner = pytest.mark.parametrize("name", LEARNERS)


def teacher_for(name, seed=0):
    _, taught, arm = LEARNERS[name]
    if not taught:
        return None
    context = np.zeros(arm.contexts.dim)
    shown = [demonstrate(arm, each.outcome, context) for each in demonstrations(PlanarArm(4))]
    return PeriodicTeacher(shown, stream(seed, "teacher"), every=20)


def line(episode):
    move, outcome = episode.move, episode.outcome
    return (
        *(episode.index, episode.context.tobytes(), move and (move.theta.tobytes(), move.origin)),
        *(outcome is not None and outcome.tobytes(), episode.demonstration and episode.demonstration.outcome.tobytes()),
    )


def events_of(path):
    with Record(path) as record:
        return list(record.rows("events"))


def step(robot, outcome=(0.1, 0.2)):
    move = robot.ask(NO_CONTEXT)
    if move is not None:
        robot.tell(outcome)
    return move


@every_learner
def test_a_loaded_learner_goes_on_as_if_it_had_never_stopped(name, tmp_path):
    build, _, arm = LEARNERS[name]
    whole, teacher = build(seed=1), teacher_for(name)
    lines, saved = [], {}
    for episode in run(whole, arm, 1, movements=130, teacher=teacher):
        lines.append(line(episode))
        if episode.index + 1 in (1, 50, 77):  # of which some are in the middle of an attempt
            path = saved[episode.index + 1] = tmp_path / f"{episode.index}.sqlite"
            save_life(whole, path)
    for movements, path in saved.items():
        learner, again = build(seed=1), teacher_for(name)
        load_life(learner, path, teacher=again)
        assert learner.movements == movements
        rest = [line(episode) for episode in run(learner, arm, 1, movements=130, teacher=again)]
        assert rest == lines[movements:]
        for part in ("contexts", "thetas", "outcomes"):
            assert getattr(learner.memory, part).tobytes() == getattr(whole.memory, part).tobytes()
        save_life(learner, tmp_path / "again.sqlite")
        save_life(whole, tmp_path / "whole.sqlite")
        assert events_of(tmp_path / "again.sqlite") == events_of(tmp_path / "whole.sqlite")


@every_learner
def test_which_movement_reaches_a_goal_is_one_call_for_all_of_them(name):
    build, _, arm = LEARNERS[name]
    learner = build(seed=2)
    for _ in run(learner, arm, 2, movements=60, teacher=teacher_for(name)):
        pass
    goal = np.array([0.3, 0.4])
    found = evaluate(learner.inverse, arm, goal[None], seed=2, step=60)
    context = found.contexts[0]
    assert arm.policies.contains(learner.inverse(context, goal).theta)
    assert np.array_equal(found.thetas[0], LocalProcess(learner.problem)(context, goal).theta)


def test_a_learner_that_was_interrupted_asked_in_vain_and_rested_is_the_same_again(tmp_path):
    lesson = demonstrate(PlanarArm(4), [-0.5, 0.5])

    def live(robot, moves):
        for k in range(40):
            if k == 9:
                robot.watch(lesson)
            if k % 7 == 3:
                robot.ask(NO_CONTEXT)
                robot.interrupt()
            if k % 11 == 5:
                robot.interrupt()
            moves.append(step(robot, (0.01 * k, 0.2)))

    whole, moves = sgim_d(ARM, 3, correspondence=last_posture), []
    live(whole, moves)
    save_life(whole, tmp_path / "life.sqlite")
    kinds = {row[1] for row in events_of(tmp_path / "life.sqlite")}
    assert kinds == {Kind.MOVED, Kind.SHOWN, Kind.INTERRUPTED}
    again = sgim_d(ARM, 3, correspondence=last_posture)
    load_life(again, tmp_path / "life.sqlite")
    assert again.movements == whole.movements == 40
    for _ in range(30):
        assert np.array_equal(step(again).theta, step(whole).theta)


def test_a_learner_without_a_life_is_saved_and_loaded(tmp_path):
    save_life(sagg_riac(ARM, 4), tmp_path / "life.sqlite")
    again = sagg_riac(ARM, 5)  # it has not moved yet, so nobody can tell
    load_life(again, tmp_path / "life.sqlite")
    assert again.movements == 0


@pytest.mark.slow
def test_a_search_through_a_model_goes_on_when_the_model_is_refreshed_as_the_loop_did(tmp_path):
    from sgimd_torch.forward_model.search import GradientSearch  # torch takes time to load

    def build():
        learner = sagg_riac(ARM, 5, search=GradientSearch)
        (shared,) = learner.problem.trained
        return shared, learner

    shared, whole = build()
    lines = []
    for episode in run(whole, ARM, 5, movements=140):
        lines.append(line(episode))
        shared.refresh(whole.memory)
        if episode.index == 99:
            save_life(whole, tmp_path / "life.sqlite")
    assert shared.model.trained
    shared, again = build()
    load_life(again, tmp_path / "life.sqlite", after=lambda move: shared.refresh(again.memory))
    rest = []
    for episode in run(again, ARM, 5, movements=140):
        rest.append(line(episode))
        shared.refresh(again.memory)
    assert rest == lines[100:]


@pytest.fixture
def saved(tmp_path):
    """A life of SGIM-D with 50 movements and 2 lessons."""
    learner = sgim_d(ARM, 6, correspondence=last_posture)
    for _ in run(learner, ARM, 6, movements=50, teacher=teacher_for("sgim-d")):
        pass
    save_life(learner, tmp_path / "life.sqlite")
    return tmp_path / "life.sqlite"


@pytest.mark.parametrize(
    ("learner", "message"),
    [
        (
            lambda: sgim_d(ARM, 7, correspondence=last_posture),
            "movement 0 was recorded with another theta: theta_3 was",
        ),
        (
            lambda: sgim_d(ARM, 6, correspondence=lambda times, trajectory: trajectory[0]),
            "movement 20 was recorded with another theta",
        ),
        (
            lambda: observation(ARM, 6, correspondence=last_posture),
            "movement 0 was recorded as a movement, the learner now rests",
        ),
    ],
)
def test_a_learner_that_would_have_moved_otherwise_is_refused(saved, learner, message):
    with pytest.raises(ReplayError, match=message):
        load_life(learner(), saved)


def exemplars(n, arm=ARM):
    memory = Memory(0, arm.policies.dim, 2)
    for k in range(n):
        theta = arm.policies.sample(stream(k, "theta"))
        memory.add(NO_CONTEXT, theta, arm.execute(NO_CONTEXT, theta, stream(k, "environment")))
    return memory


def test_a_teacher_that_shows_something_else_is_refused(saved):
    learner = sgim_d(ARM, 6, correspondence=last_posture)
    with pytest.raises(ReplayError, match="movement 20 a demonstration was shown, the teacher now offers another"):
        load_life(learner, saved, teacher=teacher_for("sgim-d", seed=9))
    teacher = teacher_for("sgim-d")
    teacher.every = 10
    with pytest.raises(ReplayError, match="before movement 10 nothing was shown, the teacher now offers a demonstr"):
        load_life(sgim_d(ARM, 6, correspondence=last_posture), saved, teacher=teacher)


def test_a_memory_that_was_written_to_from_outside_is_not_saved(tmp_path):
    robot = random_exploration(ARM, 8)
    step(robot)
    robot.memory.add(NO_CONTEXT, np.full(4, 0.5), [0.0, 0.0])
    with pytest.raises(ValueError, match=r"has 2 exemplars, but 1 were lived; .* without learner\.add\(\)"):
        save_life(robot, tmp_path / "life.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_only_a_learner_freshly_built_can_load(saved):
    learner = sgim_d(ARM, 6, correspondence=last_posture)
    step(learner)
    with pytest.raises(RuntimeError, match="freshly built"):
        load_life(learner, saved)


def test_a_life_of_another_robot_and_a_damaged_one_are_refused(saved):
    with pytest.raises(
        RunError, match=r"has dims \(0, 4, 2\) of context, theta, outcome, not \(0, 5, 2\); another robot"
    ):
        load_life(sagg_riac(PlanarArm(5), 6), saved)
    edit(saved, "UPDATE events SET theta_1 = 0.5 WHERE movement = 30")
    learner = sgim_d(ARM, 6, correspondence=last_posture)
    with pytest.raises(RunError, match=r"life\.sqlite"):
        load_life(learner, saved)
    assert learner.movements == 0


def test_lessons_of_different_shape_are_saved(tmp_path):
    """Of a glove with more joints, or of another length: a correspondence may take any."""
    robot, again = (observation(ARM, 0, correspondence=lambda times, trajectory: np.full(4, 0.5)) for _ in range(2))
    for n_times, n_joints in ((5, 2), (7, 3)):
        robot.watch(Demonstration(NO_CONTEXT, np.arange(1.0 * n_times), np.ones((n_times, n_joints)), np.zeros(2)))
    save_life(robot, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    with Record(tmp_path / "life.sqlite") as record:
        assert [each.trajectory.shape for each in record.demonstrations()] == [(5, 2), (7, 3)]


@pytest.mark.parametrize(
    ("algorithm", "more"),
    [("sgim-d", ()), ("sgim-acts", ("--teachers", "low-half,high-half")), ("practice", ()), ("imitation", ())],
)
def test_the_file_of_a_run_is_loaded_by_a_learner_of_a_program_of_ones_own(tmp_path, algorithm, more):
    words = f"--algorithm {algorithm} --environment planar-arm-7 --evaluate_at [] --seed 4 --name run".split()
    for movements in (50, 70):
        options = [*words, *more, "--movements", str(movements), "--out", str(tmp_path / str(movements))]
        assert command(main, options) == 0
    run_of_50, run_of_70 = (read_run(tmp_path / f"{movements}/run/seed-004") for movements in (50, 70))
    parts = build(config_of(run_of_50))
    load_life(parts.learner, run_of_50.path / FILE, teacher=parts.teacher)
    lived = {"movements": 70, "teacher": parts.teacher, "teachers": parts.teachers}
    episodes = list(run(parts.learner, parts.environment, 4, **lived))
    assert [e.move and e.move.theta.tolist() for e in episodes] == [
        None if np.isnan(theta).any() else theta.tolist() for theta in run_of_70.thetas[50:]
    ]


@pytest.mark.parametrize("build", [random_exploration, sagg_riac, map_elites, cma_me, cma_mae, isoline])
def test_a_learner_starts_from_a_memory_and_leaves_it_as_it_was(build):
    start = exemplars(30)
    learner = build(ARM, 0, memory=start)
    for _ in run(learner, ARM, 0, movements=25):
        pass
    assert len(learner.memory) == 55
    assert len(start) == 30
    assert np.array_equal(learner.memory.thetas[:30], start.thetas)


def test_goal_babbling_from_a_memory_uses_it_at_its_first_movement():
    empty, full = (next(run(sagg_riac(ARM, 0, memory=start), ARM, 0, movements=1)) for start in (None, exemplars(200)))
    assert empty.move.origin == "global"
    assert full.move.origin == "local"


def test_map_elites_from_a_memory_varies_its_elites_at_once():
    start = exemplars(40)
    moves = [e.move.theta for e in run(map_elites(ARM, 0, memory=start, sd=0.01), ARM, 0, movements=10)]
    nearest = [np.abs(start.thetas - theta).max(axis=1).min() for theta in moves]
    assert max(nearest) < 0.06


def test_a_life_that_started_from_a_memory_is_loaded_by_one_that_starts_from_the_same(tmp_path):
    whole = sagg_riac(ARM, 0, memory=exemplars(30))
    for _ in range(10):
        step(whole)
    save_life(whole, tmp_path / "life.sqlite")
    again = sagg_riac(ARM, 0, memory=exemplars(30))
    load_life(again, tmp_path / "life.sqlite")
    assert np.array_equal(step(again).theta, step(whole).theta)
    with pytest.raises(ReplayError, match="began with 30 exemplars in memory, this learner began with 0"):
        load_life(sagg_riac(ARM, 0), tmp_path / "life.sqlite")


def test_a_memory_of_another_robot_is_no_start():
    with pytest.raises(ValueError, match=r"must have dims \(0, 4, 2\) of context, theta, outcome, got \(0, 5, 2\)"):
        sagg_riac(ARM, 0, memory=exemplars(3, PlanarArm(5)))
    memory = Memory(0, 4, 2)
    memory.add(NO_CONTEXT, np.full(4, 1.5), [0.0, 0.0])
    with pytest.raises(ValueError, match="thetas of a memory to start from must lie in its box"):
        random_exploration(ARM, 0, memory=memory)


@pytest.mark.parametrize(
    ("theta_d", "message"),
    [
        (np.full(4, 1.5), "theta_d of the correspondence must lie in its box, but .* is 1.5 .*, outside"),
        (np.full(5, 0.5), r"theta_d of the correspondence must have shape \(..., 4\), got \(5,\)"),
        (np.full((1, 4), 0.5), r"theta_d of the correspondence must have shape \(4,\)"),
        (np.full(4, np.nan), "theta_d of the correspondence must be finite"),
    ],
)
@pytest.mark.parametrize("name", sorted(TAUGHT))
def test_a_correspondence_that_leaves_pi_is_refused_where_it_enters(name, theta_d, message):
    learner = ALGORITHMS[name](ARM, 0)
    learner.correspondence = lambda times, trajectory: theta_d
    with pytest.raises(ValueError, match=message):
        learner.watch(demonstrate(PlanarArm(4), [0.5, 0.5]))
    assert learner.idle
    assert len(learner.memory) == 0
