"""Two families: the narrow one knows no movement of the wide one, and all else that the learner knows."""

import numpy as np
import pytest

from sgimd_torch.algorithms.families import TwoFamilies
from sgimd_torch.algorithms.practice import practice, practice_taught
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.learner import Learner
from sgimd_torch.session import run
from sgimd_torch.spaces import Failure, stream
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
def test_after_a_hundred_movements_one_attempt_of_three_is_narrow(at_once):
    learner = practice(ARM, 0)
    for _ in run(learner, ARM, 0, movements=FIRST + 60, at_once=at_once):
        pass
    assert families(learner).wide.memory is learner.memory
    assert narrow_rows(learner) == [row for row in range(FIRST + at_once - 1, FIRST + 60) if row % 3 == 2]


def test_the_narrow_family_begins_around_the_middle():
    learner = practice(PlanarArm(25), 0)
    for _ in run(learner, PlanarArm(25), 0, movements=FIRST + 6):
        pass
    assert (learner.memory.thetas[:30].std(axis=1) > 0.2).all()  # .29 if uniform, .1 around the middle
    assert (learner.memory.thetas[narrow_rows(learner)].std(axis=1) < 0.15).all()
    assert narrow_rows(learner)


def test_the_narrow_family_knows_what_the_learner_begins_with():
    memory = executed(ARM, stream(0, "begun").random((FIRST, 3)))
    learner = practice(ARM, 0, memory=memory)
    for _ in run(learner, ARM, 0, movements=6):
        pass
    assert narrow_rows(learner) == [*range(FIRST), FIRST + 2, FIRST + 5]


def test_the_narrow_family_knows_demonstrations_and_movements_of_others():
    learner = practice_taught(ARM, 0, correspondence=last_posture)
    for _ in run(learner, ARM, 0, movements=FIRST):
        pass
    learner.watch(demonstrate(ARM, [0.4, 0.4]))
    learner.tell(ARM.execute(NO_CONTEXT, learner.ask(NO_CONTEXT).theta, stream(0, "noise")))
    learner.add(NO_CONTEXT, np.full(3, 0.25), [0.1, 0.2])
    learner.ask(NO_CONTEXT)
    assert narrow_rows(learner) == [FIRST, FIRST + 1]


def test_a_narrow_movement_that_fails_is_known_to_nobody():
    learner = practice(ARM, 0)
    for _ in run(learner, ARM, 0, movements=FIRST + 1):
        pass
    moves = learner.ask_many([NO_CONTEXT] * 2)  # the first of these is narrow
    learner.tell_many([Failure("stuck"), ARM.execute(NO_CONTEXT, moves[1].theta, stream(0, "noise"))])
    learner.ask_many([NO_CONTEXT] * 2)
    assert len(learner.memory) == FIRST + 2
    assert narrow_rows(learner) == []


def test_answers_come_from_all_movements():
    learner = practice(ARM, 0)
    assert learner.inverse.problem.memory is learner.memory
    assert families(learner).narrow.inverse.problem.memory is families(learner).narrow.memory
