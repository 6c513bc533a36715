"""Strategies: movements inside Pi, one goal remembered for each attempt however it ends, and what it had gained."""

import re
from collections.abc import Callable, Generator
from contextlib import suppress
from functools import partial

import numpy as np
import pytest

from sgimd_torch.competence import AttemptCompetence, Competence, performance
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Goals, Problem, Search, Social
from sgimd_torch.searches.perturb import Perturb
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.spaces import Array, Attempt, Box, Demonstration, Estimate, Move, stream
from sgimd_torch.strategies import Babble, Emulate, GoalBabbling, Imitate, Mimic, Remember
from worlds import NO_CONTEXT, demonstrate, executed, problem

ARM = PlanarArm(5)
MEASURE = partial(performance, rest=ARM.rest, d_min=0.02)
FAR = np.array([-0.9, 0.3])


class Diary(Goals):
    """Always the same goal, and a list of what it was told."""

    def __init__(self, problem: Problem, *, goal: Array) -> None:
        super().__init__(problem)
        self.goal = goal
        self.entries: list[tuple[Array, float, str]] = []
        self.gains: list[float] = []

    def sample(self, context: Array) -> Array:
        return self.goal

    def add(
        self, context: Array, goal: Array, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        self.entries.append((goal, competence, strategy))
        self.gains.append(gain)


def remembering(n: int) -> Memory:
    """``n`` random movements of the arm."""
    return executed(ARM, stream(0, "remembered").random((n, 5)))


def babbling(memory: Memory, *, goal: Array = FAR, seed: int = 0, **options) -> GoalBabbling:
    """Goal babbling that keeps a `Diary`."""
    given = problem(ARM, memory=memory, inverse=NearestNeighbour, seed=seed)
    usual = {"search": Perturb, "budget": 12, "tolerance": 1e-9, "global_range": (0.0, 0.0), "give_up": -1.0}
    parts = {"goals": partial(Diary, goal=goal), "judge": AttemptCompetence, **usual, **options}
    given.autonomous = GoalBabbling(given, **{"goals": InterestMap, "search": NelderMead, **parts})
    return given.autonomous


def execute(move: Move) -> Array:
    return ARM.execute(NO_CONTEXT, move.theta, stream(0, "environment"))


def live(attempt: Attempt, memory: Memory | None = None, n: int = 10_000) -> list[Move]:
    """The first ``n`` movements, all but the n-th executed; with ``memory``, as a learner remembers them."""
    moves: list[Move] = []
    with suppress(StopIteration):
        moves.append(next(attempt))
        while len(moves) < n:
            outcome = execute(moves[-1])
            if memory is not None:
                memory.add(NO_CONTEXT, moves[-1].theta, outcome)
            moves.append(attempt.send(outcome))
    return moves


LESSON = demonstrate(ARM, [-0.5, 0.5])
THETA_D = LESSON.trajectory[-1]


MEMORY = remembering(50)
SIMPLEX = partial(NelderMead, step=0.3)
ATTEMPTS = {  # every strategy that moves, in a learner that has made 50 movements; its goal, by whom, and the regimes
    "goal babbling": ({"global_range": (0.5, 0.5)}, None, FAR, "autonomous", {"global", "local"}),
    "simplex": ({"search": SIMPLEX, "budget": 40}, None, FAR, "autonomous", {"local"}),
    "imitate": ({}, partial(Imitate, repeats=4, epsilon=0.6), LESSON.outcome, "social", {"imitate"}),
    "emulate": ({}, Emulate, LESSON.outcome, "social", {"local"}),
}


def begin(pursuit: GoalBabbling, social: Callable[[Problem], Social] | None, lesson: Demonstration = LESSON) -> Attempt:
    """An attempt of its own, or the answer to a demonstration."""
    if social is None:
        return pursuit.attempt(NO_CONTEXT)
    return social(pursuit.problem).attempt(NO_CONTEXT, THETA_D, lesson)


@pytest.mark.parametrize("n", [10_000, 3, 1], ids=["to its end", "interrupted", "before it moved"])
@pytest.mark.parametrize("name", ATTEMPTS)
def test_an_attempt_moves_inside_pi_and_leaves_one_goal_judged_by_what_was_executed(name: str, n: int) -> None:
    options, social, goal, strategy, origins = ATTEMPTS[name]
    pursuit = babbling(MEMORY, **options)
    attempt, goals = begin(pursuit, social), pursuit.goals
    moves = live(attempt, n=n)
    assert ARM.policies.contains([move.theta for move in moves]).all()
    assert all(np.array_equal(move.goal, goal) for move in moves)
    assert {move.origin for move in moves} <= origins
    if n <= 3:
        assert goals.entries == []
        attempt.close()
        attempt.close()
        moves.pop()  # proposed, not executed
    assert len(moves) >= 4 or len(moves) == n - 1
    if moves:
        ((told, competence, by),) = goals.entries
        assert np.array_equal(told, goal)
        assert by == strategy
        assert competence == pytest.approx(max(float(MEASURE(goal, execute(move))) for move in moves))
    else:
        assert goals.entries == []


def test_babbling_is_one_uniform_movement_without_a_goal() -> None:
    box = Box.cube(2, 3, 4)
    babble = Babble(problem(policies=box))
    moves = [list(babble.attempt(NO_CONTEXT)) for _ in range(300)]
    assert {len(attempt) for attempt in moves} == {1}
    thetas = np.array([attempt[0].theta for attempt in moves])
    assert box.contains(thetas).all()
    # Standard error of a uniform mean: 0.289 / sqrt(300) = 0.017; five of them fail once in a million.
    assert thetas.mean(axis=0) == pytest.approx(np.full(4, 2.5), abs=5 * 0.017)
    assert all(attempt[0].goal is None and attempt[0].origin == "babble" for attempt in moves)


@pytest.mark.parametrize("budget", [1, 2, 7])
def test_goal_babbling_spends_exactly_its_budget_on_a_goal_it_does_not_reach(budget: int) -> None:
    for global_range in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0)):
        strategy = babbling(remembering(20), budget=budget, global_range=global_range)
        assert len(live(strategy.attempt(NO_CONTEXT))) == budget


