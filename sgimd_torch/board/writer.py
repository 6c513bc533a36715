"""A TensorBoard board: where is the robot competent, where does it make progress, what did its teacher do?

Called from the caller's loop, which it does not change; steps are movements. ``scalars.py`` says what is shown.
    with Board("runs/mine", environment.outcomes) as board:
        for episode in run(...):
            board.episode(episode)
            if board.due:
                board.regions(interest_map.regions)
"""

from __future__ import annotations

import math
import os
import struct
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary, SummaryMetadata
from tensorboard.compat.proto.tensor_pb2 import TensorProto
from tensorboard.compat.proto.tensor_shape_pb2 import TensorShapeProto
from tensorboard.compat.proto.types_pb2 import DT_FLOAT, DT_STRING
from tensorboard.compat.tensorflow_stub.pywrap_tensorflow import masked_crc32c
from tensorboard.plugins.custom_scalar import layout_pb2
from tensorboard.plugins.custom_scalar import metadata as layout_metadata
from tensorboard.plugins.hparams import api_pb2, plugin_data_pb2
from tensorboard.plugins.hparams import metadata as hparams_metadata
from tensorboard.summary.writer.record_writer import RecordWriter

from sgimd_torch.board.scalars import LEGEND, METRICS, Curves, layout_of
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box, Episode

_NAME: Final = "events.out.tfevents."  # TensorBoard looks for the last part


