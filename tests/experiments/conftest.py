"""Rows that are made up need few draws of the bootstrap."""

import pytest

from sgimd_torch.extras.table import statistics


@pytest.fixture
def few_draws(monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 499)
