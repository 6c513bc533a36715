"""The run that is taught: its parts and its record, what can be asked of it, and how a lesson is taken back.

    run = TaughtRun(config, ask); run.give(demonstration); run.chart().mean_error; run.take_back(); run.close()
All of it happens in one thread, that of the learner; ``session.py`` says when.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations.lessons import HandLesson, LedMovement, lesson_by_hand
from sgimd_torch.record import Record
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import FILE, holds_run
from sgimd_torch.runs.run import Life
from sgimd_torch.runs.tasks import correspondence_of, hand_led_of
from sgimd_torch.spaces import Array, Demonstration, stream
from sgimd_torch.teachers.by_hand import BY_HAND, Ask, ByHand
from sgimd_torch.views.teach.chart import Chart, chart_of

NO_MORE: Final = "it has made all its {0} movements; end this session, and go on with --movements {1}"


@dataclass(frozen=True, eq=False)
class Trial:
    """``goal`` and ``outcome`` ``(outcome_dim,)`` of the movement ``theta``, from which nothing was learnt."""

    goal: Array
    theta: Array
    outcome: Array

    @property
    def missed(self) -> float:
        """The distance from the goal to the outcome."""
        return float(np.linalg.norm(self.outcome - self.goal))


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

    def open(self) -> None:
        """Take the run as it is on disk; its movements are lived through again by ``life.episodes()``."""
        parts = build(self.config)
        asked = (each for each in parts.teachers.values() if isinstance(each, ByHand))
        self.hand = next(asked, ByHand(parts.teacher))
        self.hand.ask = self._ask
        self.parts: RunParts = replace(parts, teacher=self.hand)
        self.life = Life(self.parts, resume=holds_run(self.path))
        with Record(self.path) as record:
            places = lessons_among(record.events())
        self.lessons = [movement for movement, _ in places]
        """Before which movements a lesson was given by hand."""

    @property
    def path(self) -> Path:
        """Of the record."""
        return self.config.directory / FILE

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

    def close(self) -> None:
        """Write what is left to write, and let others have the directory."""
        self.life.close()

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
            raise ValueError("this learner takes a lesson only when it asks for one; wait until it asks")
        self.parts.environment.contexts.check("context of the lesson", demonstration.context)
        if asked:
            self.parts.environment.outcomes.check("outcome of the lesson", demonstration.outcome)
        self.parts.learner.translate(demonstration)

    def give(self, demonstration: Demonstration, *, asked: bool) -> None:
        """Have a lesson shown before the next movement; one that was ``asked`` for goes to who has asked."""
        self.lessons.append(self.life.movements)
        if not asked:
            self.hand.give(demonstration)

    def take_back(self) -> None:
        """Close the run, let its record end before the last lesson by hand, and open it again.

        A copy of the record as it was stays beside it. Killed on the way, the run is as before.

        Raises:
            OSError: the record cannot be written.
        """
        self.close()
        copy = next(place for n in count() if not (place := self.path.with_name(f"run.taken-back-{n}.sqlite")).exists())
        partial = copy.with_suffix(".part")
        shutil.copy(self.path, partial)
        os.replace(partial, copy)
        with Record(self.path, write=True) as record:
            record.rewrite(n_events=lessons_among(record.events())[-1][1]).close()
        self.open()

    def chart(self) -> Chart:
        """The map of what the learner can do now."""
        robot, memory = self.parts.environment, self.parts.learner.memory
        so_far = {"movements": self.life.movements, "lessons": len(self.lessons)}
        return chart_of(memory, robot.outcomes, robot.rest, self.parts.benchmark, self.context, **so_far)

    def lesson_of(self, recording: LedMovement) -> HandLesson:
        """What a recording would teach.

        Raises:
            ValueError: the robot cannot make this movement.
        """
        task, robot = self.parts.task, self.parts.environment
        rng = stream(self.config.seed, "lessons", len(self.lessons))
        return lesson_by_hand(recording, robot, correspondence_of(task), hand_led_of(task), rng, context=self.context)

    def try_goal(self, goal: Array) -> Trial:
        """Execute once what the run's inverse model infers for ``goal`` ``(outcome_dim,)``, with its own noise.

        Raises:
            ValueError: nothing is remembered yet, or the goal is not one of T.
        """
        parts = self.parts
        goal = parts.environment.outcomes.check("goal", goal, "a click beside the map?")
        if not len(parts.learner.memory):
            raise ValueError("it remembers no movement yet; let it move, or show it something first")
        self._trials += 1
        theta, rng = parts.answers["own"](self.context, goal).theta, stream(self.config.seed, "trials", self._trials)
        return Trial(goal, theta, parts.environment.execute(self.context, theta.copy(), rng))


def lessons_among(events: Iterable[Any]) -> list[tuple[int, int]]:
    """For each lesson by hand the numbers of movements, and of events, that came before it and the question for it."""
    found, movements, asked = list[tuple[int, int]](), 0, 0
    for k, event in enumerate(events):
        if event.kind in ("moved", "rested"):
            movements += 1
        elif event.kind == "shown" and event.who == BY_HAND:
            found.append((movements, k - asked))
        asked = event.kind == "asked"
    return found
