"""A life is lived again: whatever has happened to a learner, one that repeats its events is the same learner."""

import copy
import pickle
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from records import read
from sgimd_torch import session
from sgimd_torch.algorithms.paper import observation, random_exploration, sagg_riac, sgim_d
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.asking.algorithms import SEARCHING, sgim_acts
from sgimd_torch.asking.teachers import AnsweringTeacher
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import Memory
from sgimd_torch.record import Record, ReplayError, RunError
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.rivals.alp_gmm import AlpGmm
from sgimd_torch.rivals.cma_es import CmaEs
from sgimd_torch.rivals.quality_diversity import cma_me, map_elites
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, Failure, Move, stream
from sgimd_torch.teach.by_hand import ByHand
from sgimd_torch.teachers import AskedTeacher, PeriodicTeacher
from worlds import ALGORITHMS, NO_CONTEXT, TAUGHT, demonstrate, last_posture


class Arm(PlanarArm):
    """Loses one movement in nine, and breaks off the movement after ``left`` others, as Ctrl-C does."""

    execute_many, left = None, 1000

    def execute(self, context, theta, rng):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        if rng.random() < 1 / 9:
            raise ConnectionError("lost")
        return super().execute(context, theta, rng)


ARM = Arm(3, noise=0.02, context=True)
QUIET = PlanarArm(4, noise=0.02)
CONTEXTS = np.array([[0.2], [0.7]])
LESSONS = [demonstrate(PlanarArm(3, context=True), g, c) for c in CONTEXTS for g in ([0.3, 0.4], [-0.5, 0.2])]
LESSONS.append(Demonstration(CONTEXTS[0], LESSONS[0].times, LESSONS[0].trajectory, np.array([3.0, 0.0])))  # beyond T
NEAREST = {"inverse": NearestNeighbour}
WATCHES = {"correspondence": last_posture, **NEAREST}


def asked_teachers():
    return {"ann": AnsweringTeacher(LESSONS[:2], stream(0, "ann"), takes=1)}


LEARNERS = {
    "sagg-riac": lambda: sagg_riac(ARM, 0, **NEAREST),
    "sgim-d": lambda: sgim_d(ARM, 0, **WATCHES),
    "observation": lambda: observation(ARM, 0, **WATCHES),
    "practice": lambda: practice(ARM, 0),
    "practice-taught": lambda: practice_taught(ARM, 0, correspondence=last_posture),
    "asking": lambda: sgim_acts(ARM, 0, teachers=asked_teachers(), **WATCHES, **SEARCHING),
}
TEACHERS = {
    "periodic": lambda: PeriodicTeacher(LESSONS, stream(0, "teacher"), every=2),
    "asked": lambda: AskedTeacher(LESSONS, stream(0, "teacher"), patience=2),
    "by hand": lambda: ByHand(teacher=PeriodicTeacher(LESSONS, stream(0, "teacher"), every=3)),
}


def seen(learner):
    """What a caller can see of a learner."""
    memory = learner.memory
    known = [column.tobytes() for column in (memory.contexts, memory.thetas, memory.outcomes)]
    slots = [(str(learner.context_at(place)), learner.lesson_waits_at(place)) for place in range(3)]
    watched = learner.social is not None and [learner.was_shown(lesson) for lesson in LESSONS]
    return learner.movements, slots, known, watched, [str(region) for region in learner.regions]


NUMBERS = st.integers(0, len(LESSONS) - 1)
PLACES = st.integers(0, 2)
MOMENTS = st.integers(1, 12)


