"""Two runs that ask, of which every movement is known, as in tests/learner/test_reference.py."""

import pytest

from reference import ALL, KEPT, check_errors, check_movements, lived

ACTS = {"algorithm": "sgim-acts-search", "teachers": ("low-half", "high-half"), "environment": "planar-arm-7"}


@pytest.mark.parametrize("run", ["sgim-acts 1000", "sgim-acts 1001"])
def test_a_run_that_asks_makes_the_movements_that_it_always_made(run, tmp_path):
    check_movements(lived(run, ACTS, tmp_path, KEPT), run)


@pytest.mark.slow
@pytest.mark.parametrize("run", ["sgim-acts 1000", "sgim-acts 1001"])
def test_a_resumed_run_that_asks_ends_with_the_errors_that_it_always_had(run, tmp_path):
    found = lived(run, ACTS, tmp_path, ALL, 130)
    check_movements(found, run)
    check_errors(found, run)
