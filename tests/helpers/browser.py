"""A real browser for tests: Chromium without a window."""

from contextlib import contextmanager
from pathlib import Path

import pytest

CHROMIUM = next((path for path in map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser")) if path.exists()), None)
# The first flag gives WebGL without a GPU; the second is needed where tests run as root.
FLAGS = ["--enable-unsafe-swiftshader", "--no-sandbox"]


@contextmanager
def chromium():
    """A browser; if none is installed, the test is skipped with a message."""
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright, which is not installed")
    if CHROMIUM is None:
        pytest.skip("needs Chromium at /usr/bin/chromium, which is not there")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()
