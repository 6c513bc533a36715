"""What goes along with a run: signals that stop it cleanly, a clock for its parts, a line that shows how far it is."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from types import FrameType
from typing import Any, ParamSpec, Self

from tqdm import tqdm

from sgimd_torch.session import Execute
from sgimd_torch.spaces import Array, Episode

P = ParamSpec("P")
REPORT_EVERY = 10.0  # s, from one line to the next where there is no terminal


class Seconds:
    """Where the time goes, counted on from the ``before`` of a resumed run."""

    def __init__(self, before: dict[str, Any]) -> None:
        self.physics: float = before.get("seconds_physics", 0.0)
        self.evaluation: float = before.get("seconds_evaluation", 0.0)
        self.learner = 0.0

    def of_physics(self, execute: Execute) -> Execute:
        """``execute``, timed; what it takes is not the learner's."""

        def timed(index: int, context: Array, theta: Array) -> Array:
            begun = time.perf_counter()
            try:
                return execute(index, context, theta)
            finally:
                taken = time.perf_counter() - begun
                self.physics += taken
                self.learner -= taken

        return timed

    def of_learner(self, episodes: Iterator[Episode]) -> Iterator[Episode]:
        """``episodes``, timed: asking, telling, watching and the teacher's choice."""
        begun = time.perf_counter()
        for episode in episodes:
            self.learner += time.perf_counter() - begun
            yield episode
            begun = time.perf_counter()

    @contextmanager
    def of_evaluation(self) -> Iterator[None]:
        """Times an evaluation and its writing."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.evaluation += time.perf_counter() - begun

    def summary(self) -> dict[str, float]:
        """As summary.json has them."""
        named = {"physics": self.physics, "learner": self.learner, "evaluation": self.evaluation}
        return {f"seconds_{name}": round(seconds, 3) for name, seconds in named.items()}


class Stopped(Exception):
    """A signal asked the run to stop."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.exit_code = 128 + signum


class Stopping:
    """Ctrl-C and SIGTERM, heard between two movements, or at once where that breaks nothing."""

    def __init__(self) -> None:
        self._signum = 0
        self._at_once = False
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for signum in (signal.SIGINT, signal.SIGTERM):
                self._handlers[signum] = signal.signal(signum, self._hear)
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._handlers.items():
            signal.signal(signum, handler)

    def _hear(self, signum: int, frame: FrameType | None) -> None:
        self._signum = signum
        if self._at_once:
            self._at_once = False
            raise Stopped(signum)

    def check(self) -> None:
        """Raise ``Stopped`` if a signal has come."""
        if self._signum:
            raise Stopped(self._signum)

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Within, a signal raises ``Stopped`` where it strikes."""
        self._at_once = True
        try:
            self.check()
            yield
        finally:
            self._at_once = False


class Progress:
    """A live line on a terminal; elsewhere a plain one now and then."""

    def __init__(self, title: str, recorded: int, total: int) -> None:
        self._title, self._recorded, self._total = title, recorded, total
        self._bar = self._start("replaying" if recorded else title, 0, recorded or total)
        self._begun = self._reported = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def show(self, movements: int, error: float | None) -> None:
        """So many movements are done; the last evaluation's mean error was ``error`` (m)."""
        self._bar.update()
        if error is not None:
            self._bar.set_postfix_str(f"error {error:.4f} m", refresh=False)
        if movements == self._recorded < self._total:  # the rate is that of living, not of replaying
            self._bar.close()
            self._bar = self._start(self._title, movements, self._total)
            self._begun = self._reported = time.monotonic()
        now = time.monotonic()
        if self._bar.disable and now - self._reported >= REPORT_EVERY and movements > self._recorded:
            self._reported = now
            rate = (movements - self._recorded) / (now - self._begun)
            left = (self._total - movements) / rate
            parts = [f"{movements} of {self._total} movements", f"{rate:.0f}/s", f"{left:.0f} s left"]
            say(f"{self._title}: {', '.join(parts)}, error {metres(error)}")

    def _start(self, title: str, initial: int, total: int) -> Any:
        silent = not sys.stderr.isatty()
        return tqdm(desc=title, initial=initial, total=total, unit=" movements", disable=silent, dynamic_ncols=True)


def metres(length: float | None) -> str:
    """A length for people."""
    return "not measured" if length is None or math.isnan(length) else f"{length:.4f} m"


def say(*messages: str) -> None:
    """On stderr, at once; a stderr that takes nothing stops nobody."""
    with suppress(OSError):
        for message in messages:
            print(message, file=sys.stderr, flush=True)


def telling_errors(main: Callable[P, int]) -> Callable[P, int]:
    """``main``; files that make no sense or cannot be read or written end it with a line and the exit code 2, Ctrl-C
    with 130."""

    @wraps(main)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> int:
        try:
            return main(*args, **kwargs)
        except ValueError as error:
            say(f"error: {error}")
        except OSError as error:
            if error.filename is not None:
                say(f"error: {error.filename} cannot be read or written: {error.strerror}")
            elif error.errno is None:  # raised by us, it says all itself
                say(f"error: {error}")
            else:  # most likely of stdout; ``with_streams`` tells
                raise
        except KeyboardInterrupt:
            return 130
        return 2

    return guarded


def with_streams(main: Callable[[], int]) -> int:
    """``main``, whatever becomes of stdout and stderr; the exit code, 1 where stdout could not be written."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
        getattr(sys, name).reconfigure(errors="backslashreplace")  # a name that the locale cannot write
    code, lost = 0, None
    try:
        code = main()
    except SystemExit as end:
        code = int(end.code or 0)
    except OSError as error:  # those of files are caught where they are used
        lost = error
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # else the interpreter would complain
            lost = error if stream is sys.stdout else lost
    if lost is not None and not isinstance(lost, BrokenPipeError):
        say(f"error: not everything could be written: {lost.strerror}")
        code = code or 1
    return code