def test_goal_babbling_stops_with_the_movement_that_reaches_the_goal() -> None:
    class ThirdTimeLucky(Search):
        def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
            yield np.full(5, 0.5)
            yield np.full(5, 0.6)
            yield ARM.solve(NO_CONTEXT, goal)
            yield np.full(5, 0.7)

    pursuit = babbling(remembering(20), goal=np.array([0.3, -0.4]), search=ThirdTimeLucky, tolerance=0.01)
    assert len(live(pursuit.attempt(NO_CONTEXT))) == 3
    assert pursuit.goals.entries[0][1] == pytest.approx(0.0, abs=1e-9)


def test_with_an_empty_memory_the_first_movement_is_global_however_unlikely() -> None:
    for seed in range(20):
        strategy = babbling(Memory(0, 5, 2), global_range=(0.0, 0.0), seed=seed)
        assert next(strategy.attempt(NO_CONTEXT)).origin == "global"


@pytest.mark.parametrize(("reached", "probability"), [(1.0, 0.05), (0.6, 0.4), (0.0, 0.95), (-5.0, 0.95)])
def test_the_less_competent_the_likelier_a_movement_is_global(reached: float, probability: float) -> None:
    # The goal lies 1 m from rest, and what is remembered ``reached`` of it: competence is reached - 1, and at least -1.
    memory = Memory(0, 5, 2)
    memory.add(NO_CONTEXT, np.full(5, 0.5), ARM.rest + np.array([reached, 0.0]))
    strategy = babbling(memory, goal=ARM.rest + np.array([1.0, 0.0]), global_range=(0.05, 0.95))
    origins = [next(strategy.attempt(NO_CONTEXT)).origin for _ in range(2000)]
    # Standard error at most 0.011; five of them fail once in a million.
    assert origins.count("global") / 2000 == pytest.approx(probability, abs=5 * 0.011)


def test_a_search_that_ends_before_the_budget_is_followed_by_one_that_knows_more() -> None:
    memory, starts = remembering(20), []

    class OneMovement(Search):
        def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
            starts.append(start)
            yield ARM.policies.clip(start.theta + 0.01)

    live(babbling(memory, search=OneMovement, budget=5).attempt(NO_CONTEXT), memory)
    assert len(starts) == 5
    assert len(memory) == 25


