"""The page: one loop that moves the led arm, plays movements and shows how the session stands; nobody waits for it.

    with Session(config) as session: Page(server, session).run()
What viewers do comes in as errands for this loop, in order. One viewer teaches at a time: whoever begins, until they
leave, hand over, or do nothing for a while.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from html import escape
from typing import Any, Final

import numpy as np
import viser

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.runs.tasks import hand_led_of
from sgimd_torch.spaces import Array
from sgimd_torch.views.teach.chart import Chart, Colours, by_change, by_competence, by_error
from sgimd_torch.views.teach.desk import Desk
from sgimd_torch.views.teach.drawing import MAPS
from sgimd_torch.views.teach.errands import Errands
from sgimd_torch.views.teach.hanging import Hanging
from sgimd_torch.views.teach.panel import Panel, put
from sgimd_torch.views.teach.playing import Outline
from sgimd_torch.views.teach.scene import Grip, Scene
from sgimd_torch.views.teach.serving import Seat
from sgimd_torch.views.teach.session import Session
from sgimd_torch.views.teach.stage import Stage
from sgimd_torch.views.teach.state import State

TICK: Final = 1 / 30  # s, from one picture to the next
SHOWS_CHANGE: Final = 6.0  # s, how long what a lesson changed is shown on the map
LANDINGS: Final = 60  # of the last movements, that are shown
FAREWELL: Final = 0.3  # s, in which the last words reach the viewers
ENDED: Final = (
    '<div style="padding:0 .6em;color:#a33"><b>This session has ended.</b> '
    "All of it is kept; to go on: <code>{0}</code></div>"
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
        assert parts.task is not None
        led = hand_led_of(parts.task)
        self._outcomes = parts.environment.outcomes
        self.leading = Leading.of(led)
        self.hanging = Hanging(led.model, led.joints, led.hand, self.leading.q)
        self.errands = Errands()
        self.seat = Seat()
        self.scene = Scene(server, led, self._outcomes, parts.benchmark.goals)
        self.panel = Panel(server, self.leading, self._act, lambda client: self._as_teacher(client, self._joints))
        self.desk = Desk(session, self.leading, self.panel, self.scene)
        self.stage = Stage(session, self.scene, self.panel, Outline(led.model, self.scene.chain))
        self._seen: State | None = None
        self.drawn: Chart | None = None
        """What the map shows."""
        self._which = ""
        self._changed = -np.inf  # when the last lesson's change came
        self._listen()

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Until the session ends; whoever still looks is told."""
        try:
            self._run(stopped)
        finally:
            self.panel.status.content = ENDED.format(escape(f"sgimd teach {self.session.run.directory.path}"))
            self.server.flush()
            time.sleep(FAREWELL)

    def _run(self, stopped: Callable[[], bool]) -> None:
        last = time.monotonic()
        while not stopped():
            self.errands.wait(max(0.0, last + TICK - time.monotonic()))
            self.errands.carry_out()
            now = time.monotonic()
            with self.server.atomic():
                self._move(now - last)
                self.stage.play(now, watched=bool(self.server.get_clients()))
                self._tell(now)
            self.server.flush()
            last = now
            if self.session.state.problem:
                return

    def _listen(self) -> None:
        for grip in self.scene.grips:
            self._listen_to(grip)
        errands, server = self.errands, self.server

        @server.scene.on_click()  # type: ignore[arg-type]
        async def _(event: Any) -> None:
            place = self.scene.place(np.array(event.ray_origin), np.array(event.ray_direction))
            if place is not None:
                errands.ask(lambda: self.stage.try_goal(place))

        @self.panel.speed.on_click
        async def _(event: Any) -> None:
            self._as_teacher(event.client, lambda: self.stage.set_speed(event.target.value))

        @self.panel.more.on_click
        async def _(event: Any) -> None:
            self._act({"Play": "play", "Save": "save", "Throw away": "discard"}[event.target.value], event.client)

        @self.panel.maps.on_update
        async def _(event: Any) -> None:
            errands.wake()

        for slider in (self.panel.start, self.panel.end):

            @slider.on_update
            async def _(event: Any) -> None:
                if event.client is not None:
                    errands.ask(self.desk.trim)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            errands.ask(lambda: self._count())

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            errands.ask(lambda: self._left(client.client_id))

    def _listen_to(self, grip: Grip) -> None:
        """Drag callbacks have to be coroutines: others run out of order."""

        @grip.handle.on_drag("left")  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            client, phase = event.client, event.phase
            start, end = np.array(event.start_position), np.array(event.end_position)
            self.errands.ask(lambda: self._drag(client, phase, grip, start, end))

    def _drag(self, client: viser.ClientHandle, phase: str, grip: Grip, start: Array, end: Array) -> None:
        if phase == "start" and self._may(client):
            self.scene.hide_hint()
            self.desk.grab(grip, start)
        if not self.leading.held or not self.seat.is_held_by(client.client_id):
            return
        if phase == "end":
            self.leading.release()
        else:
            self.seat.busy(time.monotonic())
            self.leading.drag(end + self.desk.offset)

    def _act(self, name: str, client: viser.ClientHandle) -> None:
        actions: dict[str, Callable[[], object]] = {
            "record": self.desk.record,
            "home": self.desk.home,
            "play": self.desk.play,
            "show": lambda: self._show(client),
            "save": lambda: self.desk.save(client),
            "discard": self.desk.discard,
            "undo": lambda: self._undo(client),
            "alone": self.session.decline,
            "pause": lambda: self.session.pause(not self.session.state.paused),
            "map": self._next_map,
            "seat": lambda: self.seat.leave(client.client_id),
        }
        self._as_teacher(client, actions[name])

    def _as_teacher(self, client: viser.ClientHandle, what: Callable[[], object]) -> None:
        """Do something that one viewer at a time may do."""

        def carefully() -> None:
            if self._may(client):
                try:
                    what()
                except (ValueError, RuntimeError, OSError) as error:
                    self._complain(client, str(error))

        self.errands.ask(carefully)

    def _may(self, client: viser.ClientHandle) -> bool:
        if self.seat.take(client.client_id, time.monotonic()):
            return True
        self._complain(client, "Someone else is teaching now. You can watch; they hand over with key L.")
        return False

    def _complain(self, client: viser.ClientHandle, why: str) -> None:
        client.add_notification("That did not work", why, color="red", auto_close_seconds=8.0)

    def _count(self) -> None:
        self.session.answered = bool(self.server.get_clients()) and bool(self.panel.wait.value)

    def _left(self, client_id: int) -> None:
        """A viewer has gone: what they held is let go."""
        if self.seat.is_held_by(client_id):
            self.leading.release()
            self.seat.leave(client_id)
        self._count()

    def _joints(self) -> None:
        self.desk.set_joints(np.array([slider.value for slider in self.panel.joints]))

    def _next_map(self) -> None:
        put(self.panel.maps, MAPS[(MAPS.index(self.panel.maps.value) + 1) % len(MAPS)])

    def _undo(self, client: viser.ClientHandle) -> None:
        def told(done: Future[None]) -> None:
            error = done.exception()
            if error is not None:
                self._complain(client, str(error))
                return
            text = f"{self.session.run.directory.path} is as it was before; what was taken back is kept in it."
            client.add_notification("The last lesson is taken back", text, auto_close_seconds=8.0)

        self.session.take_back().add_done_callback(told)

    def _show(self, client: viser.ClientHandle) -> None:
        def told(done: Future[None]) -> None:
            error = done.exception()
            self.errands.ask(lambda: self._after_lesson(client, error))

        self.desk.show().add_done_callback(told)

    def _after_lesson(self, client: viser.ClientHandle, error: BaseException | None) -> None:
        """What a lesson changed, now that the learner has answered it."""
        if error is not None:
            self._complain(client, str(error))
            return
        before, after = self.session.state.before, self.session.state.chart
        if before is not None and after is not None:
            self.panel.say_effect(before, after)
        self._changed = time.monotonic()
        self.desk.discard()

    def _move(self, seconds: float) -> None:
        """The led arm, and what hangs on it."""
        self.leading.step(seconds)
        q = self.desk.posture(time.monotonic())
        self.hanging.follow(q, seconds)
        self.scene.draw_arm(self.hanging.data, self.hanging.hand)
        self.desk.look_again()
        if not (self.leading.held or self.desk.by_joints):
            for slider, angle in zip(self.panel.joints, np.round(q, 2), strict=True):
                if abs(slider.value - angle) > 0.02:
                    put(slider, float(angle))

    def _tell(self, now: float) -> None:
        """Whatever has changed since the last picture."""
        state = self.session.state
        if state is not self._seen:
            self.panel.say_state(state, self.session.run.cannot_be_taught)
            if self._seen is None or state.curve is not self._seen.curve:
                self.panel.say_curve(state, sorted(self.session.run.hand.lessons))
            if self._seen is None or state.asked is not self._seen.asked:
                self.scene.mark("asked", state.asked, "show me how to get here")
                self.stage.show_best(state.best, now)
            landed = [episode.outcome for episode in state.latest if episode.outcome is not None]
            self.scene.draw_landings(
                np.array(landed[-60:]).reshape(-1, self.session.run.parts.environment.outcomes.dim)
            )
            self._seen = state
        self._count()
        which = MAPS[2] if now < self._changed + SHOWS_CHANGE else self.panel.maps.value
        if state.chart is not None and (self.drawn is not state.chart or self._which != which):
            self.drawn, self._which = state.chart, which
            self.scene.draw_map(self._colours(which, state), state.chart.met)
            self.panel.say_map(which)

    def _colours(self, which: str, state: State) -> Colours:
        outcomes = self._outcomes
        assert state.chart is not None
        if which == MAPS[2]:
            return by_change(state.before or state.chart, state.chart, outcomes)
        return by_competence(state.chart) if which == MAPS[1] else by_error(state.chart, outcomes)
