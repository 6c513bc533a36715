"""A run with lessons by hand: the learner moves by itself, gets lessons, and reports its status.

    run = TaughtRun(config); run.go_on(20); run.show(demonstration); run.status().chart.mean_distance; run.close()
Only one thread at a time may use a `TaughtRun`. ``sgimd run --resume`` can continue the run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

from sgimd_torch.extras.teach.by_hand import BY_HAND, ByHand
from sgimd_torch.extras.teach.chart import Chart, chart_of
from sgimd_torch.extras.teach.led import hand_led_of
from sgimd_torch.extras.teach.lessons import HandLesson, lesson_by_hand
from sgimd_torch.options.config import Config
from sgimd_torch.runs.directory import build_again, record_of
from sgimd_torch.runs.run import RunLoop
from sgimd_torch.spaces import Array, Demonstration, stream

LATEST: Final = 60  # number of latest outcomes that the page draws
IMITATIONS: Final = 10  # largest number of movements that imitate a lesson at once
NO_MORE: Final = "the learner has made all its {0} movements; end this session, and go on with --movements {1}"
ALONE: Final = (
    "{0} cannot be taught by hand, as it learns alone or asks its teachers; sgimd teach begins with practice-taught; "
    "sgim-d, imitation and observation can be taught, too"
)


@dataclass(frozen=True, eq=False)
class Status:
    """The status of a taught run.

    Attributes:
        movements: movements so far.
        lessons: lessons by hand so far.
        replaying: whether the recorded movements are still being replayed.
        outcomes: ``(n, outcome_dim)`` latest outcomes.
        chart: map of the distances to the nearest outcomes.
    """

    movements: int
    lessons: int
    replaying: bool
    outcomes: Array
    chart: Chart


class TaughtRun:
    """A run on disk, open for lessons. Recorded movements are replayed first.

    Args:
        config: settings of the run.

    Attributes:
        config: settings of the run, with what its robot found by movements.
        parts: parts of the run; its teacher is `ByHand`.
        led: the robot as a hand leads it.

    Raises:
        ValueError: the run cannot be made, its learner or its robot cannot be taught by hand, or its directory belongs
            to another run; nothing is written then.
        OSError: a file of the run cannot be read.
    """

    def __init__(self, config: Config) -> None:
        record = record_of(config)
        parts = build_again(config, record)
        self.config, self.led = parts.config, hand_led_of(parts.task)
        if parts.learner.social is None or parts.teachers:
            raise ValueError(ALONE.format(config.algorithm))
        self._hand = ByHand(teacher=parts.teacher)
        self.parts = replace(parts, teacher=self._hand)
        self._loop = RunLoop(self.parts, resume=record is not None)
        self._episodes = self._loop.episodes()
        self._lessons = sum(event.kind == "shown" and event.who == BY_HAND for event in self._loop.record.events())

    def go_on(self, movements: int, *, until_idle: bool = False) -> Status:
        """Let the learner make further movements, or replay recorded ones.

        Args:
            movements: largest number of movements; fewer are made if the run ends.
            until_idle: whether to stop as soon as the learner is between two attempts.

        Raises:
            SimulationError, ReplayError, ValueError, OSError: as ``sgimd run``.
        """
        for _ in islice(self._episodes, movements):
            if until_idle and self.parts.learner.idle:
                break
        if not self._loop.replaying:
            self._loop.commit()
        return self.status()

    def give(self, demonstration: Demonstration) -> None:
        """Offer a lesson before the next movement.

        Raises:
            ValueError: the learner cannot use this lesson, or not now; nothing has changed then.
        """
        total = self.config.movements
        if self._loop.replaying:
            raise ValueError("the run still replays its record; a lesson must wait until that is done")
        if self._loop.movements >= total:
            raise ValueError(NO_MORE.format(total, 2 * total))
        self.parts.environment.contexts.check("context of the lesson", demonstration.context)
        self.parts.learner.translate(demonstration)
        self._hand.give(demonstration)
        self._lessons += 1

    def imitate(self) -> Status:
        """Let the learner imitate the given lesson."""
        return self.go_on(IMITATIONS, until_idle=True)

    def show(self, demonstration: Demonstration) -> Status:
        """Give a lesson and let the learner imitate it; raises what `give` and `go_on` raise."""
        self.give(demonstration)
        return self.imitate()

    def lesson_of(self, times: Array, joints: Array) -> HandLesson:
        """Make a lesson of a recording for this learner; see `lesson_by_hand`."""
        return lesson_by_hand(times, joints, self.parts.task, stream(self.config.seed, "lessons", self._lessons))

    def status(self) -> Status:
        """The present status."""
        robot, memory = self.parts.environment, self.parts.learner.memory
        chart = chart_of(robot, memory, self.parts.benchmark)
        return Status(self._loop.movements, self._lessons, self._loop.replaying, memory.outcomes[-LATEST:], chart)

    def close(self) -> None:
        """Write the rest of the record, and release the directory for other processes."""
        self._loop.close()
