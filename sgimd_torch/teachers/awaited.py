"""A teacher who may be slow, such as a person: waited for, with a message, and for ever only if there is no limit.

teachers = {"ann": Awaited("ann", ann, patience=30.0)}
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from threading import Thread
from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.teachers.answering import Demonstrator

SILENT_FOR: Final = 1.0  # s; who answers sooner is not waited for


class Awaited:
    """Answers as ``teacher`` does, who works in a thread of their own. See `Demonstrator`.

    A teacher has one request at a time: while they are busy with one that was given up, the next one waits, and that
    time counts. Which requests are given up depends on the clock, so a replay needs the replies that were recorded.

    Args:
        name: in messages.
        teacher: who answers.
        patience: seconds to wait for an answer; None for as long as it takes.
        say: gets the messages; None prints them on stderr.
        silent_for: seconds of waiting before the first message.
        waiting: a block to wait in, such as one that a signal may end.

    Raises:
        ValueError: ``patience`` is not above 0.
    """

    def __init__(
        self,
        name: str,
        teacher: Demonstrator,
        *,
        patience: float | None = None,
        say: Callable[[str], object] | None = None,
        silent_for: float = SILENT_FOR,
        waiting: Callable[[], AbstractContextManager[object]] = nullcontext,
    ) -> None:
        if patience is not None and not patience > 0:
            raise ValueError(f"patience must be above 0 s, got {patience}; None waits for ever")
        self.name, self.teacher, self.takes = name, teacher, getattr(teacher, "takes", 0)
        self.patience = np.inf if patience is None else patience
        self._say = partial(print, file=sys.stderr) if say is None else say
        self._silent_for, self._waiting = silent_for, waiting
        self._busy: Thread | None = None

    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """See `Demonstrator`.

        Raises:
            TimeoutError: no answer came in time.
        """
        found: Future[Demonstration | None] = Future()
        work = partial(self.teacher.demonstrate, context, goal, memory)
        self._busy = Thread(target=_answer, args=(found, self._busy, work), daemon=True)
        with self._waiting():
            self._busy.start()
            self._wait(found)
        if not found.done():
            found.cancel()
            raise TimeoutError(f"it took longer than {self.patience:g} s")
        return found.result()

    def _wait(self, found: Future[Demonstration | None]) -> None:
        begun = time.monotonic()
        wait([found], min(self._silent_for, self.patience))
        left = self.patience - self._silent_for
        if found.done() or left <= 0:
            return
        limit = "for as long as it takes" if left == np.inf else f"for {self.patience:g} s at most"
        self._say(f"waiting for teacher {self.name}, {limit}")
        wait([found], None if left == np.inf else left)
        if found.done():
            self._say(f"teacher {self.name} answered after {time.monotonic() - begun:.0f} s")


def _answer(
    found: Future[Demonstration | None], before: Thread | None, work: Callable[[], Demonstration | None]
) -> None:
    if before is not None:
        before.join()
    if not found.set_running_or_notify_cancel():
        return  # it was given up before it began
    try:
        found.set_result(work())
    except BaseException as error:  # whatever it is, it belongs to the one who has asked
        found.set_exception(error)
