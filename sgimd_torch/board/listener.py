"""A listener that writes the board of a run for TensorBoard. Steps are movements.

A resumed run first tells its listeners its whole record. So the board is written anew, and holds each point once.
    board = BoardListener(folder, parts, seconds); board.episode(episode, replayed=False); board.flush(); board.close()
``tensorboard --logdir RUNS`` shows it.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from tensorboardX import summary
from tensorboardX.event_file_writer import EventsWriter
from tensorboardX.proto.event_pb2 import Event, SessionLog
from tensorboardX.proto.summary_pb2 import Summary

from sgimd_torch.board.curves import Behaviour, Places, evaluation_curves, region_curves
from sgimd_torch.board.legend import as_markdown, meaning_of
from sgimd_torch.evaluation import Benchmark, Evaluation
from sgimd_torch.options.config import Config, dashed
from sgimd_torch.runs.directory import not_compared
from sgimd_torch.runs.hooks import Listener
from sgimd_torch.spaces import Array, Box, Episode
from sgimd_torch.texts import as_text

EVERY: Final = 50  # number of movements from one point of a curve to the next
BINS: Final = 30  # number of bins of a histogram, over T
MOST_TOLD: Final = 10  # largest number of reasons for failures that are told
COLUMNS: Final = ("algorithm", "environment", "seed", "inverse", "search", "goals", "memory", "explore", "social")
"""Columns that every run has in the table of hyperparameters."""


class EventFile:
    """An event file: summaries wait in memory until ``begin``, which replaces earlier event files of the ``folder``.

    It uses tensorboardX's `EventsWriter`, not `SummaryWriter`, which writes in a thread, so a full disk would not stop
    the run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # An open TensorBoard drops the points of earlier files when it reads this event.
        self._waiting = [Event(session_log=SessionLog(status=SessionLog.START))]
        self._writer: EventsWriter | None = None

    def begin(self) -> None:
        """Write the waiting summaries to a new file, then remove the earlier files.

        The new file has a new name, because an open TensorBoard does not read a file of a known name again.

        Raises:
            OSError: the folder cannot be written.
        """
        earlier = sorted(self._folder.glob("events.out.tfevents.*"))
        self._writer = EventsWriter(str(self._folder / "events"), f".{time.time_ns()}")
        for event in self._waiting:
            self._writer.write_event(event)
        self._waiting.clear()
        self.flush()
        for path in earlier:
            path.unlink(missing_ok=True)

    def add(self, step: int, summary: Summary) -> None:
        """Add a summary at a step; before ``begin`` it waits in memory."""
        event = Event(step=step, wall_time=time.time(), summary=summary)
        if self._writer is None:
            self._waiting.append(event)
        else:
            self._writer.write_event(event)

    def flush(self) -> None:
        """Bring all written summaries to the disk; before ``begin``, do nothing."""
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        """Flush and close the file; if ``begin`` was not called, the earlier event files stay."""
        if self._writer is not None:
            self._writer.close()


