"""The event file of a board, which TensorBoard reads.

    file = EventFile(folder); file.add(50, summary.scalar("error/mean", 0.2)); file.begin(); file.close()

``summary`` is ``tensorboardX.summary``. This module uses tensorboardX's `EventsWriter`, not its `SummaryWriter`: that
class writes in a thread, so a full disk would not stop the run.
"""

from __future__ import annotations

import time
from pathlib import Path

from tensorboardX.event_file_writer import EventsWriter
from tensorboardX.proto.event_pb2 import Event, SessionLog
from tensorboardX.proto.summary_pb2 import Summary


class EventFile:
    """An event file: summaries wait in memory until ``begin``, which replaces earlier event files of the ``folder``."""

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