@pytest.mark.parametrize(
    "options",
    [
        *({"budget": budget} for budget in (0, 1.5, True)),
        *({"tolerance": tolerance} for tolerance in (np.nan, np.inf, -0.1)),
        *({"global_range": pair} for pair in ((0.9, 0.1), (-0.1, 0.5), (0.5, 1.1), (np.nan, 0.5), (0.5,))),
        *({"give_up": competence} for competence in (np.nan, 0.5)),
        *({"epsilon": epsilon} for epsilon in (np.nan, -0.1)),
        *({"repeats": repeats} for repeats in (0, 1.5)),
    ],
)
def test_numbers_that_a_strategy_cannot_use_are_refused(options: dict[str, object]) -> None:
    ((name, value),) = options.items()
    make = partial(Mimic, problem(ARM)) if name in ("epsilon", "repeats") else partial(babbling, MEMORY)
    with pytest.raises(ValueError, match=f"{name} must .*got {re.escape(str(value))}"):
        make(**options)


def test_imitation_is_exact_first_and_then_varied_by_less_than_epsilon() -> None:
    theta_d = np.full(5, 0.5)
    imitate = Mimic(problem(ARM), repeats=200, epsilon=0.05)
    thetas = np.array([move.theta for move in live(imitate.attempt(NO_CONTEXT, theta_d, LESSON))])
    assert np.array_equal(thetas[0], theta_d)
    variations = thetas[1:] - theta_d
    assert len(variations) == 199
    assert np.abs(variations).max() <= 0.05
    assert np.abs(variations).max() > 0.049
    assert (variations.min(axis=0) < -0.04).all()  # in every parameter, both ways
    assert (variations.max(axis=0) > 0.04).all()


@pytest.mark.parametrize(("repeats", "exact_first", "n_exact"), [(1, True, 1), (3, True, 1), (3, False, 0)])
def test_repeats_are_counted_and_the_paper_varies_even_the_first(repeats: int, exact_first: bool, n_exact: int) -> None:
    imitate = partial(Imitate, repeats=repeats, exact_first=exact_first)
    moves = live(begin(babbling(MEMORY), imitate, LESSON))
    assert len(moves) == repeats
    assert [np.array_equal(move.theta, THETA_D) for move in moves] == [True] * n_exact + [False] * (repeats - n_exact)


def test_a_demonstrated_outcome_outside_the_task_space_is_imitated_but_never_a_goal() -> None:
    pursuit = babbling(MEMORY)
    outside = Demonstration(LESSON.context, LESSON.times, LESSON.trajectory, np.array([1.5, 0.0]))
    assert len(live(begin(pursuit, partial(Imitate, repeats=3), outside))) == 3
    assert live(begin(pursuit, Emulate, outside)) == []
    assert pursuit.goals.entries == []


@pytest.mark.parametrize("social", [Imitate, Emulate])
def test_a_demonstrated_goal_is_for_a_learner_that_has_goals(social) -> None:
    given = problem(ARM)
    given.autonomous = Babble(given)
    with pytest.raises(ValueError, match="needs goal babbling, got a Babble"):
        social(given)


def test_remembering_stores_the_demonstrated_pair_and_does_not_move() -> None:
    memory = Memory(0, 5, 2)
    assert live(Remember(problem(ARM, memory=memory)).attempt(NO_CONTEXT, THETA_D, LESSON)) == []
    assert memory.thetas.tolist() == [THETA_D.tolist()]
    assert memory.outcomes.tolist() == [LESSON.outcome.tolist()]


METRE = ARM.rest - np.array([1.0, 0.0])  # a goal 1 m from rest: competence at it is -1 plus the part of the way made
AT_METRE = Demonstration(NO_CONTEXT, LESSON.times, LESSON.trajectory, METRE)


def way(part: float) -> Array:
    return ARM.rest - np.array([part, 0.0])


def having_made(*parts: float, context: Array = NO_CONTEXT) -> Memory:
    memory = Memory(len(context), 5, 2)
    for part in parts:
        memory.add(context, np.full(5, 0.5), way(part))
    return memory


def make_way(attempt: Attempt, memory: Memory, *parts: float, context: Array = NO_CONTEXT) -> int:
    """How many movements it makes when they come these parts of the way, and a demonstration interrupts the next."""
    move = next(attempt)
    for n, part in enumerate(parts, start=1):
        memory.add(context, move.theta, way(part))
        try:
            move = attempt.send(way(part))
        except StopIteration:
            return n
    attempt.close()
    return len(parts)


