"""Pages without their pictures, for tests of texts and numbers; most of the time of a page is spent on drawing."""

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made, but saved as files of no bytes."""
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
