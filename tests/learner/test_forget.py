"""What was measured wrongly is taken back: the learner is as if these exemplars had never come."""

import numpy as np
import pytest

from sgimd_torch.algorithms.paper import observation, random_exploration, sagg_riac
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.search import GradientSearch
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Kind
from sgimd_torch.memory import FlatMemory, Memory, ScanMemory, neighbours
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.strategies import Babble
from worlds import NO_CONTEXT, ArmThat, demonstrate, last_posture, problem

WRONG = [12, *range(40, 46)]
GOALS = np.array([[0.3, 0.4], [-0.4, 0.5], [0.9, -0.9]])


def covered():
    """An arm whose camera says (.9, -.9) at the movements ``WRONG``; movement 20 fails."""

    def act(call, rng):
        if call == 20:
            raise ConnectionError("lost")
        return np.array([0.9, -0.9]) if call in WRONG else None

    return ArmThat(act)


def lived(make=practice, movements=80, **options):
    learner = make(covered(), 0, **options)
    for _ in run(learner, covered(), 0, movements=movements):
        pass
    return learner


def answers(learner):
    return [learner.inverse(NO_CONTEXT, goal) for goal in GOALS]


@pytest.mark.parametrize("make", [practice, sagg_riac, random_exploration])
@pytest.mark.parametrize("memory", [Memory, FlatMemory, ScanMemory])
def test_answers_are_those_of_a_learner_that_never_had_the_exemplars(make, memory, monkeypatch):
    monkeypatch.setattr(neighbours, "_FLAT_UP_TO", (30, 0))  # so that Memory is a graph
    monkeypatch.setattr(neighbours, "_BLOCK", 10)
    learner = lived(make, memory=memory)
    rows = [learner.rows[number] for number in range(80) if number not in (20, *WRONG)]
    others = Exemplars.of(learner.memory, np.array(rows))
    assert len(rows) == 80 - 8
    before = answers(learner)
    learner.forget(WRONG)
    never = make(covered(), 1, memory=others.memory_like(memory(0, 5, 2)))
    assert repr(answers(learner)) == repr(answers(never)) != repr(before)
    for known in (learner.memory, learner.problem.memory):
        assert type(known) is memory
        assert all(map(np.array_equal, Exemplars.of(known), others))
    assert [learner.rows[number] for number in (*WRONG, 20, 21)] == [Kind.FORGOTTEN] * 7 + [Kind.FAILED, 19]


def test_goals_are_as_if_the_exemplars_had_never_come():
    learner = lived()
    learner.forget(WRONG)
    never = practice(covered(), 1, memory=learner.memory)
    for each in (learner, never):
        each.autonomous.goals.sample(NO_CONTEXT)
    assert np.array_equal(learner.autonomous.goals._box, never.autonomous.goals._box)  # of reach
    mapped = lived(sagg_riac)
    assert sum(len(region.goals) for region in mapped.regions) > 0
    mapped.forget([12])
    assert sum(len(region.goals) for region in mapped.regions) == 0


def test_a_life_keeps_what_was_forgotten_and_one_that_repeats_it_goes_on_equally(tmp_path):
    learner, arm = lived(), covered()
    learner.forget(WRONG)
    assert sum(event.kind == Kind.MOVED for event in learner.events()) == 79
    assert [event.reply for event in learner.events() if event.kind == Kind.FORGOTTEN] == ["12,40-45"]
    arm.calls = 80
    for _ in run(learner, arm, 0, movements=90):
        pass
    learner.forget([85])
    save_life(learner, tmp_path / "life.sqlite")
    again = practice(covered(), 0)
    load_life(again, tmp_path / "life.sqlite")
    for each in (learner, again):
        arm = covered()
        arm.calls = 90
        for _ in run(each, arm, 0, movements=110):
            pass
    assert np.array_equal(again.memory.thetas, learner.memory.thetas)
    assert repr(answers(again)) == repr(answers(learner))


def test_what_was_added_or_was_there_at_the_start_stays():
    start = Memory(0, 5, 2)
    start.extend(np.empty((3, 0)), np.full((3, 5), 0.25), np.full((3, 2), 0.5))
    learner = lived(movements=30, memory=start)
    learner.add(NO_CONTEXT, np.full(5, 0.75), [0.1, 0.2])
    learner.forget([0, 29])
    assert len(learner.memory) == 3 + 30 - 1 - 2 + 1  # movement 20 failed
    assert (learner.memory.thetas[[0, 2, -1]] == [[0.25], [0.25], [0.75]]).all()
    assert learner.movements == 30


REFUSED = {
    "movement 80,99 does not exist: 80 were made, from 0 on; nothing was forgotten": [12, 80, 99],
    "movement -1 does not exist": [-1],
    "movement 20 failed, so nothing was learnt from it; movement 30 was forgotten before": [20, 30],
    "needs numbers of movements, got none": [],
    r"needs numbers of movements, such as \[12, 40\], got 12": 12,
    r"got \[1.5\]": [1.5],
    "got '12'": "12",
}


def test_what_cannot_be_forgotten_is_told_with_its_numbers_and_nothing_changes():
    learner = lived()
    learner.forget([30])
    told, memory = [*learner.events()], learner.memory
    for message, movements in REFUSED.items():
        with pytest.raises(ValueError, match=message):
            learner.forget(movements)
    learner.ask(NO_CONTEXT)
    with pytest.raises(ValueError, match="movement 80 is under way: tell its outcome first, or fail it"):
        learner.forget([80])
    with pytest.raises(RuntimeError, match=r"forget\(\) needs the outcome of the last movement first"):
        learner.forget([12])
    assert len([*learner.events()]) == len(told)
    assert learner.memory is memory


def test_who_watches_or_cannot_begin_again_has_nothing_to_forget_and_is_told_why():
    arm = PlanarArm(4)
    watching, by_hand = observation(arm, 0, correspondence=last_posture), Learner(each := problem(arm), Babble(each))
    watching.watch(demonstrate(arm, [0.5, 0.5]))
    assert watching.ask(NO_CONTEXT) is None
    trained = sagg_riac(arm, 0, search=GradientSearch)
    for learner in (by_hand, trained):
        learner.tell(arm.execute(NO_CONTEXT, learner.ask(NO_CONTEXT).theta, np.random.default_rng(0)))
    for learner, why in {
        watching: "movement 0 was a rest, without an outcome; demonstrations stay",
        by_hand: "this learner cannot forget, as it cannot begin again",
        trained: "a forward model cannot forget what it was trained on",
    }.items():
        with pytest.raises(ValueError, match=why):
            learner.forget([0])
