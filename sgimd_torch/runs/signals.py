"""Shared by all commands: signals, standard streams, exit codes, messages, progress.

    sys.exit(command(main))    # main(argv) returns the exit code; an exception becomes one line and an exit code

Exit codes: 0 done, 1 failed while running, 2 the request is wrong, 130 stopped by Ctrl-C, 143 stopped by SIGTERM.
"""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from types import FrameType
from typing import Any, Final, Self, TextIO

from sgimd_torch.options.signature import parsed

REPORT_EVERY: Final = 20.0  # s between two lines of progress if stderr is no terminal
ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a process for small matrices, for which several threads would be slower."""
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class Stopped(KeyboardInterrupt):
    """A signal has stopped the command."""

    def __init__(self, signum: int = signal.SIGINT) -> None:
        super().__init__(signum)
        self.exit_code = 128 + signum


class Failed(RuntimeError):
    """A correct request failed while running: exit code 1."""


def command(main: Callable[[Sequence[str]], int], argv: Sequence[str] | None = None) -> int:
    """Run ``main`` with the arguments of the command line; handle signals, exceptions and closed standard streams.

    Returns:
        The exit code. It is 2, a wrong request, after a ``ValueError``, an error of a file or a missing package.
    """
    sys.stdout, sys.stderr = sys.stdout or _sink(), sys.stderr or _sink()  # a closed stream is None
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # the locale may lack signs of a name
    code = 0
    with _on_signals(_stop):
        try:
            try:
                code = main(sys.argv[1:] if argv is None else argv)
            except SystemExit as end:  # of argparse, after --help or a wrong option
                code = int(end.code or 0)
            sys.stdout.flush()
        except KeyboardInterrupt as stop:
            code = stop.exit_code if isinstance(stop, Stopped) else 130
        except Failed as error:
            say(f"error: {error}")
            code = 1
        except (ValueError, ImportError) as error:
            say(f"error: {error}")
            code = 2
        except BrokenPipeError:  # a reader such as head has seen enough
            pass
        except OSError as error:
            code, why = 2, str(error)  # an error of this library has a complete message
            if error.filename is not None:
                name = str(
                    error.filename
                )  # with control characters and lone surrogates, it is shown as Python spells it
                why = f"{name if name.isprintable() else repr(name)} cannot be read or written: {error.strerror}"
            elif error.errno is not None:
                code, why = 1, f"not everything could be written: {error.strerror}"
            say(f"error: {why}")
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # the interpreter would complain at exit
    return code


def parser_of(name: str, about: str | None, **more: Any) -> argparse.ArgumentParser:
    """A parser for the options of ``sgimd name``. Its help shows the text ``about`` with its line ends.

    Numbers, of ``type=int``, ``float`` or ``"numbers"`` with commas between, are read like those of ``sgimd run``.
    """
    form = argparse.RawDescriptionHelpFormatter
    made = argparse.ArgumentParser(f"sgimd {name}", description=about, formatter_class=form, allow_abbrev=False, **more)
    for word, kind in {int: int, float: float, "numbers": tuple[float, ...]}.items():
        made.register("type", word, partial(parsed_argument, kind=kind))
    return made


def parsed_argument(text: str, kind: Any) -> Any:
    """The value that a word of the command line stands for.

    Raises:
        ArgumentTypeError: the word is of another type than ``kind``.
    """
    try:
        return parsed(text, kind)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _sink() -> TextIO:
    return os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")


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


def _in_forked_worker() -> None:
    """A worker that is forked in such a block ends at SIGTERM, at once even where it waits: there a handler of Python
    might never run. Ctrl-C is for the owner, who waits for its workers."""
    for signum, action in ((signal.SIGINT, lambda *_: None), (signal.SIGTERM, signal.SIG_DFL)):
        if getattr(signal.getsignal(signum), "__module__", None) == __name__:
            signal.signal(signum, action)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


os.register_at_fork(  # a signal that arrives while a worker is forked waits until the worker is ready for it
    before=partial(signal.pthread_sigmask, signal.SIG_BLOCK, SIGNALS),
    after_in_parent=partial(signal.pthread_sigmask, signal.SIG_UNBLOCK, SIGNALS),
    after_in_child=_in_forked_worker,
)


def _end(signum: int, frame: FrameType | None) -> None:
    os._exit(128 + signum)


def _stop(signum: int, frame: FrameType | None) -> None:
    raise Stopped(signum)


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


class Progress(AbstractContextManager["Progress"]):
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