class Board:
    """What one run shows, in one event file in its directory.

    Args:
        directory: of the run, made if missing.
        grid: the part of T that is cut into cells, the same for runs to be compared.
        tolerance: distance (m) at which a goal counts as reached.
        near: distance (m) at which a goal of the benchmark counts as met.
        every: movements from one point of a curve to the next.
        depth: regions have curves of their own down to this level of the tree, 15 at most with 3.
        legend: a sentence for each tag that you add, or for the part of it before the slash.
        layout: the charts of the tab Custom Scalars, category -> chart -> tag, a regular expression; None for those of
            ``layout_of``.
        replace: the run is replayed, and its event files are to be replaced by the first ``publish``.

    Raises:
        ValueError: ``every`` is below 1; or there are event files, and ``replace`` is False.
        OSError: the directory cannot be written.
    """

    def __init__(
        self,
        directory: str | os.PathLike[str],
        grid: Box,
        *,
        tolerance: float = 0.02,
        near: float = 0.05,
        every: int = 50,
        depth: int = 3,
        legend: Mapping[str, str] | None = None,
        layout: Mapping[str, Mapping[str, str]] | None = None,
        replace: bool = False,
    ) -> None:
        if every < 1:
            raise ValueError(f"every must be at least one movement, got {every}")
        if not replace and any(Path(directory).glob(f"{_NAME}*")):
            raise ValueError(f"{directory} holds the board of a run already; give this one another directory")
        self.every, self.movements = every, 0
        self.legend = {**LEGEND, "about": "What this run is, and how to read its board.", **(legend or {})}
        self.curves = Curves(grid, tolerance=tolerance, near=near, depth=depth)
        self.layout = layout_of(self.curves.places.names, near) if layout is None else layout
        self._explained: set[str] = set()
        self._file = _EventFile(Path(directory))
        if not replace:
            self.publish()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def due(self) -> bool:
        """Whether the curves get a point at this movement."""
        return self.movements > 0 and self.movements % self.every == 0

    def episode(self, episode: Episode) -> None:
        """Count a movement; if a point is ``due``, regimes, goals and demonstrations get theirs."""
        self.curves.episode(episode)
        self.movements = episode.index + 1
        if self.due:
            self.scalars(self.curves.of_behaviour())

    def regions(self, regions: Sequence[Region]) -> None:
        """A point for all curves of the interest map, given its leaves; none for a learner that has no such map."""
        if regions:
            self.scalars(self.curves.of_regions(regions))

    def evaluation(self, goals: Array, errors: Array, noise_floor: float) -> None:
        """A point for the error: on ``goals`` ``(n, outcome_dim)``, of ``errors`` ``(n,)``, all in m."""
        values = self.curves.of_evaluation(goals, errors, noise_floor)
        self.curves.evaluated(self.movements, values)
        self.scalars(values)

    def scalars(self, values: Mapping[str, float]) -> None:
        """A point for each curve, by tag; those that are not finite are left out.

        Raises:
            ValueError: a tag that the legend does not explain.
        """
        number = partial(TensorProto, dtype=DT_FLOAT, tensor_shape=TensorShapeProto())
        self._write({tag: number(float_val=[value]) for tag, value in values.items() if math.isfinite(value)})

    def image(self, tag: str, png: bytes) -> None:
        """A picture, as the bytes of a png file."""
        width, height = struct.unpack(">II", png[16:24])  # of the header
        self._write({tag: _strings(str(width).encode(), str(height).encode(), png)})

    def text(self, tag: str, markdown: str) -> None:
        """A page of text."""
        self._write({tag: _strings(markdown.encode())})

    def settings(self, settings: Mapping[str, bool | float | str], first: Collection[str] = ()) -> None:
        """Show the options of this run in the tabs Text and HParams, with the legend and the charts of the layout.

        HParams shows the columns ``first`` before the others. A setting should have the same type in all runs.
        """
        rows = "\n".join(f"| {name} | {value} |" for name, value in settings.items())
        self.text("about/settings", f"| option | value |\n|---|---|\n{rows}")
        rows = "\n".join(f"| **{tag if '/' in tag else f'{tag}/…'}** | {what} |" for tag, what in self.legend.items())
        self.text("about/legend", f"Steps are movements.\n\n| tag | what it shows |\n|---|---|\n{rows}")
        self._file.write(self.movements, [_layout(self.layout), *_hparams(settings, first)])

    def finish(self) -> None:
        """Show in the tab HParams that the run has ended."""
        ended = plugin_data_pb2.SessionEndInfo(status=api_pb2.STATUS_SUCCESS, end_time_secs=time.time())
        value = _hparams_value(hparams_metadata.SESSION_END_INFO_TAG, session_end_info=ended)
        self._file.write(self.movements, [value])

    def recall(self, *families: str, needs: Collection[str] = ()) -> bool:
        """Copy from earlier event files, for this movement, what a replay does not make again.

        Args:
            families: of the tags to copy: the parts before the slash.
            needs: tags without which nothing is copied.

        Returns:
            Whether the earlier event file had any of it.
        """
        events = [
            (event.wall_time, {v.tag: v.tensor for v in event.summary.value if v.tag.partition("/")[0] in families})
            for event in self._file.before.get(self.movements, ())
        ]
        tags = {tag for _, tensors in events for tag in tensors}
        if not tags.issuperset(needs):
            return False
        for wall_time, tensors in events:
            self._write(tensors, wall_time)
            if "error/mean" in tensors:
                numbers = {tag: tensor.float_val[0] for tag, tensor in tensors.items() if tensor.float_val}
                self.curves.evaluated(self.movements, numbers)
        return bool(tags)

    def publish(self) -> None:
        """Appear under the name that TensorBoard looks for, and replace earlier event files."""
        self._file.publish()

    def flush(self) -> None:
        """Hand everything to the operating system: a killed process then loses nothing of it."""
        self._file.flush()

    def close(self) -> None:
        """Flush and close; what was not published is dropped."""
        self._file.close()

    def _write(self, tensors: Mapping[str, TensorProto], wall_time: float | None = None) -> None:
        values = []
        for tag, tensor in tensors.items():
            value = Summary.Value(tag=tag, tensor=tensor)
            if tag not in self._explained:
                value.metadata.CopyFrom(self._metadata(tag, tensor))
                self._explained.add(tag)
            values.append(value)
        if values:
            self._file.write(self.movements, values, wall_time)

    def _metadata(self, tag: str, tensor: TensorProto) -> SummaryMetadata:
        sentence = self.legend.get(tag) or self.legend.get(tag.partition("/")[0])
        if sentence is None:
            raise ValueError(f"the legend must explain every tag, got {tag!r}; give the board a legend that does")
        plugin = {0: "scalars", 1: "text"}.get(len(tensor.string_val), "images")
        data = SummaryMetadata.PluginData(plugin_name=plugin)
        return SummaryMetadata(plugin_data=data, summary_description=sentence)