class Lives(RuleBasedStateMachine):
    """A learner that lives without a stop, and its twin, in whose place another one loads the life now and then.

    Without a teacher of the run a caller may do anything; with one, movements are made by `run` alone.
    """

    def __init__(self, learner, teacher):
        super().__init__()
        self.new = lambda: (LEARNERS[learner](), TEACHERS[teacher]() if teacher else None)
        self.asking = asked_teachers() if learner == "asking" else None
        self.folder = TemporaryDirectory()
        self.path = Path(self.folder.name)
        (self.whole, self.teacher), (self.twin, self.twins_teacher) = self.new(), self.new()
        self.contexts, self.told = [], []  # contexts of what was asked for and not told; events
        self.record = Record.make(self.path / "run.sqlite", self.whole.problem.dims, {})
        self.whole.listeners += [self.hear, self.record.add]

    def hear(self, event):
        """Events are told in order, after they have happened."""
        self.told.append(event)
        counted = (Kind.MOVED, Kind.RESTED, Kind.FAILED)
        assert sum(event.kind in counted for event in self.told) == self.whole.movements
        if event.kind == Kind.MOVED:
            assert np.array_equal(self.whole.memory.outcomes[-1], event.outcome)
        if event.kind == Kind.SHOWN:
            assert self.whole.was_shown(event.lesson)

    def both(self, act):
        """Both learners do the same, with the same result."""
        results = [act(self.whole, self.teacher), act(self.twin, self.twins_teacher)]
        assert repr(results[0]) == repr(results[1])
        return results[0]

    @property
    def free(self):
        """Whether a caller may ask now."""
        return self.teacher is None and not self.contexts

    @precondition(lambda self: self.free)
    @rule(robots=st.integers(1, 3), lost=st.none() | PLACES, k=NUMBERS)
    def ask_many(self, robots, lost, k):
        under_way = [self.whole.context_at(place) for place in range(robots)]
        contexts = [CONTEXTS[(n + k) % 2] if context is None else context for n, context in enumerate(under_way)]
        self.contexts = [Failure("blind") if n == lost else context for n, context in enumerate(contexts)]
        self.both(lambda learner, _: learner.ask_many(self.contexts))

    @precondition(lambda self: self.contexts)
    @rule(k=NUMBERS, lost=st.none() | PLACES)
    def tell_many(self, k, lost):
        moves = [move for _, move in self.whole._asked]
        outcomes = [np.array([0.1 * k, 0.2]) if isinstance(move, Move) else None for move in moves]
        told = [
            move if isinstance(move, Failure) else Failure("lost") if n == lost else outcome
            for n, (move, outcome) in enumerate(zip(moves, outcomes, strict=True))
        ]
        self.both(lambda learner, _: learner.tell_many(told))
        self.contexts = []

    @precondition(lambda self: self.free)
    @rule(k=NUMBERS)
    def ask(self, k):
        context = self.whole.context_at(0)
        context = CONTEXTS[k % 2] if context is None else context
        move = self.both(lambda learner, _: learner.ask(context))
        self.contexts = [] if move is None else [context]

    @precondition(lambda self: self.teacher is None and len(self.contexts) < 2)
    @rule()
    def fail(self):
        self.both(lambda learner, _: learner.fail("lost"))
        self.contexts = []

    @rule()
    def interrupt(self):
        self.both(lambda learner, _: learner.interrupt())
        self.contexts = []

    @precondition(lambda self: self.free)
    @rule(k=NUMBERS, place=PLACES)
    def request(self, k, place):
        context = self.whole.context_at(place)
        context = CONTEXTS[k % 2] if context is None else context
        if self.both(lambda learner, _: learner.request(context, place=place)) is not None and k == 0:
            self.both(lambda learner, _: learner.go_on_alone("nothing", place=place))

    @precondition(lambda self: not self.contexts)
    @rule(k=NUMBERS, place=PLACES, who=st.sampled_from([None, "teacher", "by-hand"]))
    def watch(self, k, place, who):
        if self.whole.social or (self.whole._slots[place:] and self.whole._slots[place].request):
            who = None if self.teacher else who
            self.both(lambda learner, _: learner.watch(LESSONS[k], who=who, place=place))

    @precondition(lambda self: isinstance(self.teacher, ByHand))
    @rule(k=NUMBERS)
    def give(self, k):
        self.both(lambda learner, teacher: teacher.give(LESSONS[k]))

    @precondition(lambda self: not self.contexts)
    @rule(k=NUMBERS)
    def add(self, k):
        self.both(lambda learner, _: learner.add(CONTEXTS[0], np.full(3, 0.2 * k), np.array([0.3, 0.1 * k])))

    @precondition(lambda self: not self.contexts)
    @rule(n=MOMENTS, at_once=st.integers(1, 3))
    def run(self, n, at_once):
        def live(learner, teacher):
            more = {"teacher": teacher, "teachers": self.asking, "at_once": at_once, "failures": 99}
            return list(run(learner, ARM, 0, movements=learner.movements + n, **more))

        self.both(live)

    @precondition(lambda self: not self.contexts)
    @rule(after=MOMENTS)
    def break_off(self, after):
        def live(learner, teacher):
            ARM.left = after
            with suppress(KeyboardInterrupt):
                list(run(learner, ARM, 0, movements=learner.movements + 20, teacher=teacher, teachers=self.asking))
            ARM.left = 1000
            learner.interrupt()

        self.both(live)

    @rule()
    def load(self):
        save_life(self.whole, self.path / "life.sqlite")
        self.twin, self.twins_teacher = self.new()
        load_life(self.twin, self.path / "life.sqlite", teacher=self.twins_teacher)
        if isinstance(self.teacher, ByHand) and self.teacher._given:  # no record has what was given and not offered
            self.twins_teacher.give(self.teacher._given)
        if self.contexts:  # these movements are asked for again
            self.twin.ask_many(self.contexts)
            assert [repr(move) for _, move in self.twin._asked] == [repr(move) for _, move in self.whole._asked]

    @invariant()
    def they_are_the_same(self):
        assert seen(self.twin) == seen(self.whole)

    def teardown(self):
        self.interrupt()
        self.record.commit()
        self.record.close()
        for learner, name in ((self.whole, "whole"), (self.twin, "twin")):
            save_life(learner, self.path / name)
        assert read(self.path / "whole")["events"] == read(self.path / "twin")["events"]
        with Record(self.path / "run.sqlite") as record, Record(self.path / "whole") as saved:
            for event, other in zip(record.events(), saved.events(), strict=True):
                same = event._replace(goal=None, origin=None) if event.kind == Kind.MOVED else event
                assert repr(same) == repr(other)
        learner, teacher = self.new()
        load_life(learner, self.path / "run.sqlite", teacher=teacher)
        assert seen(learner) == seen(self.whole)
        self.folder.cleanup()


