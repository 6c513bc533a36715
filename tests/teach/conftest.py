"""The page of a taught run in a real browser, and what tests ask of it."""

import threading
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

from browser import chromium
from sgimd_torch.options.config import Config
from sgimd_torch.teach.command import serving
from sgimd_torch.teach.page import Page
from sgimd_torch.teach.taught import TaughtRun

SIZE = {"width": 1150, "height": 640}
TOKEN = "a-token-that-nobody-guesses"
LONG = 120_000  # ms, after which Playwright gives a browser up
# Colours of a square of the scene, and the share of its pixels that differ from earlier ones by more than a threshold.
COLOURS = """
const getContext = HTMLCanvasElement.prototype.getContext;  // without preserveDrawingBuffer pixels cannot be read
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return getContext.call(this, kind, kind.startsWith("webgl") ? {...options, preserveDrawingBuffer: true} : options);
};
window.colours = (x, y, side) => {
  const canvas = [...document.querySelectorAll("canvas")].find((element) => element.width);
  if (!canvas) return [];
  const box = canvas.getBoundingClientRect(), scale = canvas.width / canvas.clientWidth;
  const small = document.createElement("canvas");
  small.width = small.height = side;
  const pen = small.getContext("2d");
  pen.drawImage(canvas, (x - box.x) * scale, (y - box.y) * scale, side * scale, side * scale, 0, 0, side, side);
  return [...pen.getImageData(0, 0, side, side).data];
};
window.changed = (x, y, side, before, threshold) => {
  const after = colours(x, y, side);
  let n = 0;
  for (let k = 0; k < after.length; k += 4)
    n += [0, 1, 2].some((channel) => Math.abs(after[k + channel] - before[k + channel]) > threshold);
  return 4 * n / after.length;
};
"""


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
        self.tab.add_init_script(COLOURS)
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
        self.until_changed(self.hand(), 60, [255] * 4 * 60 * 60, 10, 0.05)

    def colours(self, place, side):
        """Colours of a square around a place on the screen."""
        return self.tab.evaluate("(square) => colours(...square)", _square(place, side))

    def until_changed(self, place, side, before, threshold, share):
        """Wait until more than this ``share`` of the square's pixels differ from ``before`` by the ``threshold``."""
        condition = "([x, y, side, before, threshold, share]) => changed(x, y, side, before, threshold) > share"
        self.tab.wait_for_function(condition, arg=[*_square(place, side), before, threshold, share])

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


def _square(place, side):
    return [float(place[0] - side / 2), float(place[1] - side / 2), side]
