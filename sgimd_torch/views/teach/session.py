"""A run that goes on by itself and takes lessons in between: what the page shows and changes, without any page.

    with Session(config) as session:
        session.show(demonstration).result(); session.do(lambda: session.run.try_goal(goal)).result().missed
The learner lives in a thread of its own and never waits for a browser: what a page wants is done between two movements.
The run directory is that of ``sgimd run``, which can go on with it.
"""

from __future__ import annotations

import time
import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from queue import Empty, SimpleQueue
from threading import Condition, Thread
from typing import Any, Final, Self, TypeVar

from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.memory import Memory
from sgimd_torch.runs.config import Config
from sgimd_torch.session import ReplayError
from sgimd_torch.spaces import Array, Demonstration, Episode
from sgimd_torch.views.teach.chart import State
from sgimd_torch.views.teach.taught import TaughtRun

LATEST: Final = 60  # movements that a page shows
CHART_EVERY: Final = 1.0  # s, from one map to the next while the learner moves by itself
ANSWERS: Final = 10  # movements after a lesson that are made at once, at most: as many as an imitation takes

Result = TypeVar("Result")


class _Ended(BaseException):
    """The session is over; no ``Exception``, so that nobody on the way takes it for a teacher's failure."""


class _GoBack(BaseException):
    """The run is to go back to the state before its last lesson."""


