"""Events: told in order, after they have happened, and enough to make the same learner again, whatever has happened."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.algorithms.paper import observation, sgim_d
from sgimd_torch.asking.algorithms import SEARCHING, sgim_acts
from sgimd_torch.asking.teachers import AnsweringTeacher
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner.events import Kind
from sgimd_torch.record import Record
from sgimd_torch.record.saving import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, Failure, Move, stream
from sgimd_torch.teach.by_hand import ByHand
from sgimd_torch.teachers import AskedTeacher, PeriodicTeacher
from worlds import demonstrate, last_posture

ARM = PlanarArm(3, noise=0.02, context=True)
DIMS = 1, 3, 2
CONTEXTS = np.array([[0.2], [0.7]])
LESSONS = [demonstrate(ARM, goal, context) for context in CONTEXTS for goal in ([0.3, 0.4], [-0.5, 0.2])]
LESSONS.append(Demonstration(CONTEXTS[0], LESSONS[0].times, LESSONS[0].trajectory, np.array([3.0, 0.0])))  # beyond T
TAUGHT = {"correspondence": last_posture, "inverse": NearestNeighbour}


def asking():
    teachers = {"ann": AnsweringTeacher(LESSONS[:2], stream(0, "ann"), takes=1)}
    return sgim_acts(ARM, 0, teachers=teachers, **TAUGHT, **SEARCHING)


LEARNERS = {
    "taught": lambda: sgim_d(ARM, 0, **TAUGHT),
    "asking": asking,
    "watching": lambda: observation(ARM, 0, **TAUGHT),
}


def act(learner, what, k, place=0):
    """What a caller may do with a learner, if it is possible now; ``k`` chooses the context and the lesson."""
    first, context = (CONTEXTS[k % 2] if (here := learner.context_at(each)) is None else here for each in (0, place))
    waits_for_outcome = learner._asked
    match what:
        case "ask many" | "ask some" if not waits_for_outcome:
            under_way = [learner.context_at(place) for place in range(1 + k)]
            contexts = [CONTEXTS[n % 2] if each is None else each for n, each in enumerate(under_way)]
            if what == "ask some":
                contexts[place % len(contexts)] = Failure("lost")
            learner.ask_many(contexts)
        case "tell" if waits_for_outcome:
            outcomes = [np.array([0.1 * k, 0.2]) if isinstance(each, Move) else None for _, each in waits_for_outcome]
            learner.tell_many([Failure("lost") if n == k else each for n, each in enumerate(outcomes)])
        case "move" if not waits_for_outcome:
            move = learner.ask(first)
            if move is not None:
                learner.tell(ARM.execute(first, move.theta, stream(k, "noise")))
        case "ask" if not waits_for_outcome:
            learner.ask(first)
        case "request" if not waits_for_outcome:
            learner.request(context, place=place)
        case "alone" if learner._places[place].request:
            learner.go_on_alone("nothing", place=place)
        case "teacher" | "by-hand" | None if not waits_for_outcome and (
            learner.social or learner._places[place].request
        ):
            learner.watch(LESSONS[k], who=what, place=place)
        case "add" if not waits_for_outcome:
            learner.add(context, np.full(3, 0.2 * k), np.array([0.3, 0.1 * k]))
        case "fail":
            learner.fail("lost")
        case "interrupt":
            learner.interrupt()


WHATS = ["move", "ask", "tell", "request", "alone", "teacher", "by-hand", None, "add", "fail", "interrupt"]
CHOICES = st.integers(0, len(LESSONS) - 1)
ALONE = st.tuples(st.sampled_from([*["move"] * 5, *WHATS]), CHOICES)
TOGETHER = st.tuples(st.sampled_from([*["ask many", "tell"] * 5, "ask some", *WHATS]), CHOICES, st.integers(0, 2))
ACTS = st.lists(ALONE, max_size=25) | st.lists(TOGETHER, max_size=25)


def state(learner):
    """What a caller can see of a learner."""
    memory, under_way = learner.memory, [str(learner.context_at(place)) for place in range(6)]
    waits = [learner.lesson_waits_at(place) for place in range(6)]
    seen = learner.movements, under_way, learner.waits_for_answer, waits
    known = [each.tobytes() for each in (memory.contexts, memory.thetas, memory.outcomes)]
    return (*seen, *known, [learner.was_shown(each) for each in LESSONS], [str(each) for each in learner.regions])


def rows(path):
    with Record(path) as record:
        return list(record.rows("events"))


@pytest.mark.parametrize("name", LEARNERS)
@settings(max_examples=150, deadline=None)
@given(acts=ACTS, later=ACTS)
def test_whatever_has_happened_a_life_that_is_loaded_becomes_the_same_learner(tmp_path_factory, name, acts, later):
    whole, again, path = LEARNERS[name](), LEARNERS[name](), tmp_path_factory.mktemp("life") / "life.sqlite"
    for each in acts:
        act(whole, *each)
    save_life(whole, path)
    load_life(again, path)
    if whole._asked:  # these movements are asked for again
        again.ask_many([each if isinstance(each, Failure) else place.context for place, each in whole._asked])
        for (_, mine), (_, theirs) in zip(whole._asked, again._asked, strict=True):
            assert repr(mine) == repr(theirs)
    assert state(again) == state(whole)
    for each in later:
        act(whole, *each)
        act(again, *each)
    assert state(again) == state(whole)
    for learner, place in ((whole, path), (again, path.with_name("again.sqlite"))):
        save_life(learner, place)
    assert rows(path) == rows(path.with_name("again.sqlite"))


@pytest.mark.parametrize("name", LEARNERS)
@settings(max_examples=100, deadline=None)
@given(acts=ACTS)
def test_events_are_told_in_order_and_after_they_have_happened_and_a_record_keeps_them(tmp_path_factory, name, acts):
    learner, told, folder = LEARNERS[name](), [], tmp_path_factory.mktemp("life")

    def listen(event):
        told.append(event)
        assert sum(each.kind in (Kind.MOVED, Kind.RESTED, Kind.FAILED) for each in told) == learner.movements
        assert sum(each.kind == Kind.MOVED for each in told) <= len(learner.memory)
        if event.kind == Kind.MOVED:
            assert np.array_equal(learner.memory.outcomes[-1], event.outcome)
        if event.kind == Kind.SHOWN:
            assert learner.was_shown(event.lesson)

    with Record.make(folder / "run.sqlite", DIMS, {}) as record:
        learner.listeners += [listen, record.add]
        for each in acts:
            act(learner, *each)
        act(learner, "interrupt", 0)
        record.commit()
    save_life(learner, folder / "life.sqlite")
    with Record(folder / "run.sqlite") as record, Record(folder / "life.sqlite") as saved:
        for mine, theirs in zip(record.events(), saved.events(), strict=True):
            same = mine._replace(goal=None, origin=None) if mine.kind == Kind.MOVED else mine
            assert repr(same) == repr(theirs)
    for path in ("run.sqlite", "life.sqlite"):
        again = LEARNERS[name]()
        load_life(again, folder / path)
        assert state(again) == state(learner)


class Broken(PlanarArm):
    """Somebody presses Ctrl-C in the movement after so many."""

    left = 1000

    def execute(self, context, theta, rng):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        return super().execute(context, theta, rng)


TEACHERS = {
    "periodic": lambda: PeriodicTeacher(LESSONS, stream(0, "teacher"), every=2),
    "asked": lambda: AskedTeacher(LESSONS, stream(0, "teacher"), patience=2),
    "by hand": lambda: ByHand(teacher=PeriodicTeacher(LESSONS, stream(0, "teacher"), every=3)),
}
RUNS = st.lists(st.tuples(st.sampled_from(["run", "break", "show", "interrupt"]), st.integers(1, 4)), max_size=8)


@pytest.mark.parametrize("name", ["taught", "watching"])
@pytest.mark.parametrize("by", TEACHERS)
@settings(max_examples=60, deadline=None)
@given(runs=RUNS)
def test_runs_that_were_broken_off_with_lessons_between_them_are_loaded_with_their_teacher(
    tmp_path_factory, name, by, runs
):
    (whole, teacher), (again, later) = ((LEARNERS[name](), TEACHERS[by]()) for _ in range(2))
    arm, path = Broken(3, noise=0.02, context=True), tmp_path_factory.mktemp("life") / "life.sqlite"

    def go_on(learner, teacher, n):
        return list(run(learner, arm, 0, movements=learner.movements + n, teacher=teacher))

    for what, k in runs:
        if what == "show" and by == "by hand":
            teacher.give(LESSONS[k])
            go_on(whole, teacher, k)
        elif what == "show":
            whole.watch(LESSONS[k])
        elif what == "run":
            go_on(whole, teacher, k)
        else:
            with suppress(KeyboardInterrupt):
                if what == "break":
                    arm.left = k
                    go_on(whole, teacher, 20)
            arm.left = 1000
            whole.interrupt()
    save_life(whole, path)
    load_life(again, path, teacher=later)
    assert state(again) == state(whole)
    for each in ((whole, teacher), (again, later)):
        go_on(*each, 12)
    assert state(again) == state(whole)


def lived(path, movements, events=()):
    """A life that asks, on an arm that loses every seventh movement, from these ``events`` on; all its rows."""
    teachers = {"ann": AnsweringTeacher(LESSONS[:4], stream(0, "ann"), takes=2)}
    learner = sgim_acts(ARM, 0, teachers=teachers, **TAUGHT, **SEARCHING)

    def execute(indices, contexts, thetas):
        moves = zip(indices, contexts, thetas, strict=True)
        return [Failure("lost") if i % 7 == 6 else ARM.execute(c, t, stream(0, "environment", i)) for i, c, t in moves]

    with Record.make(path, DIMS, {}) as record:
        for event in events:
            record.add(event)
        for _ in run(learner, ARM, 0, movements=movements, teachers=teachers, execute=execute, record=record):
            pass
        record.commit()
        return list(record.rows("events")), list(record.events())


def test_a_record_that_ends_at_any_movement_goes_on_to_the_same_rows(tmp_path):
    whole, events = lived(tmp_path / "whole", 60)
    assert {row[1] for row in whole} == {Kind.MOVED, Kind.RESTED, Kind.ASKED, Kind.SHOWN, Kind.FAILED}
    for movement in range(60):
        kept = [event for event, row in zip(events, whole, strict=True) if row[0] < movement]
        assert lived(tmp_path / str(movement), 60, kept)[0] == whole


def test_a_movement_made_elsewhere_enters_memory_and_record_but_counts_as_none(tmp_path):
    learner, told = sgim_d(ARM, 0, **TAUGHT), []
    learner.listeners.append(told.append)
    learner.add(CONTEXTS[0], [0.5, 0.5, 0.5], [0.9, 0.1])
    assert (len(learner.memory), learner.movements, [each.kind for each in told]) == (1, 0, [Kind.ADDED])
    with pytest.raises(ValueError, match="theta must lie in its box"):
        learner.add(CONTEXTS[0], [0.5, 0.5, 1.5], [0.9, 0.1])
    with pytest.raises(ValueError, match="outcome"):
        learner.add(CONTEXTS[0], [0.5, 0.5, 0.5], [0.9, np.nan])
    learner.ask(CONTEXTS[0])
    with pytest.raises(RuntimeError, match="was tell\\(\\) forgotten"):
        learner.add(CONTEXTS[0], [0.5, 0.5, 0.5], [0.9, 0.1])
    assert len(learner.memory) == 1
    save_life(learner, tmp_path / "life.sqlite")
    again = sgim_d(ARM, 0, **TAUGHT)
    load_life(again, tmp_path / "life.sqlite")
    np.testing.assert_array_equal(again.memory.outcomes, [[0.9, 0.1]])
    assert again.ask(CONTEXTS[0]).theta.tolist() == learner._asked[0][1].theta.tolist()
