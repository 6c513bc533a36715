"""The page of a taught run in a real browser, and what tests ask of it."""

import io
import threading
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest
from PIL import Image

from browser import chromium
from sgimd_torch.extras.teach.command import serving
from sgimd_torch.extras.teach.page import Page
from sgimd_torch.extras.teach.taught import TaughtRun
from sgimd_torch.options.config import Config

SIZE = {"width": 1150, "height": 640}
TOKEN = "a-token-that-nobody-guesses"
LONG = 120_000  # ms, after which Playwright gives a browser up
LOOKS = 500  # pictures that are taken of something that ought to change


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture
def open_tab(browser):
    """Opens tabs, which are closed at the end."""
    yield partial(Tab, browser)
    for context in browser.contexts:
        context.close()


@pytest.fixture
def rod(tmp_path):
    """A served run on the fishing rod after its first movements."""
    settings = {"algorithm": "practice-taught", "teacher": "by-hand", "movements": 400, "evaluate_at": ()}
    run = TaughtRun(Config.from_settings({**settings, "name": "taught", "out": tmp_path, "repeats": 0}))
    run.go_on(5)
    with served(run) as page:
        yield page


@contextmanager
def served(taught):
    """The page of a taught run, served; its ``address``, ``end()``, and ``until(condition)``, which waits until that
    holds after one of its ticks."""
    ended, ticked = threading.Event(), threading.Condition()

    def stopped():
        with ticked:
            ticked.notify_all()
        return ended.is_set()

    def until(condition):
        with ticked:
            ticked.wait_for(condition)

    with serving(8300, TOKEN) as server:
        page = Page(server, taught)
        page.address, page.until, page.end = f"http://127.0.0.1:{server.get_port()}/?token={TOKEN}", until, ended.set
        loop = threading.Thread(target=page.run, args=(stopped,))
        loop.start()
        try:
            yield page
        finally:
            ended.set()
            loop.join()


class Tab:
    """A tab of the browser that shows the page."""

    def __init__(self, browser, page):
        self.page, before = page, set(page.server.get_clients())
        self.tab = browser.new_page(viewport=SIZE)
        self.tab.set_default_timeout(LONG)
        self.tab.goto(page.address)
        self.tab.get_by_role("button", name="Record").wait_for()
        page.until(lambda: set(page.server.get_clients()) - before)
        (number,) = set(page.server.get_clients()) - before
        self.client = page.server.get_clients()[number]
        note = self.tab.get_by_text("Software WebGL rendering detected")
        note.wait_for()  # it would lie over the scene
        note.locator("xpath=ancestor::*[@role='alert']").get_by_role("button").click()
        # The panels take their places, the camera hears of it, and something is drawn.
        self.tab.wait_for_function("innerWidth - document.querySelector('canvas').clientWidth > 600")
        self.box = self.tab.locator("canvas").first.bounding_box()
        page.until(lambda: abs(self.client.camera.image_width - self.box["width"]) < 2)
        self.until_changed(self.hand(), np.full((60, 60, 3), 255), 10, 0.05)

    def picture(self, place, side):
        """Colours ``(side, side, 3)`` of a square around a place on the screen."""
        corner = {"x": place[0] - side / 2, "y": place[1] - side / 2}
        taken = self.tab.screenshot(clip={**corner, "width": side, "height": side})
        return np.asarray(Image.open(io.BytesIO(taken)).convert("RGB").resize((side, side))).astype(int)

    def until_changed(self, place, before, threshold, share):
        """Wait until more than this ``share`` of a square's pixels differ from ``before`` by the ``threshold``."""
        for _ in range(LOOKS):
            if (np.abs(self.picture(place, len(before)) - before).max(axis=2) > threshold).mean() > share:
                return
        pytest.fail("the picture does not change")

    def at(self, point):
        """Where on the screen a point ``(3,)`` of the scene is."""
        camera = self.client.camera
        w, x, y, z = camera.wxyz
        right = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
        down = np.array([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)])
        ahead = np.cross(right, down)
        away = np.asarray(point) - camera.position
        focus = camera.image_height / 2 / np.tan(camera.fov / 2)
        across, along = focus * away @ right / (away @ ahead), focus * away @ down / (away @ ahead)
        return self.box["x"] + camera.image_width / 2 + across, self.box["y"] + camera.image_height / 2 + along

    def hand(self):
        """Where on the screen the hand is."""
        return self.at(self.page.leading.hand)
