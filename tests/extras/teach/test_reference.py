"""Two runs with lessons by hand of which every movement is known, as in tests/learner/test_reference.py."""

import pytest

from reference import ALL, KEPT, check_errors, check_movements, lived
from sgimd_torch.demonstrations import load_demonstrations

BY_HAND = {"algorithm": "sgim-d", "teacher": "by-hand"}
LESSONS = {0: 0, 37: 5, 38: 10, 120: 15, 200: 20}  # number of movements before a lesson -> demonstration


def give(teacher, movements):
    if movements in LESSONS:
        teacher.give(load_demonstrations()[LESSONS[movements]])


@pytest.mark.parametrize("run", ["by-hand 1000", "by-hand 1001"])
def test_a_run_with_lessons_makes_the_movements_that_it_always_made(run, tmp_path):
    check_movements(lived(run, BY_HAND, tmp_path, KEPT, lessons=give), run)


@pytest.mark.slow
@pytest.mark.parametrize("run", ["by-hand 1000", "by-hand 1001"])
def test_a_resumed_run_with_lessons_ends_with_the_errors_that_it_always_had(run, tmp_path):
    found = lived(run, BY_HAND, tmp_path, ALL, 130, lessons=give)
    check_movements(found, run)
    check_errors(found, run)
