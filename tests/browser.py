"""A real browser for the tests of the page: Chromium without a window, and what they ask it."""

import io
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from sgimd_torch.views.teach.page import Page, serving
from sgimd_torch.views.teach.session import Session

CHROMIUM = next((path for path in map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser")) if path.exists()), None)
# Without the first one there is no WebGL, and so no picture; the second is for machines where tests run as root.
FLAGS = ["--enable-unsafe-swiftshader", "--no-sandbox"]
SIZE = {"width": 1150, "height": 640}
# After each frame: where the middle of all orange pixels is, the ball that is dragged, and when.
WATCH = """
(() => {
  const make = HTMLCanvasElement.prototype.getContext;  // else a picture that was shown cannot be read any more
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return make.call(this, kind, kind.startsWith("webgl") ? {...options, preserveDrawingBuffer: true} : options);
  };
  const small = document.createElement("canvas"), at = [];
  const pen = small.getContext("2d", {willReadFrequently: true});
  window.watched = at;
  window.moved = [];
  window.addEventListener("pointermove", () => window.moved.push(performance.now()), true);
  const look = () => {
    const canvas = [...document.querySelectorAll("canvas")].find((each) => each.width);
    if (!window.watching || !canvas) return;
    const [x, y, side] = window.watching;
    small.width = small.height = side;
    const scale = canvas.width / canvas.clientWidth;
    pen.drawImage(canvas, x * scale, y * scale, side * scale, side * scale, 0, 0, side, side);
    const pixels = pen.getImageData(0, 0, side, side).data;
    let n = 0, mx = 0, my = 0;
    for (let k = 0; k < pixels.length; k += 4) {
      if (pixels[k] > 130 && pixels[k + 1] > 40 && pixels[k + 1] < 0.7 * pixels[k] && pixels[k + 2] < 0.4 * pixels[k]) {
        n += 1; mx += (k / 4) % side; my += Math.floor(k / 4 / side);
      }
    }
    if (n > 20) at.push([performance.now(), mx / n, my / n]);
  };
  const frame = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => frame((t) => { draw(t); look(); });
})();
"""


@contextmanager
def chromium():
    """A browser; the test is skipped, with a word, where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright, which is not installed")
    if CHROMIUM is None:
        pytest.skip("needs Chromium at /usr/bin/chromium, which is not there")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def served(config):
    """A session and its page, served; the address is ``page.address``."""
    session, ended = Session(config), threading.Event()
    with serving(8300) as server:
        page = Page(server, session)
        page.address = f"http://127.0.0.1:{server.get_port()}"
        with session:
            loop = threading.Thread(target=page.run, args=(ended.is_set,))
            loop.start()
            try:
                yield page
            finally:
                ended.set()
                loop.join()


def until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)


class Tab:
    """A tab of the browser that shows the page."""

    def __init__(self, browser, page):
        self.page, before = page, set(page.server.get_clients())
        self.tab = browser.new_page(viewport=SIZE)
        self.tab.add_init_script(WATCH)
        self.tab.goto(page.address)
        self.tab.get_by_role("button", name="Record").wait_for()
        until(lambda: set(page.server.get_clients()) - before)
        (number,) = set(page.server.get_clients()) - before
        self.client = page.server.get_clients()[number]
        self.box = self.tab.locator("canvas").first.bounding_box()
        note = self.tab.get_by_text("Software WebGL rendering detected")
        note.wait_for()  # it would lie over the scene
        note.locator("xpath=ancestor::*[@role='alert']").get_by_role("button").click()
        until(lambda: (self.colours() == [255, 255, 255]).all(axis=2).mean() < 0.9)  # something is drawn
        time.sleep(1.0)  # the panels take their places

    def enter(self, label, value):
        """Type a number beside a slider."""
        row = self.tab.get_by_text(label, exact=True).locator("xpath=ancestor::div[contains(@class, 'Flex-root')][1]")
        row.locator("input").last.fill(f"{value:g}")
        row.locator("input").last.press("Tab")

    def colours(self, place=None, side=None):
        """``(height, width, 3)`` of the scene, or of a square around a place on the screen."""
        from PIL import Image

        clip = self.box if place is None else square(place, side)
        return np.array(Image.open(io.BytesIO(self.tab.screenshot(clip=clip))).convert("RGB")).astype(int)

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
        return self.at(self.page.arm.hanging.hand)

    def watch(self, side=240):
        """Note where the hand is drawn, in a square around it, from now on."""
        x, y = self.hand()
        corner = [float(x - self.box["x"] - side / 2), float(y - self.box["y"] - side / 2), side]
        self.tab.evaluate(f"() => {{ window.watching = {corner}; watched.length = moved.length = 0; }}")

    def seen(self):
        """Times (ms) and places ``(n, 3)`` of the hand in the pictures, and times of the mouse's moves."""
        drawn, moved = self.tab.evaluate("() => [watched, moved]")
        return np.array(drawn), np.array(moved)


def square(place, side):
    return {"x": place[0] - side / 2, "y": place[1] - side / 2, "width": side, "height": side}
