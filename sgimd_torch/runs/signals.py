"""Signals: Ctrl-C and SIGTERM end a command cleanly.

with Stopping() as stopping: ...    # the first signal is noted in stopping.heard, the second one raises Stopped
reading = returned(robot.read, 5.0)    # a call that does not return in 5 s raises Overdue
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from types import FrameType
from typing import Any, Final, Self

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class Stopped(KeyboardInterrupt):
    """A signal has stopped the command."""

    def __init__(self, signum: int = signal.SIGINT) -> None:
        super().__init__(signum)
        self.exit_code = 128 + signum


class Stopping:
    """A context manager. In its block the first SIGINT or SIGTERM is only noted; the second one raises ``Stopped``.

    Args:
        message: text to print at the first signal.

    Attributes:
        heard: number of the first signal; 0 if there was none.
    """

    def __init__(self, message: str = "stopping after this movement; Ctrl-C once more stops at once") -> None:
        self.heard = 0
        self._message = message
        self._block = _on_signals(self._hear)

    def __enter__(self) -> Self:
        self._block.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._block.__exit__(*error)

    def _hear(self, signum: int, frame: FrameType | None) -> None:
        if self.heard:
            raise Stopped(signum)
        self.heard = signum
        with suppress(OSError):  # say() could print into a print that the signal has interrupted
            os.write(2, f"\n{self._message}\n".encode())


class Overdue(RuntimeError):
    """A call has not returned in time."""


def returned(call: Callable[[], Any], seconds: float) -> Any:
    """The result of ``call``. In the main thread, a call that does not return in ``seconds`` is broken off, and told.

    Raises:
        Overdue: it was broken off.
    """

    def break_off(signum: int, frame: FrameType | None) -> None:
        message = f"the driver has not returned for {seconds:g} s; its call is broken off"
        with suppress(OSError):
            os.write(2, f"\n{message}\n".encode())
        raise Overdue(message)

    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        return call()
    before = signal.signal(signal.SIGALRM, break_off)
    signal.setitimer(signal.ITIMER_REAL, seconds, seconds)  # again, if the call catches the first one
    try:
        return call()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def stopping_at_once() -> AbstractContextManager[None]:
    """A block that a signal ends by ``Stopped``."""
    return _on_signals(_stop)


def loading() -> AbstractContextManager[None]:
    """A block for imports. A signal during the block ends the process, as imports cannot be interrupted cleanly."""
    return _on_signals(_end)


@contextmanager
def _on_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """A block in which ``handler`` gets SIGINT and SIGTERM. In another thread than the main one nothing changes."""
    heard = SIGNALS if threading.current_thread() is threading.main_thread() else ()
    before = {signum: signal.signal(signum, handler) for signum in heard}
    try:
        yield
    finally:
        for signum, earlier in before.items():
            signal.signal(signum, earlier)


def _end(signum: int, frame: FrameType | None) -> None:
    os._exit(128 + signum)


def _stop(signum: int, frame: FrameType | None) -> None:
    raise Stopped(signum)
