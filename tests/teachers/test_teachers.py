"""Teachers: when they demonstrate, what they choose, and that they look at the learner's memory without touching it."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pytest

from sgimd_torch.memory import Memory
from sgimd_torch.parts import Teacher
from sgimd_torch.spaces import Demonstration, stream
from sgimd_torch.teachers import AskedTeacher, InitialTeacher, PeriodicTeacher, at_random, least_explored

NO_CONTEXT = np.zeros(0)


def lesson(*outcome: float) -> Demonstration:
    return Demonstration(NO_CONTEXT, np.array([0.0, 1.0]), np.zeros((2, 3)), np.array(outcome))


def reached(*outcomes: Sequence[float]) -> Memory:
    memory = Memory(0, 3, 2)
    for outcome in outcomes:
        memory.add(NO_CONTEXT, np.zeros(3), np.array(outcome))
    return memory


LESSONS = [lesson(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
TEACHERS: dict[str, Callable[[int], Teacher]] = {
    "periodic": lambda seed: PeriodicTeacher(LESSONS, stream(seed, "teacher"), every=7),
    "periodic, at random": lambda seed: PeriodicTeacher(LESSONS, stream(seed, "teacher"), every=7, choose=at_random),
    "initial": lambda seed: InitialTeacher(LESSONS, stream(seed, "teacher"), every=7),
    "asked": lambda seed: AskedTeacher(LESSONS, stream(seed, "teacher"), patience=7),
}
every_teacher = pytest.mark.parametrize("name", TEACHERS)


def course(teacher: Teacher, memory: Memory, movements: int = 200) -> dict[int, Demonstration]:
    """What is offered, and when, to a learner that reaches nothing new."""
    offers = {index: teacher.offer(index, memory) for index in range(movements)}
    return {index: offer for index, offer in offers.items() if offer is not None}


@every_teacher
def test_a_teacher_offers_its_own_demonstrations_and_leaves_the_memory_as_it_is(name: str) -> None:
    memory = reached([0.0, 0.0], [0.5, 0.5])
    offers = course(TEACHERS[name](0), memory)
    assert len(offers) > 5
    assert all(any(offer is mine for mine in LESSONS) for offer in offers.values())
    assert len({id(offer) for offer in offers.values()}) > 1
    assert memory.outcomes.tolist() == [[0.0, 0.0], [0.5, 0.5]]


@every_teacher
def test_the_same_stream_offers_the_same_and_another_stream_something_else(name: str) -> None:
    first, same, other = (
        {index: id(offer) for index, offer in course(TEACHERS[name](seed), reached([0.0, 0.0])).items()}
        for seed in (1, 1, 2)
    )
    assert first == same
    assert first != other


@every_teacher
def test_a_learner_that_has_reached_nothing_yet_can_be_taught(name: str) -> None:
    assert len(course(TEACHERS[name](0), reached())) > 5


def test_the_periodic_teacher_demonstrates_166_times_in_5000_movements() -> None:
    teacher = PeriodicTeacher(LESSONS, stream(0, "teacher"), every=30)
    offers = course(teacher, reached([0.0, 0.0]), 5000)
    assert list(offers) == list(range(30, 5000, 30))
    assert len(offers) == 166


def test_the_initial_teacher_gives_each_demonstration_once_and_then_falls_silent() -> None:
    offers = course(InitialTeacher(LESSONS, stream(0, "teacher"), every=10), reached(), 1000)
    assert list(offers) == list(range(0, 90, 10))
    assert {id(offer) for offer in offers.values()} == {id(mine) for mine in LESSONS}


def choices(
    lessons: Sequence[Demonstration], memory: Memory, n: int = 200, tiles: int = 2
) -> Counter[tuple[float, ...]]:
    rng = stream(0, "teacher")
    return Counter(tuple(least_explored(lessons, memory, rng, tiles=tiles).outcome.tolist()) for _ in range(n))


QUARTERS = [lesson(0.0, 0.0), lesson(4.0, 0.0), lesson(0.0, 4.0), lesson(4.0, 4.0)]  # one in each tile of 2 x 2


def test_the_demonstration_comes_from_the_tile_that_the_learner_reached_least() -> None:
    memory = reached([1.0, 1.0], [1.0, 1.5], [3.0, 1.0], [1.0, 3.0], [1.2, 3.0])
    assert set(choices(QUARTERS, memory)) == {(4.0, 4.0)}
    memory.add(NO_CONTEXT, np.zeros(3), np.array([3.0, 3.0]))
    assert set(choices(QUARTERS, memory)) == {(4.0, 4.0), (4.0, 0.0)}  # once each, the others twice


def test_tiles_that_were_reached_equally_often_are_equally_likely() -> None:
    crowded = [*QUARTERS, lesson(0.1, 0.1), lesson(0.2, 0.2)]
    counts = choices(crowded, reached(), n=4000)
    # Four tiles, the first with three demonstrations: 1/4 each and 1/12 each. Standard errors .007 and .0044.
    for outcome, probability in (((4.0, 4.0), 1 / 4), ((0.0, 4.0), 1 / 4), ((0.1, 0.1), 1 / 12), ((0.0, 0.0), 1 / 12)):
        assert counts[outcome] / 4000 == pytest.approx(probability, abs=5 * 0.007)


def test_tiles_without_a_demonstration_are_never_chosen_and_need_not_be_reached() -> None:
    diagonal = [lesson(0.0, 0.0), lesson(4.0, 4.0)]
    assert set(choices(diagonal, reached([1.0, 1.0]))) == {(4.0, 4.0)}


@pytest.mark.parametrize("tiles", [1, 2, 7, 49])
def test_borders_belong_to_a_tile_the_outermost_included(tiles: int) -> None:
    # Whatever was demonstrated and then reached exactly counts there, however low + tiles * side was rounded.
    rng = stream(tiles, "corners")
    for _ in range(20):
        low = rng.normal(0, 1, 2)
        high = low + rng.uniform(0.1, 3, 2)
        shown = choices([lesson(*low), lesson(*high)], reached(high), n=20, tiles=tiles)
        assert set(shown) == ({tuple(low)} if tiles > 1 else {tuple(low), tuple(high)})


def test_demonstrations_on_a_line_or_on_one_point_have_tiles_too() -> None:
    on_a_line = [lesson(0.0, 1.0), lesson(4.0, 1.0)]
    assert set(choices(on_a_line, reached([0.5, 1.0]))) == {(4.0, 1.0)}
    assert set(choices([lesson(0.3, 0.3)], reached([5.0, -5.0], [0.3, 0.3]))) == {(0.3, 0.3)}


def test_all_demonstrations_are_equally_likely_when_the_teacher_chooses_at_random() -> None:
    rng = stream(0, "teacher")
    counts = Counter(id(at_random(LESSONS, reached([0.0, 0.0]), rng)) for _ in range(9000))
    assert len(counts) == 9
    assert all(abs(count - 1000) < 5 * 30 for count in counts.values())  # standard deviation 30


def test_the_asked_teacher_is_silent_while_progress_is_made_and_demonstrates_when_it_stalls() -> None:
    goal = lesson(1.0, 0.0)
    teacher = AskedTeacher([goal], stream(0, "teacher"), patience=10)
    memory, offered = reached([0.0, 0.0]), []
    for look, nearest in enumerate([0.0, 0.5, 0.8, 0.801, 0.9, 0.9], start=1):
        memory.add(NO_CONTEXT, np.zeros(3), np.array([nearest, 0.0]))
        offered += [10 * look] if teacher.offer(10 * look, memory) is goal else []
    # Distances 1, .5, .2, .199, .1, .1: the fall from .2 to .199 is less than a hundredth, and so is none at all.
    assert offered == [40, 60]


@pytest.mark.parametrize(
    "make",
    [
        partial(PeriodicTeacher, every=30),
        partial(InitialTeacher, every=10),
        partial(AskedTeacher, patience=30),
    ],
)
def test_a_teacher_without_demonstrations_or_with_a_wrong_period_is_refused(make: Callable[..., Teacher]) -> None:
    with pytest.raises(ValueError, match="at least one demonstration"):
        make([], stream(0, "teacher"))
    (word,) = make.keywords
    for movements in (0, 1.5):
        with pytest.raises(ValueError, match=word):
            make(LESSONS, stream(0, "teacher"), **{word: movements})


@pytest.mark.parametrize("other", [lesson(0.5), lesson(0.1, 0.2, 0.3), lesson()])
def test_demonstrations_of_another_robot_are_refused_by_name(other: Demonstration) -> None:
    with pytest.raises(ValueError, match=r"outcomes of the demonstrations must have shape \(..., 2\), got \(9, "):
        least_explored([other] * 9, reached([0.0, 0.0]), stream(0, "teacher"))
    with pytest.raises(ValueError, match=r"demonstrations must have contexts .*all alike, got .*\(2,\)"):
        PeriodicTeacher([LESSONS[0], other], stream(0, "teacher"))
