"""Explorers, and the exemplars with an effect from which `Returning` and `AmongEffects` learn."""

from functools import partial

import numpy as np
import pytest

from experiments.toys import crawler, fetch, puck, toss, toy_benchmark, two_elbows
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.evaluation import evaluate
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.searches.effects import Effects
from sgimd_torch.searches.explore import Returning
from sgimd_torch.session import run
from sgimd_torch.spaces import Box
from worlds import NO_CONTEXT, part, problem

POLICIES = Box(np.array([-1.0, 0.0]), np.array([3.0, 10.0]))


def explored(make, movements, seed=0):
    """An explorer and its ``movements``; their outcomes, theta itself, come into the memory."""
    space = problem(policies=POLICIES, inverse=NearestNeighbour, seed=seed)
    explore, thetas = make(space), []
    for _ in range(movements):
        thetas.append(explore(NO_CONTEXT))
        space.memory.add(NO_CONTEXT, thetas[-1], thetas[-1])
    return explore, np.array(thetas)


@pytest.mark.parametrize("word", WORDS["explore"])
def test_movements_lie_in_pi_and_come_from_the_stream_alone(word):
    first, same, other = (explored(part("explore", word), 60, seed)[1] for seed in (1, 1, 2))
    assert POLICIES.contains(first).all()
    assert np.array_equal(first, same)
    assert not np.isclose(first, other).all(axis=1).any()


@pytest.mark.parametrize("uniform", [0.0, 0.3, 1.0])
def test_movements_lie_between_the_middle_and_a_uniform_one(uniform):
    _, thetas = explored(partial(Returning, first=4000, uniform=uniform), 4000)
    sizes = np.abs(2 * (thetas - POLICIES.low) / POLICIES.sides - 1).max(axis=1)  # 0: the middle, 1: the border
    assert thetas.mean(axis=0) == pytest.approx([1.0, 5.0], abs=0.2)
    draws = np.random.default_rng(0).random((4000, 3)) ** [1, 0.5, 1]  # .5: the largest of two uniform numbers
    far = draws[:, 0] ** (POLICIES.dim / 25)
    expected = draws[:, 1] * np.where(draws[:, 2] < uniform, 1, far)
    for share in (0.25, 0.5, 0.75):
        assert np.quantile(sizes, share) == pytest.approx(np.quantile(expected, share), abs=0.03)


@pytest.mark.parametrize(
    ("inverse", "reasons"),
    [
        (NearestNeighbour, ["NearestNeighbour does not report them"]),
        (LocalProcess, ["LocalProcess does not report them"]),
        (AmongEffects, []),
    ],
)
def test_what_an_inverse_model_does_not_tell_exploration_is_remarked(inverse, reasons):
    space = problem(inverse=inverse)
    Returning(space)
    assert [remark.partition(": ")[2] for remark in space.remarks] == reasons


def lived(robot, movements, seed=0):
    """A memory of uniform movements."""
    rng, memory = np.random.default_rng(seed), Memory(robot.contexts.dim, robot.policies.dim, robot.outcomes.dim)
    for _ in range(movements):
        context, theta = robot.observe(rng), robot.policies.sample(rng)
        memory.add(context, theta, robot.execute(context, theta, rng))
    return memory


def presses(n, *, noise=0.0, unit=1.0, pressed=0.25, memory=None):
    """A memory of ``n`` movements; theta[0] below ``pressed`` moves an object that lies at -3 c + 1."""
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1) if memory is None else memory
    for _ in range(n):
        context, theta = rng.uniform(-1, 1, size=1), rng.uniform(size=3)
        outcome = 1 - 3 * context + (theta[0] < pressed) * (0.1 + theta[1])
        memory.add(context, theta, unit * rng.normal(outcome, noise))
    return memory


def returning(memory):
    return Returning(problem(memory=memory, inverse=AmongEffects))


@pytest.mark.parametrize(("noise", "unit"), [(0.0, 1.0), (0.01, 1.0), (0.01, 1000.0), (0.0, 1e-4)])
def test_movements_with_an_effect_are_told_from_those_without_in_any_unit(noise, unit):
    whole, memory = presses(400, noise=noise, unit=unit), Memory(1, 3, 1)
    effects = Effects(memory, noise * unit)
    for exemplar in zip(whole.contexts, whole.thetas, whole.outcomes, strict=True):
        memory.add(*exemplar)
        acted = effects()
    pressed = memory.thetas[:, 0] < 0.25
    assert np.array_equal(acted.thetas, memory.thetas[pressed])
    assert np.array_equal(acted.outcomes, memory.outcomes[pressed])
    assert len(Effects(presses(50, noise=0.01, pressed=0.0), 0.01)()) == 0  # no movement has had an effect yet


@pytest.mark.parametrize("make", [toss, two_elbows, crawler])
def test_where_each_movement_has_its_own_effect_there_is_no_plateau(make):
    robot = make().environment
    memory, whole = lived(robot, 0), lived(robot, 300)
    effects = Effects(memory, robot.outcome_noise)
    for exemplar in zip(whole.contexts, whole.thetas, whole.outcomes, strict=True):
        memory.add(*exemplar)
        assert effects() is None


@pytest.mark.parametrize("make", [puck, fetch])
def test_touches_of_an_object_are_found(make):
    robot = make().environment
    memory = lived(robot, 1000)
    acted = Effects(memory, robot.outcome_noise)()
    moved = np.linalg.norm(memory.outcomes - (memory.contexts if robot.contexts.dim else robot.rest), axis=1) > 0.06
    assert {tuple(theta) for theta in memory.thetas[moved]} <= {tuple(theta) for theta in acted.thetas}
    assert moved.sum() <= len(acted) < 0.25 * 1000


