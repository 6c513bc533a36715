"""One life: replay what was recorded, live on, evaluate now and then, write everything to one run directory.

print(carry_out(Config(seed=3), resume=False, accept_loss=False, again="sgimd run --seed 3 --resume"))
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import platform
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

import sgimd_torch
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.evaluation import Evaluation, evaluate
from sgimd_torch.goals.regions import Region
from sgimd_torch.runs.board import RunBoard
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import Config, having
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.log import Columns, RunError
from sgimd_torch.runs.model_record import RunModel
from sgimd_torch.runs.process import Failed, Progress, Stopped, Stopping, say
from sgimd_torch.runs.tables import OWN
from sgimd_torch.session import ReplayError, live, replay, run
from sgimd_torch.spaces import Episode

# Files count by their content, of which a checksum is recorded; a benchmark may be another one when a run is resumed.
MAY_CHANGE: Final = (*having("on_resume"), "benchmark_crc32")
EVALUATION_SETTINGS: Final = (*having("evaluates"), "benchmark_crc32")  # all evaluations of a run share these
FLUSH_EVERY = 1.0  # s, what a killed run loses at most


def carry_out(config: Config, *, resume: bool, accept_loss: bool, again: str) -> str:
    """Make a run, or go on with one; what came of it, in a line.

    Args:
        config: of the run.
        resume: go on with what is there.
        accept_loss: also if movements are missing from its log.
        again: the command that goes on, for whoever stops it.

    Raises:
        ValueError, OSError: the request is wrong.
        Failed: it failed under way.
        Stopped: by a signal.
    """
    with Stopping() as stopping:
        with stopping.at_once():
            parts = build(config)
        directory = open_directory(config, parts, resume, accept_loss=accept_loss)
        try:
            with directory:
                say(*config.without_effect, *parts.notes, *directory.notes, *correspondence_of(parts))
                return run_in(directory, config, parts, stopping)
        except Stopped:
            say(f"stopped after {directory.summary.get('movements', 0)} movements; to go on: {again}")
            raise
        except ReplayError as error:
            raise RunError(str(error)) from error
        except (SimulationError, ValueError) as error:
            raise Failed(str(error)) from error
        except OSError as error:
            raise Failed(f"{directory.path} cannot be written: {error}; is the disk full? --resume goes on") from error


def run_in(directory: RunDirectory, config: Config, parts: RunParts, stopping: Stopping) -> str:
    """Replay what the directory's log holds, live on to the end, and say what came out.

    Seconds: physics and evaluations of a resumed run add to those of its summary, which is at most ``FLUSH_EVERY`` old
    if it was killed; the learner's are counted from movement 0 on, since a replay lets it do all its work again.
    """
    seconds = Seconds(directory.summary)
    with RunBoard(directory, config, parts, seconds, partial(regions_of, parts)) as board:
        life = _Life(directory, config, parts, seconds, board)
        finished = False
        try:
            life.go_on(stopping)
            finished = True
        finally:
            if not life.replaying:  # else the summary that was found counts for more
                life.summarise(finished=finished)
    error, floor = (directory.summary[name] for name in ("mean_error_m", "noise_floor_m"))
    measured = "not measured" if floor is None or math.isnan(floor) else f"{floor:.4f} m"
    found = "not evaluated" if error is None else f"mean error {error:.4f} m, noise floor {measured}"
    return f"{directory.path}: {life.movements} movements, {found}"


class _Life:
    """A run under way: after each movement it is written, shown, learnt from and evaluated, in this order."""

    def __init__(
        self, directory: RunDirectory, config: Config, parts: RunParts, seconds: Seconds, board: RunBoard
    ) -> None:
        self.directory, self.config, self.parts, self.seconds, self.board = directory, config, parts, seconds, board
        self.model = RunModel(directory, parts.model, 0.0 if parts.trust is None else parts.trust.error)
        self.movements, self.recorded = 0, len(directory.lines)
        self._wanted = set(config.evaluations)
        self._rows = {id(demonstration): row for row, demonstration in enumerate(parts.demonstrations)}
        self._flushed = time.monotonic()

    @property
    def replaying(self) -> bool:
        """Whether what was recorded is not lived through again yet."""
        return self.movements < self.recorded

    def go_on(self, stopping: Stopping) -> None:
        """From the first movement to the last."""
        recorded = self.directory.columns.recorded(self.directory.lines)
        execute = replay(recorded, self.seconds.of_physics(live(self.parts.environment, self.config.seed)))
        learner, robot, total = self.parts.learner, self.parts.environment, self.config.movements
        episodes = run(learner, robot, self.config.seed, movements=total, teacher=self.parts.teacher, execute=execute)
        title = f"{self.config.variant} seed {self.config.seed}"
        with Progress("replaying" if recorded else title, self.recorded or total) as progress:
            if not recorded:
                self._begin()
            for episode in self.seconds.of_learner(episodes):
                self._after(episode, stopping)
                progress.show(self.movements, _error_so_far(self.directory))
                if self.movements == self.recorded < total:
                    progress.begin(title, total, self.movements)
                stopping.check()
        say(*self.model.news(ended=True))
        self.board.finish()

    def summarise(self, *, finished: bool = False) -> None:
        """Hand everything to the operating system, and say how far it is."""
        self._flush()
        self.model.flush()
        last = self.directory.evaluations.last
        self.directory.summarise(
            movements=self.movements,
            mean_error_m=last.get("mean_error_m"),
            noise_floor_m=last.get("noise_floor_m"),
            **self.seconds.summary(),
            **self.model.summary(),
            finished=finished,
        )

    def _after(self, episode: Episode, stopping: Stopping) -> None:
        self._write(episode)
        self.movements = episode.index + 1
        self.board.episode(episode)
        if self.model.episode(episode, self.parts.learner.memory):
            self.board.model(self.model.curves)
        if self.movements in self._wanted:
            self._evaluate(stopping)
        if self.movements == self.recorded:
            self._begin()
        if self.movements > self.recorded and time.monotonic() - self._flushed >= FLUSH_EVERY:
            self.summarise()
            self._flushed = time.monotonic()
        if not self.replaying:
            say(*self.model.news())

    def _write(self, episode: Episode) -> None:
        """A line for the log; one that is there already must be the same."""
        shown, columns = episode.demonstration, self.directory.columns
        line = columns.line(episode, None if shown is None else self._rows[id(shown)])
        if episode.index >= self.recorded:
            self.directory.log.append(line)
        elif line != self.directory.lines[episode.index]:
            raise ReplayError(_differs(columns, self.directory.lines[episode.index], line))

    def _evaluate(self, stopping: Stopping) -> None:
        """Unless it was done, and shown, before."""
        if self.movements in self.directory.evaluations and self.board.recall_evaluation():
            return
        self._flush()
        with self.seconds.of_evaluation():
            found = evaluate_in(self.config, self.parts, self.movements, stopping)
        if found is not None:
            self.board.evaluation(found)
            with self.seconds.of_evaluation():
                near = self.parts.benchmark.side / 2
                self.directory.evaluations.add(self.movements, found, near, regions_of(self.parts))

    def _begin(self) -> None:
        """The replay is over: from now on files change."""
        self.directory.begin()
        self.model.begin()
        self.board.begin()

    def _flush(self) -> None:
        self.board.flush()  # first: of a movement that the log holds, a replay does not know again when it was
        self.directory.log.flush()


def _error_so_far(directory: RunDirectory) -> str:
    """Of the last evaluation, for the line of progress."""
    error = directory.evaluations.last.get("mean_error_m")
    return "" if error is None else f"error {error:.4f} m"


def evaluate_in(config: Config, parts: RunParts, movements: int, stopping: Stopping) -> dict[str, Evaluation] | None:
    """Evaluate the learner as it is now by each of its answers, with streams that the run does not use.

    All answers are executed with the same noise, goal by goal; only of the run's own the noise is measured.
    Before its first exemplar there is nothing to infer a movement from, as for the learner by observation before its
    first demonstration: such an evaluation is left out.
    """
    if len(parts.learner.memory) == 0:
        return None
    goals = parts.benchmark.goals
    repeats = config.repeats if config.floor_at is None or movements in config.floor_at else 0
    found: dict[str, Evaluation] = {}
    with stopping.at_once():
        judged = partial(evaluate, environment=parts.environment, goals=goals, seed=config.seed, movements=movements)
        for answer, inverse in parts.answers.items():
            again = answer != OWN and inverse is parts.inverse
            found[answer] = found[OWN] if again else judged(inverse, repeats=repeats if answer == OWN else 0)
    return found


def correspondence_of(parts: RunParts) -> list[str]:
    """How well the robot can play what it will be shown; nothing for who learns alone."""
    if not parts.residuals:
        return []
    median, worst = np.median(parts.residuals), max(parts.residuals)
    n = len(parts.residuals)
    return [
        f"{n} demonstrations; correspondence misses them by {median:.4f} rad (median), {worst:.4f} rad at most",
        *_outside(parts),
    ]


def _outside(parts: RunParts) -> list[str]:
    box, shown = parts.environment.outcomes, parts.demonstrations
    outside = [row for row, demonstration in enumerate(shown) if not box.contains(demonstration.outcome)]
    if not outside:
        return []
    place = ", ".join(f"{x:g}" for x in shown[outside[0]].outcome)
    more = f", as do {len(outside) - 1} more" if len(outside) > 1 else ""
    return [f"recording {outside[0]} lands at ({place}) m, outside T{more}; were they recorded in cm?"]


def regions_of(parts: RunParts) -> list[Region]:
    """Of the learner's goal model, whichever it is; none if it has no regions."""
    goals = getattr(parts.learner.autonomous, "goals", None)
    return list(getattr(goals, "regions", ()))


