"""The page in a real browser: leading, teaching; several tabs, and tabs and servers that go away."""

from http import HTTPStatus
from itertools import pairwise
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from sgimd_torch.extras.teach.command import serving
from sgimd_torch.extras.teach.guard import guard, guarded
from sgimd_torch.runs.read import read_run

PATH = np.array([[0.05, 0.0, 0.02], [0.12, -0.02, 0.1], [0.2, -0.06, 0.2], [0.26, -0.1, 0.12], [0.3, -0.12, 0.0]])
"""m, from where the hand begins: it swings to the right, up and down again."""


def lead(tab, path):
    """Drag the hand along points of the scene, with the mouse, and let go where it arrives."""
    begun = tab.page.leading.hand
    tab.tab.mouse.move(*tab.hand())
    tab.tab.mouse.down()
    for before, after in pairwise(path):
        for share in np.linspace(0, 1, 6):
            tab.tab.mouse.move(*tab.at(begun + before + share * (after - before)))
    end = tab.at(begun + path[-1])
    # The mouse moves in the plane that faces the camera; on the screen the hand is where the path ends.
    tab.page.until(lambda: np.linalg.norm(np.subtract(tab.hand(), end)) < 25)
    tab.tab.mouse.up()
    tab.page.until(lambda: not tab.page.leading.held)


@pytest.mark.slow
def test_a_person_leads_the_arm_teaches_it_and_sees_what_changed(open_tab, rod):
    """In the first minute a recording without a movement is told."""
    tab = open_tab(rod)
    assert rod.status.movements == 5  # it waits for a lesson
    tab.tab.get_by_text("The coloured map is the task space, x (m) and y (m)").wait_for()
    show = tab.tab.get_by_role("button", name="Show it to the learner")
    record = tab.tab.get_by_role("button", name="Record")
    record.click()
    rod.until(lambda: rod.leading.recording)
    tab.tab.get_by_role("button", name="Stop").click()
    tab.tab.get_by_text("no joint moved").wait_for()
    assert show.is_disabled()
    record.click()
    rod.until(lambda: rod.leading.recording)
    begun = rod.leading.hand
    lead(tab, PATH)
    assert np.linalg.norm(rod.leading.hand - begun) > 0.2
    tab.tab.get_by_role("button", name="Stop").click()
    rod.until(lambda: rod.lesson is not None)
    lesson = rod.lesson
    assert np.array_equal(rod.leading.q, rod.leading.arm.start)  # it went back by itself

    landing = tab.at([*lesson.demonstration.outcome, 0])
    before = tab.picture(landing, 60)
    show.click()
    tab.tab.get_by_text("goals within reach.").wait_for()
    tab.until_changed(landing, before, 30, 0.3)
    assert rod.status.lessons == 1
    tab.tab.get_by_text("1 lesson by hand").wait_for()
    assert np.array_equal(rod.taught.parts.learner.memory.thetas[5], lesson.theta_d)
    tab.tab.get_by_role("button", name="Let the learner go on").click()
    rod.until(lambda: rod.status.movements > 50)
    record.click()
    tab.tab.get_by_text("Nothing recorded yet.").wait_for()  # the old throw goes away
    assert show.is_disabled()


@pytest.mark.slow
def test_a_tab_closed_in_mid_drag_lets_go_its_recording_is_over_and_another_one_goes_on(open_tab, rod):
    tab, other = open_tab(rod), open_tab(rod)
    tab.tab.get_by_role("button", name="Record").click()
    rod.until(lambda: rod.leading.recording)
    x, y = tab.hand()
    tab.tab.mouse.move(x, y)
    tab.tab.mouse.down()
    for k in range(5):
        tab.tab.mouse.move(x + 10 * k, y)
    rod.until(lambda: rod.leading.held)
    assert rod.leading.recording
    tab.tab.close()
    rod.until(lambda: not rod.leading.held)
    rod.until(lambda: not rod.leading.recording)
    lead(other, PATH[::4])


@pytest.mark.slow
def test_whoever_still_looks_is_told_of_the_end_and_the_run_is_whole(open_tab, rod):
    tab = open_tab(rod)
    rod.end()
    tab.tab.get_by_text("This session has ended.").wait_for()
    assert len(read_run(rod.taught.config.directory).index) == 5


class Refuse:
    """What a server answers a request with, for the guard."""

    def respond(self, status, text):
        return Response(status, status.phrase, Headers(), text.encode())


ADDRESS = "/?token=secret"
OWN = {"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:8080"}
WITH_COOKIE = OWN | {"Cookie": "of=another-page"}


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        (ADDRESS, OWN, 200),
        (ADDRESS, WITH_COOKIE, 200),
        (ADDRESS, {"Host": "localhost:9000"}, 200),  # through ssh, from a shell
        ("/", OWN, 403),
        ("/?token=guessed", OWN, 403),
        (ADDRESS, OWN | {"Host": "evil.example:8080"}, 403),  # a name that was bound to this machine
        (ADDRESS, OWN | {"Host": "127.0.0.1.evil.example"}, 403),
        (ADDRESS, OWN | {"Origin": "http://evil.example"}, 403),
        (ADDRESS, OWN | {"Origin": "http://127.0.0.1:8081"}, 403),  # another page of this machine
        (ADDRESS, {"Origin": "http://127.0.0.1:8080"}, 403),
        (ADDRESS + "&x=" + "x" * 5000, OWN, 414),
        (ADDRESS, OWN | {"Host": "["}, 403),
        *((ADDRESS, [*WITH_COOKIE.items(), header], 403) for header in WITH_COOKIE.items()),  # two headers of one name
    ],
)
def test_only_a_page_with_the_token_in_its_address_is_answered(path, headers, status):
    guarded = guard("secret", lambda connection, request: connection.respond(HTTPStatus.OK, "the page"))
    response = guarded(Refuse(), Request(path, Headers(headers)))
    assert response.status_code == status
    assert ("Set-Cookie" in response.headers) == (status == 200)
    if status == 200:
        cookie = response.headers["Set-Cookie"].partition(";")[0]
        for sent, answered in ((cookie, 200), (f"{cookie}x", 403)):
            assert guarded(Refuse(), Request("/", Headers(headers | {"Cookie": sent}))).status_code == answered


def test_the_served_page_asks_for_the_token_and_no_request_gets_an_error_of_the_server(tmp_path):
    with serving(8300, "secret") as server:
        address = f"http://127.0.0.1:{server.get_port()}"
        for path, status in (("/", 403), ("/?token=secret", 200), ("/" + "x" * 150 + "?token=secret", 404)):
            assert answer_of(address + path) == status
        for length in (300, 5000):
            assert 400 <= answer_of(f"{address}/{'x' * length}?token=secret") < 500


def test_a_server_that_nothing_guards_is_no_server():
    with pytest.raises(RuntimeError, match="nothing would guard the page"), guarded("secret"):
        pass


def answer_of(address):
    try:
        return urlopen(address, timeout=60).status
    except HTTPError as error:
        return error.code