class _EventFile:
    """A new event file; ``publish`` replaces those of the directory. ``before`` holds their events by step."""

    def __init__(self, directory: Path) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self._earlier = sorted(directory.glob(f"{_NAME}[0-9][0-9][0-9]"))
        self.before: dict[int, list[Event]] = {}
        for path in self._earlier[-1:]:  # it has all that the others had
            for event in read_events(path):
                self.before.setdefault(event.step, []).append(event)
        number = int(self._earlier[-1].name[-3:]) + 1 if self._earlier else 0
        self._path = directory / f"{_NAME}{number:03d}"  # a new name, else a running TensorBoard would ignore it
        self._partial: Path | None = directory / "board.part"
        self._writer = RecordWriter(self._partial.open("wb"))
        self._add(Event(wall_time=time.time(), file_version="brain.Event:2"))
        self._add(Event(wall_time=time.time(), session_log=SessionLog(status=SessionLog.START)))  # forget what was

    def write(self, step: int, values: Sequence[Summary.Value], wall_time: float | None = None) -> None:
        self._add(Event(wall_time=wall_time or time.time(), step=step, summary=Summary(value=values)))

    def publish(self) -> None:
        if self._partial is None:
            return
        self.flush()
        self._partial.replace(self._path)
        self._partial = None
        for path in self._earlier:
            path.unlink(missing_ok=True)

    def flush(self) -> None:
        self._writer.flush()

    def close(self) -> None:
        self._writer.close()
        if self._partial is not None:
            self._partial.unlink(missing_ok=True)

    def _add(self, event: Event) -> None:
        self._writer.write(event.SerializeToString())


def read_events(path: Path) -> Iterator[Event]:
    """The events of a file up to where it is torn or damaged: length, its checksum, event, its checksum, and so on."""
    with path.open("rb") as file:
        while len(head := file.read(12)) == 12 and head[8:] == _checksum(head[:8]):
            content = file.read(struct.unpack("<Q", head[:8])[0])
            if file.read(4) != _checksum(content):
                return
            yield Event.FromString(content)


def _checksum(content: bytes) -> bytes:
    return struct.pack("<I", masked_crc32c(content))


def _strings(*strings: bytes) -> TensorProto:
    dims = [TensorShapeProto.Dim(size=len(strings))] if len(strings) > 1 else []
    return TensorProto(dtype=DT_STRING, tensor_shape=TensorShapeProto(dim=dims), string_val=strings)


def _layout(layout: Mapping[str, Mapping[str, str]]) -> Summary.Value:
    page = layout_pb2.Layout()
    for title, charts in layout.items():
        category = page.category.add(title=title)
        for name, tag in charts.items():
            category.chart.add(title=name).multiline.tag.append(f"^{tag}$")
    tag, metadata = layout_metadata.CONFIG_SUMMARY_TAG, layout_metadata.create_summary_metadata()
    return Summary.Value(tag=tag, metadata=metadata, tensor=_strings(page.SerializeToString()))


def _hparams(settings: Mapping[str, bool | float | str], first: Collection[str]) -> list[Summary.Value]:
    """Which options and results the tab compares, and this run's options."""
    kinds = {bool: ("bool_value", api_pb2.DATA_TYPE_BOOL), str: ("string_value", api_pb2.DATA_TYPE_STRING)}
    compared, start = api_pb2.Experiment(), plugin_data_pb2.SessionStartInfo(start_time_secs=time.time())
    for name, value in settings.items():
        field, kind = kinds.get(type(value), ("number_value", api_pb2.DATA_TYPE_FLOAT64))
        compared.hparam_infos.add(name=name, type=kind, differs=name in first)  # those that differ come first
        setattr(start.hparams[name], field, value)
    for tag in METRICS:
        compared.metric_infos.add(name=api_pb2.MetricName(tag=tag), display_name=tag)
    return [
        _hparams_value(hparams_metadata.EXPERIMENT_TAG, experiment=compared),
        _hparams_value(hparams_metadata.SESSION_START_INFO_TAG, session_start_info=start),
    ]


def _hparams_value(tag: str, **content: Any) -> Summary.Value:
    metadata = hparams_metadata.create_summary_metadata(plugin_data_pb2.HParamsPluginData(**content))
    return Summary.Value(tag=tag, metadata=metadata, tensor=hparams_metadata.NULL_TENSOR)
