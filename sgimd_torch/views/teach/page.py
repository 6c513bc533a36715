"""The page: one loop that moves the led arm and shows how the session stands; nobody waits for it.

    with serving(8080) as server, Session(config) as session: Page(server, session).run()
What viewers do is put into a queue for this loop. All viewers see the same, and each may do everything.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import Future
from html import escape
from queue import Empty, SimpleQueue
from typing import Any, Final

import numpy as np
import viser

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.runs.tasks import hand_led_of
from sgimd_torch.spaces import Array
from sgimd_torch.views.teach.chart import Chart, State, by_change, by_error
from sgimd_torch.views.teach.panel import MAPS, SPEEDS, Panel
from sgimd_torch.views.teach.scene import Scene
from sgimd_torch.views.teach.session import Session
from sgimd_torch.views.teach.taught import Trial

TICK: Final = 1 / 30  # s, from one picture to the next
FAREWELL: Final = 0.3  # s, in which the last words reach the viewers
ENDED: Final = (
    '<div style="padding:0 .6em;color:#a33"><b>This session has ended.</b> '
    "All of it is kept; to go on: <code>sgimd teach {0}</code></div>"
)


class Page:
    """What viewers see and do.

    Args:
        server: that serves it.
        session: that is taught.

    Raises:
        ValueError: nothing in this task can be led by the hand.
    """

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        self.server, self.session = server, session
        parts = session.run.parts
        led = hand_led_of(parts.task)
        self._outcomes = parts.environment.outcomes
        self.leading = Leading(led)
        self._hand, self._offset = led.hand, np.zeros(3)  # (3,) m from the mouse to the held point
        self.scene = Scene(server, led, self.leading.links, self._outcomes, parts.benchmark.goals)
        self.panel = Panel(server, self._act, self._outcomes, asks="teachers" in session.config)
        self.lesson: HandLesson | None = None
        """What the recording teaches; None until that is known."""
        self.drawn: Chart | None = None
        """What the map shows."""
        self._tasks: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._seen: State | None = None
        self._which = ""
        self._set_speed(next(iter(SPEEDS)))
        self._listen()

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Until the session ends; whoever still looks is told."""
        last = time.monotonic()
        try:
            while not stopped() and not self.session.state.problem:
                self._carry_out(until=last + TICK)
                now = time.monotonic()
                with self.server.atomic():
                    self.leading.step(now - last)
                    self.scene.draw_arm(self.leading.data, self.leading.hand)
                    self._tell()
                self.server.flush()
                last = now
        finally:
            self.panel.status.content = ENDED.format(escape(str(self.session.run.path.parent)))
            self.server.flush()
            time.sleep(FAREWELL)

    def _carry_out(self, until: float) -> None:
        """What viewers want, until the next picture is due."""
        with contextlib.suppress(Empty):
            while True:
                self._tasks.get(timeout=max(0.0, until - time.monotonic()))()

    def _listen(self) -> None:
        """Callbacks are coroutines; others run out of order."""
        for body, handle in self.scene.grips:
            self._listen_to(body, handle)

        @self.server.scene.on_click()  # type: ignore[arg-type]
        async def _(event: Any) -> None:
            place = self.scene.place(np.array(event.ray_origin), np.array(event.ray_direction))
            if place is not None:
                self._later(event.client, lambda: self._try(event.client, place))

        @self.panel.speed.on_click
        async def _(event: Any) -> None:
            self._later(event.client, lambda: self._set_speed(event.target.value))

        @self.server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._tasks.put(self._leave)

    def _listen_to(self, body: str, handle: Any) -> None:
        @handle.on_drag("left")  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            phase, start, end = event.phase, np.array(event.start_position), np.array(event.end_position)
            self._later(event.client, lambda: self._drag(phase, body, start, end))

    def _later(self, client: viser.ClientHandle, what: Callable[[], object]) -> None:
        """Have the loop do what a viewer wants; if it cannot be done, they are told why."""

        def carefully() -> None:
            try:
                what()
            except (ValueError, RuntimeError, OSError) as error:
                client.add_notification("That did not work", str(error), color="red", auto_close_seconds=8.0)

        self._tasks.put(carefully)

    def _then(self, client: viser.ClientHandle, future: Future[Any], what: Callable[[Any], object]) -> None:
        """The same, with what comes of ``future``."""
        future.add_done_callback(lambda done: self._later(client, lambda: what(done.result())))

    def _act(self, name: str, client: viser.ClientHandle) -> None:
        actions: dict[str, Callable[[], object]] = {
            "record": self._record,
            "home": self.leading.home,
            "discard": lambda: self._say(None),
            "show": lambda: self._show(client),
            "undo": lambda: self._then(client, self.session.take_back(), lambda _: self._taken_back(client)),
            "alone": self.session.decline,
            "pause": lambda: self.session.pause(not self.session.state.paused),
        }
        self._later(client, actions[name])

    def _drag(self, phase: str, body: str, start: Array, end: Array) -> None:
        """The mouse takes hold of a ``body`` at ``start``, goes to ``end``, or lets go there; ``(3,)`` m."""
        if phase == "start":
            self.scene.hint.visible = False
            self.leading.grab(body, None if body == self._hand else start)
            self._offset = self.leading.point - start
        if phase == "end":
            self.leading.release()
        elif self.leading.held:
            self.leading.drag(end + self._offset)

    def _leave(self) -> None:
        """A tab was closed: the arm is let go, and a recording is over."""
        self.leading.release()
        if self.leading.recording:
            self.leading.stop()
            self.panel.say_recording(False)

    def _record(self) -> None:
        """Begin a recording, or end the one under way and find out what it teaches."""
        if not self.leading.recording:
            self._say(None)
            self.leading.record()
            self.panel.say_recording(True)
            return
        self.panel.say_recording(False)
        try:
            recording = self.leading.stop().moving()
        except ValueError as error:
            self._say(None, str(error))
            return
        future = self.session.do(lambda: self.session.run.lesson_of(recording))
        future.add_done_callback(lambda done: self._tasks.put(lambda: self._judged(done)))

    def _judged(self, done: Future[HandLesson]) -> None:
        error = done.exception()
        self._say(*((done.result(), "") if error is None else (None, str(error))))

    def _say(self, lesson: HandLesson | None, problem: str = "") -> None:
        self.lesson = lesson
        self.panel.say_lesson(lesson, problem)
        self.scene.mark("lesson", None if lesson is None else lesson.demonstration.outcome, "your throw lands here")

    def _show(self, client: viser.ClientHandle) -> None:
        if self.lesson is None:
            raise ValueError("there is no lesson to show yet; record one first")
        self.panel.buttons["show"].disabled = True
        self._then(client, self.session.show(self.lesson.demonstration), lambda _: self._shown())

    def _shown(self) -> None:
        """What a lesson changed, now that the learner has answered it."""
        state = self.session.state
        assert state.before is not None
        assert state.chart is not None
        self.panel.say_effect(state.before, state.chart)
        self.panel.maps.value = MAPS[1]
        self._say(None)

    def _taken_back(self, client: viser.ClientHandle) -> None:
        self.panel.maps.value = MAPS[0]
        text = f"{self.session.run.path.parent} is as it was before; a copy of what was taken back is beside it."
        client.add_notification("The last lesson is taken back", text, auto_close_seconds=8.0)

    def _try(self, client: viser.ClientHandle, goal: Array) -> None:
        self._then(client, self.session.do(lambda: self.session.run.try_goal(goal)), self._tried)

    def _tried(self, trial: Trial) -> None:
        self.panel.say_trial(trial)
        self.scene.mark("goal", trial.goal)
        self.scene.mark("landed", trial.outcome, f"missed by {self._outcomes.amount(trial.missed, '.2f')}")

    def _set_speed(self, word: str) -> None:
        """One of ``SPEEDS``."""
        self.session.pace(SPEEDS[word])

    def _tell(self) -> None:
        """Whatever has changed since the last picture."""
        state, seen = self.session.state, self._seen
        self.session.answered = self.panel.waits.value and bool(self.server.get_clients())
        if state is not seen:
            self.panel.say_state(state, self.session.run.cannot_be_taught)
            if seen is None or state.asked is not seen.asked:
                self.scene.mark("asked", state.asked, "show me how to get here")
            landed = [episode.outcome for episode in state.latest if episode.outcome is not None]
            self.scene.draw_landings(np.array(landed).reshape(-1, self._outcomes.dim))
            self._seen = state
        which = self.panel.maps.value
        if state.chart is not None and (self.drawn is not state.chart or self._which != which):
            self.drawn, self._which = state.chart, which
            before = state.before if which == MAPS[1] else None
            outcomes = self._outcomes
            colours = by_error(state.chart, outcomes) if before is None else by_change(before, state.chart, outcomes)
            self.scene.draw_map(colours, state.chart.met)
            self.panel.say_map(which if before is not None else MAPS[0])
