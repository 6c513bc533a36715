"""Where most movements do nothing: which had an effect, who answers, and where to look next."""

from functools import partial

import numpy as np
import pytest

from experiments.toys import crawler, fetch, puck, toss, toy_benchmark, two_elbows
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.evaluation import evaluate
from sgimd_torch.inverses.among_effects import AmongEffects
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.searches.effects import Effects
from sgimd_torch.searches.explore import Returning, Widening
from sgimd_torch.session import run
from worlds import NO_CONTEXT, problem


def lived(robot, movements, seed=0):
    """A memory of uniform movements."""
    rng, memory = np.random.default_rng(seed), Memory(robot.contexts.dim, robot.policies.dim, robot.outcomes.dim)
    for _ in range(movements):
        context, theta = robot.observe(rng), robot.policies.sample(rng)
        memory.add(context, theta, robot.execute(context, theta, rng))
    return memory


def button(rng, *, noise=0.0, unit=1.0, pressed=0.25):
    """A context, a movement and an outcome: theta[0] below ``pressed`` moves something that lies at -3 c + 1."""
    context, theta = rng.uniform(-1, 1, size=1), rng.uniform(size=3)
    outcome = 1 - 3 * context + (theta[0] < pressed) * (0.1 + theta[1])
    return context, theta, unit * rng.normal(outcome, noise)


def returning(memory):
    return Returning(problem(memory=memory, inverse=AmongEffects))


@pytest.mark.parametrize(("noise", "unit"), [(0.0, 1.0), (0.01, 1.0), (0.01, 1000.0), (0.0, 1e-4)])
def test_movements_that_had_an_effect_are_told_from_those_without_in_any_unit(noise, unit):
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    effects = Effects(memory, noise * unit)
    for _ in range(400):
        memory.add(*button(rng, noise=noise, unit=unit))
        acted = effects()
    pressed = memory.thetas[:, 0] < 0.25
    assert np.array_equal(acted.thetas, memory.thetas[pressed])
    assert np.array_equal(acted.outcomes, memory.outcomes[pressed])


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


def test_before_anything_had_an_effect_all_have_none():
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    for _ in range(50):
        memory.add(*button(rng, noise=0.01, pressed=0.0))
    assert len(Effects(memory, 0.01)()) == 0


def test_the_answer_is_learnt_from_movements_with_an_effect():
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    for _ in range(400):
        memory.add(*button(rng))
    inverse, errors = AmongEffects(problem(memory=memory)), []
    for goal in np.linspace(1.2, 2, 20):
        theta = inverse(np.zeros(1), np.array([goal])).theta
        assert theta[0] < 0.25
        errors.append(abs(1.1 + theta[1] - goal))
    assert np.mean(errors) < 0.02


def test_without_a_plateau_the_answer_and_the_exploration_are_the_usual_ones():
    robot = two_elbows().environment
    memory = lived(robot, 200)
    ours, theirs = (problem(robot, memory=memory, inverse=make) for make in (AmongEffects, LocalProcess))
    goal = np.array([0.3, 0.4])
    assert np.array_equal(ours.inverse(NO_CONTEXT, goal).theta, theirs.inverse(NO_CONTEXT, goal).theta)
    look, usual = Returning(ours), Widening(theirs)
    assert look.share is None
    for _ in range(20):
        theta = look(NO_CONTEXT)
        assert np.array_equal(theta, usual(NO_CONTEXT))
        memory.add(NO_CONTEXT, theta, robot.execute(NO_CONTEXT, theta, np.random.default_rng(2)))


def test_it_looks_anywhere_until_something_had_an_effect_and_then_around_that():
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    look = returning(memory)
    for _ in range(50):
        memory.add(*button(rng, pressed=0.0))
    assert look.share == 1.0
    anywhere = np.array([look(np.zeros(1)) for _ in range(200)])
    assert anywhere.std(axis=0) == pytest.approx(np.full(3, np.sqrt(1 / 12)), rel=0.15)
    memory.add(np.zeros(1), np.array([0.1, 0.9, 0.5]), np.array([2.0]))
    around = np.array([look(np.zeros(1)) for _ in range(200)])
    assert (np.abs(around - [0.1, 0.9, 0.5]).max(axis=1) < 0.25).mean() == pytest.approx(0.5, abs=0.15)


def test_it_explores_less_when_there_are_effects_to_learn_from():
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    look = returning(memory)
    shares = []
    for _ in range(200):
        memory.add(*button(rng))
        shares.append(look.share)
    assert shares[40] == 1.0
    assert shares[-1] == 0.1


def test_practice_learns_to_fetch_a_ball_that_it_would_not_have_found_around_the_middle():
    robot, errors = fetch().environment, []
    goals = toy_benchmark(robot, 0.1).goals[::4]
    for parts in ({}, {"inverse": LocalProcess, "explore": Widening}):
        learner = practice(robot, 1, **parts)
        for _ in run(learner, robot, 1, movements=400):
            pass
        errors.append(evaluate(learner.inverse, robot, goals, 1, 400, repeats=0).mean_error)
    assert errors[0] < 0.3 * errors[1]


def test_it_returns_to_effects_in_similar_contexts():
    rng, memory = np.random.default_rng(0), Memory(1, 3, 1)
    for _ in range(400):
        memory.add(*button(rng))
    for side in (-1.0, 1.0):
        for row in range(20):
            memory.add([side], [0.1, (1 + side) / 2, row / 20], [1 - 3 * side + 0.1 + (1 + side) / 2])
    look = returning(memory)
    for side in (-1.0, 1.0):
        found = np.array([look(np.array([side])) for _ in range(200)])[:, 1]
        assert 0.35 < (np.abs(found - (1 + side) / 2) < 0.15).mean() < 0.65  # half of them, and .15 of the others


def test_it_varies_more_the_more_often_the_effect_persists():
    rng, widths = np.random.default_rng(0), []
    for persists in (True, False):
        memory = Memory(0, 3, 1)
        look = returning(memory)
        for row in range(40):
            memory.add([], rng.uniform(size=3), [0.0 if row else 1.0])
        for _ in range(30):
            memory.add([], look(NO_CONTEXT), [rng.uniform(1, 2) if persists else 0.0])
        widths.append(look.width.sd)
    assert widths[0] > 5 * widths[1]


def test_exploration_begins_with_uniform_movements_or_in_the_middle():
    robot = crawler().environment
    learner = practice(robot, 0)
    origins = [episode.move.origin for episode in run(learner, robot, 0, movements=120)]
    assert origins[:30] == ["global"] * 30
    assert origins[30:].count("global") < 60
    sides = robot.policies.sides
    assert (learner.memory.thetas[:30].std(axis=0) > 0.2 * sides).all()  # .29 if uniform, .1 around the middle
    middle = practice(robot, 0, explore=partial(Returning, first=0))
    for _ in run(middle, robot, 0, movements=30):
        pass
    assert (middle.memory.thetas.std(axis=0) < 0.2 * sides).all()
