"""The page: a loop moves the led arm and shows the status, while the learner works in a second thread.

    with serving(8080, token) as server: Page(server, TaughtRun(config)).run()
The actions of viewers go through a queue to the loop. All viewers see and control the same page.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from html import escape
from queue import Empty, SimpleQueue
from typing import Any, Final

import numpy as np
import viser

from sgimd_torch.extras.recordings.units import moving
from sgimd_torch.extras.teach.leading import Leading
from sgimd_torch.extras.teach.lessons import HandLesson
from sgimd_torch.extras.teach.panel import Panel
from sgimd_torch.extras.teach.scene import Scene
from sgimd_torch.extras.teach.taught import Status, TaughtRun
from sgimd_torch.spaces import Array

TICK: Final = 1 / 30  # s, time from one picture to the next
BLOCK: Final = 10  # number of movements of the learner between two updates of the page
FAREWELL: Final = 0.3  # s, wait before the server stops, in which the last message reaches the viewers
ENDED: Final = (
    '<div style="padding:0 .6em;color:#a33"><b>This session has ended.</b> '
    "Everything is kept; to go on: <code>sgimd teach {0}</code></div>"
)


class Page:
    """The scene and the controls that viewers see, and their actions.

    Args:
        server: web server of the page.
        taught: run that is taught; ``Page.run`` closes this run at the end.

    Attributes:
        lesson: lesson of the last recording, None if there is none.
        status: last status of the run, None before the first one.
        running: whether the learner moves by itself, False at first.

    Raises:
        ValueError: the robot does not fit its model, see `Arm`.
    """

    def __init__(self, server: viser.ViserServer, taught: TaughtRun) -> None:
        self.server, self.taught = server, taught
        robot, led = taught.parts.environment, taught.led
        self.leading = Leading(led)
        self._hand, self._offset = led.hand, np.zeros(3)  # (3,) m, vector from the mouse to the held point
        self.scene = Scene(server, led, self.leading.arm, robot.outcomes, taught.parts.benchmark.goals)
        self.panel = Panel(server, self._act, robot.outcomes, taught.config.movements)
        self.lesson: HandLesson | None = None
        self.status: Status | None = None
        self.running = False
        self._before: Status | None = None  # status before a given lesson, until the effect of the lesson is shown
        self._given = False  # whether there is a lesson that the learner has not begun to imitate
        self._actions: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._learner = ThreadPoolExecutor(1)
        self._moving: Future[Status] | None = self._learner.submit(taught.status)
        for body, handle in self.scene.grips:
            self._listen_to(body, handle)

        # All callbacks are coroutines, because viser may call plain functions out of order.
        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._actions.put(self._tab_closed)

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Serve until ``stopped()`` is true or the taught run fails; then tell viewers that the session has ended."""
        last = time.monotonic()
        try:
            while not stopped():
                self._work_until(last + TICK)
                now = time.monotonic()
                with self.server.atomic():
                    self.leading.step(now - last)
                    self.scene.draw_arm(self.leading.arm.data, self.leading.hand)
                    self._follow_learner()
                self.server.flush()
                last = now
        finally:
            self.panel.status.content = ENDED.format(escape(str(self.taught.config.directory)))
            self.server.flush()
            self._learner.submit(self.taught.close).result()
            self._learner.shutdown()
            time.sleep(FAREWELL)

    def _follow_learner(self) -> None:
        """Show the result of the learner's last movements, and start the next ones."""
        if self._moving is not None:
            if not self._moving.done():
                return
            self.status, self._moving = self._moving.result(), None
            self.panel.show_status(self.status, self.running)
            self.scene.draw_map(self.status.chart)
            self.scene.draw_outcomes(self.status.outcomes)
            if self._before is not None and not self._given:
                self.panel.show_effect(self._before.chart, self.status.chart)
                self._before = None
        assert self.status is not None
        left = self.status.movements < self.taught.config.movements
        if self._given:
            self._given, self._moving = False, self._learner.submit(self.taught.imitate)
        elif self.status.replaying or (self.running and left):
            self._moving = self._learner.submit(self.taught.go_on, BLOCK)

    def _work_until(self, until: float) -> None:
        """Perform the queued actions of viewers until the time ``until``."""
        with contextlib.suppress(Empty):
            while True:
                self._actions.get(timeout=max(0.0, until - time.monotonic()))()

    def _listen_to(self, body: str, handle: Any) -> None:
        @handle.on_drag("left")  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            phase, start, end = event.phase, np.array(event.start_position), np.array(event.end_position)
            self._queue(event.client, lambda: self._drag(phase, body, start, end))

    def _queue(self, client: viser.ClientHandle, action: Callable[[], object]) -> None:
        """Let the loop perform the ``action`` of a viewer; a failure is reported to this viewer."""

        def act_or_report() -> None:
            try:
                action()
            except (ValueError, RuntimeError, OSError) as error:
                client.add_notification("That did not work", str(error), color="red", auto_close_seconds=8.0)

        self._actions.put(act_or_report)

    def _act(self, name: str, client: viser.ClientHandle) -> None:
        actions: dict[str, Callable[[], object]] = {
            "record": lambda: self._record(client),
            "discard": lambda: self._set_lesson(None),
            "show": lambda: self._give_lesson(client),
            "run": self._run_or_pause,
        }
        self._queue(client, actions[name])

    def _drag(self, phase: str, body: str, start: Array, end: Array) -> None:
        """Grab a ``body`` at ``start`` ``(3,)`` m, pull it to ``end`` ``(3,)`` m, or release it, as the mouse does."""
        if phase == "start":
            self.leading.grab(body, None if body == self._hand else start)
            self._offset = self.leading.point - start
        if phase == "end":
            self.leading.release()
        elif self.leading.held:
            self.leading.drag(end + self._offset)

    def _tab_closed(self) -> None:
        """Release the arm and end a recording, as the viewer who left may have been the last one."""
        self.leading.release()
        if self.leading.recording:
            self.leading.end_recording()
            self.leading.home()
            self.panel.show_recording(False)

    def _record(self, client: viser.ClientHandle) -> None:
        """Begin a recording at the start of movements, or end it, make a lesson of it, and go back to the start."""
        self._set_lesson(None)
        self.panel.show_recording(not self.leading.recording)
        if not self.leading.recording:
            self.leading.home()
            self.leading.begin_recording()
            return
        try:
            recording = moving(*self.leading.end_recording())
        except ValueError as error:
            self._set_lesson(None, str(error))
            return
        finally:
            self.leading.home()
        future = self._learner.submit(self.taught.lesson_of, *recording)
        future.add_done_callback(lambda done: self._queue(client, lambda: self._lesson_made(done)))

    def _lesson_made(self, done: Future[HandLesson]) -> None:
        error = done.exception()
        self._set_lesson(*((done.result(), "") if error is None else (None, str(error))))

    def _set_lesson(self, lesson: HandLesson | None, problem: str = "") -> None:
        self.lesson = lesson
        self.panel.show_lesson(lesson, problem)
        self.scene.mark(None if lesson is None else lesson.demonstration.outcome)

    def _give_lesson(self, client: viser.ClientHandle) -> None:
        if self.lesson is None:
            raise ValueError("there is no lesson to show yet; record one first")
        self.panel.buttons["show"].disabled = True
        future = self._learner.submit(self.taught.give, self.lesson.demonstration)
        future.add_done_callback(lambda done: self._queue(client, lambda: self._lesson_given(done)))

    def _lesson_given(self, done: Future[None]) -> None:
        done.result()
        self._before, self._given = self.status, True
        self._set_lesson(None)

    def _run_or_pause(self) -> None:
        self.running = not self.running
        if self.status is not None:
            self.panel.show_status(self.status, self.running)
