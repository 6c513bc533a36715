"""A case of a test that only `scripts/test --slow` runs."""

import pytest


def slow(*values, more=()):
    return pytest.param(*values, marks=[pytest.mark.slow, *more])
