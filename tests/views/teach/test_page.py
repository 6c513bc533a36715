"""The page in a real browser: leading, teaching, trying; several tabs, and tabs and servers that go away."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from browser import Tab, chromium, served
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.teach.arm import LedArm
from sgimd_torch.views.teach.session import Session

PATH = np.array([[0.05, 0.0, 0.02], [0.12, -0.02, 0.1], [0.2, -0.06, 0.2], [0.26, -0.1, 0.12], [0.3, -0.12, 0.0]])
"""m, from where the hand begins: it swings to the right, up and down again."""


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


def paused(out, **options):
    given = {"teacher": "by-hand", "movements": 400, "evaluate_at": (), **options}
    session = Session(Config.from_settings({**given, "name": "taught", "out": out, "repeats": 0}))
    session.pause(True)
    session.advance(5)
    return session


@pytest.fixture
def rod(tmp_path):
    """A served session on the fishing rod, paused after its first movements."""
    with served(paused(tmp_path)) as page:
        page.session.when(lambda state: state.movements == 5)
        yield page


def lead(tab, path):
    """Drag the hand along points of the scene, with the mouse, and let go where it arrives."""
    begun = tab.page.arm.hanging.hand
    tab.tab.mouse.move(*tab.hand())
    tab.tab.mouse.down()
    for before, after in pairwise(path):
        for share in np.linspace(0, 1, 6):
            tab.tab.mouse.move(*tab.at(begun + before + share * (after - before)))
    end = tab.at(begun + path[-1])
    # The mouse moves in the plane that faces the camera; on the screen the hand is where the path ends.
    tab.page.until(lambda: np.linalg.norm(np.subtract(tab.hand(), end)) < 25)
    tab.tab.mouse.up()
    tab.page.until(lambda: not tab.page.arm.leading.held)


@pytest.mark.slow
def test_a_person_leads_the_arm_teaches_it_and_sees_what_changed(open_tab, rod):
    tab = open_tab(rod)
    tab.tab.get_by_role("button", name="Record").click()
    rod.until(lambda: rod.arm.leading.recording)
    begun = rod.arm.hanging.hand
    lead(tab, PATH)
    assert np.linalg.norm(rod.arm.hanging.hand - begun) > 0.2
    tab.tab.get_by_role("button", name="Stop").click()
    rod.until(lambda: rod.lesson is not None)
    whole, lasts = rod.lesson, rod.arm.recording.duration

    tab.enter("From (s)", 0.1)
    tab.enter("To (s)", round(lasts - 0.1, 2))
    rod.until(lambda: rod.trimmed().duration < lasts - 0.15)
    assert rod.trimmed().duration == pytest.approx(lasts - 0.2, abs=0.03)
    rod.until(lambda: rod.lesson is not None and rod.lesson is not whole)
    lesson = rod.lesson

    landing = tab.at([*lesson.demonstration.outcome, 0])
    before = tab.colours(landing, 60)
    tab.tab.get_by_role("button", name="Show it to the learner").click()
    rod.session.when(lambda state: state.lessons)
    tab.until_changed(landing, 60, before, 30, 0.3)
    assert rod.session.state.chart.lessons == 1
    assert np.array_equal(rod.session.run.parts.learner.memory.thetas[5], lesson.theta_d)

    place = tab.at([-0.5, 0.1, 0])
    before = tab.colours(place, 50)
    tab.tab.mouse.click(*place)
    tab.tab.get_by_text("missed by").first.wait_for()
    tab.until_changed(place, 50, before, 60, 0.016)  # the ring around the goal


@pytest.mark.slow
def test_a_tab_closed_in_mid_drag_lets_go_and_another_one_goes_on(open_tab, rod):
    tab, other = open_tab(rod), open_tab(rod)
    x, y = tab.hand()
    tab.tab.mouse.move(x, y)
    tab.tab.mouse.down()
    for k in range(5):
        tab.tab.mouse.move(x + 10 * k, y)
    rod.until(lambda: rod.arm.leading.held)
    tab.tab.close()
    rod.until(lambda: not rod.arm.leading.held)
    rod.session.advance(1).result()  # the learner never noticed
    lead(other, PATH[::4])


@pytest.mark.slow
def test_keys_do_what_buttons_do(open_tab, rod):
    tab = open_tab(rod)
    press = tab.tab.keyboard.press
    press("r")
    rod.until(lambda: rod.arm.leading.recording)
    lead(tab, PATH[::4])
    press("r")
    rod.until(lambda: rod.lesson is not None)
    press("t")
    rod.session.when(lambda state: state.lessons)
    rod.until(lambda: not rod.panel.buttons["undo"].disabled)
    press("u")
    rod.session.when(lambda state: not state.lessons)
    press("Space")
    rod.session.when(lambda state: not state.paused)


@pytest.mark.slow
def test_a_page_whose_server_has_stopped_says_so_and_the_run_is_whole(open_tab, tmp_path):
    with served(paused(tmp_path, environment="planar-arm-7")) as page:
        tab = open_tab(page)
        page.session.when(lambda state: state.movements == 5)
    tab.tab.get_by_text("This session has ended.").wait_for()
    assert len(read_run(page.session.run.path.parent).index) == 5


def test_an_arm_that_one_viewer_holds_does_not_follow_another_one():
    arm = LedArm(PlanarArm().hand_led)
    ann, bob = 1, 2
    arm.grab(ann, "end", np.array([1.0, 0.0, 0.0]))
    arm.drag(ann, np.array([0.3, 0.6, 0.0]))
    arm.grab(bob, "end", np.array([1.0, 0.0, 0.0]))
    arm.drag(bob, np.array([-0.3, -0.6, 0.0]))
    arm.let_go(bob)
    arm.move(3.0, 3.0)
    np.testing.assert_allclose(arm.hanging.hand, [0.3, 0.6, 0.0], atol=1e-2)
    arm.let_go(ann)
    assert not arm.leading.held


def test_what_was_recorded_is_played_again():
    arm = LedArm(PlanarArm().hand_led)
    arm.record()
    arm.grab(1, "end", np.array([1.0, 0.0, 0.0]))
    arm.drag(1, np.array([0.3, 0.6, 0.0]))
    arm.move(1.0, 1.0)
    with pytest.raises(ValueError, match="under way"):
        arm.play(arm.recording, 1.0)
    arm.let_go(1)
    arm.record()
    ended = arm.recording.joints[-1]
    arm.home()
    arm.play(arm.recording, 10.0)
    arm.move(10.0, 0.1)
    np.testing.assert_allclose(arm.hanging.data.qpos, 0.0, atol=1e-9)
    arm.move(11.0, 0.1)
    np.testing.assert_allclose(arm.hanging.data.qpos, ended, atol=1e-9)
    arm.move(12.0, 0.1)
    arm.move(12.1, 0.1)  # it is over
    np.testing.assert_allclose(arm.hanging.data.qpos, 0.0, atol=1e-9)
