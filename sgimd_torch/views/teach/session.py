"""A run that goes on by itself and takes lessons in between: what the page shows and changes, without any page.

    with Session(config) as session:
        session.show(demonstration).result(); session.try_goal(goal).result().missed; session.take_back().result()
The learner lives in a thread of its own and never waits for a browser: what a page wants is done between two movements.
The run directory is that of ``sgimd run``, which can go on with it: the lessons lie in it, see ``teachers/by_hand.py``.
Killed at any moment, the same command goes on where it was.
"""

from __future__ import annotations

import time
import traceback
from collections import deque
from concurrent.futures import Future
from dataclasses import replace
from threading import Lock, Thread
from typing import Any, Final, Self

from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.environments.protocol import Recorded, SimulationError
from sgimd_torch.memory import Memory
from sgimd_torch.runs.config import Config
from sgimd_torch.session import ReplayError
from sgimd_torch.spaces import Array, Demonstration, Episode
from sgimd_torch.teachers.by_hand import GivenLesson
from sgimd_torch.views.teach.errands import Errands
from sgimd_torch.views.teach.state import State
from sgimd_torch.views.teach.taught import TaughtRun
from sgimd_torch.views.teach.trial import Trial

LATEST: Final = 200  # movements that a page can show
CHART_EVERY: Final = 1.0  # s, from one map to the next while the learner moves by itself
ANSWERS: Final = 10  # movements after a lesson that are made at once, at most: as many as an imitation takes


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
        self.interval = 0.0
        """s from one movement to the next, at least."""
        self.answered = False
        """Whether someone is there to answer, so that a learner that asks waits for it."""
        self.run = TaughtRun(config, self._asked)
        """The run itself; it belongs to the learner's thread, others may look at what does not change."""
        self._state, self._told = State(config.movements), Lock()
        self._latest: deque[Episode] = deque(maxlen=LATEST)
        self._errands = Errands()
        self._closing = False
        self._hurry = 0  # movements that are still made at once, after a lesson
        self._shown: Future[None] | None = None
        self._going_back: Future[None] | None = None
        self._answer: Demonstration | None = None
        self._made, self._drawn = 0.0, 0.0
        self._thread = Thread(target=self._work, name="learner", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        self._errands.wake()
        self._thread.join()

    @property
    def state(self) -> State:
        """How it stands now; it does not change afterwards."""
        return self._state

    def pause(self, paused: bool) -> None:
        """Stop after the movement under way, or go on."""
        self._tell(paused=paused)
        self._errands.wake()

    def lesson_of(self, recording: Recording) -> Future[HandLesson]:
        """What a recording would teach: nobody is shown it yet.

        Raises (as its result):
            ValueError: the robot cannot make this movement.
        """
        return self._errands.ask(lambda: self.run.lesson_of(recording))

    def show(self, demonstration: Demonstration) -> Future[None]:
        """Show the learner a lesson. It answers at once; the new map is there when this is done.

        Raises (as its result):
            ValueError: the learner cannot be taught, or cannot use it; nothing has happened then.
        """
        return self._errands.ask(lambda: self._show(demonstration))

    def decline(self) -> Future[None]:
        """Let a learner that waits for an answer go on alone."""
        return self._errands.ask(lambda: self._tell(waiting=False))

    def take_back(self) -> Future[None]:
        """Go back to the state before the last lesson; what is taken back is kept as a copy in the run directory.

        Raises (as its result):
            ValueError: there is no lesson.
        """
        return self._errands.ask(self._take_back)

    def try_goal(self, goal: Array) -> Future[Trial]:
        """Let the learner do its best at ``goal`` ``(outcome_dim,)``; it learns nothing from it.

        Raises (as its result):
            ValueError: it remembers nothing yet, or the goal is not one of T.
        """
        return self._errands.ask(lambda: self.run.try_goal(goal))

    def recorded(self, episode: Episode) -> Future[Recorded | None]:
        """A movement that was made, to be shown; None if the task has no picture, or the learner rested."""
        return self._errands.ask(lambda: self.run.recorded(episode))

    def _tell(self, **news: Any) -> None:
        with self._told:
            self._state = replace(self._state, **news)

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
            self._tell(problem=problem, busy="", waiting=False)
            for waiting in filter(None, (self._shown, self._going_back)):
                waiting.set_exception(ValueError(problem))
            self._errands.close(problem)
            self.run.close()

    def _live(self) -> None:
        """The run from where it is to its end, and then whatever is wanted."""
        life = self.run.life
        self._tell(busy="replaying" if life.recorded else "", asked=None, best=None, before=None)
        for episode in life.episodes():
            self._latest.append(episode)
            if not life.replaying:
                lessons = sum(index < life.movements for index in self.run.hand.lessons)
                self._tell(movements=life.movements, lessons=lessons, latest=tuple(self._latest), busy="")
                self._between()
            elif self._closing:
                raise _Ended
        while True:
            self._between(ended=True)

    def _between(self, *, ended: bool = False) -> None:
        """Between two movements: do what is wanted, draw the map now and then, wait until the next one is due."""
        self._hurry = max(0, self._hurry - 1)
        if self._hurry and not self.run.parts.learner.idle and not ended:
            return
        self._hurry = 0
        for done in filter(None, (self._shown, self._going_back)):
            self.run.flush()
            self._draw()
            done.set_result(None)
        self._shown = self._going_back = None
        while True:
            self._do_errands()
            if self._hurry:
                return
            left = self._made + self.interval - time.monotonic()
            still = ended or self._state.paused
            if not self._is_drawn and (still or time.monotonic() > self._drawn + CHART_EVERY):
                self._draw()
            if left <= 0 and not still:
                break
            if still or left > CHART_EVERY:
                self.run.flush()  # a killed process loses nothing
            self._errands.wait(0.25 if still else min(left, 0.25))
        self._made = time.monotonic()

    def _do_errands(self) -> None:
        self._errands.carry_out()
        if self._closing:
            raise _Ended
        if self._going_back is not None:
            raise _GoBack

    @property
    def _is_drawn(self) -> bool:
        chart = self._state.chart
        return chart is not None and (chart.movements, chart.lessons) == (self._state.movements, self._state.lessons)

    def _draw(self) -> None:
        chart = self.run.chart(self._state.lessons)
        curve = [point for point in self._state.curve if point[0] < chart.movements]
        self._drawn = time.monotonic()
        self._tell(chart=chart, curve=(*curve, (chart.movements, chart.mean_error)))

    def _show(self, demonstration: Demonstration) -> Future[None]:
        self.run.check(demonstration, asked=self._state.waiting)
        self._draw()
        self._tell(before=self._state.chart)
        self._shown, self._hurry = Future(), ANSWERS + 1
        if self._state.waiting:
            self._answer = demonstration
        else:
            self.run.keep(GivenLesson(self.run.life.movements, demonstration))
        return self._shown

    def _asked(self, index: int, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """The answer of whoever is there; None at once if nobody is."""
        self._answer = None
        self._tell(asked=goal, best=self.run.best_try(context, goal, memory), waiting=self.answered)
        while self._state.waiting and self._answer is None:
            if not self._is_drawn:
                self._draw()
            self.run.flush()
            self._do_errands()
            self._errands.wait(0.05)
        self._tell(waiting=False)
        return self._answer_to(index)

    def _answer_to(self, index: int) -> Demonstration | None:
        """What was shown while the learner waited before movement ``index``; it is kept."""
        if self._answer is not None:
            self._tell(asked=None, best=None)
            self.run.keep(GivenLesson(index, self._answer, asked=True))
        return self._answer

    def _take_back(self) -> Future[None]:
        if not self.run.hand.lessons:
            raise ValueError("there is no lesson to take back")
        self._going_back = Future()
        return self._going_back

    def _go_back(self) -> None:
        self._tell(busy="going back", waiting=False)
        left = self.run.go_back()
        self._latest.clear()
        self._tell(curve=tuple(point for point in self._state.curve if point[0] <= left))
