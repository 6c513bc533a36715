"""The run that is taught: its parts and its directory, what can be asked of it, and how it is taken back.

    run = TaughtRun(config, ask); run.keep(lesson); run.chart(lessons=1).mean_error; run.go_back(); run.close()
All of it happens in one thread, that of the learner; ``session.py`` says when.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.demonstrations.lessons import HandLesson, lesson_by_hand
from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.environments.protocol import Recorded
from sgimd_torch.files import write_bytes, write_json
from sgimd_torch.memory import Memory
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.process import Stopping, say
from sgimd_torch.runs.run import Life
from sgimd_torch.runs.tasks import correspondence_of, hand_led_of
from sgimd_torch.spaces import Array, Demonstration, Episode, stream
from sgimd_torch.teachers.by_hand import FOLDER, Ask, ByHand, GivenLesson, keep_lesson, lesson_path
from sgimd_torch.views.teach.chart import Chart, chart_of
from sgimd_torch.views.teach.trial import Trial, try_goal

KEPT: Final = "taken-back-"  # and a number: a copy of the run directory, as it was when a lesson was taken back
NO_MORE: Final = "it has made all its {0} movements; end this session, and go on with --movements {1}"


class TaughtRun:
    """A run on disk, open for lessons.

    Args:
        config: of the run; it goes on with what is in its directory.
        ask: asks the person who is there, for a learner that asks.

    Raises:
        ValueError: the run cannot be made, or its directory belongs to another one.
        OSError: a file of it cannot be read.
    """

    def __init__(self, config: Config, ask: Ask) -> None:
        self.config, self._ask = config, ask
        self._trials = 0
        self.open()

    @property
    def context(self) -> Array:
        """``(context_dim,)`` of maps, lessons and trials: the middle of C."""
        contexts = self.parts.environment.contexts
        return np.asarray((contexts.low + contexts.high) / 2)

    @property
    def cannot_be_taught(self) -> str:
        """Why the learner cannot be shown anything, "" if it can."""
        if self.parts.learner.social is not None or self.parts.teachers:
            return ""
        can = "sgim-d, practice-taught, imitation, observation and sgim-im can"
        return f"{self.config.algorithm} learns alone and cannot be shown anything; {can}: --algorithm sgim-d"

    def open(self) -> None:
        """Take the run as it is on disk; its movements are lived through again by ``life.episodes()``."""
        parts = build(self.config)
        assert parts.hand is not None
        self.hand: ByHand = parts.hand
        self.hand.ask = self._ask
        self.parts: RunParts = replace(parts, teacher=self.hand)
        self.directory = RunDirectory(self.parts, resume=(self.config.directory / "config.json").exists())
        say(*parts.notes, *self.directory.notes)
        self.life = Life(self.directory, self.parts, Stopping(), Seconds(self.directory.summary), None)

    def close(self) -> None:
        """Write what is left to write, and let others have the directory."""
        try:
            if not self.life.replaying:
                self.life.summarise(finished=self.life.movements == self.config.movements)
        finally:
            self.directory.__exit__()

    def flush(self) -> None:
        """Bring all movements to the disk, if any are not there yet."""
        if self.directory.summary.get("movements") != self.life.movements:
            self.life.summarise()

    def go_back(self) -> int:
        """Close the run, take back its last lesson, and open it again; the movements that are left."""
        last = self.hand.lessons[max(self.hand.lessons)]
        self.close()
        take_back(self.directory, last)
        self.open()
        return last.index

    def check(self, demonstration: Demonstration, *, asked: bool) -> None:
        """Refuse what cannot be shown now; ``asked``: the learner waits for an answer.

        Raises:
            ValueError: the learner cannot be taught, or cannot use this.
        """
        total = self.config.movements
        if self.cannot_be_taught:
            raise ValueError(self.cannot_be_taught)
        if self.life.movements >= total:
            raise ValueError(NO_MORE.format(total, 2 * total))
        if self.parts.teachers and not asked:
            raise ValueError("this learner takes a lesson only when it asks for one; wait until it asks, or save it")
        self.parts.environment.contexts.check("context of the lesson", demonstration.context)
        if asked:
            self.parts.environment.outcomes.check("outcome of the lesson", demonstration.outcome)
        self.parts.learner.translate(demonstration)

    def keep(self, lesson: GivenLesson) -> None:
        """Have a lesson shown: on disk first, so that a process that is killed now shows it when it goes on."""
        keep_lesson(self.directory.path / FOLDER, lesson)
        self.hand.add(lesson)
        self.life.add_demonstration(lesson.demonstration)
        self.life.summarise()

    def chart(self, lessons: int) -> Chart:
        """The map of what the learner can do now, after so many ``lessons``."""
        memory, robot = self.parts.learner.memory, self.parts.environment
        so_far = {"movements": self.life.movements, "lessons": lessons}
        return chart_of(memory, robot.outcomes, robot.rest, self.parts.benchmark, self.context, **so_far)

    def lesson_of(self, recording: Recording) -> HandLesson:
        """What a recording would teach.

        Raises:
            ValueError: the robot cannot make this movement.
        """
        task, robot = self.parts.task, self.parts.environment
        assert task is not None
        rng = stream(self.config.seed, "lessons", len(self.hand.lessons))
        return lesson_by_hand(recording, robot, correspondence_of(task), hand_led_of(task), rng, context=self.context)

    def try_goal(self, goal: Array) -> Trial:
        """See `sgimd_torch.views.teach.trial`; each trial has a noise of its own."""
        self._trials += 1
        return try_goal(self.parts, self.context, goal, stream(self.config.seed, "trials", self._trials))

    def recorded(self, episode: Episode) -> Recorded | None:
        """A movement that was made, as it was; None if the task has no picture, or the learner rested."""
        if episode.move is None or self.parts.record is None:
            return None
        rng = stream(self.config.seed, "environment", episode.index)
        return self.parts.record(episode.context, episode.move.theta, rng)

    def best_try(self, context: Array, goal: Array, memory: Memory) -> Recorded | None:
        """The remembered movement that came nearest to a goal; None without any, or without a picture."""
        if not len(memory) or self.parts.record is None:
            return None
        row = int(memory.near_outcomes(context, goal, 1)[0])
        return self.parts.record(memory.contexts[row], memory.thetas[row], stream(self.config.seed, "best try", row))


def take_back(directory: RunDirectory, lesson: GivenLesson) -> Path:
    """Let a run end before a lesson; the copy of what was there.

    Killed on the way, the run is as before, or it goes on with that lesson once more.

    Args:
        directory: of the run, which nobody writes in now.
        lesson: the last one.

    Raises:
        OSError: it cannot be written.
    """
    path, log = directory.path, directory.log
    copy = next(place for n in count() if not os.path.lexists(place := path / f"{KEPT}{n}"))
    partial = copy.with_name(f"{copy.name}.part")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(path, partial, ignore=shutil.ignore_patterns("lock", f"{KEPT}*"))
    os.replace(partial, copy)
    write_json(path / "summary.json", {**directory.summary, "movements": lesson.index, "finished": False})
    write_bytes(log.path, log.header + b"".join(log.read().lines[: lesson.index]))
    lesson_path(path / FOLDER, lesson).unlink()
    return copy
