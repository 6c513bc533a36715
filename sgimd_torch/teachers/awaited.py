"""A teacher who may be slow, such as a person: the learner waits, says so, and gives up when its patience ends.

teachers = {"ann": Awaited("ann", ann, patience=30.0)}
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import Final

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Demonstration
from sgimd_torch.teachers.answering import Demonstrator

SILENT_FOR: Final = 1.0  # s of waiting before the first message

Found = Future[Demonstration | None]


class Awaited:
    """Answers as ``teacher`` does, who works in a thread of their own. See `Demonstrator`.

    A teacher has one request at a time: while they are busy with one that was given up, the next one waits, and that
    time counts. Which requests are given up depends on the clock, so a replay needs the replies that were recorded.

    Args:
        name: in messages.
        teacher: who answers.
        patience: seconds to wait for an answer; None for as long as it takes.
        say: gets the messages; None prints them on stderr.

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
    ) -> None:
        if patience is not None and not patience > 0:
            raise ValueError(f"patience must be above 0 s, got {patience}; None waits for ever")
        self.name, self.teacher, self.takes = name, teacher, getattr(teacher, "takes", 0)
        self.patience = patience
        self._say = partial(print, file=sys.stderr) if say is None else say
        self._requests: SimpleQueue[tuple[Found, Callable[[], Demonstration | None]]] = SimpleQueue()
        # An executor's thread would keep a process alive whose teacher never answers.
        self._thread = Thread(target=self._work, daemon=True)

    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """See `Demonstrator`.

        Raises:
            TimeoutError: no answer came in time.
        """
        found = Found()
        if not self._thread.is_alive():
            self._thread.start()
        self._requests.put((found, partial(self.teacher.demonstrate, context, goal, memory)))
        silent = SILENT_FOR if self.patience is None else min(SILENT_FOR, self.patience)
        wait([found], silent)
        if not found.done() and silent != self.patience:
            limit = "for as long as it takes" if self.patience is None else f"for {self.patience:g} s at most"
            self._say(f"waiting for teacher {self.name}, {limit}")
            wait([found], None if self.patience is None else self.patience - silent)
        if not found.done():
            found.cancel()  # if it has not begun yet, it never does
            raise TimeoutError(f"it took longer than {self.patience:g} s")
        return found.result()

    def _work(self) -> None:
        while True:
            found, answer = self._requests.get()
            if found.set_running_or_notify_cancel():
                try:
                    found.set_result(answer())
                except BaseException as error:  # whatever it is, it belongs to the one who has asked
                    found.set_exception(error)
