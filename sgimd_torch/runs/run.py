"""One life: replay what was recorded, live on, evaluate now and then, write everything to one run directory.

print(carry_out(build(Config(seed=3)), stopping, resume=False, accept_loss=False, again="sgimd run --seed 3 --resume"))
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import closing, nullcontext
from typing import TYPE_CHECKING

from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.evaluation import evaluate
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import OWN
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.log import Requests, RunError
from sgimd_torch.runs.model_record import RunModel
from sgimd_torch.runs.process import Failed, Progress, Stopped, Stopping, say
from sgimd_torch.session import ReplayError, live, replay, run
from sgimd_torch.spaces import Demonstration, Episode
from sgimd_torch.teachers.answering import Demonstrator
from sgimd_torch.teachers.awaited import Awaited
from sgimd_torch.teachers.by_hand import ByHand

if TYPE_CHECKING:
    from sgimd_torch.board.listener import BoardListener

FLUSH_EVERY = 1.0  # s, after which a finished movement hands over all before it; a killed run loses what came since


def carry_out(parts: RunParts, stopping: Stopping, *, resume: bool, accept_loss: bool, again: str) -> str:
    """Make a run, or go on with one; what came of it, in a line.

    Args:
        parts: of the run.
        stopping: says when a signal has come.
        resume: go on with what is there.
        accept_loss: also if movements are missing from its log.
        again: the command that goes on, for whoever stops it.

    Raises:
        ValueError, OSError: the request is wrong.
        Failed: it failed under way.
        Stopped: by a signal.
    """
    with RunDirectory(parts, resume=resume, accept_loss=accept_loss) as directory:
        say(*parts.notes, *directory.notes)
        try:
            return live_in(directory, parts, stopping)
        except Stopped:
            say(f"stopped after {directory.summary.get('movements', 0)} movements; to go on: {again}")
            raise
        except ReplayError as error:
            raise RunError(str(error)) from error
        except (SimulationError, ValueError) as error:
            raise Failed(str(error)) from error
        except OSError as error:
            either = f"{directory.path} cannot be written, or the robot failed"
            raise Failed(f"{either}: {type(error).__name__}: {error}; --resume goes on") from error


def live_in(directory: RunDirectory, parts: RunParts, stopping: Stopping) -> str:
    """Replay what the directory's log holds, live on to the end, and say what came out.

    Seconds: physics and evaluations of a resumed run add to those of its summary, which is at most ``FLUSH_EVERY`` old
    if it was killed; the learner's are counted from movement 0 on, since a replay lets it do all its work again.
    """
    seconds = Seconds(directory.summary)
    with closing(_board(directory, parts, seconds)) if parts.config.board else nullcontext() as board:
        life = Life(directory, parts, stopping, seconds, board)
        finished = False
        try:
            life.go_on()
            finished = True
        finally:
            if not life.replaying:  # else the summary that was found counts for more
                life.summarise(finished=finished)
    error, floor = (directory.summary[name] for name in ("mean_error_m", "noise_floor_m"))
    measured = "not measured" if floor is None or math.isnan(floor) else f"{floor:.4f} m"
    found = "not evaluated" if error is None else f"mean error {error:.4f} m, noise floor {measured}"
    return f"{directory.path}: {life.movements} movements, {found}"


def _board(directory: RunDirectory, parts: RunParts, seconds: Seconds) -> BoardListener:
    from sgimd_torch.board.listener import BoardListener  # loaded only when there is a board

    return BoardListener(directory.path, parts, seconds.summary)


class Life:
    """A run under way: after each movement it is written, shown, learnt from and evaluated, in this order."""

    def __init__(
        self,
        directory: RunDirectory,
        parts: RunParts,
        stopping: Stopping,
        seconds: Seconds,
        board: BoardListener | None,
    ) -> None:
        self.directory, self.parts, self.stopping, self.seconds, self.board = directory, parts, stopping, seconds, board
        model, trust = parts.model, parts.trust
        self.model = RunModel(directory.path, model, trust.error) if model and trust else None
        robot = parts.environment
        self.requests = Requests(directory.path, robot.contexts.dim + robot.outcomes.dim)
        self.movements, self.recorded = 0, len(directory.lines)
        self._wanted = set(parts.config.evaluations)
        self._rows = {id(demonstration): row for row, demonstration in enumerate(parts.demonstrations)}
        self._played = {shown.trajectory.tobytes(): row for row, shown in enumerate(parts.demonstrations)}
        self._flushed = time.monotonic()

    @property
    def replaying(self) -> bool:
        """Whether what was recorded is not lived through again yet."""
        return self.movements < self.recorded

    def go_on(self) -> None:
        """From the first movement to the last."""
        total, title = self.parts.config.movements, self.parts.config.title
        with Progress("replaying" if self.recorded else title, self.recorded or total) as progress:
            for _ in self.episodes():
                error = self.directory.evaluations.last.get("mean_error_m")
                progress.show(self.movements, "" if error is None else f"error {error:.4f} m")
                if self.movements == self.recorded < total:
                    progress.begin(title, total, self.movements)
                self.stopping.check()
        if self.model is not None:
            say(*self.model.news(ended=True))

    def episodes(self) -> Iterator[Episode]:
        """The same, one movement after the other; each is written, shown and learnt from when it comes."""
        parts, total, seed = self.parts, self.parts.config.movements, self.parts.config.seed
        recorded = self.directory.columns.recorded(self.directory.lines)
        alive = self.stopping.at_once(2)(live(parts.environment, seed))
        execute = replay(recorded, self.seconds.of("physics")(alive))
        on_record = self.requests.answers(parts.teachers, self._row)
        episodes = run(
            parts.learner,
            parts.environment,
            seed,
            movements=total,
            teacher=parts.teacher,
            teachers={name: self._awaited(name, each) for name, each in parts.teachers.items()},
            execute=execute,
            answers={request: found for request, found in on_record.items() if request[0] < self.recorded},
        )
        if not recorded:
            self._begin()
        for episode in self.seconds.of_learner(episodes):
            self._after(episode)
            yield episode

    def _awaited(self, name: str, teacher: Demonstrator) -> Demonstrator:
        """A person who teaches by hand is waited for by the page that they see."""
        if isinstance(teacher, ByHand):
            return teacher
        return Awaited(name, teacher, patience=self.parts.config.patience, say=say, waiting=self.stopping.at_once)

    def add_demonstration(self, shown: Demonstration) -> None:
        """One more that the learner may be shown: the log knows it by the next row."""
        self._rows[id(shown)] = len(self._rows)

    def summarise(self, *, finished: bool = False) -> None:
        """Hand everything to the operating system, and say how far it is."""
        self._flush()
        last = self.directory.evaluations.last
        self.directory.summarise(
            movements=self.movements,
            mean_error_m=last.get("mean_error_m"),
            noise_floor_m=last.get("noise_floor_m"),
            **self.seconds.summary(),
            **({} if self.model is None else self.model.summary()),
            finished=finished,
        )

    def _after(self, episode: Episode) -> None:
        self._write(episode)
        self.movements = episode.index + 1
        curves = {} if self.model is None else self.model.episode(episode, self.parts.learner.memory)
        if self.board is not None:
            self.board.episode(episode, replayed=episode.index < self.recorded)
            self.board.model(curves)
        if self.movements in self._wanted:
            self._evaluate()
        if self.movements == self.recorded:
            self._begin()
        if self.movements > self.recorded and time.monotonic() - self._flushed >= FLUSH_EVERY:
            self.summarise()
            self._flushed = time.monotonic()
        if self.model is not None and not self.replaying:
            say(*self.model.news())

    def _write(self, episode: Episode) -> None:
        """A line for the log; one that is there already must be the same."""
        shown, columns = episode.demonstration, self.directory.columns
        row = None if shown is None else self._row(shown)
        line = columns.line(episode, row)
        self.requests.add(episode, row)
        if episode.index >= self.recorded:
            self.directory.log.append(line)
        elif line != self.directory.lines[episode.index]:
            raise ReplayError(columns.difference(self.directory.lines[episode.index], line))

    def _row(self, shown: Demonstration) -> int | None:
        """In the file; also of one with another label, None of one that is not there."""
        return self._rows.get(id(shown), self._played.get(shown.trajectory.tobytes()))

    def _evaluate(self) -> None:
        """Evaluate the learner as it is now by each of its answers, with streams that the run does not use; unless it
        was done before, and there is no board to tell. All answers get the same noise, goal by goal; of the run's own
        it is measured, too. Without an exemplar there is nothing to infer a movement from, so there is no evaluation:
        the learner by observation has none before its first demonstration."""
        parts, config, evaluations = self.parts, self.parts.config, self.directory.evaluations
        if self.movements in evaluations and self.board is None:
            return
        self._flush()
        if len(parts.learner.memory) == 0:
            return
        repeats = config.repeats if config.floor_at is None or self.movements in config.floor_at else 0
        judged = (parts.environment, parts.benchmark.goals, config.seed, self.movements)
        with self.seconds.of("evaluation"), self.stopping.at_once():
            found = {OWN: evaluate(parts.inverse, *judged, repeats=repeats)}
            for answer, inverse in parts.answers.items():
                if answer != OWN:
                    same = inverse is parts.inverse
                    found[answer] = found[OWN].without_noise if same else evaluate(inverse, *judged, repeats=0)
        if self.board is not None:
            self.board.evaluated(self.movements, found)
            self.board.flush()
        with self.seconds.of("evaluation"):
            evaluations.add(self.movements, found, parts.benchmark.side / 2, parts.regions)

    def _begin(self) -> None:
        """The replay is over: from now on files change."""
        for each in (self.directory, self.model, self.board):
            if each is not None:
                each.begin()

    def _flush(self) -> None:
        """The board and requests first: of a movement that the log holds, a replay does not know again when it was,
        nor who did not answer in time."""
        if not self.replaying:
            self.requests.write(getattr(self.parts.learner.autonomous, "brought", ()))
        for each in (self.board, self.directory.log, self.model):
            if each is not None:
                each.flush()
