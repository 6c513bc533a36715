"""Lives of learners, for tests of replay: whatever may happen to a learner, in any order."""

from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from records import read
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import Memory
from sgimd_torch.record import Record
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, Failure, Move, stream
from worlds import NO_CONTEXT, demonstrate, last_posture


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


def exemplars(n, arm=QUIET):
    memory = Memory(0, arm.policies.dim, 2)
    for k in range(n):
        theta = arm.policies.sample(stream(k, "theta"))
        memory.add(NO_CONTEXT, theta, arm.execute(NO_CONTEXT, theta, stream(k, "environment")))
    return memory


def seen(learner):
    """What a caller can see of a learner."""
    memory = learner.memory
    known = [column.tobytes() for column in (memory.contexts, memory.thetas, memory.outcomes)]
    slots = [(str(learner.context_of(robot)), learner.lesson_waits_for(robot)) for robot in range(3)]
    watched = learner.social is not None and [learner.was_shown(lesson) for lesson in LESSONS]
    return learner.movements, slots, known, watched, [str(region) for region in learner.regions]


NUMBERS = st.integers(0, len(LESSONS) - 1)
ROBOTS = st.integers(0, 2)
MOMENTS = st.integers(1, 12)


class Lives(RuleBasedStateMachine):
    """A learner that lives without a stop, and its twin, in whose place another one loads the life now and then.

    Without a teacher of the run a caller may do anything; with one, movements are made by `run` alone.
    """

    def __init__(self, learner, teacher=None, asked=None):
        super().__init__()
        self.new = lambda: (learner(), teacher() if teacher else None)
        self.asking = asked
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
    @rule(robots=st.integers(1, 3), lost=st.none() | ROBOTS, k=NUMBERS)
    def ask_many(self, robots, lost, k):
        under_way = [self.whole.context_of(robot) for robot in range(robots)]
        contexts = [CONTEXTS[(n + k) % 2] if context is None else context for n, context in enumerate(under_way)]
        self.contexts = [Failure("blind") if n == lost else context for n, context in enumerate(contexts)]
        self.both(lambda learner, _: learner.ask_many(self.contexts))

    @precondition(lambda self: self.contexts)
    @rule(k=NUMBERS, lost=st.none() | ROBOTS)
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
        context = self.whole.context_of(0)
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
    @rule(k=NUMBERS, robot=ROBOTS)
    def request(self, k, robot):
        context = self.whole.context_of(robot)
        context = CONTEXTS[k % 2] if context is None else context
        if self.both(lambda learner, _: learner.request(context, robot=robot)) is not None and k == 0:
            self.both(lambda learner, _: learner.go_on_alone("nothing", robot=robot))

    @precondition(lambda self: not self.contexts)
    @rule(k=NUMBERS, robot=ROBOTS, who=st.sampled_from([None, "teacher", "by-hand"]))
    def watch(self, k, robot, who):
        if self.whole.social or (self.whole._slots[robot:] and self.whole._slots[robot].request):
            who = None if self.teacher else who
            self.both(lambda learner, _: learner.watch(LESSONS[k], who=who, robot=robot))

    @precondition(lambda self: not self.contexts)
    @rule(k=NUMBERS)
    def add(self, k):
        self.both(lambda learner, _: learner.add(CONTEXTS[0], np.full(3, 0.2 * k), np.array([0.3, 0.1 * k])))

    @precondition(lambda self: not self.contexts)
    @rule(k=NUMBERS)
    def forget(self, k):
        known = [number for number, row in self.whole.rows.items() if isinstance(row, int)]
        if wrong := known[k::7]:
            self.both(lambda learner, _: learner.forget(wrong))

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


def check_lives(machine):
    """Let hypothesis look for a life after which the two learners differ."""
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=5, stateful_step_count=20, deadline=None, derandomize=True, database=None),
    )


def check_start(build, path):
    """A learner leaves the memory that it starts from as it was; so does the one that loads its life from ``path``."""
    start = exemplars(30)
    learner, again = (build(QUIET, 0, memory=start) for _ in range(2))
    for _ in run(learner, QUIET, 0, movements=25):
        pass
    save_life(learner, path)
    load_life(again, path)
    assert (len(start), len(learner.memory)) == (30, 55)
    assert np.array_equal(learner.memory.thetas[:30], start.thetas)
    assert np.array_equal(again.memory.thetas, learner.memory.thetas)