def open_directory(config: Config, parts: RunParts, resume: bool, *, accept_loss: bool = False) -> RunDirectory:
    """The directory of this run; of an earlier part's evaluations it keeps those that the whole run would have.

    Raises:
        RunError: see ``RunDirectory``; or its log is longer than the run is to be.
    """
    environment, regions = parts.environment, regions_of(parts)
    settings = json.loads(json.dumps({**vars(config), **parts.data}, default=str))  # as they will read back
    directory = RunDirectory(
        config.directory,
        settings,
        free=MAY_CHANGE,
        columns=Columns(environment.contexts.dim, environment.policies.dim, environment.outcomes.dim),
        region_dims=len(regions[0].low) if regions else None,
        versions=versions(),
        resume=resume,
        movements=config.movements,
        accept_loss=accept_loss,
    )
    same = directory.before is not None and all(
        directory.before.get(key) == settings[key] for key in EVALUATION_SETTINGS
    )
    kept = [m for m in config.evaluations if same and m <= len(directory.lines)]
    directory.evaluations.keep(kept, config.answered)
    return directory


def versions() -> dict[str, Any]:
    """What runs here; ``commit`` is None outside a git repository and ends in "-dirty" when files were changed."""
    packages = {"numpy": "numpy", "scipy": "scipy", "faiss": "faiss-cpu", "mujoco": "mujoco"}
    here = str(Path(__file__).parent)
    describe = ["git", "-C", here, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        commit = subprocess.run(describe, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        commit = None
    return {
        "python": platform.python_version(),
        **{name: importlib.metadata.version(package) for name, package in packages.items()},
        "sgimd_torch": sgimd_torch.__version__,
        "platform": platform.platform(),
        "commit": commit,
    }


def _differs(columns: Columns, recorded: bytes, now: bytes) -> str:
    """Of two lines: which columns differ, the first three in full."""
    were, are = (line.decode().split(",")[:-1] for line in (recorded, now))
    differences = [
        f"{name} was {old or 'empty'}, now {new or 'empty'}"
        for name, old, new in zip(columns.names, were, are, strict=True)
        if old != new
    ]
    more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
    return (
        f"movement {were[0]} is replayed otherwise than recorded: {'; '.join(differences[:3])}{more}. "
        "Was it recorded by another version, or on another processor?"
    )
