"""The run that is taught: it practises, is shown lessons by hand, and says how it stands.

    run = TaughtRun(config); run.practise(20); run.show(demonstration); run.standing().chart.mean_error; run.close()
One thread at a time may use it. The directory is that of ``sgimd run``, which can go on with it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.lessons import HandLesson, LedMovement, lesson_by_hand
from sgimd_torch.runs.build import build
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import FILE, holds_run
from sgimd_torch.runs.run import Life
from sgimd_torch.runs.tasks import correspondence_of, hand_led_of
from sgimd_torch.spaces import Array, Demonstration, stream
from sgimd_torch.teachers.by_hand import BY_HAND, ByHand
from sgimd_torch.views.teach.chart import Chart, chart_of

LATEST: Final = 60  # landings that a page shows
ANSWER: Final = 10  # movements that answer a lesson, at most: as many as an imitation takes
NO_MORE: Final = "it has made all its {0} movements; end this session, and go on with --movements {1}"
ALONE: Final = "{0} cannot be shown a lesson by hand; sgim-d, practice-taught, imitation and observation can"


@dataclass(frozen=True, eq=False)
class Standing:
    """How a run stands: after how many ``movements`` and ``lessons`` by hand, and whether it is still ``replaying``
    what was recorded before. ``landed`` ``(n, outcome_dim)`` are the last outcomes, ``chart`` what it can do."""

    movements: int
    lessons: int
    replaying: bool
    landed: Array
    chart: Chart


class TaughtRun:
    """A run on disk, open for lessons.

    Args:
        config: of the run; it goes on with what is in its directory. What is recorded is lived through again first.

    Raises:
        ValueError: the run cannot be made, or its directory belongs to another one.
        OSError: a file of it cannot be read.
    """

    def __init__(self, config: Config) -> None:
        self.config, parts = config, build(config)
        self._hand = ByHand(teacher=parts.teacher)
        self.parts = replace(parts, teacher=self._hand)
        self._life = Life(self.parts, resume=holds_run(config.directory / FILE))
        self._episodes = self._life.episodes()
        self._lessons = sum(each.kind == "shown" and each.who == BY_HAND for each in self._life.record.events())
        self._landed: deque[Array] = deque(maxlen=LATEST)

    @property
    def context(self) -> Array:
        """``(context_dim,)`` of maps and lessons: the middle of C."""
        contexts = self.parts.environment.contexts
        return np.asarray((contexts.low + contexts.high) / 2)

    @property
    def cannot_be_taught(self) -> str:
        """Why the learner cannot be shown anything, "" if it can."""
        can = self.parts.learner.social is not None and not self.parts.teachers
        return "" if can else ALONE.format(self.config.algorithm)

    def practise(self, movements: int) -> Standing:
        """Go on by so many movements, fewer where the run ends.

        Raises:
            SimulationError, ReplayError, ValueError, OSError: as ``sgimd run``.
        """
        return self._go_on(movements)

    def give(self, demonstration: Demonstration) -> None:
        """Have a lesson shown before the next movement.

        Raises:
            ValueError: the learner cannot be taught, or cannot use this; nothing has happened then.
        """
        total = self.config.movements
        if self.cannot_be_taught:
            raise ValueError(self.cannot_be_taught)
        if self._life.replaying:
            raise ValueError("it still replays what was recorded; a lesson has to wait until that is done")
        if self._life.movements >= total:
            raise ValueError(NO_MORE.format(total, 2 * total))
        self.parts.environment.contexts.check("context of the lesson", demonstration.context)
        self.parts.learner.translate(demonstration)
        self._hand.give(demonstration)
        self._lessons += 1

    def answer(self) -> Standing:
        """Let the learner make the movements that answer a lesson."""
        return self._go_on(ANSWER, answer=True)

    def show(self, demonstration: Demonstration) -> Standing:
        """Give a lesson, and let the learner answer it; raises what both raise."""
        self.give(demonstration)
        return self.answer()

    def lesson_of(self, recording: LedMovement) -> HandLesson:
        """What a recording would teach.

        Raises:
            ValueError: the robot cannot make this movement.
        """
        task, robot = self.parts.task, self.parts.environment
        rng = stream(self.config.seed, "lessons", self._lessons)
        return lesson_by_hand(recording, robot, correspondence_of(task), hand_led_of(task), rng, context=self.context)

    def standing(self) -> Standing:
        """How it stands now."""
        robot, memory = self.parts.environment, self.parts.learner.memory
        landed = np.array(self._landed).reshape(-1, robot.outcomes.dim)
        chart = chart_of(memory, robot.outcomes, robot.rest, self.parts.benchmark, self.context)
        return Standing(self._life.movements, self._lessons, self._life.replaying, landed, chart)

    def close(self) -> None:
        """Write what is left to write, and let others have the directory."""
        self._life.close()

    def _go_on(self, movements: int, *, answer: bool = False) -> Standing:
        for episode in islice(self._episodes, movements):
            if episode.outcome is not None:
                self._landed.append(episode.outcome)
            if answer and self.parts.learner.idle:
                break
        if not self._life.replaying:
            self._life.commit()
        return self.standing()