BY_RUNS = [(name, by) for name in ("sgim-d", "observation") for by in TEACHERS]


@pytest.mark.parametrize(("learner", "teacher"), [*((name, None) for name in LEARNERS), *BY_RUNS])
def test_whatever_happens_a_learner_that_repeats_the_life_is_the_same(learner, teacher, monkeypatch):
    monkeypatch.setattr(session, "JOINS_EVERY", 1)
    run_state_machine_as_test(
        lambda: Lives(learner, teacher),
        settings=settings(max_examples=5, stateful_step_count=20, deadline=None, derandomize=True, database=None),
    )


RIVALS = {
    "map-elites": lambda: map_elites(QUIET, 0, first=20),
    "cma-me": lambda: cma_me(QUIET, 0),
    "alp-gmm and cma-es": lambda: sagg_riac(QUIET, 0, goals=AlpGmm, search=CmaEs),
}


def line(episode):
    return episode.index, episode.move and (episode.move.theta.tobytes(), episode.move.origin)


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_goes_on_in_the_middle_of_its_search(name, tmp_path):
    lines, whole = [], RIVALS[name]()
    for episode in run(whole, QUIET, 1, movements=130):
        lines.append(line(episode))
        if episode.index == 76:
            save_life(whole, tmp_path / "life.sqlite")
    learner = RIVALS[name]()
    load_life(learner, tmp_path / "life.sqlite")
    assert [line(episode) for episode in run(learner, QUIET, 1, movements=130)] == lines[77:]


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, pickle.dumps])
def test_who_copies_a_learner_is_told_how_to_save_its_life(copied):
    with pytest.raises(TypeError, match=r"^a learner cannot be copied or pickled.*save_life.*load_life.*$"):
        copied(LEARNERS["sgim-d"]())


def exemplars(n, arm=QUIET):
    memory = Memory(0, arm.policies.dim, 2)
    for k in range(n):
        theta = arm.policies.sample(stream(k, "theta"))
        memory.add(NO_CONTEXT, theta, arm.execute(NO_CONTEXT, theta, stream(k, "environment")))
    return memory


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


@pytest.mark.parametrize("build", [random_exploration, sagg_riac, map_elites, cma_me])
def test_a_learner_starts_from_a_memory_and_leaves_it_as_it_was_and_so_does_the_one_that_loads(build, tmp_path):
    start = exemplars(30)
    learner, again = (build(QUIET, 0, memory=start) for _ in range(2))
    for _ in run(learner, QUIET, 0, movements=25):
        pass
    save_life(learner, tmp_path / "life.sqlite")
    load_life(again, tmp_path / "life.sqlite")
    assert (len(start), len(learner.memory)) == (30, 55)
    assert np.array_equal(learner.memory.thetas[:30], start.thetas)
    assert np.array_equal(again.memory.thetas, learner.memory.thetas)


def test_map_elites_from_a_memory_varies_its_elites_at_once():
    start = exemplars(40)
    moves = [e.move.theta for e in run(map_elites(QUIET, 0, memory=start, sd=0.01), QUIET, 0, movements=10)]
    assert max(np.abs(start.thetas - theta).max(axis=1).min() for theta in moves) < 0.06


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
