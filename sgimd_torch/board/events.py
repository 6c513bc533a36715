"""The event file of a board, which TensorBoard reads: numbers, pictures, texts and a page of charts.

file = EventFile(folder); file.scalars(50, {"error/mean": 0.2}); file.begin(); file.flush(); file.close()
"""

from __future__ import annotations

import math
import re
import struct
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.plugins.custom_scalar import layout_pb2
from tensorboard.plugins.custom_scalar import metadata as charts
from tensorboard.plugins.image import metadata as images
from tensorboard.plugins.scalar.summary_v2 import scalar_pb
from tensorboard.plugins.text.summary_v2 import text_pb
from tensorboard.summary.writer.record_writer import RecordWriter
from tensorboard.util.tensor_util import make_tensor_proto

from sgimd_torch.board.legend import sentence

NAME: Final = "events.out.tfevents."  # TensorBoard looks for it


class EventFile:
    """Events wait in memory until ``begin``, which replaces the earlier event files of the folder.

    ``tags`` are those of the numbers written so far, in order.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting: list[bytes] = []
        self._file: RecordWriter | None = None
        self._explained: set[str] = set()
        self.tags: dict[str, None] = {}
        self._add(Event(file_version="brain.Event:2"))
        self._add(Event(session_log=SessionLog(status=SessionLog.START)))  # an open TensorBoard forgets earlier files

    def begin(self) -> None:
        """Write what waits into a new file, then remove the earlier ones: an open TensorBoard ignores an old name.

        Raises:
            OSError: the folder cannot be written.
        """
        earlier = sorted(self._folder.glob(f"{NAME}*"))
        self._file = RecordWriter((self._folder / f"{NAME}{time.time_ns()}").open("xb"))
        for event in self._waiting:
            self._file.write(event)
        self._waiting.clear()
        self.flush()
        for path in earlier:
            path.unlink(missing_ok=True)

    def flush(self) -> None:
        """Hand everything to the operating system, if it has begun."""
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Flush and close; if it has not begun, the earlier event files stay."""
        if self._file is not None:
            self._file.close()

    def scalars(self, step: int, values: Mapping[str, float]) -> None:
        """A point for each curve, by tag; numbers that are not finite are left out."""
        summary = Summary()
        for tag, value in values.items():
            if math.isfinite(value):
                summary.MergeFrom(scalar_pb(tag, value, sentence(tag)))
                self.tags[tag] = None
        self._write(step, summary)

    def image(self, step: int, tag: str, png: bytes) -> None:
        """A picture, as the bytes of a png file."""
        width, height = struct.unpack(">II", png[16:24])  # of the header
        tensor = make_tensor_proto([str(width).encode(), str(height).encode(), png])
        metadata = images.create_summary_metadata(None, sentence(tag))
        self._write(step, Summary(value=[Summary.Value(tag=tag, tensor=tensor, metadata=metadata)]))

    def text(self, step: int, tag: str, markdown: str) -> None:
        """A page of text."""
        self._write(step, text_pb(tag, markdown, sentence(tag)))

    def layout(self, page: Mapping[str, Mapping[str, str]]) -> None:
        """The page of charts, category -> title -> tag; the largest counts."""
        layout = layout_pb2.Layout()
        for title, each in page.items():
            category = layout.category.add(title=title)
            for name, tag in each.items():
                category.chart.add(title=name).multiline.tag.append(f"^{re.escape(tag)}$")
        tensor = make_tensor_proto(layout.SerializeToString())
        value = Summary.Value(tag=charts.CONFIG_SUMMARY_TAG, metadata=charts.create_summary_metadata(), tensor=tensor)
        self._write(sum(map(len, page.values())), Summary(value=[value]))

    def _write(self, step: int, summary: Summary) -> None:
        for value in summary.value:
            if value.tag in self._explained:
                value.ClearField("metadata")  # TensorBoard keeps that of the first
            self._explained.add(value.tag)
        if summary.value:
            self._add(Event(step=step, summary=summary))

    def _add(self, event: Event) -> None:
        event.wall_time = time.time()
        content = event.SerializeToString()
        if self._file is None:
            self._waiting.append(content)
        else:
            self._file.write(content)
