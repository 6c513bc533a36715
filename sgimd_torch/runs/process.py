"""What all commands share: signals, standard streams, exit codes, messages, progress.

    sys.exit(command(main))    # main(argv) returns the exit code; what it raises becomes one line and an exit code

Exit codes: 0 done, 1 it failed while running, 2 the request is wrong, 130 stopped by Ctrl-C, 143 stopped by SIGTERM.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Final, NamedTuple, Self

from sgimd_torch.catalogue import did_you_mean

REPORT_EVERY: Final = 10.0  # s, from one line of progress to the next where there is no terminal
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class Stopped(KeyboardInterrupt):
    """A signal asked the command to stop."""

    def __init__(self, signum: int = signal.SIGINT) -> None:
        super().__init__(signum)
        self.exit_code = 128 + signum


class Failed(RuntimeError):
    """The request was right, but it failed while running: exit code 1."""


class Command(NamedTuple):
    """A command: the ``module`` whose ``main(argv)`` it is, one line ``about`` it, and the ``extra`` that it needs."""

    module: str
    about: str
    extra: str = ""


def dispatch(prog: str, commands: Mapping[str, Command], help_text: str, argv: Sequence[str]) -> int:
    """Run the command that the first word names.

    Args:
        prog: what the user typed to come here.
        commands: by name.
        help_text: for ``--help``.
        argv: the words after ``prog``.

    Returns:
        The exit code.
    """

    def call(words: Sequence[str]) -> int:
        if not words or words[0] in ("-h", "--help"):
            print(help_text)
            return 0 if words else 2
        name = words[0]
        if name not in commands:
            raise ValueError(
                f"unknown command {name!r}, known are {', '.join(commands)}{did_you_mean(name, commands)}; "
                f"{prog} --help explains them"
            )
        chosen = commands[name]
        try:
            with loading():
                module = importlib.import_module(chosen.module)
        except ModuleNotFoundError as error:
            if not chosen.extra:
                raise
            slip = f"pip install 'sgimd-torch[{chosen.extra}]' installs it"
            raise ImportError(f"{prog} {name} needs {error.name}, which is not installed; {slip}") from error
        return int(module.main(words[1:]))

    return command(call, argv)


def command(main: Callable[[Sequence[str]], int], argv: Sequence[str] | None = None) -> int:
    """Run ``main`` on the words of the command line, and handle signals, errors and closed standard streams.

    Returns:
        The exit code. A ``ValueError``, an error of a file and a missing package are the request's fault.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
        getattr(sys, name).reconfigure(errors="backslashreplace")  # a name that the locale cannot write
    before = [signal.getsignal(signum) for signum in SIGNALS]
    _on_signals(_stop)
    code, lost = 0, None
    try:
        code = main(sys.argv[1:] if argv is None else argv)
    except SystemExit as end:
        code = int(end.code or 0)
    except KeyboardInterrupt as stop:
        code = getattr(stop, "exit_code", 130)
    except Failed as error:
        say(f"error: {error}")
        code = 1
    except (ValueError, ImportError) as error:
        say(f"error: {error}")
        code = 2
    except OSError as error:
        if error.filename is not None:
            say(f"error: {error.filename} cannot be read or written: {error.strerror}")
        elif error.errno is None:  # raised by us, with a complete message
            say(f"error: {error}")
        else:  # of stdout, or the disk
            lost = error
        code = 2
    for signum, handler in zip(SIGNALS, before, strict=True):
        signal.signal(signum, handler)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # else the interpreter would complain
            lost = error if stream is sys.stdout else lost
    if lost is not None:
        if isinstance(lost, BrokenPipeError):
            return 0 if code == 2 else code
        say(f"error: not everything could be written: {lost.strerror}")
        return 1
    return code


@contextmanager
def loading() -> Iterator[None]:
    """A block that imports libraries. An import cannot be interrupted cleanly, so a signal ends the process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = [signal.getsignal(signum) for signum in SIGNALS]
    _on_signals(lambda signum, _: os._exit(128 + signum))
    try:
        yield
    finally:
        for signum, handler in zip(SIGNALS, before, strict=True):
            signal.signal(signum, handler)


def _on_signals(handler: Callable[[int, FrameType | None], object]) -> None:
    for signum in SIGNALS:
        signal.signal(signum, handler)


def _stop(signum: int, frame: FrameType | None) -> None:
    raise Stopped(signum)


class Stopping:
    """In this block, SIGINT and SIGTERM wait for the next ``check()``, or for ``at_once()``; a context manager."""

    def __init__(self) -> None:
        self._signum = 0
        self._at_once = False
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._handlers = {signum: signal.signal(signum, self._hear) for signum in SIGNALS}
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
        """In this block, a signal raises ``Stopped`` at once."""
        self._at_once = True
        try:
            self.check()
            yield
        finally:
            self._at_once = False


class Progress:
    """A bar with an estimate of the time left on a terminal; elsewhere a plain line now and then. A context manager.

    Args:
        title: what is going on.
        total: how much there is to do; it may change on the way.
        done: how much of it was done before; it does not count for the speed.
        unit: what is counted.
        every: seconds between two plain lines.
    """

    def __init__(
        self, title: str, total: int, done: int = 0, *, unit: str = "movements", every: float = REPORT_EVERY
    ) -> None:
        self._unit, self._every = unit, every
        self._bar: Any = None
        self.begin(title, total, done)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def begin(self, title: str, total: int, done: int = 0) -> None:
        """Another part begins, with a speed of its own."""
        self._title, self.total, self._first = title, total, done
        if self._bar is not None:
            self._bar.close()
        if sys.stderr.isatty():
            from tqdm import tqdm  # only a terminal needs it

            self._bar = tqdm(
                desc=title, initial=done, total=total, unit=f" {self._unit}", dynamic_ncols=True, smoothing=0.02
            )
        self._begun = self._reported = time.monotonic()

    def show(self, done: int, note: str = "") -> None:
        """Show how much is ``done``, including what was done before."""
        if self._bar is not None:
            self._bar.total = self.total
            self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(done - self._bar.n)
            return
        now = time.monotonic()
        if now - self._reported < self._every or done <= self._first:
            return
        self._reported = now
        rate = (done - self._first) / (now - self._begun)
        left = clock((self.total - done) / rate)
        parts = [f"{done} of {self.total} {self._unit}", f"{rate:.3g}/s", f"{left} left", note]
        say(f"{self._title}: {', '.join(filter(None, parts))}")


def clock(seconds: float) -> str:
    """``45 s``, ``3:20``, ``2:03:20``."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02}:{rest:02}"
    return f"{minutes}:{rest:02}" if minutes else f"{rest} s"


def say(*messages: str) -> None:
    """Print on stderr, above a progress bar if there is one; a stderr that cannot be written is no error."""
    bars = sys.modules.get("tqdm")
    write: Any = print if bars is None else bars.tqdm.write
    with suppress(OSError):
        for message in messages:
            write(message, file=sys.stderr)
