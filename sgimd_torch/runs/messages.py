"""What a command tells people while it works: messages and a progress bar, on stderr."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager, suppress
from typing import Any, Final

REPORT_EVERY: Final = 20.0  # s between two lines of progress if stderr is no terminal


class ProgressBar(AbstractContextManager["ProgressBar"]):
    """A context manager: a progress bar on a terminal; elsewhere, a plain line now and then.

    Args:
        title: name of the work in progress.
        total: number of movements in all; the attribute may be changed later.
        done: number of movements made earlier; these do not count for the speed.
    """

    def __init__(self, title: str, total: int, done: int = 0) -> None:
        self._bar: Any = None
        self.begin(title, total, done)

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def begin(self, title: str, total: int, done: int = 0) -> None:
        """Begin another part of the work; its speed is measured anew."""
        from tqdm import tqdm  # imported here so that --help is fast

        if self._bar is not None:
            self._bar.close()
        self._title, self.total, self._first = title, total, done
        form = {"unit": " movements", "dynamic_ncols": True, "smoothing": 0, "disable": not sys.stderr.isatty()}
        self._bar = tqdm(desc=title, initial=done, total=total, **form)
        self._begun = self._reported = time.monotonic()

    def show(self, done: int, note: str = "") -> None:
        """Show that ``done`` movements are made, earlier ones included, with a ``note`` beside the bar.

        The time that is left is that of the movements so far, their evaluations included.
        """
        self._bar.total = self.total
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(done - self._bar.n)
        now = time.monotonic()
        if not self._bar.disable or now - self._reported < REPORT_EVERY or done <= self._first:
            return
        self._reported = now
        rate = (done - self._first) / (now - self._begun)
        left = self._bar.format_interval((self.total - done) / rate)
        parts = [f"{done} of {self.total} movements", f"{rate:.3g}/s", f"{left} left", note]
        say(f"{self._title}: {', '.join(filter(None, parts))}")


def say(*messages: str) -> None:
    """Print on stderr, above a progress bar if there is one; ignore a stderr that cannot be written."""
    bars = sys.modules.get("tqdm")
    write: Any = print if bars is None else bars.tqdm.write
    with suppress(OSError):
        for message in messages:
            write(printable(message), file=sys.stderr)


def printable(text: str) -> str:
    """``text`` without control characters, such as terminal escape codes in a name."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else "\N{REPLACEMENT CHARACTER}" for sign in text)