class Session:
    """A taught run, a context manager: it lives in the block.

    Args:
        config: of the run; it goes on with what is in its directory.

    Raises:
        ValueError: the run cannot be made, or its directory belongs to another one.
        OSError: a file of it cannot be read.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.answered = False
        """Whether someone is there to answer, so that a learner that asks waits for it."""
        self.run = TaughtRun(config, self._asked)
        """The run itself; it belongs to the learner's thread, others may look at what does not change."""
        self._state, self._changed = State(config.movements), Condition()
        self._latest: deque[Episode] = deque(maxlen=LATEST)
        self._tasks: SimpleQueue[tuple[Future[Any], Callable[[], Any], bool]] = SimpleQueue()
        self._later: list[Future[Any]] = []  # tasks that are done when the movements that they need are made
        self._at_once: Callable[[], bool] | None = None  # movements are made without a pause until this holds
        self._closing = self._going_back = False
        self._answer: Demonstration | None = None
        self._interval, self._made, self._drawn = 0.0, 0.0, 0.0
        self._thread = Thread(target=self._work, name="learner", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        self.do(lambda: None)
        self._thread.join()

    @property
    def state(self) -> State:
        """How it stands now; it does not change afterwards."""
        return self._state

    def when(self, condition: Callable[[State], bool]) -> State:
        """Wait until ``condition`` holds; the state of which it does.

        Raises:
            ValueError: the session has ended before.
        """
        with self._changed:
            self._changed.wait_for(lambda: condition(self._state) or bool(self._state.problem))
            state = self._state
        if not condition(state):
            raise ValueError(state.problem)
        return state

    def pause(self, paused: bool) -> Future[None]:
        """Stop after the movement under way, or go on."""
        return self.do(lambda: self._tell(paused=paused))

    def pace(self, interval: float) -> Future[None]:
        """Let ``interval`` s pass from one movement to the next, at least."""
        return self.do(lambda: setattr(self, "_interval", interval))

    def advance(self, movements: int) -> Future[None]:
        """Let it make so many movements at once, also while it is paused."""
        return self.do(lambda: self._hurry(self.run.life.movements + movements), later=True)

    def show(self, demonstration: Demonstration) -> Future[None]:
        """Show the learner a lesson. It answers at once; the new map is there when this is done.

        Raises (as its result):
            ValueError: the learner cannot be taught, or cannot use it; nothing has happened then.
        """
        return self.do(lambda: self._show(demonstration), later=True)

    def decline(self) -> Future[None]:
        """Let a learner that waits for an answer go on alone."""
        return self.do(lambda: self._tell(waiting=False))

    def take_back(self) -> Future[None]:
        """Go back to the state before the last lesson; a copy of the record as it was is kept.

        Raises (as its result):
            ValueError: there is no lesson.
        """
        return self.do(self._take_back, later=True)

    def do(self, what: Callable[[], Result], *, later: bool = False) -> Future[Result]:
        """Have something done between two movements, such as ``lambda: session.run.try_goal(goal)``.

        Args:
            what: to be done in the learner's thread; what it gives, or raises, is the result.
            later: the result comes when the movements are made for which ``what`` has asked.
        """
        future: Future[Result] = Future()
        with self._changed:
            if self._state.problem:
                future.set_exception(ValueError(self._state.problem))
            else:
                self._tasks.put((future, what, later))
        return future

    def _carry_out(self, wait: float | None) -> None:
        """The next task; if there is none, wait so many seconds for it, or as long as it takes."""
        try:
            future, what, later = self._tasks.get(timeout=wait)
        except Empty:
            return
        try:
            result = what()
        except Exception as error:  # belongs to the one who has asked
            future.set_exception(error)
        else:
            if later:
                self._later.append(future)
            else:
                future.set_result(result)
        if self._closing:
            raise _Ended
        if self._going_back:
            raise _GoBack

    def _tell(self, **news: Any) -> None:
        with self._changed:
            self._state = replace(self._state, **news)
            self._changed.notify_all()

    def _work(self) -> None:
        """All that happens in the learner's thread."""
        problem = "the session has ended"
        try:
            while True:
                try:
                    self._live()
                except _GoBack:
                    self._go_back()
        except _Ended:
            pass
        except (ReplayError, SimulationError, ValueError, OSError) as error:
            problem = str(error)
        except Exception as error:  # a fault of ours; the page says so, too
            traceback.print_exc()
            problem = f"{type(error).__name__}: {error}"
        finally:
            try:
                self.run.close()
            finally:  # nobody waits for ever, not even if the disk is full
                self._tell(problem=problem, busy="", waiting=False)
                while not self._tasks.empty():
                    self._later.append(self._tasks.get()[0])
                for future in self._later:
                    future.set_exception(ValueError(problem))

    def _live(self) -> None:
        """The run from where it is to its end, and then whatever is wanted."""
        life = self.run.life
        self._tell(busy="replaying" if life.recorded else "", asked=None, before=None, lessons=tuple(self.run.lessons))
        if not life.recorded:
            self._between()
        for episode in life.episodes():
            self._latest.append(episode)
            if not life.replaying:
                self._tell(movements=life.movements, latest=tuple(self._latest), busy="")
                self._between()
            elif self._closing:
                raise _Ended
        while True:
            self._between(ended=True)

    def _between(self, *, ended: bool = False) -> None:
        """Between two movements: do what is wanted, draw the map now and then, wait until the next one is due."""
        if self._at_once is not None and not (ended or self._at_once()):
            return
        self._at_once = None
        if self._later:
            self.run.life.commit()
            self._draw()
        for future in self._later:
            future.set_result(None)
        self._later.clear()
        while self._at_once is None:
            still = ended or self._state.paused
            left = self._made + self._interval - time.monotonic()
            if not self._is_drawn and (still or time.monotonic() > self._drawn + CHART_EVERY):
                self._draw()
            if not still and left <= 0 and self._tasks.empty():
                break
            if still or left > CHART_EVERY:
                self.run.life.commit()
            self._carry_out(None if still else max(left, 0.0))
        self._made = time.monotonic()

    @property
    def _is_drawn(self) -> bool:
        chart = self._state.chart
        return chart is not None and (chart.movements, chart.lessons) == (
            self._state.movements,
            len(self._state.lessons),
        )

    def _draw(self) -> None:
        chart = self.run.chart()
        self._drawn = time.monotonic()
        self._tell(chart=chart)

    def _hurry(self, movements: int, *, answer: bool = False) -> None:
        """Until so many movements are made, or an ``answer`` to a lesson is complete."""
        life, learner = self.run.life, self.run.parts.learner
        self._at_once = lambda: life.movements >= movements or (answer and learner.idle)

    def _show(self, demonstration: Demonstration) -> None:
        asked = self._state.waiting
        self.run.check(demonstration, asked=asked)
        self._draw()
        self.run.give(demonstration, asked=asked)
        self._answer = demonstration
        self._tell(before=self._state.chart, lessons=tuple(self.run.lessons))
        self._hurry(self.run.life.movements + ANSWERS, answer=True)

    def _asked(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """The answer of whoever is there; None at once if nobody is."""
        self._answer = None
        self._tell(asked=goal, waiting=self.answered)
        while self._state.waiting and self._answer is None:
            if not self._is_drawn:
                self._draw()
            self.run.life.commit()
            self._carry_out(None)
        self._tell(waiting=False, asked=self._state.asked if self._answer is None else None)
        return self._answer

    def _take_back(self) -> None:
        if not self.run.lessons:
            raise ValueError("there is no lesson to take back")
        self._going_back = True

    def _go_back(self) -> None:
        self._going_back = False
        self._tell(busy="going back", waiting=False)
        self.run.take_back()
        self._latest.clear()
