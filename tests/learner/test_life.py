"""A life is lived again: whatever has happened to a learner, one that repeats its events is the same learner."""

import copy
import pickle

import numpy as np
import pytest

from any_life import ARM, LESSONS, NEAREST, QUIET, WATCHES, Lives, check_lives, check_start, exemplars
from sgimd_torch import session
from sgimd_torch.algorithms.paper import observation, random_exploration, sagg_riac, sgim_d
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.memory import Memory
from sgimd_torch.record import Record, ReplayError, RunError
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.teachers import AskedTeacher, PeriodicTeacher
from worlds import ALGORITHMS, NO_CONTEXT, TAUGHT, demonstrate, last_posture

LEARNERS = {
    "sagg-riac": lambda: sagg_riac(ARM, 0, **NEAREST),
    "sgim-d": lambda: sgim_d(ARM, 0, **WATCHES),
    "observation": lambda: observation(ARM, 0, **WATCHES),
    "practice": lambda: practice(ARM, 0),
    "practice-taught": lambda: practice_taught(ARM, 0, correspondence=last_posture),
}
TEACHERS = {
    "periodic": lambda: PeriodicTeacher(LESSONS, stream(0, "teacher"), every=2),
    "asked": lambda: AskedTeacher(LESSONS, stream(0, "teacher"), patience=2),
}


BY_RUNS = [(name, by) for name in ("sgim-d", "observation") for by in TEACHERS]


@pytest.mark.parametrize(("learner", "teacher"), [*((name, None) for name in LEARNERS), *BY_RUNS])
def test_whatever_happens_a_learner_that_repeats_the_life_is_the_same(learner, teacher, monkeypatch):
    monkeypatch.setattr(session, "JOINS_EVERY", 1)
    check_lives(lambda: Lives(LEARNERS[learner], TEACHERS.get(teacher)))


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, pickle.dumps])
def test_who_copies_a_learner_is_told_how_to_save_its_life(copied):
    with pytest.raises(TypeError, match=r"^a learner cannot be copied or pickled.*save_life.*load_life.*$"):
        copied(LEARNERS["sgim-d"]())


def taught(seed=6, correspondence=last_posture):
    return sgim_d(QUIET, seed, correspondence=correspondence)


def teacher_of(seed=0, every=20):
    lessons = [demonstrate(QUIET, goal) for goal in ([0.3, 0.4], [-0.5, 0.2], [0.1, -0.6])]
    return PeriodicTeacher(lessons, stream(seed, "teacher"), every=every)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A life of SGIM-D with 50 movements and 2 lessons."""
    path, learner = tmp_path_factory.mktemp("saved") / "life.sqlite", taught()
    for _ in run(learner, QUIET, 6, movements=50, teacher=teacher_of()):
        pass
    save_life(learner, path)
    return path


def lived():
    learner = taught()
    learner.ask(NO_CONTEXT)
    learner.fail("lost")
    return learner


def first_posture(times, trajectory):
    return trajectory[0]


REFUSED = {  # message: error, learner, and, if there is one, its teacher
    "life.sqlite is the life of a learner with seed 6, this learner has seed 7": (ReplayError, lambda: taught(7)),
    "movement 20 was recorded with another theta": (ReplayError, lambda: taught(6, first_posture)),
    "movement 0 was recorded as a movement, the learner now rests": (
        *(ReplayError, lambda: observation(QUIET, 6, correspondence=last_posture)),
    ),
    "before movement 20 the learner was shown a demonstration, now it takes none": (
        *(ReplayError, lambda: sagg_riac(QUIET, 6)),
    ),
    "began with 0 exemplars in memory, this learner began with 3": (
        *(ReplayError, lambda: sagg_riac(QUIET, 6, memory=exemplars(3))),
    ),
    "before movement 20 a demonstration was shown, the teacher now offers another one": (
        *(ReplayError, taught, lambda: teacher_of(seed=9)),
    ),
    "before movement 10 nothing was shown, the teacher now offers a demonstration": (
        *(ReplayError, taught, lambda: teacher_of(every=10)),
    ),
    "needs a learner freshly built; this one has lived already": (RuntimeError, lived),
    r"dims \(0, 4, 2\) of context, theta, outcome, not \(0, 5, 2\); another robot": (
        *(RunError, lambda: sagg_riac(PlanarArm(5), 6)),
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_life_that_this_learner_cannot_repeat_is_refused(saved, message):
    error, learner, *teacher = REFUSED[message]
    with pytest.raises(error, match=message):
        load_life(learner(), saved, teacher=teacher[0]() if teacher else None)


def test_a_memory_that_was_written_to_from_outside_is_not_saved(tmp_path):
    learner = lived()
    learner.memory.add(NO_CONTEXT, np.full(4, 0.5), [0.0, 0.0])
    with pytest.raises(ValueError, match=r"has 1 exemplars, but 0 were lived; .* without learner\.add\(\)"):
        save_life(learner, tmp_path / "life.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_lessons_of_different_shape_are_saved(tmp_path):
    """Of a glove with more joints, or of another length: a correspondence may take any."""
    learner, again = (observation(QUIET, 0, correspondence=lambda times, trajectory: np.full(4, 0.5)) for _ in range(2))
    for n_times, n_joints in ((5, 2), (7, 3)):
        learner.watch(Demonstration(NO_CONTEXT, np.arange(1.0 * n_times), np.ones((n_times, n_joints)), np.zeros(2)))
    save_life(learner, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    with Record(tmp_path / "life.sqlite") as record:
        assert [lesson.trajectory.shape for lesson in record.demonstrations()] == [(5, 2), (7, 3)]


@pytest.mark.parametrize("build", [random_exploration, sagg_riac])
def test_a_learner_starts_from_a_memory_and_leaves_it_as_it_was_and_so_does_the_one_that_loads(build, tmp_path):
    check_start(build, tmp_path / "life.sqlite")


def test_a_memory_of_another_robot_is_no_start():
    with pytest.raises(ValueError, match=r"must have dims \(0, 4, 2\) of context, theta, outcome, got \(0, 5, 2\)"):
        sagg_riac(QUIET, 0, memory=exemplars(3, PlanarArm(5)))
    memory = Memory(0, 4, 2)
    memory.add(NO_CONTEXT, np.full(4, 1.5), [0.0, 0.0])
    with pytest.raises(ValueError, match="thetas of a memory to start from must lie in its box"):
        random_exploration(QUIET, 0, memory=memory)


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
    learner = ALGORITHMS[name](QUIET, 0)
    learner.correspondence = lambda times, trajectory: theta_d
    with pytest.raises(ValueError, match=message):
        learner.watch(demonstrate(QUIET, [0.5, 0.5]))
    assert learner.idle
    assert len(learner.memory) == 0