def test_the_answer_is_learnt_from_movements_with_an_effect():
    inverse, goals = AmongEffects(problem(memory=presses(400))), np.linspace(1.2, 2, 20)
    thetas = np.array([inverse(np.zeros(1), np.array([goal])).theta for goal in goals])
    assert (thetas[:, 0] < 0.25).all()
    assert np.abs(1.1 + thetas[:, 1] - goals).mean() < 0.02


def test_without_a_plateau_answers_and_exploration_are_the_usual_ones():
    robot = two_elbows().environment
    memory = lived(robot, 200)
    ours, usual = (problem(robot, memory=memory, inverse=make) for make in (AmongEffects, LocalProcess))
    goal = np.array([0.3, 0.4])
    assert np.array_equal(ours.inverse(NO_CONTEXT, goal).theta, usual.inverse(NO_CONTEXT, goal).theta)
    explore, plain = Returning(ours), Returning(usual)
    assert explore.share() == 0.1  # 20 of the 200 movements so far
    assert all(np.array_equal(explore(NO_CONTEXT), plain(NO_CONTEXT)) for _ in range(20))


def test_returning_is_uniform_until_a_movement_has_an_effect_and_then_half_around_this_movement():
    memory = presses(50, pressed=0.0)
    explore = returning(memory)
    assert explore.share() == 1.0
    anywhere = np.array([explore(np.zeros(1)) for _ in range(200)])
    assert anywhere.std(axis=0) == pytest.approx(np.full(3, np.sqrt(1 / 12)), rel=0.15)
    memory.add(np.zeros(1), np.array([0.1, 0.9, 0.5]), np.array([2.0]))
    around = np.array([explore(np.zeros(1)) for _ in range(200)])
    assert (np.abs(around - [0.1, 0.9, 0.5]).max(axis=1) < 0.25).mean() == pytest.approx(0.5, abs=0.15)
    presses(200, memory=memory)
    assert explore.share() == 2 * 20 / 251  # enough effects to learn from


def test_after_the_first_movements_global_ones_are_uniform_and_ever_less_frequent():
    memory, rng = Memory(0, 2, 1), np.random.default_rng(0)
    explore, shares = Returning(problem(policies=POLICIES, memory=memory, inverse=AmongEffects)), {}
    for n in range(1001):
        shares[n] = explore.share()
        theta = POLICIES.sample(rng)
        memory.add([], theta, theta[:1])
    assert [shares[n] for n in (0, 19, 20, 100, 200, 400, 1000)] == [1.0, 1.0, 0.2, 0.2, 0.1, 0.05, 0.05]
    thetas = np.array([explore(NO_CONTEXT) for _ in range(400)])
    assert thetas.std(axis=0) == pytest.approx(POLICIES.sides / np.sqrt(12), rel=0.1)


def test_a_plateau_holds_most_movements_when_it_is_found_and_a_tenth_of_them_later():
    some, most = presses(60, pressed=0.6), presses(60, pressed=0.4)
    assert Effects(some, 0.0)() is None
    effects = Effects(most, 0.0)
    assert effects() is not None
    presses(240, pressed=0.85, memory=most)
    assert effects() is not None


def test_returning_varies_movements_of_similar_contexts():
    memory = presses(400)
    for side in (-1.0, 1.0):
        for row in range(20):
            memory.add([side], [0.1, (1 + side) / 2, row / 20], [1 - 3 * side + 0.1 + (1 + side) / 2])
    explore = returning(memory)
    for side in (-1.0, 1.0):
        thetas = np.array([explore(np.array([side])) for _ in range(200)])[:, 1]
        assert 0.35 < (np.abs(thetas - (1 + side) / 2) < 0.15).mean() < 0.65  # half of them, and .15 of the others


def test_variations_are_wider_the_more_often_the_effect_persists():
    rng, widths = np.random.default_rng(0), []
    for persists in (True, False):
        memory = Memory(0, 3, 1)
        explore = returning(memory)
        for row in range(40):
            memory.add([], rng.uniform(size=3), [0.0 if row else 1.0])
        for _ in range(30):
            theta = explore(NO_CONTEXT)
            memory.add([], theta, [rng.uniform(1, 2) if persists else 0.0])
            explore.add(theta)
        widths.append(explore.width)
    assert widths[0] > 5 * widths[1]


def test_practice_fetches_a_ball_that_it_would_not_fetch_if_all_movements_counted_as_effective():
    robot, errors = fetch().environment, []
    goals = toy_benchmark(robot, 0.1).goals[::4]
    for parts in ({}, {"inverse": LocalProcess}):
        learner = practice(robot, 3, **parts)
        for _ in run(learner, robot, 3, movements=400):
            pass
        errors.append(evaluate(learner.inverse, robot, goals, 3, 400, repeats=0).mean_error)
    assert errors[0] < 0.3 * errors[1]


@pytest.mark.parametrize("first", [0, 30])
def test_the_first_movements_are_global(first):
    robot = crawler().environment
    learner = practice(robot, 0, explore=partial(Returning, first=first))
    origins = [episode.move.origin for episode in run(learner, robot, 0, movements=120)]
    assert origins[:first] == ["global"] * first
    assert origins[30:].count("global") < 15
