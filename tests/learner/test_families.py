"""Two families: the narrow one knows no movement of the wide one, and all else that the learner knows."""

from functools import partial

import numpy as np
import pytest

from sgimd_torch.algorithms.families import TwoFamilies
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.learner import Learner
from sgimd_torch.session import run
from sgimd_torch.spaces import stream
from worlds import NO_CONTEXT, demonstrate, executed, last_posture

ARM = PlanarArm(3)
FIRST = 100  # number of movements after which the narrow family acts, too


def families(learner: Learner) -> TwoFamilies:
    assert isinstance(learner.autonomous, TwoFamilies)
    return learner.autonomous


def narrow_rows(learner: Learner) -> list[int]:
    """Rows of the learner's memory that the narrow family knows."""
    known = learner.autonomous.narrow.memory
    rows = {theta.tobytes(): row for row, theta in enumerate(learner.memory.thetas)}
    found = [rows[theta.tobytes()] for theta in known.thetas]
    assert np.array_equal(known.outcomes, learner.memory.outcomes[found])
    return found


@pytest.mark.parametrize("at_once", [1, 3])
def test_after_a_hundred_movements_some_attempts_are_narrow(at_once, monkeypatch):
    learner, attempts = practice(ARM, 0), []
    for family in (families(learner).wide, families(learner).narrow):
        monkeypatch.setattr(
            family, "pursue", partial(told, family.pursue, attempts, family is families(learner).narrow)
        )
    for _ in run(learner, ARM, 0, movements=FIRST + 60, at_once=at_once):
        pass
    assert families(learner).wide.memory is learner.memory
    begun = len(attempts) - FIRST - 60  # attempts whose outcome is not known yet
    narrow = [row for row, each in enumerate(attempts[: len(attempts) - begun]) if each]
    assert narrow_rows(learner) == narrow
    assert FIRST <= narrow[0] < FIRST + 12
    assert 8 < len(narrow) < 32  # a third of sixty


def told(pursue, attempts, narrow, context, goal):
    """Note whose attempt begins."""
    attempts.append(narrow)
    return pursue(context, goal)


def test_the_narrow_family_begins_around_the_middle():
    learner = practice(PlanarArm(25), 0)
    for _ in run(learner, PlanarArm(25), 0, movements=FIRST + 12):
        pass
    assert (learner.memory.thetas[:30].std(axis=1) > 0.2).all()  # .29 if uniform, .1 around the middle
    assert (learner.memory.thetas[narrow_rows(learner)].std(axis=1) < 0.15).all()
    assert narrow_rows(learner)


def test_the_narrow_family_knows_what_the_learner_begins_with():
    memory = executed(ARM, stream(0, "begun").random((FIRST, 3)))
    learner = practice(ARM, 0, memory=memory)
    for _ in run(learner, ARM, 0, movements=6):
        pass
    assert narrow_rows(learner)[:FIRST] == [*range(FIRST)]


def test_the_narrow_family_knows_demonstrations_and_movements_of_others():
    learner = practice_taught(ARM, 0, correspondence=last_posture)
    for _ in run(learner, ARM, 0, movements=60):
        pass
    learner.watch(demonstrate(ARM, [0.4, 0.4]))
    learner.tell(ARM.execute(NO_CONTEXT, learner.ask(NO_CONTEXT).theta, stream(0, "noise")))
    learner.add(NO_CONTEXT, np.full(3, 0.25), [0.1, 0.2])
    learner.ask(NO_CONTEXT)
    assert narrow_rows(learner) == [60, 61]


def test_a_narrow_movement_that_fails_is_known_to_nobody(monkeypatch):
    learner = practice(ARM, 0)
    for _ in run(learner, ARM, 0, movements=FIRST):
        pass
    monkeypatch.setattr(families(learner), "_narrow_turn", lambda: True)
    known = narrow_rows(learner)
    learner.ask(NO_CONTEXT)
    learner.fail("stuck")
    learner.ask(NO_CONTEXT)
    assert narrow_rows(learner) == known
    assert len(learner.memory) == FIRST


@pytest.mark.parametrize(("better", "least", "most"), [(False, 0, 0.2), (True, 0.8, 1)])
def test_the_family_that_errs_less_gets_more_goals(better, least, most):
    found = families(practice(ARM, 0))
    rng = stream(0, "thetas")
    found.problem.memory.extend(np.zeros((200, 0)), rng.random((200, 3)), rng.random((200, 2)))
    found.attempt(NO_CONTEXT).send(None)  # tells the narrow family
    turns = []
    for _ in range(400):
        turns.append(found._narrow_turn())
        found._errors.append((turns[-1], rng.normal(-1 if turns[-1] is better else 0, 0.3)))
    assert least <= np.mean(turns[100:]) <= most
    assert {True, False} == {*turns}  # the other one is tried again and again


def test_answers_come_from_all_movements():
    learner = practice(ARM, 0)
    assert learner.inverse.problem.memory is learner.memory
    assert families(learner).narrow.inverse.problem.memory is families(learner).narrow.memory
