"""Movements of an arm with seven joints, a model that has learnt from them, and goals that the arm can reach."""

import pytest

from models import ARM
from sgimd_torch.forward_model import anchored
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.spaces import stream
from worlds import executed


@pytest.fixture(scope="module")
def memory():
    return executed(ARM, stream(0, "thetas").random((600, 7)))


@pytest.fixture(scope="module")
def model(memory):
    """Good enough to be used, but still wrong by some cm."""
    model = ForwardModel(0, 7, 2, rate=1.0)
    model.refresh(memory)
    return model


@pytest.fixture(scope="module")
def goals():
    return executed(ARM, stream(1, "goals").random((30, 7))).outcomes


@pytest.fixture
def fixed(monkeypatch):
    """Sets other constants of anchored predictions: ``reach``, ``share`` or ``caution``."""

    def fixed(**values):
        for name, value in values.items():
            monkeypatch.setattr(anchored, f"_{name.upper()}", value)

    return fixed
