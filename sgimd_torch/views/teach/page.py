"""The page: one loop that moves the led arm and shows how the run stands; a thread beside it has the learner move.

    with serving(8080, token) as server: Page(server, TaughtRun(config)).run()
What viewers do is put into a queue for this loop. All viewers see the same, and each may do everything.
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

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.runs.tasks import hand_led_of
from sgimd_torch.spaces import Array
from sgimd_torch.views.teach.chart import by_error
from sgimd_torch.views.teach.panel import Panel
from sgimd_torch.views.teach.scene import Scene
from sgimd_torch.views.teach.taught import Standing, TaughtRun

TICK: Final = 1 / 30  # s, from one picture to the next
AT_ONCE: Final = 10  # movements of the learner, before it hears of anything else
FAREWELL: Final = 0.3  # s, in which the last words reach the viewers
ENDED: Final = (
    '<div style="padding:0 .6em;color:#a33"><b>This session has ended.</b> '
    "All of it is kept; to go on: <code>sgimd teach {0}</code></div>"
)


class Page:
    """What viewers see and do.

    Args:
        server: that serves it.
        taught: the run; it belongs to the page until ``run`` has ended, which closes it.

    Raises:
        ValueError: nothing in this task can be led by the hand.
    """

    def __init__(self, server: viser.ViserServer, taught: TaughtRun) -> None:
        self.server, self.taught = server, taught
        parts = taught.parts
        led = hand_led_of(parts.task)
        self._outcomes = parts.environment.outcomes
        self.leading = Leading(led)
        self._hand, self._offset = led.hand, np.zeros(3)  # (3,) m from the mouse to the held point
        self.scene = Scene(server, led, self.leading.links, self._outcomes, parts.benchmark.goals)
        self.panel = Panel(server, self._act, self._outcomes, taught.config.movements, taught.cannot_be_taught)
        self.practising = False
        """Whether the learner moves by itself; at first it waits for a lesson."""
        self.lesson: HandLesson | None = None
        """What the recording teaches; None until that is known."""
        self.standing: Standing | None = None
        """What is shown."""
        self._before: Standing | None = None  # at the last lesson, until it is answered
        self._given = False  # a lesson that the learner has not begun to answer
        self._tasks: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._learner = ThreadPoolExecutor(1)
        self._moving: Future[Standing] | None = self._learner.submit(taught.standing)
        self._listen()

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Until it is ``stopped``, or the run fails with an error; whoever still looks is told."""
        last = time.monotonic()
        try:
            while not stopped():
                self._carry_out(until=last + TICK)
                now = time.monotonic()
                with self.server.atomic():
                    self.leading.step(now - last)
                    self.scene.draw_arm(self.leading.data, self.leading.hand)
                    self._attend()
                self.server.flush()
                last = now
        finally:
            self.panel.status.content = ENDED.format(escape(str(self.taught.config.directory)))
            self.server.flush()
            self._learner.submit(self.taught.close).result()
            self._learner.shutdown()
            time.sleep(FAREWELL)

    def _attend(self) -> None:
        """Show what came of the learner's last movements, and have it make the next ones."""
        if self._moving is not None:
            if not self._moving.done():
                return
            self.standing, self._moving = self._moving.result(), None
            self._tell(self.standing)
        assert self.standing is not None
        left = self.standing.movements < self.taught.config.movements
        if self._given:
            self._given, self._moving = False, self._learner.submit(self.taught.answer)
        elif self.standing.replaying or (self.practising and left):
            self._moving = self._learner.submit(self.taught.practise, AT_ONCE)

    def _tell(self, standing: Standing) -> None:
        self.panel.say_standing(standing, self.practising)
        self.scene.draw_map(by_error(standing.chart, self._outcomes), standing.chart.met)
        self.scene.draw_landings(standing.landed)
        if self._before is not None and not self._given:
            self.panel.say_effect(self._before.chart, standing.chart)
            self._before = None

    def _carry_out(self, until: float) -> None:
        """What viewers want, until the next picture is due."""
        with contextlib.suppress(Empty):
            while True:
                self._tasks.get(timeout=max(0.0, until - time.monotonic()))()

    def _listen(self) -> None:
        """Callbacks are coroutines; others run out of order."""
        for body, handle in self.scene.grips:
            self._listen_to(body, handle)

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

    def _act(self, name: str, client: viser.ClientHandle) -> None:
        actions: dict[str, Callable[[], object]] = {
            "record": lambda: self._record(client),
            "home": self.leading.home,
            "discard": lambda: self._say(None),
            "show": lambda: self._show(client),
            "practise": self._practise,
        }
        self._later(client, actions[name])

    def _drag(self, phase: str, body: str, start: Array, end: Array) -> None:
        """The mouse takes hold of a ``body`` at ``start``, goes to ``end``, or lets go there; ``(3,)`` m."""
        if phase == "start":
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

    def _record(self, client: viser.ClientHandle) -> None:
        """Begin a recording, or end the one under way and find out what it teaches."""
        self._say(None)
        self.panel.say_recording(not self.leading.recording)
        if not self.leading.recording:
            self.leading.record()
            return
        try:
            recording = self.leading.stop().moving()
        except ValueError as error:
            self._say(None, str(error))
            return
        future = self._learner.submit(self.taught.lesson_of, recording)
        future.add_done_callback(lambda done: self._later(client, lambda: self._judged(done)))

    def _judged(self, done: Future[HandLesson]) -> None:
        error = done.exception()
        self._say(*((done.result(), "") if error is None else (None, str(error))))

    def _say(self, lesson: HandLesson | None, problem: str = "") -> None:
        self.lesson = lesson
        self.panel.say_lesson(lesson, problem)
        self.scene.mark(None if lesson is None else lesson.demonstration.outcome)

    def _show(self, client: viser.ClientHandle) -> None:
        if self.lesson is None:
            raise ValueError("there is no lesson to show yet; record one first")
        self.panel.buttons["show"].disabled = True
        future = self._learner.submit(self.taught.give, self.lesson.demonstration)
        future.add_done_callback(lambda done: self._later(client, lambda: self._shown(done)))

    def _shown(self, done: Future[None]) -> None:
        done.result()
        self._before, self._given = self.standing, True
        self._say(None)

    def _practise(self) -> None:
        self.practising = not self.practising
        if self.standing is not None:
            self.panel.say_standing(self.standing, self.practising)
