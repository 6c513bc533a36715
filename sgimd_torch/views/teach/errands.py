"""Errands: what other threads want done in this one, in order, when it has time.

found = errands.ask(lambda: memory.outcomes.mean())        # any thread; found.result() waits
errands.carry_out(); errands.wait(0.25)                    # the thread that does them
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

Result = TypeVar("Result")


class Errands:
    """A queue of things to do; what one gives, or raises, goes back to who asked for it."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._wake = threading.Event()
        self._closed = ""
        self._lock = threading.Lock()

    def ask(self, what: Callable[[], Any]) -> Future[Any]:
        """Have something done. If it gives a future in its turn, that one's result counts.

        Raises (as its result):
            ValueError: nothing is done any more.
        """
        future: Future[Any] = Future()
        with self._lock:
            if self._closed:
                future.set_exception(ValueError(self._closed))
            else:
                self._waiting.append((what, future))
        self._wake.set()
        return future

    def carry_out(self) -> None:
        """Do all that is wanted by now."""
        while self._waiting:
            what, future = self._waiting.popleft()
            try:
                result = what()
            except Exception as error:  # goes to who asked
                future.set_exception(error)
                continue
            if isinstance(result, Future):
                result.add_done_callback(lambda done, future=future: _pass_on(done, future))  # type: ignore[misc]
            else:
                future.set_result(result)

    def wait(self, seconds: float) -> None:
        """Until something is wanted or told, but not longer than this."""
        self._wake.wait(seconds)
        self._wake.clear()

    def wake(self) -> None:
        """End a ``wait``."""
        self._wake.set()

    def close(self, why: str) -> None:
        """Nothing is done from now on; whoever still waits is told ``why``."""
        with self._lock:
            self._closed = why
        while self._waiting:
            self._waiting.popleft()[1].set_exception(ValueError(why))


def _pass_on(done: Future[Any], future: Future[Any]) -> None:
    error = done.exception()
    if error is None:
        future.set_result(done.result())
    else:
        future.set_exception(error)