@pytest.mark.parametrize("name", ["goal babbling", "emulate", "imitate"])
@pytest.mark.parametrize("n", [3, 12], ids=["to the end", "interrupted"])
@pytest.mark.parametrize(
    ("before", "made", "gain"),
    [
        ((0.2,), (0.1, 0.5, 0.4), 0.3),  # from -.8 to -.5, though the last movement left it at -.6
        ((0.2, 0.3), (0.9, 0.1, 0.1), 0.6),
        ((0.6,), (0.5, 0.6, 0.0), 0.0),  # no better than what was remembered
        ((), (0.25, 0.0, 0.0), 0.25),  # an empty memory is worth -1
        ((), (0.0, -0.5, 0.0), 0.0),
    ],
)
def test_the_gain_of_an_attempt_is_its_goals_competence_afterwards_less_that_before(
    name: str, n: int, before: tuple[float, ...], made: tuple[float, ...], gain: float
) -> None:
    memory = having_made(*before)
    pursuit = babbling(memory, goal=METRE, budget=n)
    social = {"goal babbling": None, "emulate": Emulate, "imitate": partial(Imitate, repeats=n)}[name]
    assert make_way(begin(pursuit, social, AT_METRE), memory, *made) == 3
    assert pursuit.goals.gains == pytest.approx([gain])
    assert pursuit.goals.entries[0][1] == pytest.approx(
        max(made) - 1
    )  # judged by the attempt alone, as this judge does


@pytest.mark.parametrize(("uses", "gain"), [(True, 0.4), (False, 0.0)])
def test_the_gain_of_a_single_movement_is_measured_if_the_goal_model_uses_it(uses, gain, monkeypatch) -> None:
    monkeypatch.setattr(Diary, "by_competence", uses)
    memory = having_made(0.2)
    pursuit = babbling(memory, goal=METRE, budget=1, judge=Competence)
    assert make_way(pursuit.attempt(NO_CONTEXT), memory, 0.6) == 1
    assert pursuit.goals.gains == pytest.approx([gain])


def test_a_gain_is_never_negative_where_contexts_vary() -> None:
    # At .3 of context from here the goal was met; here, .2 of the way is missing, which is nearer than .3.
    here, there = np.array([0.0]), np.array([0.3])
    memory = having_made(1.0, context=there)
    strategy = babbling(memory, goal=METRE, budget=1)
    assert strategy.competence(here, METRE) == 0
    assert make_way(strategy.attempt(here), memory, 0.8, context=here) == 1
    assert strategy.competence(here, METRE) == pytest.approx(-0.2)
    assert strategy.goals.gains == [0.0]


@pytest.mark.parametrize(
    ("give_up", "before", "made", "n"),
    [
        (-0.5, 0.2, (0.1, 0.9, 0.9, 0.9), 1),  # hopeless, and no nearer
        (-0.5, 0.2, (0.2, 0.9, 0.9, 0.9), 1),  # as near is no nearer
        (-0.5, 0.2, (0.3, 0.4, 0.35, 0.9), 3),  # nearer, nearer, no nearer
        (-0.5, 0.2, (0.3, 0.55, 0.0, 0.0), 4),  # no longer hopeless
        (-0.5, 0.6, (0.0, 0.1, 0.2, 0.3), 4),  # hopeful
        (-0.5, 0.5, (0.0, 0.0, 0.0, 0.0), 4),  # -.5 is not below -.5
        (-0.3, 0.6, (0.0, 0.9, 0.9, 0.9), 1),
        (-1.0, 0.0, (0.0, 0.0, 0.0, 0.0), 4),  # -1 never gives up
    ],
)
def test_a_hopeless_goal_is_given_up_at_the_first_movement_that_brings_it_no_nearer(
    give_up: float, before: float, made: tuple[float, ...], n: int
) -> None:
    memory = having_made(before)
    pursuit = babbling(memory, goal=METRE, budget=4, give_up=give_up)
    assert make_way(pursuit.attempt(NO_CONTEXT), memory, *made) == n
    ((_, competence, _),) = pursuit.goals.entries  # what was learnt counts
    assert competence == pytest.approx(max(made[:n]) - 1)
