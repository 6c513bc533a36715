"""Teachers: when they demonstrate, what they choose, and that they look at the learner's memory without touching it."""

from collections import Counter
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.teachers import AskedTeacher, InitialTeacher, PeriodicTeacher, at_random, least_explored

NO_CONTEXT = np.zeros(0)


def lesson(*outcome):
    return Demonstration(NO_CONTEXT, np.array([0.0, 1.0]), np.zeros((2, 3)), np.array(outcome))


def reached(*outcomes):
    memory = Memory(0, 3, 2)
    for outcome in outcomes:
        memory.add(NO_CONTEXT, np.zeros(3), np.array(outcome))
    return memory


LESSONS = [lesson(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
TEACHERS = {
    "periodic": partial(PeriodicTeacher, every=7),
    "periodic, at random": partial(PeriodicTeacher, choose=at_random, every=7),
    "initial": partial(InitialTeacher, every=7),
    "asked": partial(AskedTeacher, patience=7),
}


def course(teacher, memory, movements=200):
    """What is offered, and when, to a learner that reaches nothing new."""
    offers = {index: teacher.offer(index, memory) for index in range(movements)}
    return {index: offer for index, offer in offers.items() if offer is not None}


@pytest.mark.parametrize("make", TEACHERS.values(), ids=TEACHERS)
def test_a_teacher_offers_its_own_demonstrations_by_its_stream_and_leaves_the_memory_as_it_is(make):
    memory = reached([0.0, 0.0], [0.5, 0.5])
    first, same, other, early = (
        course(make(LESSONS, stream(seed, "teacher")), to)
        for seed, to in ((1, memory), (1, memory), (2, memory), (0, reached()))
    )
    assert memory.outcomes.tolist() == [[0.0, 0.0], [0.5, 0.5]]
    assert len({id(offer) for offer in first.values()}) > 1
    assert {id(offer) for offer in first.values()} <= {id(mine) for mine in LESSONS}
    assert first == same
    assert first != other
    assert len(early) > 5  # of a learner that has reached nothing yet
    (word,) = {*make.keywords} - {"choose"}
    for movements in (0, 1.5):
        with pytest.raises(ValueError, match=word):
            make(LESSONS, stream(0, "teacher"), **{word: movements})
    with pytest.raises(ValueError, match="at least one demonstration"):
        make([], stream(0, "teacher"))


def test_the_periodic_teacher_demonstrates_166_times_in_5000_movements():
    offers = course(PeriodicTeacher(LESSONS, stream(0, "teacher"), every=30), reached([0.0, 0.0]), 5000)
    assert list(offers) == list(range(30, 5000, 30))
    assert len(offers) == 166


def test_the_initial_teacher_gives_each_demonstration_once_and_then_falls_silent():
    offers = course(InitialTeacher(LESSONS, stream(0, "teacher"), every=10), reached(), 1000)
    assert list(offers) == list(range(0, 90, 10))
    assert {id(offer) for offer in offers.values()} == {id(mine) for mine in LESSONS}


def choices(lessons, memory, n=200, tiles=2):
    rng = stream(0, "teacher")
    return Counter(tuple(least_explored(lessons, memory, rng, tiles=tiles).outcome.tolist()) for _ in range(n))


QUARTERS = [lesson(0.0, 0.0), lesson(4.0, 0.0), lesson(0.0, 4.0), lesson(4.0, 4.0)]  # one in each tile of 2 x 2


def test_the_demonstration_comes_from_the_tile_that_the_learner_reached_least():
    memory = reached([1.0, 1.0], [1.0, 1.5], [3.0, 1.0], [1.0, 3.0], [1.2, 3.0])
    assert set(choices(QUARTERS, memory)) == {(4.0, 4.0)}
    memory.add(NO_CONTEXT, np.zeros(3), np.array([3.0, 3.0]))
    assert set(choices(QUARTERS, memory)) == {(4.0, 4.0), (4.0, 0.0)}  # once each, the others twice
    assert set(choices([QUARTERS[0], QUARTERS[3]], reached([1.0, 1.0]))) == {(4.0, 4.0)}  # two tiles are empty
    on_a_line, on_a_point = [lesson(0.0, 1.0), lesson(4.0, 1.0)], [lesson(0.3, 0.3)]
    assert set(choices(on_a_line, reached([0.5, 1.0]))) == {(4.0, 1.0)}
    assert set(choices(on_a_point, reached([5.0, -5.0], [0.3, 0.3]))) == {(0.3, 0.3)}


def test_tiles_that_were_reached_equally_often_are_equally_likely():
    counts = choices([*QUARTERS, lesson(0.1, 0.1), lesson(0.2, 0.2)], reached(), n=4000)
    # Four tiles, the first with three demonstrations: 1/4 each and 1/12 each. Standard errors .007 and .0044.
    for outcome, probability in (((4.0, 4.0), 1 / 4), ((0.0, 4.0), 1 / 4), ((0.1, 0.1), 1 / 12), ((0.0, 0.0), 1 / 12)):
        assert counts[outcome] / 4000 == pytest.approx(probability, abs=5 * 0.007)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-3, 3)] * 2), st.tuples(*[st.floats(0.1, 3)] * 2), st.integers(1, 49))
def test_borders_belong_to_a_tile_the_outermost_included(low, sides, tiles):
    # Whatever was demonstrated and then reached exactly counts, however low + tiles * side was rounded.
    high = np.add(low, sides)
    chosen = choices([lesson(*low), lesson(*high)], reached(high), n=20, tiles=tiles)
    assert set(chosen) == ({low} if tiles > 1 else {low, tuple(high.tolist())})


def test_all_demonstrations_are_equally_likely_when_the_teacher_chooses_at_random():
    rng = stream(0, "teacher")
    counts = Counter(id(at_random(LESSONS, reached([0.0, 0.0]), rng)) for _ in range(9000))
    assert len(counts) == 9
    assert all(abs(count - 1000) < 5 * 30 for count in counts.values())  # standard deviation 30


def test_the_asked_teacher_is_silent_while_progress_is_made_and_demonstrates_when_it_stalls():
    teacher = AskedTeacher([lesson(1.0, 0.0)], stream(0, "teacher"), patience=10)
    memory, offered = reached([0.0, 0.0]), []
    for check, nearest in enumerate([0.0, 0.5, 0.8, 0.801, 0.9, 0.9], start=1):
        memory.add(NO_CONTEXT, np.zeros(3), np.array([nearest, 0.0]))
        offered += [10 * check] if teacher.offer(10 * check, memory) else []
    # Distances 1, .5, .2, .199, .1, .1: the fall from .2 to .199 is less than a hundredth, and so is none at all.
    assert offered == [40, 60]


@pytest.mark.parametrize("other", [lesson(0.5), lesson(0.1, 0.2, 0.3), lesson()])
def test_demonstrations_of_another_robot_are_refused_by_name(other):
    with pytest.raises(ValueError, match=r"outcomes of the demonstrations must have shape \(..., 2\), got \(9, "):
        least_explored([other] * 9, reached([0.0, 0.0]), stream(0, "teacher"))
    with pytest.raises(ValueError, match=r"demonstrations must have contexts .*all alike, got .*\(2,\)"):
        PeriodicTeacher([LESSONS[0], other], stream(0, "teacher"))