class BoardListener(EventFile, Listener):
    """A listener that writes the curves of a run.

    Args:
        folder: folder of the run; its event files do not change before ``begin``, the end of a replay.
        parts: parts of the run; only config, environment, learner and benchmark are used.
        seconds: function that returns the seconds spent so far, by part of the run.
        curves: function that returns the new numbers of other listeners for the board, by tag.

    Attributes:
        behaviour: counts of movements, goals and demonstrations so far.
        hparams: options of the run, as `hparams_of` has them.
        trackers: functions that get each point of the curves, too: number of movements, and values by tag.
    """

    def __init__(
        self,
        folder: Path,
        parts: Any,
        seconds: Callable[[], Mapping[str, float]],
        curves: Callable[[], Mapping[str, float]],
    ) -> None:
        super().__init__(folder)
        self._config, self._learner, self._seconds, self._curves = parts.config, parts.learner, seconds, curves
        self._space: Box = parts.environment.outcomes
        self._benchmark: Benchmark = parts.benchmark
        self.behaviour = Behaviour(self._space, parts.learner.problem.tolerance, parts.robots)
        self._places = Places(parts.benchmark, parts.learner.problem)
        self._movements = self._changes = self._failed = 0
        self.trackers: list[Callable[[int, Mapping[str, float]], object]] = []
        self._explained: set[str] = set()
        # The result on TensorBoard's page of hyperparameters.
        result = "error/mean" if parts.config.evaluations else "goals/missed_by"
        self.hparams = hparams_of(parts.config)
        names, values, _ = summary.hparams(self.hparams, {result: math.nan})  # the third marks the end
        self.add(0, names)
        self.add(0, values)
        self.add(0, summary.text("about/legend", as_markdown(self._space.unit)))

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Count a movement; after every 50th movement the curves get a point. Replayed movements have no times."""
        self._movements = episode.index + 1
        self.behaviour.episode(episode)
        if self._movements % EVERY == 0:
            self._point()
            if not replayed:
                self._scalars({f"time/{name.removeprefix('seconds_')}": s for name, s in self._seconds().items()})
        if curves := self._curves():
            self._scalars(curves)
        for change in self._learner.changes[self._changes :]:
            self.add(self._movements, summary.text("about/changes", str(change)))
        self._changes = len(self._learner.changes)

    def evaluated(self, movements: int, evaluations: Mapping[str, Evaluation]) -> None:
        """Show an evaluation; of inverse models other than the run's own, show only the mean error."""
        own = evaluations["own"]
        others = {f"error/by_{name}": other.mean_error for name, other in evaluations.items() if name != "own"}
        tiles = self._places.curves(own.errors)
        self._scalars({**evaluation_curves(own, self._benchmark.side / 2), **others, **tiles})

    def _point(self) -> None:
        """Add a point to the curves that need no evaluation, and to the histograms."""
        behaviour, places = self.behaviour, self._places
        self._show("histograms", self._histograms("goals", [*behaviour.goals.values()]))
        self._show("histograms", self._histograms("outcomes", behaviour.outcomes))
        places.add(behaviour.outcomes)
        tiles = {} if self._config.evaluations else places.curves(places.missed)
        known = {**behaviour.curves(), **region_curves(self._learner.regions), "outcomes/coverage": places.coverage}
        self._scalars({**known, **tiles})
        if (n := behaviour.failures.total()) > self._failed:
            self._failed = n
            told = "\n".join(f"- {times} times: {why}" for why, times in behaviour.failures.most_common(MOST_TOLD))
            self.add(self._movements, summary.text("about/failures", told))

    def _histograms(self, kind: str, points: Sequence[Array]) -> dict[str, Any]:
        """Histograms of ``points``, each ``(outcome_dim,)``, by tag; points outside T count at its border."""
        space, made = self._space, {}
        for k in range(space.dim if points else 0):
            bins = np.linspace(space.low[k], space.high[k], BINS + 1)
            values = np.clip([point[k] for point in points], bins[0], bins[-1])
            tag = f"{kind}/{space.names[k] if space.names else k}"
            made[tag] = summary.histogram(tag, values, bins).value[0]
        return made

    def show_pictures(self, pictures: Mapping[str, NDArray[np.uint8]]) -> None:
        """Add pictures ``(height, width, 4)`` by tag, at the last movement."""
        made = {tag: summary.image(tag, picture, dataformats="HWC").value[0] for tag, picture in pictures.items()}
        self._show("images", made)

    def _scalars(self, values: Mapping[str, float]) -> None:
        """Add a point to each curve; ``values`` are by tag, and values that are not finite are left out."""
        finite = {tag: value for tag, value in values.items() if math.isfinite(value)}
        names = {tag: re.sub(r"[^-/\w., ]", "_", tag) for tag in finite}
        self._show("scalars", {tag: Summary.Value(tag=names[tag], simple_value=finite[tag]) for tag in finite})
        for tracker in self.trackers:
            tracker(self._movements, {names[tag]: value for tag, value in finite.items()})

    def _show(self, plugin: str, values: Mapping[str, Any]) -> None:
        """Add values to TensorBoard's page ``plugin``, in one event; the first one of a tag carries its explanation."""
        for tag, value in values.items():
            if tag not in self._explained:
                self._explained.add(tag)
                value.metadata.summary_description = meaning_of(tag, self._space.unit)
                value.metadata.plugin_data.plugin_name = plugin
        if values:
            self.add(self._movements, Summary(value=[*values.values()]))


def hparams_of(config: Config) -> dict[str, bool | float | str]:
    """Options of a run for TensorBoard's page of hyperparameters, by their names on the command line.

    TensorBoard shows the columns of the first run only. So each run has the same `COLUMNS`, the options in the name of
    its variant, such as "sgim-d,budget=5", which a sweep varies, and "changed", all other options that differ from
    their defaults.
    """
    settings = {dashed(name): value for name, value in config.settings.items()}
    varied = re.findall(r"(?:^|,)([\w.-]+)=", config.variant)
    columns = dict.fromkeys([*COLUMNS, *(name for name in varied if name in settings)])
    changed = [dashed(name) for name in dict(config.parts) if name not in not_compared()]
    others = [f"{name}={as_text(settings[name])}" for name in changed if name not in columns]
    values = {name: settings.get(name, "none") for name in columns} | {"changed": " ".join(others) or "nothing"}
    return {name: v if isinstance(v, bool | int | float | str) else as_text(v) for name, v in values.items()}
